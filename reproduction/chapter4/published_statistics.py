"""Every statistic of 4.3 from the published tables, printed beside ours."""

from collections.abc import Mapping
from statistics import fmean, stdev
from typing import Any, Final

import numpy as np
import pandas as pd
from scipy.optimize import brentq
from scipy.special import stdtr, stdtrit

from jointz.core.channels import PARAMETER_UNITS
from jointz.kernels.statistics.random_field import SearchRegion, critical_height
from jointz.reference import Printed, chapter4, row_mean
from jointz.results.statistics.mixed_model_fit import MixedModelFit
from jointz.stats import compare_quasi_stiffness, mixed_model
from jointz.stats.comparison import paired_difference
from reproduction import printed_numbers
from reproduction.audit_chapter4 import column_mean
from reproduction.chapter4.replicates import (
    N_ROWS,
    critical_difference,
    fitting_scatter,
    largest_scatter,
    published_cells,
    replicates_as_people,
    replicates_published,
)
from reproduction.chapter4.stated_trends import PILOT, stated_trends
from reproduction.printed_numbers import PARAMETER_NAMES
from reproduction.reproduction_tables import (
    Claim,
    ClaimTable,
    Compared,
    ComparedTable,
    Table,
    Verdict,
    claim_table,
    compare,
    compared_table,
    stated_claims,
)

#: Tables 4.1 to 4.4 -> (name in sentences, unit).
_TABLES: Final[Mapping[str, tuple[str, str]]] = {
    **{key: (name, PARAMETER_UNITS[key]) for key, name in PARAMETER_NAMES.items()},
    "vaf": ("VAF", "%"),
}
#: Nodes of a gait cycle, 0 to 100 %.
_NODES: Final = 101
#: Half of the last printed digit of the threshold.
_ROUNDING: Final = 0.0005
#: Differences of no importance, over the grand mean of the parameter.
BAND: Final = 0.2
#: Of a test of equivalence at 5 %: two one-sided ones.
_ONE_SIDED: Final = 1.0 - printed_numbers.SIGNIFICANCE_LEVEL


def published_statistics(
    seed: int = 4, *, n_simulations: int = 4000
) -> tuple[tuple[Table, ...], dict[str, Any]]:
    """Return the statistics of 4.3 from the published tables, beside the printed claims."""
    fits = fitted_models()
    pairs, of_pairs = pairs_table(fits)
    replicates, of_replicates = replicates_as_people(seed, n_simulations)
    tables = (
        spm_table(),
        averages(),
        factors(fits, fitted_models("satterthwaite")),
        pairs,
        replicates_published(),
        replicates,
        quasi_stiffness_table(),
        pilot_people(),
        stated_trends(),
    )
    return tables, {"pairs": of_pairs, "replicates": of_replicates}


# --- gait curves and quasi-stiffness -------------------------------------------------------------

# Neither is printed (4.3.1, 4.3.2.3): what the printed numbers imply is solved for.


def spm_threshold(fwhm_nodes: float, *, df: float = 9.0, n_nodes: int = _NODES) -> float:
    """Return the threshold of a two-tailed t over a curve, by random field theory, at 0.05."""
    region = SearchRegion(fwhm_nodes, (n_nodes - 1) / fwhm_nodes, n_nodes)
    return critical_height(printed_numbers.SIGNIFICANCE_LEVEL / 2.0, df=df, region=region)


def implied_fwhm(threshold: float, *, df: float = 9.0, n_nodes: int = _NODES) -> float:
    """Return the smoothness that a threshold implies, in nodes."""

    def excess(fwhm_nodes: float) -> float:
        return spm_threshold(fwhm_nodes, df=df, n_nodes=n_nodes) - threshold

    if not excess(2.0) > 0.0 > excess(n_nodes - 1.0):
        raise ValueError(
            f"implied_fwhm: no width of 2 to {n_nodes - 1} nodes has a threshold of {threshold:g}"
        )
    return float(brentq(excess, 2.0, n_nodes - 1.0, xtol=1e-9))


def spm_table() -> ClaimTable:
    """Return what is printed of the gait curves (4.3.1), and what can be checked of it."""
    printed = printed_numbers.SPM_THRESHOLD.value
    people = int(printed_numbers.N_PARTICIPANTS.value)
    width = implied_fwhm(printed)
    claims = stated_claims(
        "spm",
        printed=printed,
        people=people,
        df=people - 1,
        nodes=_NODES,
        width=width,
        threshold=spm_threshold(width),
        resels=(_NODES - 1) / width,
        narrow=implied_fwhm(printed + _ROUNDING),
        wide=implied_fwhm(printed - _ROUNDING),
        nodewise=float(-stdtrit(people - 1, printed_numbers.SIGNIFICANCE_LEVEL / 2.0 / _NODES)),
        open_sd=printed / people**0.5,
    )
    return claim_table(4, "spm", claims)


def quasi_stiffness_table() -> ClaimTable:
    """Return what is printed of quasi-stiffness (4.3.2.3) beside ours."""
    stiffness = {point: row_mean(row) for point, row in chapter4.STIFFNESS.items()}
    implied = chapter4.implied_quasi_stiffness()
    test = compare_quasi_stiffness(implied, stiffness)
    printed = chapter4.QUASI_STIFFNESS_P.value
    apart = [d.value for d in chapter4.QUASI_STIFFNESS_DIFFERENCES.values()]
    claims = stated_claims(
        "quasi_stiffness",
        printed=printed,
        test=test,
        n=test.n,
        unit=test.unit,
        verdict="reproduced" if abs(test.p - printed) < 5e-5 else "not reproduced",
        pooled=2.0 * float(stdtr(2 * test.n - 2, -abs(test.statistic))),
        paired=paired_difference(
            np.array([implied[point] for point in stiffness]), np.array(list(stiffness.values()))
        ),
        differences=", ".join(f"{d:g}" for d in apart),
        implied=", ".join(f"{value:.3f}" for value in implied.values()),
        mean=sum(stiffness.values()) / test.n,
        lowest=min(apart),
        highest=max(apart),
        near=sum(abs(d) <= 20 for d in apart),
        opposite=sum(q < 0 for q in implied.values()),
    )
    return claim_table(4, "quasi_stiffness", claims)


# --- averages ------------------------------------------------------------------------------------


def averages() -> ComparedTable:
    """Return the means over people of tables 4.1 to 4.4 beside the printed ones (4.3.2.1)."""
    rows = []
    for parameter, (name, unit) in _TABLES.items():
        for point, cells in chapter4.TABLES[parameter].items():
            printed = chapter4.MEANS[parameter][point]
            repaired = [s for s, cell in cells.items() if cell.note.startswith("repaired")]
            note = f"a digit of {', '.join(repaired)} is repaired" if repaired else ""
            quantity = f"{name}, {point}"
            rows.append(
                compare(quantity, unit, printed, recommended=_mean_of_people(cells), note=note)
            )
        if parameter in printed_numbers.RANGES:
            means = published_cells(parameter).mean(axis=0)
            rows += _range_rows(
                f"{name}, {{}} of the six", unit, printed_numbers.RANGES[parameter], means
            )
    return compared_table(4, "averages", (*rows, _vaf_mean()))


def _mean_of_people(cells: Mapping[str, Printed]) -> tuple[float, float, float]:
    """Return the mean over people with its interval from Student's t."""
    values = [cell.value for cell in cells.values()]
    t = float(stdtrit(len(values) - 1, 0.975))
    mean, half = fmean(values), t * stdev(values) / len(values) ** 0.5
    return mean, mean - half, mean + half


def _range_rows(
    quantity: str, unit: str, printed: tuple[Printed, Printed], means: np.ndarray
) -> list[Compared]:
    """Return the largest and the smallest of six means beside the printed ones."""
    ours = {"largest": float(means.max()), "smallest": float(means.min())}
    return [
        compare(quantity.format(word), unit, number, recommended=mean)
        for (word, mean), number in zip(ours.items(), printed, strict=True)
    ]


def _vaf_mean() -> Compared:
    cells = published_cells("vaf")
    people = cells.mean(axis=1)
    half = float(stdtrit(people.size - 1, 0.975)) * people.std(ddof=1) / people.size**0.5
    mean = cells.mean()
    return compare(
        "VAF, all subjects and timing points",
        "%",
        printed_numbers.VAF_MEAN,
        (float(mean), float(cells.mean(axis=0).std(ddof=1))),
        (float(mean), float(mean - half), float(mean + half)),
        note=f"SD over six timing-point means as printed; {people.std(ddof=1):.2f} over ten "
        f"people, {cells.std(ddof=1):.2f} over all {cells.size}",
    )


# --- factors -------------------------------------------------------------------------------------


def factors(
    fits: Mapping[str, MixedModelFit], satterthwaite: Mapping[str, MixedModelFit]
) -> ClaimTable:
    """Return whether timing point and subject matter, printed beside ours (4.3.2.2)."""
    rows = []
    for parameter, fit in fits.items():
        f, person, exact = fit.f_test, fit.random_effects[0], fit.repeated_measures
        if exact is None or person.p is None or person.F is None:
            raise ValueError(f"factors: expected a complete table of {parameter}")
        of_point, of_subject = largest_scatter(parameter)
        rows += [
            _factor(
                (parameter, "timing_point"),
                p=f.p,
                scatter=of_point,
                ours=f"F({f.df_num:g}, {f.df_den:.4g}) = {f.F:.3f}, p {p_text(f.p)} "
                f"(Satterthwaite {satterthwaite[parameter].f_test.p:.3g}); Greenhouse-Geisser "
                f"epsilon {exact.epsilon:.2f}, p {p_text(exact.p_epsilon)}",
                p_careful=exact.p_epsilon,
            ),
            _factor(
                (parameter, "participant"),
                p=person.p,
                scatter=of_subject,
                ours=f"exact F({person.df_num:g}, {person.df_den:g}) = {person.F:.3f}, "
                f"p {p_text(person.p)}; likelihood ratio {person.likelihood_ratio:.2f}, "
                f"p {p_text(person.p_mixture)} (mixture), {person.p_chi2:.3g} (chi-squared); "
                f"ICC {fit.icc.value:.2f}",
            ),
        ]
    return claim_table(4, "factors", rows, n_rows=N_ROWS)


def _factor(
    key: tuple[str, str],
    *,
    p: float,
    scatter: float | None,
    ours: str,
    p_careful: float | None = None,
) -> Claim:
    limit = printed_numbers.FACTOR_P_BELOW[key].value
    factor = "timing point" if key[1] == "timing_point" else "subject"
    claim = f"{factor}, {PARAMETER_NAMES[key[0]]}"
    verdict: Verdict = "reproduced"
    remark = ""
    if p < limit:
        if p_careful is not None and p_careful >= limit:
            remark = f"not below {limit:g} where the want of sphericity is heeded"
    elif scatter is not None:
        verdict = "only with replicates as people"
        remark = (
            f"{N_ROWS} rows a cell as people give p < {limit:g} as long as they scatter inside it "
            f"by less than {scatter:.1f} residual SD; consistent with it, not proof of it"
        )
    else:
        verdict = "not reproduced"
    return Claim("4.3.2.2", claim, f"p < {limit:g}", ours, verdict, remark)


# --- pairs of timing points (4.3.2.2) ------------------------------------------------------------


def fitted_models(df: str = "kenward-roger") -> dict[str, MixedModelFit]:
    """Return the mixed model of every parameter, on tables 4.1 to 4.3."""
    table = chapter4.participant_table()
    return {
        parameter: mixed_model(
            table, response=parameter, within="timing_point", participant="participant", df=df
        )
        for parameter in PARAMETER_NAMES
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
    level = printed_numbers.SIGNIFICANCE_LEVEL
    paired = (fit.pairs(error="paired")["p_adjusted"] < level for fit in fits.values())
    table = claim_table(
        4,
        "pairs",
        rows,
        unstated=len(unstated),
        differ=sum(pair["p"] < level for pair in unstated),
        paired=sum(int(significant.sum()) for significant in paired),
        band_pct=100 * BAND,
        bands=", ".join(f"{c['band']:.2g} {c['unit']}" for c in curves.values()),
        alike=sum(pair["alike"] for curve in curves.values() for pair in curve["pairs"]),
    )
    return table, curves


def _curve(parameter: str, fit: MixedModelFit) -> dict[str, Any]:
    name, unit = _TABLES[parameter]
    grand_mean = sum(level.mean for level in fit.means) / len(fit.means)
    band = BAND * grand_mean
    fits = fitting_scatter(parameter)
    points = list(printed_numbers.POINT_NUMBERS.values())
    pairs = fit.pairs("bonferroni")
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
                "numbers": [points.index(row["first"]) + 1, points.index(row["second"]) + 1],
                "points": [row["first"], row["second"]],
                "printed": printed_numbers.PAIRS[parameter][row["first"], row["second"]],
                "difference": float(row["difference"]),
                "ci_low": float(row["ci_low"]),
                "ci_high": float(row["ci_high"]),
                "p": float(row["p_adjusted"]),
                "p_alone": float(row["p"]),
                "p_paired": float(p_paired),
                "alike": _alike(row, band),
            }
            for (_, row), p_paired in zip(pairs.iterrows(), paired["p"], strict=True)
        ],
    }


def _alike(row: "pd.Series[Any]", band: float) -> bool:
    """Tell whether two one-sided tests of this pair alone put it inside the band."""
    half = float(row["se"]) * float(stdtrit(row["df"], _ONE_SIDED))
    return abs(float(row["difference"])) + half < band


def _claim(curve: Mapping[str, Any], pair: Mapping[str, Any]) -> Claim:
    first, second = pair["numbers"]
    verdict, remark = _judge(curve, pair)
    return Claim(
        "4.3.2.2",
        f"{curve['name']}, {first} and {second} ({' and '.join(pair['points'])})",
        str(pair["printed"]),
        f"{pair['difference']:.3g} [{pair['ci_low']:.3g}, {pair['ci_high']:.3g}] "
        f"{curve['unit']}, p {p_text(pair['p'])}",
        verdict,
        remark,
    )


def _judge(curve: Mapping[str, Any], pair: Mapping[str, Any]) -> tuple[Verdict, str]:
    """Return the verdict on what is printed of a pair, and the reason."""
    level, band = printed_numbers.SIGNIFICANCE_LEVEL, f"±{curve['band']:.2g} {curve['unit']}"
    differs = pair["p"] < level
    if pair["printed"] == "similar":
        if differs:
            return "not reproduced", ""
        if -curve["band"] < pair["ci_low"] and pair["ci_high"] < curve["band"]:
            return "reproduced", f"inside {band}: alike"
        return "not shown", f"no rejection here either; the interval leaves {band}"
    if differs or curve["rows_find"] is None:
        return "reproduced" if differs else "not reproduced", ""
    uncorrected = {"pooled": pair["p_alone"], "paired": pair["p_paired"]}
    alone = [f"{name} p {p_text(p)}" for name, p in uncorrected.items() if p < level]
    if alone:
        return (
            "not reproduced",
            "comes out with replicates as people, and with people where p is not corrected for 15 "
            f"pairs ({', '.join(alone)}); 4.2.4 says that it is",
        )
    return (
        "only with replicates as people",
        "consistent with replicates taken as people; not proof of it",
    )


def p_text(p: float) -> str:
    """Return a p-value with its sign of equality."""
    return f"= {p:.3g}"


# --- the pilot's people --------------------------------------------------------------------------


def pilot_people() -> ComparedTable:
    """Return the pilot's printed numbers beside S2 and S3 of tables 4.1 to 4.4 (3.3.4)."""
    rows = []
    places = [chapter4.SUBJECTS.index(subject) for subject in PILOT]
    for parameter, printed in printed_numbers.PILOT_RANGES.items():
        name, unit = _TABLES[parameter]
        means = published_cells(parameter)[places].mean(axis=0)
        rows += _range_rows(f"{name}, {{}} of the six means", unit, printed, means)
    vaf = {subject: column_mean(chapter4.VAF, subject) for subject in PILOT}
    for number, (subject, mean) in zip(("1", "2"), vaf.items(), strict=True):
        quantity, note = f"VAF, participant {number}", f"{subject} of table 4.4"
        rows.append(
            compare(quantity, "%", printed_numbers.PILOT_VAF[number], recommended=mean, note=note)
        )
    both = float(np.mean(list(vaf.values())))
    rows.append(
        compare("VAF, both", "%", printed_numbers.PILOT_VAF["mean"], recommended=both, note="")
    )
    return compared_table(4, "pilot_people", rows)
