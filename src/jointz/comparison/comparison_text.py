"""Tables of a comparison, and of a mixed model, for a terminal."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np

from jointz.comparison.comparison_result import Comparison
from jointz.results.statistics.comparison_rows import GROUPS, PAIRED, Difference, FactorTest
from jointz.results.statistics.mixed_model_fit import MixedModelFit

#: Title, column names, cells.
TextTable = tuple[str, list[str], list[list[str]]]

_DASH = "-"


def comparison_tables(comparison: Comparison) -> list[TextTable]:
    """Return the tables of a comparison that are not empty."""
    level = f"{100 * comparison.ci_level:g} % interval"
    tables = [
        (
            "Means over people",
            ["results", "timing point", "parameter", "mean", level, "SD", "sample SD", "unit",
             "people", "no value", "at bound"],
            [[m.source, m.timing_point, m.parameter, _number(m.mean),
              _interval(m.ci_low, m.ci_high), _number(m.sd), _number(m.sample_sd), m.unit, str(m.n),
              _count(m.n_missing), _count(m.n_at_bound)] for m in comparison.means],
        ),
        (
            "Mixed models",
            ["parameter", "of", "where", "F", "df", "p", "epsilon", "p (Greenhouse-Geisser)",
             "people"],
            [_test_row(t) for t in comparison.tests],
        ),
        _differences_table(comparison, level),
        (
            "Repeatability (SEM without shifts between days; MDC of one person)",
            ["timing point", "parameter", "ICC(A,1)", level, "ICC(C,1)", level, "SEM", "MDC",
             level, "unit", "people"],
            [[r.timing_point, r.parameter,
              _number(r.icc_agreement, 2) if r.status == "ok" else r.status,
              _interval(r.icc_agreement_low, r.icc_agreement_high, decimals=2),
              _number(r.icc_consistency, 2),
              _interval(r.icc_consistency_low, r.icc_consistency_high, decimals=2),
              _number(r.sem), _number(r.mdc), _interval(r.mdc_low, r.mdc_high), r.unit,
              str(r.n)] for r in comparison.repeatability],
        ),
    ]  # fmt: skip
    return [table for table in tables if table[2]]


def _differences_table(comparison: Comparison, level: str) -> TextTable:
    single, rows = len(comparison.sources) == 1, comparison.differences
    title = (
        "First minus second; each interval is for one difference, p "
        f"{comparison.adjusted} over a parameter"
    )
    if single and any(d.design == PAIRED for d in rows):
        title += "; each pair has its own error"
    columns: list[tuple[str, Callable[[Difference], str]]] = [
        ("pair", lambda d: f"{d.first} - {d.second}"),
        ("parameter", lambda d: d.parameter),
        ("difference", lambda d: _number(d.difference)),
        (level, lambda d: _interval(d.ci_low, d.ci_high) if d.available else d.status),
        ("unit", lambda d: d.unit),
        (adjusted_p(comparison), lambda d: p_text(d.p_adjusted)),
    ]
    if not single:
        columns = [("timing point", lambda d: d.timing_point), *columns]
    if has_effects(comparison):
        columns += [
            ("effect", _effect),
            (level, lambda d: _interval(d.effect_low, d.effect_high, decimals=2)),
        ]
    columns += [("people", people_text)]
    if comparison.margin_pct is not None and not single:
        name = f"equivalent within {comparison.margin_pct:g} %"
        columns += [(name, lambda d: equivalence_text(d, comparison.ci_level))]
    return title, [name for name, _ in columns], [[cell(d) for _, cell in columns] for d in rows]


def _effect(d: Difference) -> str:
    return _DASH if d.effect_size is None else f"{d.effect} {d.effect_size:.2f}"


def _test_row(t: FactorTest) -> list[str]:
    start = [t.parameter, f"{t.factor.replace('_', ' ')}s", t.where]
    if t.fit is None:
        return [*start, *[_DASH] * 6]
    f, rm = t.fit.f_test, t.fit.repeated_measures
    df = f"{f.df_num:g}, {f.df_den:.4g}"
    sphericity = [_DASH, _DASH] if rm is None else [f"{rm.epsilon:.2f}", p_text(rm.p_epsilon)]
    return [*start, f"{f.F:.4g}", df, p_text(f.p), *sphericity, str(t.fit.n_participants)]


def has_effects(comparison: Comparison) -> bool:
    """Return whether there is an effect size to show."""
    return any(d.effect for d in comparison.differences)


def adjusted_p(comparison: Comparison) -> str:
    """Return the heading of the column of adjusted p."""
    return "p (alone)" if comparison.adjust == "none" else f"p ({comparison.adjust.title()})"


def people_text(d: Difference) -> str:
    """Return the number of people of a difference."""
    if d.design == GROUPS or d.n_first != d.n_second:
        return f"{d.n_first} and {d.n_second}"
    return str(d.n_first)


def equivalence_text(d: Difference, ci_level: float) -> str:
    """Return whether two means are shown to be equivalent."""
    if d.p_equivalence is None:
        return _DASH
    shown = d.p_equivalence < 1.0 - ci_level
    return f"{'yes' if shown else 'not shown'} (p {p_text(d.p_equivalence)})"


# --- mixed model of a table ----------------------------------------------------------------------


def fit_tables(fit: MixedModelFit, *, adjust: str, error: str) -> list[TextTable]:
    """Return means and pairs of a mixed model."""
    level = f"{100 * fit.ci_level:g} % interval"
    means = [
        [m.level, _number(m.mean), _interval(m.ci_low, m.ci_high), str(m.n_participants)]
        for m in fit.means
    ]
    pairs = [
        [f"{row['first']} - {row['second']}", _number(row["difference"]),
         _interval(row["ci_low"], row["ci_high"]), _number(row["t"]), _number(row["df"]),
         p_text(row["p"]), p_text(row["p_adjusted"]), str(row["n_participants"])]
        for row in fit.pairs(adjust, error=error).to_dict("records")
    ]  # fmt: skip
    coverage = "for each pair alone" if adjust == "none" else "simultaneous"
    return [
        (f"Means of {fit.response}", [fit.within, "mean", level, "people"], means),
        (
            f"Pairs, {error} error, intervals {coverage}",
            ["pair", "difference", level, "t", "df", "p", f"p ({adjust})", "people"],
            pairs,
        ),
    ]


def fit_dict(fit: MixedModelFit, *, adjust: str, error: str) -> dict[str, Any]:
    """Return a mixed model with its pairs for JSON."""
    rows = fit.pairs(adjust, error=error).to_dict("records")
    plain = fit.to_dict() | {"formula": fit.formula, "adjust": adjust, "error": error}
    text = json.dumps({**plain, "pairs": rows})
    finite: dict[str, Any] = json.loads(text, parse_constant=lambda _: None)  # NaN, infinity
    return finite


# --- cells ---------------------------------------------------------------------------------------


def p_text(p: float | None) -> str:
    """Write a probability, a dash if there is none."""
    if p is None or not np.isfinite(p):
        return _DASH
    return "< 0.0001" if p < 1e-4 else f"{p:.2g}"


def _number(value: float | None, decimals: int | None = None) -> str:
    if value is None or not np.isfinite(value):
        return _DASH
    return f"{value:.4g}" if decimals is None else f"{value:.{decimals}f}"


def _interval(low: float | None, high: float | None, *, decimals: int | None = None) -> str:
    if low is None or high is None or not np.isfinite(low):
        return _DASH
    return f"{_number(low, decimals)} to {_number(high, decimals)}"


def _count(n: int) -> str:
    return str(n) if n else _DASH
