"""Chapter IV again: which timing points differ, printed beside ours (4.3.2.2)."""

from collections.abc import Mapping
from typing import Any, Final

import pandas as pd
from scipy.special import stdtrit

from jointz.reference import chapter4
from jointz.reproduction.chapter4.rows import PARAMETERS, critical_difference, fitting_scatter
from jointz.reproduction.reproduction_tables import Claim, ClaimTable, Verdict
from jointz.results.statistics.mixed_model_fit import MixedModelFit
from jointz.stats import mixed_model

#: Differences of no importance, over the grand mean of the parameter.
BAND: Final = 0.2
#: Of a test of equivalence at 5 %: two one-sided ones.
_ONE_SIDED: Final = 1.0 - chapter4.SIGNIFICANCE_LEVEL
_CONSISTENT: Final = "consistent with replicates taken as people; not proof of it"


def fitted_models(df: str = "kenward-roger") -> dict[str, MixedModelFit]:
    """Return the mixed model of every parameter, on tables 4.1 to 4.3."""
    table = chapter4.participant_table()
    return {
        parameter: mixed_model(
            table, response=parameter, within="timing_point", participant="participant", df=df
        )
        for parameter in PARAMETERS
    }


def pairs_table(fits: Mapping[str, MixedModelFit]) -> tuple[ClaimTable, dict[str, Any]]:
    """Return the pairs that the text states beside ours, and all 45 for the figure."""
    curves = {parameter: _curve(parameter, fit) for parameter, fit in fits.items()}
    rows = [
        _claim(curve, pair)
        for curve in curves.values()
        for pair in curve["pairs"]
        if pair["printed"] != "not stated"
    ]
    unstated = [p for c in curves.values() for p in c["pairs"] if p["printed"] == "not stated"]
    found = sum(pair["p"] < chapter4.SIGNIFICANCE_LEVEL for pair in unstated)
    alike = sum(pair["alike"] for curve in curves.values() for pair in curve["pairs"])
    paired = sum(
        int((fit.pairs(error="paired")["p_adjusted"] < chapter4.SIGNIFICANCE_LEVEL).sum())
        for fit in fits.values()
    )
    bands = ", ".join(f"{c['band']:.2g} {c['unit']}" for c in curves.values())
    caption = (
        "First minus second of timing points 1 to 6 (LRE, MST, TST, PSW, ISW, MSW), 95 % interval "
        "and p by pooled error, Bonferroni over the 15 pairs of a parameter; one value a person "
        f"and timing point. Of the {len(unstated)} pairs that the text does not state, {found} "
        f"differ; by paired t-tests {paired} of all 45 do. Similar is a test that did not reject. "
        f"Alike would be an interval inside ±{100 * BAND:g} % of the grand mean ({bands}); "
        f"{alike} of 45 are, even by 90 % intervals that are not adjusted."
    )
    return ClaimTable("pairs", "Pairs of timing points (4.3.2.2)", caption, tuple(rows)), curves


def _curve(parameter: str, fit: MixedModelFit) -> dict[str, Any]:
    name, unit = PARAMETERS[parameter]
    grand_mean = sum(level.mean for level in fit.means) / len(fit.means)
    band = BAND * grand_mean
    fits = fitting_scatter(parameter)
    numbers = {point: number for number, point in chapter4.POINT_NUMBERS.items()}
    found = fit.pairs("bonferroni")
    paired = fit.pairs("none", error="paired")
    return {
        "name": name,
        "unit": unit,
        "grand_mean": grand_mean,
        "band": band,
        # In the middle of the scatters of rows with which all claims come out.
        "rows_find": None if fits is None else critical_difference(parameter, 0.5 * sum(fits)),
        "pairs": [
            {
                "numbers": [numbers[row["first"]], numbers[row["second"]]],
                "points": [row["first"], row["second"]],
                "printed": chapter4.PAIRS[parameter][row["first"], row["second"]],
                "difference": float(row["difference"]),
                "ci_low": float(row["ci_low"]),
                "ci_high": float(row["ci_high"]),
                "p": float(row["p_adjusted"]),
                "p_alone": float(row["p"]),
                "p_paired": float(p_paired),
                "alike": _alike(row, band),
            }
            for (_, row), p_paired in zip(found.iterrows(), paired["p"], strict=True)
        ],
    }


def _alike(row: "pd.Series[Any]", band: float) -> bool:
    """Tell whether two one-sided tests of this pair alone put it inside the band."""
    half = float(row["se"]) * float(stdtrit(row["df"], _ONE_SIDED))
    return abs(float(row["difference"])) + half < band


def _claim(curve: Mapping[str, Any], pair: Mapping[str, Any]) -> Claim:
    first, second = pair["numbers"]
    judge = _of_likeness if pair["printed"] == "similar" else _of_difference
    verdict, remark = judge(curve, pair)
    return Claim(
        where="4.3.2.2",
        claim=f"{curve['name']}, {first} and {second} ({' and '.join(pair['points'])})",
        printed=str(pair["printed"]),
        ours=(
            f"{pair['difference']:.3g} [{pair['ci_low']:.3g}, {pair['ci_high']:.3g}] "
            f"{curve['unit']}, p {p_text(pair['p'])}"
        ),
        verdict=verdict,
        remark=remark,
    )


def _of_likeness(curve: Mapping[str, Any], pair: Mapping[str, Any]) -> tuple[Verdict, str]:
    band, unit = curve["band"], curve["unit"]
    if pair["p"] < chapter4.SIGNIFICANCE_LEVEL:
        return "not reproduced", ""
    if -band < pair["ci_low"] and pair["ci_high"] < band:
        return "reproduced", f"inside ±{band:.2g} {unit}: alike"
    return "not shown", f"no rejection here either; the interval leaves ±{band:.2g} {unit}"


def _of_difference(curve: Mapping[str, Any], pair: Mapping[str, Any]) -> tuple[Verdict, str]:
    level = chapter4.SIGNIFICANCE_LEVEL
    if pair["p"] < level:
        return "reproduced", ""
    if curve["rows_find"] is None:
        return "not reproduced", ""
    without = {"pooled": pair["p_alone"], "paired": pair["p_paired"]}
    alone = [f"{name} p {p_text(p)}" for name, p in without.items() if p < level]
    if alone:
        return (
            "not reproduced",
            "comes out with replicates as people, and with people where p is not corrected for 15 "
            f"pairs ({', '.join(alone)}); 4.2.4 says that it is",
        )
    return "only with replicates as people", _CONSISTENT


def p_text(p: float) -> str:
    """Return a p-value with its sign of equality."""
    return f"= {p:.3g}"
