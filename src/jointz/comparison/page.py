"""Page of a comparison: one HTML file that needs no other."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from jointz.comparison.comparison_result import Comparison
from jointz.comparison.comparison_text import (
    adjusted_p,
    equivalence_text,
    p_text,
    people_text,
)
from jointz.report.html_page import page_figures, render_template
from jointz.report.wording import (
    DASH,
    MINUS,
    format_interval,
    format_number,
    format_signed,
    joined,
    parameter_name,
    point_name,
)
from jointz.results.statistics.comparison_rows import (
    Difference,
    FactorTest,
    Repeatability,
    SourceMean,
)

_WARNING: Final = "WARNING: "
_HASH_DIGITS: Final = 12
_ALPHA: Final = 0.05

_Row = dict[str, Any]


def render_comparison(comparison: Comparison, figures: Mapping[str, str]) -> str:
    """Write a comparison as one HTML page with its figures and styles inside."""
    single = len(comparison.sources) == 1
    margin = None if comparison.margin_pct is None or single else f"{comparison.margin_pct:g} %"
    return render_template(
        "comparison.html.j2",
        title=_title(comparison),
        about=[str(v) for key, v in comparison.provenance.items() if key == "created"],
        designs={d.design for d in comparison.differences},
        facts=_facts(comparison),
        warnings=[n.removeprefix(_WARNING) for n in comparison.notes if n.startswith(_WARNING)],
        notes=[n for n in comparison.notes if not n.startswith(_WARNING)],
        figures=page_figures((name, svg, "", "") for name, svg in figures.items()),
        published=any(s.published for s in comparison.sources)
        or any(r.value is not None for r in comparison.references),
        single=single,
        level=f"{100 * comparison.ci_level:g} %",
        margin=margin,
        means=_by_parameter(comparison.means, _mean),
        several=len({(d.first, d.second) for d in comparison.differences}) > 1,
        contrast=_contrast(comparison),
        effects={d.effect for d in comparison.differences} - {""},
        adjusted=comparison.adjusted,
        adjusted_p=adjusted_p(comparison),
        df=_df(comparison),
        differences=_by_parameter(
            comparison.differences, lambda d: _difference(d, comparison.ci_level)
        ),
        tests=[_test(t) for t in comparison.tests],
        repeatability=_by_parameter(comparison.repeatability, _repeatability),
        references=[r for r in comparison.references if r.value is None],
        provenance=_provenance(comparison),
    )


def _title(comparison: Comparison) -> str:
    names = [source.name for source in comparison.sources]
    if len(names) == 1:
        return f"Timing points of {names[0]}"
    return joined(names) if names else "Comparison of nothing"


def _contrast(comparison: Comparison) -> str:
    pairs = {(d.first, d.second) for d in comparison.differences}
    if len(pairs) != 1 or len(comparison.sources) == 1:
        return "first minus second"
    ((first, second),) = pairs
    return f"{first} {MINUS} {second}"


def _df(comparison: Comparison) -> str:
    methods = {t.fit.df_method for t in comparison.tests if t.fit is not None}
    return "Satterthwaite" if methods == {"satterthwaite"} else "Kenward and Roger"


def _facts(comparison: Comparison) -> list[tuple[str, str]]:
    facts = [(str(len(s.participants)), f"people in {s.name}") for s in comparison.sources[:3]]
    tested = [d for d in comparison.differences if d.available]
    if tested:
        below = sum((d.p_adjusted or 0.0) < _ALPHA for d in tested)
        facts.append(
            (f"{below} of {len(tested)}", f"differences with p < 0.05, {comparison.adjusted}")
        )
    elif comparison.differences:
        facts.append(("0", "differences can be tested, see the notes"))
    if n := comparison.n_missing:
        facts.append((str(n), f"{'value' if n == 1 else 'values'} missing, listed in the notes"))
    return facts


def _by_parameter(rows: Sequence[Any], cells: Callable[[Any], _Row]) -> list[_Row]:
    groups: dict[str, _Row] = {}
    for row in rows:
        group: _Row = {"name": parameter_name(row.parameter), "unit": row.unit, "rows": []}
        groups.setdefault(row.parameter, group)["rows"].append(cells(row))
    return list(groups.values())


def _mean(m: SourceMean) -> _Row:
    share = None if not m.error_sd or not m.sd else 100.0 * (m.error_sd / m.sd) ** 2
    sample_sd = m.sample_sd if m.mean is not None and m.sample_sd != m.sd else None
    sample = "" if sample_sd is None else f" ({format_number(sample_sd, like=m.mean)})"
    return {
        "point": point_name(m.timing_point),
        "source": m.source,
        "mean": m.status if m.mean is None else format_interval(m.mean, m.ci_low, m.ci_high),
        "sd": format_number(m.sd, like=m.mean) + sample,
        "share": DASH if share is None else f"{share:.0f} %",
        "n": m.n,
        "missing": m.n_missing or "",
        "at_bound": m.n_at_bound or "",
    }


def _difference(d: Difference, ci_level: float) -> _Row:
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
        "equivalent": equivalence_text(d, ci_level),
        "status": "" if d.available else d.status,
    }


def _test(t: FactorTest) -> _Row:
    row = {"parameter": parameter_name(t.parameter), "factor": t.factor.replace("_", " "),
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


def _repeatability(r: Repeatability) -> _Row:
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


def _provenance(comparison: Comparison) -> list[tuple[str, str]]:
    record = comparison.provenance
    rows = [(key, str(record[key])) for key in ("jointz", "python", "created") if key in record]
    rows += [(f"setting {k}", str(v)) for k, v in comparison.settings.items() if v is not None]
    inputs = record.get("inputs", ())
    return rows + [(file["file"], str(file["sha256"])[:_HASH_DIGITS]) for file in inputs]
