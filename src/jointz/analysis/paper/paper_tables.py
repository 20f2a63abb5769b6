"""Tables for a paper, with captions that give unit, interval, n and method."""

from collections.abc import Iterable, Mapping, Sequence

from jointz.analysis.page.method_means import available, cells_by_method, method_mean
from jointz.analysis.page.quasi_stiffness_section import quasi_stiffness_table
from jointz.analysis.paper.latex import MARKS
from jointz.analysis.paper.table import NO_VALUE, NOTE, Table
from jointz.analysis.summary import (
    chosen_method,
    counted_people_and_pulses,
    fitted_signals,
    has_onsets,
    interval_methods,
    mean_interval,
    mean_over_people_note,
)
from jointz.core.channels import PARAMETER_UNITS, axis_label, pretty_unit
from jointz.core.gait_phases import ALL_POINTS
from jointz.core.grouping import by_key
from jointz.report.subjects import nobody_perturbed, subjects, timing_points
from jointz.report.wording import (
    ABSOLUTE,
    PARAMETERS,
    PER_MASS,
    exclusion_meaning,
    format_integer,
    format_interval,
    format_number,
    format_spread,
    format_vaf,
    method_name,
    parameter_name,
    point_name,
    status_meaning,
)
from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.study_analysis import PopulationEstimate, StudyAnalysis
from jointz.results.study_counts import study_counts


def paper_tables(analysis: StudyAnalysis) -> dict[str, Table]:
    """Return the tables that an analysis has data for, by the names of their files."""
    tables = {
        "estimates": _estimates(analysis, ABSOLUTE),
        "estimates_per_mass": _estimates(analysis, PER_MASS),
        "population": _population(analysis),
        "methods": _methods(analysis),
        "quasi_stiffness": quasi_stiffness_table(analysis),
        "exclusions": _exclusions(analysis),
    }
    return {name: table for name, table in tables.items() if table.rows}


def captions_text(tables: Mapping[str, Table]) -> str:
    """Return captions and notes of tables as plain text, as csv files have no place for them."""
    texts = [
        f"{name}: {' '.join((t.caption, *(note.lstrip(MARKS) for note in t.notes)))}\n"
        for name, t in tables.items()
    ]
    return "\n".join(texts)


def printed_estimate(estimate: ParameterEstimate | None) -> str:
    """Write an estimate for a table: a value, ``< limit``, or a dash."""
    if estimate is None or not estimate.available:
        return NO_VALUE
    if estimate.status == "at_bound":
        limit = estimate.ci_high
        return NO_VALUE if limit is None else f"< {format_number(limit)}"
    return format_interval(estimate.value, estimate.ci_low, estimate.ci_high)


def _estimates(analysis: StudyAnalysis, names: Sequence[str]) -> Table:
    names = () if nobody_perturbed(analysis) else names
    present = [n for n in names if any(c.parameter(n) for c in analysis.cells)]
    words = subjects(analysis)
    walking = has_onsets(analysis)
    order = {n: i for i, n in enumerate([*timing_points(analysis.cells), ALL_POINTS])}
    people = list(dict.fromkeys(c.label for c in analysis.cells))
    cells = sorted(
        (c for c in analysis.cells if any(c.parameter(n) for n in present)),
        key=lambda c: (people.index(c.label), order[c.timing_point]),
    )
    head = [words.one.capitalize(), words.point.capitalize()]
    head += ["Onset (% of cycle)"] if walking else []
    head += [*map(axis_label, present), "VAF (%)", "Used", "Out", NOTE]
    estimates = [p for c in cells for n in present if (p := c.parameter(n)) is not None]
    marks = _marks(estimates)
    rows = tuple(_estimate_row(c, present, marks, walking=walking) for c in cells)
    quantities = ", ".join(parameter_name(n).lower() for n in present).capitalize()
    intervals = "; ".join(interval_methods(analysis))
    caption = (
        f"{quantities} of each {words.one} at each {words.point}: value "
        f"[{_level(analysis)} interval]. {f'Interval: {intervals}. ' if intervals else ''}"
        f"{_method_of(c.method for c in analysis.cells)} "
        f"n: {counted_people_and_pulses(analysis)} used and "
        f"{format_integer(study_counts(analysis).excluded)} excluded. "
        f"VAF: variance accounted for of the {fitted_signals(analysis)}, which is not accuracy."
    )
    return Table(caption, tuple(head), rows if present else (), tuple(_notes(marks)))


def _estimate_row(
    cell: CellEstimate, names: Sequence[str], marks: Mapping[str, str], *, walking: bool
) -> tuple[str, ...]:
    onset = "" if cell.onset_gait_pct is None else f"{cell.onset_gait_pct:.1f}"
    # The row of a shared value has no other parameters: these cells are blank, not undecided.
    estimates = [cell.parameter(n) for n in names]
    texts = [
        "" if p is None else f"{printed_estimate(p)}{marks.get(p.status, '')}" for p in estimates
    ]
    return (
        cell.label,
        point_name(cell.timing_point),
        *((onset,) if walking else ()),
        *texts,
        "" if cell.vaf_pct is None else format_vaf(cell.vaf_pct),
        format_integer(cell.n_used),
        format_integer(cell.n_excluded),
        _reasons([p for p in estimates if p is not None]),
    )


def _reasons(estimates: Iterable[ParameterEstimate]) -> str:
    """Name the parameters of a row without a value, and the reasons."""
    by_status = by_key((p.status, PARAMETERS[p.name][1]) for p in estimates if p.status != "ok")
    return "; ".join(
        f"{', '.join(symbols)} {_status_word(status)}" for status, symbols in by_status.items()
    )


def _status_word(status: str) -> str:
    return "upper limit" if status == "at_bound" else status.replace("failed:", "failed: ")


def _marks(estimates: Iterable[ParameterEstimate]) -> dict[str, str]:
    """Give each status other than ok a mark; if there are too many, the last mark is shared."""
    statuses = dict.fromkeys(p.status for p in estimates if p.status != "ok")
    return {status: MARKS[min(k, len(MARKS) - 1)] for k, status in enumerate(statuses)}


def _notes(marks: Mapping[str, str]) -> list[str]:
    """Explain every status that has a mark."""
    return [
        f"{mark}{'<' if status == 'at_bound' else NO_VALUE} ({_status_word(status)}): "
        f"{status_meaning(status)}."
        for status, mark in marks.items()
    ]


def _population(analysis: StudyAnalysis) -> Table:
    order = [*timing_points(analysis.cells), ALL_POINTS]
    names = list(PARAMETERS)
    means = sorted(
        (
            m
            for m in analysis.population
            if m.n_participants > 1 and m.timing_point in order and m.parameter in names
        ),
        key=lambda m: (names.index(m.parameter), order.index(m.timing_point)),
    )
    words = subjects(analysis)
    caption = (
        f"Means over {words.many}: mean [{_level(analysis)} interval], standard deviation between "
        f"{words.many} (SD) and number of {words.many} (n). {mean_over_people_note(analysis)} "
        f"Interval: {mean_interval(analysis)}. {_method_of(m.method for m in means)} "
        f"{_symbols(m.parameter for m in means)}"
    )
    head = ("Parameter", "Unit", words.point.capitalize(), "Mean [interval]", "SD", "n", NOTE)
    missing = dict.fromkeys(m.status for m in means if m.value is None)
    notes = tuple(f"{NO_VALUE}: {status_meaning(status)}." for status in missing)
    return Table(caption, head, tuple(map(_mean_row, means)), notes)


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
    """Compare the means of the methods, except over unlike loads."""
    words = subjects(analysis)
    people = {c.participant for c in analysis.cells}
    by_method = cells_by_method(analysis)
    caption = (
        "Methods compared on the same recordings, each without the pulses that it cannot use: mean "
        f"over the {words.many} with an estimate [{_level(analysis)} t interval over {words.many}; "
        f"with one {words.one}, the {words.one}'s own] (n); for the chosen method as in the table "
        "of means. An estimate at its bound counts with the value of the bound. Chosen method: "
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
            by_name = {m: available(cells, parameter, point) for m, cells in by_method.items()}
            if any(by_name.values()):
                unit = pretty_unit(PARAMETER_UNITS[parameter])
                texts = (
                    _mean_text(method_mean(analysis, m, estimates, point), len(estimates))
                    for m, estimates in by_name.items()
                )
                rows.append((PARAMETERS[parameter][1], unit, point_name(point), *texts))
    note = f"{NO_VALUE}: no estimate available. {NO_VALUE} (n): the mean of n is undecided."
    return Table(caption, head, tuple(rows), (note,))


def _mean_text(mean: tuple[float, float, float], n: int) -> str:
    if not n:
        return NO_VALUE
    value, low, high = mean
    ends = (None, None) if low != low or high != high else (low, high)  # NaN: no interval
    return f"{NO_VALUE if value != value else format_interval(value, *ends)} ({n})"


def _exclusions(analysis: StudyAnalysis) -> Table:
    words = subjects(analysis)
    groups = analysis.excluded_frame().groupby(["kind", "code"], as_index=False)
    counts = groups.agg(n=("participant", "size"), people=("participant", "nunique"))
    counts = counts.sort_values(["kind", "n", "code"], ascending=[True, False, True])
    found = {"pulse": len(analysis.pulses), "stride": len(analysis.strides)}
    rows = tuple(
        (kind, code, exclusion_meaning(code), *map(format_integer, (n, found[kind], people)))
        for kind, code, n, people in counts.itertuples(index=False)
    )
    caption = (
        "Pulses and strides excluded from the analysis, by code: number left out, number found, "
        f"and number of {words.many} concerned."
    )
    head = ("What", "Code", "Meaning", "Left out", "Found", words.many.capitalize())
    return Table(caption, head, rows)


def _symbols(parameters: Iterable[str]) -> str:
    """Explain the symbols."""
    present = set(parameters)
    named = [f"{s}: {text.lower()}" for n, (text, s) in PARAMETERS.items() if n in present]
    return f"{'; '.join(named)}." if named else ""


def _level(analysis: StudyAnalysis) -> str:
    return f"{100 * analysis.settings.get('ci_level', 0.95):g} %"


def _method_of(methods: Iterable[str]) -> str:
    names = " and ".join(dict.fromkeys(method_name(m) for m in methods if m))
    return f"Method: {names}." if names else ""
