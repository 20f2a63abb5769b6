"""A comparison as one HTML page that needs nothing else."""

from collections.abc import Mapping
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined

from jointz.analysis.page.report_page import inline_svg
from jointz.comparison.comparison_result import Comparison
from jointz.comparison.comparison_text import (
    adjusted_p,
    equivalence_text,
    has_effects,
    p_text,
    people_text,
)
from jointz.report.wording import (
    DASH,
    MINUS,
    PARAMETERS,
    format_interval,
    format_number,
    format_signed,
    point_name,
    pretty_unit,
)
from jointz.results.statistics.comparison_rows import (
    PAIRED,
    POOLED,
    Difference,
    FactorTest,
    Repeatability,
    SourceMean,
)

_WARNING: Final = "WARNING: "
_HASH_DIGITS: Final = 12
_ALPHA: Final = 0.05

_PAIRS: Final = {
    PAIRED: "; every pair is compared by itself (paired t test), with p over all pairs.",
    POOLED: "; pairs are compared by its error, which all pairs share.",
}
_EFFECTS: Final = {
    "g_z": "g_z: mean over standard deviation of the differences of the same people.",
    "g": "g: difference of groups over their pooled standard deviation.",
}

_Row = dict[str, Any]


def render_comparison(made: Comparison, figures: Mapping[str, str]) -> str:
    """Write a comparison as one HTML page with its figures and styles inside."""
    environment = Environment(
        loader=PackageLoader("jointz.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["unit"] = pretty_unit
    single = len(made.sources) == 1
    return environment.get_template("comparison.html.j2").render(
        title=_title(made),
        about=[str(made.provenance[key]) for key in ("created",) if key in made.provenance],
        lead=_lead(made),
        facts=_facts(made),
        warnings=[n.removeprefix(_WARNING) for n in made.notes if n.startswith(_WARNING)],
        notes=[n for n in made.notes if not n.startswith(_WARNING)],
        figures={
            name: {
                "svg": inline_svg(svg, name, f"Figure {number}"),
                "number": number,
                "caption": _caption(name, made),
            }
            for number, (name, svg) in enumerate(figures.items(), start=1)
        },
        single=single,
        level=f"{100 * made.ci_level:g} %",
        margin=None if made.margin_pct is None or single else f"{made.margin_pct:g} %",
        means=_by_parameter([(m.parameter, m.unit, _mean(m)) for m in made.means]),
        several=len({(d.first, d.second) for d in made.differences}) > 1,
        contrast=_contrast(made),
        effects=_effects(made),
        adjusted_p=adjusted_p(made),
        df=_df(made),
        differences=_by_parameter(
            [(d.parameter, d.unit, _difference(d, made)) for d in made.differences]
        ),
        tests=[_test(t) for t in made.tests],
        repeatability=_by_parameter(
            [(r.parameter, r.unit, _repeat(r)) for r in made.repeatability]
        ),
        references=[r for r in made.references if r.value is None],
        provenance=_provenance(made),
    )


def _title(made: Comparison) -> str:
    names = [source.name for source in made.sources]
    if not names:
        return "Comparison of nothing"
    if len(names) == 1:
        return f"Timing points of {names[0]}"
    return f"{', '.join(names[:-1])} and {names[-1]}"


def _contrast(made: Comparison) -> str:
    if not made.differences or len(made.sources) == 1:
        return "first minus second"
    one = made.differences[0]
    same = all((d.first, d.second) == (one.first, one.second) for d in made.differences)
    return f"{one.first} {MINUS} {one.second}" if same else "first minus second"


def _effects(made: Comparison) -> str:
    """Return what the effect sizes are that are shown."""
    shown = {d.effect for d in made.differences}
    told = [words for name, words in _EFFECTS.items() if name in shown]
    if not has_effects(made):
        return ""
    both = "; one is not to be compared with the other" if len(told) > 1 else ""
    return (
        f"{' '.join(told)} With Hedges\N{RIGHT SINGLE QUOTATION MARK} correction and the interval "
        f"of the noncentral t distribution{both}."
    )


def _df(made: Comparison) -> str:
    methods = {t.fit.df_method for t in made.tests if t.fit is not None}
    return "Satterthwaite" if methods == {"satterthwaite"} else "Kenward and Roger"


def _lead(made: Comparison) -> str:
    told = "Every number counts people: pulses and resamples of one person are no people. "
    designs = {d.design for d in made.differences}
    if len(made.sources) == 1:
        return told + (
            "A mixed model with participants as a random factor asks whether timing points differ"
            + _PAIRS.get(next(iter(designs), ""), ".")
        )
    told += "Differences are first minus second. "
    if "paired" in designs:
        told += "The same people are compared with themselves (paired t test). "
    if "groups" in designs:
        told += "Different people are compared as groups (t test of Welch). "
    return told + (
        "That a difference is not found does not show that there is none: read its interval."
    )


def _facts(made: Comparison) -> list[tuple[str, str]]:
    facts = [(str(len(s.participants)), f"people in {s.name}") for s in made.sources[:3]]
    standing = [d for d in made.differences if d.stands]
    if standing:
        below = sum((d.p_adjusted or 0.0) < _ALPHA for d in standing)
        facts.append((f"{below} of {len(standing)}", f"differences below 0.05, {made.adjusted}"))
    elif made.differences:
        facts.append(("0", "differences: nothing to test, see the notes"))
    if n := len(made.missing):
        words = "value missing, named" if n == 1 else "values missing, named"
        facts.append((str(n), f"{words} in the notes"))
    return facts


def _caption(name: str, made: Comparison) -> str:
    if name == "means":
        thin = "Thin lines: people. "
        if len(made.sources) > 1:
            paired = any(d.design == PAIRED for d in made.differences)
            thin = f"Dots: people{'; lines join those of the same person' if paired else ''}. "
        beside = (
            "Open triangles: the dissertation\N{RIGHT SINGLE QUOTATION MARK}s people, some of "
            "whose values stand at a bound. "
            if any(r.value is not None for r in made.references)
            or any(s.published for s in made.sources)
            else ""
        )
        stated = (
            "Grey boxes: range that the dissertation states in words for another study."
            if any(r.value is None for r in made.references)
            else ""
        )
        level = f"{100 * made.ci_level:g}"
        return f"Mean over people with {level} % interval over people. {thin}{beside}{stated}"
    text = (
        f"Differences with {100 * made.ci_level:g} % interval, each holding alone; filled: p below "
        f"0.05, {made.adjusted} over all differences of the parameter."
    )
    if made.margin_pct is not None and len(made.sources) > 1:
        text += (
            f" Boxes: {made.margin_pct:g} % of the second mean. Two means are shown to be alike "
            "where the 90 % interval, a little shorter than the one drawn, lies inside."
        )
    return text


def _by_parameter(rows: list[tuple[str, str, _Row]]) -> list[_Row]:
    groups: dict[str, _Row] = {}
    for parameter, unit, row in rows:
        name = PARAMETERS[parameter][0]
        groups.setdefault(parameter, {"name": name, "unit": unit, "rows": []})["rows"].append(row)
    return list(groups.values())


def _mean(m: SourceMean) -> _Row:
    share = None if not m.error_sd or not m.sd else 100.0 * (m.error_sd / m.sd) ** 2
    return {
        "point": point_name(m.timing_point),
        "source": m.source,
        "mean": format_interval(m.mean, m.ci_low, m.ci_high),
        "sd": format_number(m.sd, like=m.mean),
        "share": DASH if share is None else f"{share:.0f} %",
        "n": m.n,
        "missing": m.n_missing or "",
        "at_bound": m.n_at_bound or "",
    }


def _difference(d: Difference, made: Comparison) -> _Row:
    pct = None
    if d.difference is not None and d.mean_second:
        pct = round(100.0 * d.difference / abs(d.mean_second)) + 0.0
    effect = DASH
    if d.effect_size is not None and d.effect_low is not None and d.effect_high is not None:
        ends = (format_signed(v, decimals=2) for v in (d.effect_low, d.effect_high))
        effect = f"{format_signed(d.effect_size, decimals=2)} [{', '.join(ends)}]"
    return {
        "point": point_name(d.timing_point) if d.timing_point else "",
        "pair": f"{d.first} {MINUS} {d.second}",
        "design": d.design,
        "difference": format_interval(d.difference, d.ci_low, d.ci_high),
        "pct": DASH if pct is None else f"{format_signed(pct, decimals=0)} %",
        "p": p_text(d.p),
        "p_adjusted": p_text(d.p_adjusted),
        "differs": d.p_adjusted is not None and d.p_adjusted < _ALPHA,
        "effect_name": d.effect,
        "effect": effect,
        "people": people_text(d),
        "equivalent": equivalence_text(d, made.ci_level),
        "status": "" if d.stands else d.status,
    }


def _test(t: FactorTest) -> _Row:
    row = {"parameter": PARAMETERS[t.parameter][0], "factor": t.factor.replace("_", " "),
           "where": t.where, "reason": t.reason}  # fmt: skip
    if t.fit is None:
        return row
    f, rm = t.fit.f_test, t.fit.repeated_measures
    return row | {
        "f": f"F({f.df_num:g}, {f.df_den:.4g}) = {f.F:.4g}",
        "p": p_text(f.p),
        "epsilon": DASH if rm is None else f"{rm.epsilon:.2f}",
        "p_epsilon": DASH if rm is None else p_text(rm.p_epsilon),
        "icc": format_interval(t.fit.icc.value, t.fit.icc.ci_low, t.fit.icc.ci_high),
        "n": t.fit.n_participants,
    }


def _repeat(r: Repeatability) -> _Row:
    return {
        "point": point_name(r.timing_point),
        "agreement": format_interval(r.icc_agreement, r.icc_agreement_low, r.icc_agreement_high),
        "consistency": format_interval(
            r.icc_consistency, r.icc_consistency_low, r.icc_consistency_high
        ),
        "sem": format_interval(r.sem, r.sem_low, r.sem_high),
        "mdc": format_interval(r.mdc, r.mdc_low, r.mdc_high),
        "n": r.n,
        "status": "" if r.status == "ok" else r.status,
    }


def _provenance(made: Comparison) -> list[tuple[str, str]]:
    held = made.provenance
    rows = [(key, str(held[key])) for key in ("jointz", "python", "created") if key in held]
    rows += [(f"setting {k}", str(v)) for k, v in made.settings.items() if v is not None]
    inputs = held.get("inputs", ())
    return rows + [(one["file"], str(one["sha256"])[:_HASH_DIGITS]) for one in inputs]
