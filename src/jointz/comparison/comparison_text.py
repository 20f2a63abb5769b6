"""A comparison, and a mixed model, as tables of text for a terminal."""

from typing import Any

import numpy as np

from jointz.comparison.comparison_result import Comparison
from jointz.results.statistics.comparison_rows import (
    GROUPS,
    PAIRED,
    Difference,
    FactorTest,
    Repeatability,
    SourceMean,
)
from jointz.results.statistics.mixed_model_fit import MixedModelFit

#: Title, column names, cells.
TextTable = tuple[str, list[str], list[list[str]]]

_DASH = "-"


def comparison_tables(made: Comparison) -> list[TextTable]:
    """Return the tables of a comparison that hold something."""
    level = f"{100 * made.ci_level:g} % interval"
    tables = [
        (
            "Means over people",
            ["results", "timing point", "parameter", "mean", level, "SD", "unit", "people",
             "no value", "at bound"],
            [_mean_row(m) for m in made.means],
        ),
        (
            "Mixed models",
            ["parameter", "of", "where", "F", "df", "p", "epsilon", "p (Greenhouse-Geisser)",
             "people"],
            [_test_row(t) for t in made.tests],
        ),
        *_difference_tables(made, level),
        (
            "Repeatability (SEM without shifts between days; MDC of one person)",
            ["timing point", "parameter", "ICC(A,1)", level, "ICC(C,1)", level, "SEM", "MDC",
             level, "unit", "people"],
            [_repeat_row(r) for r in made.repeatability],
        ),
    ]  # fmt: skip
    return [table for table in tables if table[2]]


def _difference_tables(made: Comparison, level: str) -> list[TextTable]:
    single = len(made.sources) == 1
    title = f"First minus second; every interval holds alone, p {made.adjusted} over a parameter"
    if any(d.design == PAIRED for d in made.differences) and single:
        title += "; every pair by itself"
    header = ["pair", "parameter", "difference", level, "unit", adjusted_p(made), "people"]
    if not single:
        header[:1] = ["timing point", "pair"]
    if has_effects(made):
        header[-1:] = ["effect", level, "people"]
    if made.margin_pct is not None and not single:
        header += [f"equivalent within {made.margin_pct:g} %"]
    return [(title, header, [_difference_row(d, made) for d in made.differences])]


def _mean_row(m: SourceMean) -> list[str]:
    return [m.source, m.timing_point, m.parameter, _number(m.mean), _interval(m.ci_low, m.ci_high),
            _number(m.sd), m.unit, str(m.n), _count(m.n_missing), _count(m.n_at_bound)]  # fmt: skip


def _test_row(t: FactorTest) -> list[str]:
    start = [t.parameter, f"{t.factor.replace('_', ' ')}s", t.where]
    if t.fit is None:
        return [*start, *[_DASH] * 6]
    f, rm = t.fit.f_test, t.fit.repeated_measures
    df = f"{f.df_num:g}, {f.df_den:.4g}"
    sphericity = [_DASH, _DASH] if rm is None else [f"{rm.epsilon:.2f}", p_text(rm.p_epsilon)]
    return [*start, f"{f.F:.4g}", df, p_text(f.p), *sphericity, str(t.fit.n_participants)]


def _difference_row(d: Difference, made: Comparison) -> list[str]:
    row = [f"{d.first} - {d.second}", d.parameter, _number(d.difference),
           _interval(d.ci_low, d.ci_high), d.unit, p_text(d.p_adjusted)]  # fmt: skip
    if not d.stands:
        row[3] = d.status
    if len(made.sources) > 1:
        row = [d.timing_point, *row]
    if has_effects(made):
        effect = _DASH if d.effect_size is None else f"{d.effect} {d.effect_size:.2f}"
        row += [effect, _interval(d.effect_low, d.effect_high, digits=2)]
    row.append(people_text(d))
    if made.margin_pct is not None and len(made.sources) > 1:
        row.append(equivalence_text(d, made.ci_level))
    return row


def has_effects(made: Comparison) -> bool:
    """Return whether there is an effect size to show."""
    return any(d.effect for d in made.differences)


def adjusted_p(made: Comparison) -> str:
    """Return the head of a column of p."""
    return "p (alone)" if made.adjust == "none" else f"p ({made.adjust.title()})"


def people_text(d: Difference) -> str:
    """Return how many people a difference is of."""
    if d.design == GROUPS or d.n_first != d.n_second:
        return f"{d.n_first} and {d.n_second}"
    return str(d.n_first)


def equivalence_text(d: Difference, ci_level: float) -> str:
    """Return whether two means are shown to be alike."""
    if d.p_equivalence is None:
        return _DASH
    shown = d.p_equivalence < 1.0 - ci_level
    return f"{'yes' if shown else 'not shown'} (p {p_text(d.p_equivalence)})"


def _repeat_row(r: Repeatability) -> list[str]:
    return [
        r.timing_point, r.parameter,
        _number(r.icc_agreement, 2) if r.status == "ok" else r.status,
        _interval(r.icc_agreement_low, r.icc_agreement_high, digits=2),
        _number(r.icc_consistency, 2),
        _interval(r.icc_consistency_low, r.icc_consistency_high, digits=2),
        _number(r.sem), _number(r.mdc), _interval(r.mdc_low, r.mdc_high), r.unit, str(r.n),
    ]  # fmt: skip


# --- a mixed model of a table --------------------------------------------------------------------


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
    alone = "each alone" if adjust == "none" else "together"
    return [
        (f"Means of {fit.response}", [fit.within, "mean", level, "people"], means),
        (
            f"Pairs, {error} error, intervals hold {alone}",
            ["pair", "difference", level, "t", "df", "p", f"p ({adjust})", "people"],
            pairs,
        ),
    ]


def fit_dict(fit: MixedModelFit, *, adjust: str, error: str) -> dict[str, Any]:
    """Return a mixed model with the pairs that were asked for, ready for JSON."""
    rows = fit.pairs(adjust, error=error).to_dict("records")
    plain = fit.to_dict() | {"formula": fit.formula, "adjust": adjust, "error": error}
    return _finite({**plain, "pairs": rows})  # type: ignore[no-any-return]


def _finite(value: Any) -> Any:
    """Return plain values with None for what JSON has no number for."""
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value


# --- cells ---------------------------------------------------------------------------------------


def p_text(p: float | None) -> str:
    """Return a probability as it is read, a dash where there is none."""
    if p is None or not np.isfinite(p):
        return _DASH
    return "< 0.0001" if p < 1e-4 else f"{p:.2g}"


def _number(value: float | None, decimals: int | None = None) -> str:
    if value is None or not np.isfinite(value):
        return _DASH
    return f"{value:.4g}" if decimals is None else f"{value:.{decimals}f}"


def _interval(low: float | None, high: float | None, *, digits: int | None = None) -> str:
    if low is None or high is None or not np.isfinite(low):
        return _DASH
    return f"{_number(low, digits)} to {_number(high, digits)}"


def _count(n: int) -> str:
    return str(n) if n else _DASH
