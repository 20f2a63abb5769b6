"""The tables of a paper, with captions that say unit, interval, n and method."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Final

from jointz.analysis.page.method_means import cells_by_method, method_mean, standing
from jointz.analysis.page.quasi_stiffness_section import quasi_stiffness_table
from jointz.core.channels import PARAMETER_UNITS
from jointz.core.gait_phases import ALL_POINTS
from jointz.report.impedance_figures import timing_points
from jointz.report.latex import MARKS
from jointz.report.prose import (
    chosen_method,
    fitted_signals,
    interval_methods,
    mean_interval,
    mean_over_people_note,
    pulse_counts,
)
from jointz.report.subjects import Subjects, nobody_perturbed, subjects
from jointz.report.table import NO_VALUE, NOTE, Table
from jointz.report.wording import (
    PARAMETERS,
    exclusion_meaning,
    format_count,
    format_integer,
    format_interval,
    format_number,
    format_spread,
    format_vaf,
    method_name,
    parameter_label,
    parameter_name,
    point_name,
    pretty_unit,
    status_meaning,
)
from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.study_analysis import PopulationEstimate, StudyAnalysis

_ABSOLUTE: Final = ("stiffness", "damping", "inertia")
_PER_MASS: Final = ("stiffness_per_mass", "damping_per_mass")


def paper_tables(analysis: StudyAnalysis) -> dict[str, Table]:
    """Return the tables that an analysis has data for, by the names of their files."""
    makers: Mapping[str, Callable[[StudyAnalysis], Table]] = {
        "estimates": lambda a: _estimates(a, _ABSOLUTE),
        "estimates_per_mass": lambda a: _estimates(a, _PER_MASS),
        "population": _population,
        "methods": _methods,
        "quasi_stiffness": quasi_stiffness_table,
        "exclusions": _exclusions,
    }
    made = {name: make(analysis) for name, make in makers.items()}
    return {name: table for name, table in made.items() if table.rows}


def captions_text(tables: Mapping[str, Table]) -> str:
    """Return captions and notes of tables as plain text: a csv file has no place for them."""
    texts = [
        f"{name}: {' '.join((t.caption, *(note.lstrip(MARKS) for note in t.notes)))}\n"
        for name, t in tables.items()
    ]
    return "\n".join(texts)


def shown(estimate: ParameterEstimate | None) -> str:
    """Write an estimate as tables print it: a value, ``< limit``, or a dash."""
    if estimate is None or not estimate.stands:
        return NO_VALUE
    if estimate.status == "at_bound":
        limit = estimate.ci_high
        return NO_VALUE if limit is None else f"< {format_number(limit)}"
    return format_interval(estimate.value, estimate.ci_low, estimate.ci_high)


def _estimates(analysis: StudyAnalysis, names: Sequence[str]) -> Table:
    wanted = () if nobody_perturbed(analysis) else names
    present = [n for n in wanted if any(c.parameter(n) for c in analysis.cells)]
    words = subjects(analysis)
    walking = any(c.onset_gait_pct is not None for c in analysis.cells)
    order = {n: i for i, n in enumerate([*timing_points(analysis.cells), ALL_POINTS])}
    people = list(dict.fromkeys(c.label for c in analysis.cells))
    cells = sorted(
        (c for c in analysis.cells if any(c.parameter(n) for n in present)),
        key=lambda c: (people.index(c.label), order[c.timing_point]),
    )
    head = [words.one.capitalize(), words.point.capitalize()]
    head += ["Onset (% of cycle)"] if walking else []
    head += [*map(parameter_label, present), "VAF (%)", "Used", "Out", NOTE]
    estimates = [p for c in cells for n in present if (p := c.parameter(n)) is not None]
    marks = _marks(estimates)
    rows = tuple(_estimate_row(c, present, marks, walking=walking) for c in cells)
    shows = [parameter_name(n).lower() for n in present]
    caption = (
        f"{', '.join(shows).capitalize()} of each {words.one} at each {words.point}: value "
        f"[{_level(analysis)} interval]. {_made(analysis)} {_counted(analysis, words)} "
        f"VAF: variance accounted for of the {fitted_signals(analysis)}, which is no accuracy."
    )
    return Table(caption, tuple(head), rows if present else (), tuple(_notes(marks)))


def _estimate_row(
    cell: CellEstimate, names: Sequence[str], marks: Mapping[str, str], *, walking: bool
) -> tuple[str, ...]:
    onset = "" if cell.onset_gait_pct is None else f"{cell.onset_gait_pct:.1f}"
    own = [(n, p) for n in names if (p := cell.parameter(n)) is not None]
    # The row of a shared value has no other parameters: those are blank, not undecided.
    held = [cell.parameter(n) for n in names]
    texts = ["" if p is None else f"{shown(p)}{marks.get(p.status, '')}" for p in held]
    return (
        cell.label,
        point_name(cell.timing_point),
        *((onset,) if walking else ()),
        *texts,
        "" if cell.vaf_pct is None else format_vaf(cell.vaf_pct),
        format_integer(cell.n_used),
        format_integer(cell.n_excluded),
        _why(own),
    )


def _why(own: Sequence[tuple[str, ParameterEstimate]]) -> str:
    """Say which parameters of a row have no value, and why."""
    by_status: dict[str, list[str]] = {}
    for name, estimate in own:
        if estimate.status != "ok":
            by_status.setdefault(estimate.status, []).append(PARAMETERS[name][1])
    return "; ".join(
        f"{', '.join(symbols)} {_status_word(status)}" for status, symbols in by_status.items()
    )


def _status_word(status: str) -> str:
    return "upper limit" if status == "at_bound" else status.replace("failed:", "failed: ")


def _marks(estimates: Iterable[ParameterEstimate]) -> dict[str, str]:
    """Give every status that is not ok a mark; those beyond the last share it."""
    found = dict.fromkeys(p.status for p in estimates if p.status != "ok")
    return {status: MARKS[min(k, len(MARKS) - 1)] for k, status in enumerate(found)}


def _notes(marks: Mapping[str, str]) -> list[str]:
    """Explain every status that has a mark."""
    return [
        f"{mark}{'<' if status == 'at_bound' else NO_VALUE} ({_status_word(status)}): "
        f"{status_meaning(status)}."
        for status, mark in marks.items()
    ]


def _population(analysis: StudyAnalysis) -> Table:
    held = [m for m in analysis.population if m.n_participants > 1]
    order = [*timing_points(analysis.cells), ALL_POINTS]
    kept = [m for m in held if m.timing_point in order and m.parameter in PARAMETERS]
    names = list(PARAMETERS)
    kept.sort(key=lambda m: (names.index(m.parameter), order.index(m.timing_point)))
    words = subjects(analysis)
    caption = (
        f"Means over {words.many}: mean [{_level(analysis)} interval], standard deviation between "
        f"{words.many} (SD) and number of {words.many} (n). {mean_over_people_note(analysis)} "
        f"Interval: {mean_interval(analysis)}. {_method_of(m.method for m in kept)} "
        f"{_symbols(m.parameter for m in kept)}"
    )
    head = ("Parameter", "Unit", words.point.capitalize(), "Mean [interval]", "SD", "n", NOTE)
    missing = dict.fromkeys(m.status for m in kept if m.value is None)
    notes = tuple(f"{NO_VALUE}: {status_meaning(status)}." for status in missing)
    return Table(caption, head, tuple(map(_mean_row, kept)), notes)


def _mean_row(mean: PopulationEstimate) -> tuple[str, ...]:
    text = format_interval(mean.value, mean.ci_low, mean.ci_high)
    return (
        PARAMETERS[mean.parameter][1],
        pretty_unit(mean.unit),
        point_name(mean.timing_point),
        NO_VALUE if mean.value is None else text,
        "" if mean.sd is None else format_spread(mean.sd, mean.value, mean.ci_low, mean.ci_high),
        format_integer(mean.n_participants),
        "" if mean.status == "ok" else status_meaning(mean.status),
    )


def _methods(analysis: StudyAnalysis) -> Table:
    """Set the methods side by side; not over unlike loads, whose means mean nothing."""
    words = subjects(analysis)
    people = {c.participant for c in analysis.cells}
    by_method = cells_by_method(analysis)
    caption = (
        "Methods compared on the same recordings, each without the pulses that it cannot use: mean "
        f"over {words.many} whose estimate stands [{_level(analysis)} Student interval over "
        f"{words.many}, or the {words.one}'s own where there is one] (n); of the chosen method as "
        "in the table of means. An estimate at its "
        "bound counts with the value of the bound. Chosen: "
        f"{method_name(chosen_method(analysis)) if analysis.cells else NO_VALUE}. "
        f"{_symbols(p.name for c in analysis.cells for p in c.parameters)}"
    )
    head = ("Parameter", "Unit", words.point.capitalize(), *map(method_name, by_method))
    if not analysis.comparison or (words.loads and len(people) > 1):
        return Table(caption, head, ())
    points = [*timing_points(analysis.cells), ALL_POINTS]
    rows = []
    for parameter in PARAMETERS:
        for point in points:
            found = {m: standing(cells, parameter, point) for m, cells in by_method.items()}
            if any(found.values()):
                unit = pretty_unit(PARAMETER_UNITS[parameter])
                texts = (
                    _mean_text(method_mean(analysis, m, own, point), len(own))
                    for m, own in found.items()
                )
                rows.append((PARAMETERS[parameter][1], unit, point_name(point), *texts))
    note = f"{NO_VALUE}: no estimate stands. {NO_VALUE} (n): the mean of n is undecided."
    return Table(caption, head, tuple(rows), (note,))


def _mean_text(mean: tuple[float, float, float], n: int) -> str:
    if not n:
        return NO_VALUE
    value, low, high = mean
    ends = (None, None) if low != low or high != high else (low, high)  # NaN: no interval
    return f"{NO_VALUE if value != value else format_interval(value, *ends)} ({n})"


def _exclusions(analysis: StudyAnalysis) -> Table:
    words = subjects(analysis)
    frame = analysis.excluded_frame()
    counts = Counter(zip(frame["kind"], frame["code"], strict=True))
    people = frame.groupby(["kind", "code"])["participant"].nunique()
    totals = {"pulse": len(analysis.pulses), "stride": len(analysis.strides)}
    rows = tuple(
        (
            kind,
            code,
            exclusion_meaning(code),
            format_integer(count),
            format_integer(totals[kind]),
            format_integer(int(people[kind, code])),
        )
        for (kind, code), count in sorted(counts.items(), key=lambda i: (i[0][0], -i[1], i[0][1]))
    )
    caption = (
        f"Pulses and strides left out of the analysis, by code: number, of how many found, and "
        f"{words.many} concerned."
    )
    head = ("What", "Code", "Meaning", "Left out", "Found", words.many.capitalize())
    return Table(caption, head, rows)


def _symbols(parameters: Iterable[str]) -> str:
    """Say what each symbol stands for."""
    present = set(parameters)
    named = [f"{s}: {text.lower()}" for n, (text, s) in PARAMETERS.items() if n in present]
    return f"{'; '.join(named)}." if named else ""


def _level(analysis: StudyAnalysis) -> str:
    return f"{100 * analysis.settings.get('ci_level', 0.95):g} %"


def _made(analysis: StudyAnalysis) -> str:
    made = "; ".join(interval_methods(analysis))
    interval = f"Interval: {made}. " if made else ""
    return f"{interval}{_method_of(c.method for c in analysis.cells)}"


def _method_of(methods: Iterable[str]) -> str:
    names = " and ".join(dict.fromkeys(method_name(m) for m in methods if m))
    return f"Method: {names}." if names else ""


def _counted(analysis: StudyAnalysis, words: Subjects) -> str:
    used, left_out = pulse_counts(analysis)
    people = len({c.participant for c in analysis.cells})
    return (
        f"n: {words.counted(people)}, {format_count(used, 'pulse')} used and "
        f"{format_integer(left_out)} left out."
    )
