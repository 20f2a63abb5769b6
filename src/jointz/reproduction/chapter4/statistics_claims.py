"""Chapter IV again: every statistic of 4.3 from the published tables, printed beside ours."""

from collections.abc import Mapping
from statistics import fmean, stdev
from typing import Any, Final

import numpy as np
from scipy.special import stdtrit

from jointz.reference import Printed, chapter3, chapter4
from jointz.reference.audit_chapter4 import column_mean
from jointz.reproduction.chapter4.comparisons import quasi_stiffness_table, spm_table
from jointz.reproduction.chapter4.pairs import fitted_models, p_text, pairs_table
from jointz.reproduction.chapter4.replicates import replicates_as_people, replicates_published
from jointz.reproduction.chapter4.rows import N_ROWS, PARAMETERS, largest_scatter, published_cells
from jointz.reproduction.reproduction_tables import (
    Claim,
    ClaimTable,
    Compared,
    ComparedTable,
    Table,
    Verdict,
)
from jointz.results.statistics.mixed_model_fit import MixedModelFit

#: Tables 4.1 to 4.4 -> (name in sentences, unit).
_TABLES: Final[Mapping[str, tuple[str, str]]] = {**PARAMETERS, "vaf": ("VAF", "%")}
#: Who of table 4.1 to 4.4 took part in the pilot; see the audit.
_PILOT: Final = ("S2", "S3")


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
    )
    return tables, {"pairs": of_pairs, "replicates": of_replicates}


# --- averages ------------------------------------------------------------------------------------


def averages() -> ComparedTable:
    """Return the means over people of tables 4.1 to 4.4 beside the printed ones (4.3.2.1)."""
    rows = []
    for parameter, (name, unit) in _TABLES.items():
        for point, cells in chapter4.TABLES[parameter].items():
            printed = chapter4.MEANS[parameter][point]
            mean, half = _mean_and_half(cells)
            rows.append(
                Compared(
                    quantity=f"{name}, {point}",
                    unit=unit,
                    printed=printed.value,
                    recommended=mean,
                    recommended_low=mean - half,
                    recommended_high=mean + half,
                    note=_repairs(cells),
                )
            )
        rows += _ranges(parameter, name, unit)
    return ComparedTable(
        "averages",
        "Averages over people (tables 4.1 to 4.4, 4.3.2.1)",
        "Recommended: the mean of ten people with its interval from Student's t over people; the "
        "dissertation prints no spread of people. Entries at the bound of 0 are averaged as they "
        "are printed. The printed SD of the VAF is that of six timing-point means.",
        (*rows, _vaf_mean()),
    )


def _mean_and_half(cells: Mapping[str, Printed]) -> tuple[float, float]:
    values = [cell.value for cell in cells.values()]
    t = float(stdtrit(len(values) - 1, 0.975))
    return fmean(values), t * stdev(values) / len(values) ** 0.5


def _repairs(cells: Mapping[str, Printed]) -> str:
    repaired = [subject for subject, cell in cells.items() if cell.note.startswith("repaired")]
    return f"a digit of {', '.join(repaired)} is repaired" if repaired else ""


def _ranges(parameter: str, name: str, unit: str) -> list[Compared]:
    if parameter not in chapter4.RANGES:
        return []
    means = published_cells(parameter).mean(axis=0)
    return [
        Compared(
            quantity=f"{name}, {word} of the six",
            unit=unit,
            printed=printed.value,
            recommended=float(mean),
            note=printed.note,
        )
        for word, printed, mean in zip(
            ("largest", "smallest"),
            chapter4.RANGES[parameter],
            (means.max(), means.min()),
            strict=True,
        )
    ]


def _vaf_mean() -> Compared:
    cells = published_cells("vaf")
    people = cells.mean(axis=1)
    half = float(stdtrit(people.size - 1, 0.975)) * people.std(ddof=1) / people.size**0.5
    return Compared(
        quantity="VAF, all subjects and timing points",
        unit="%",
        printed=chapter4.VAF_MEAN.value,
        printed_sd=chapter4.VAF_MEAN.sd,
        dissertation=float(cells.mean()),
        dissertation_sd=float(cells.mean(axis=0).std(ddof=1)),
        recommended=float(cells.mean()),
        recommended_low=float(cells.mean() - half),
        recommended_high=float(cells.mean() + half),
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
        of_point, of_subject = largest_scatter(parameter)
        rows += [
            _point_claim(parameter, fit, satterthwaite[parameter], of_point),
            _subject_claim(parameter, fit, of_subject),
        ]
    return ClaimTable(
        "factors",
        "Timing point and subject (4.3.2.2)",
        "The mixed model (4.3) with one value a person and timing point, 60 rows: F test with "
        "Kenward-Roger degrees of freedom, which is the repeated-measures ANOVA here; "
        "Greenhouse-Geisser where differences do not all vary alike. Replicates as people: "
        f"{N_ROWS} rows a cell, all as independent; how far rows scatter inside their cell is not "
        "printed.",
        tuple(rows),
    )


def _point_claim(
    parameter: str, fit: MixedModelFit, satterthwaite: MixedModelFit, scatter: float | None
) -> Claim:
    f, other, exact = fit.f_test, satterthwaite.f_test, fit.repeated_measures
    if exact is None:
        raise ValueError(f"factors: expected a complete table of {parameter}")
    name = PARAMETERS[parameter][0]
    return _factor(
        (parameter, "timing_point"),
        claim=f"timing point, {name}",
        p=f.p,
        scatter=scatter,
        ours=f"F({f.df_num:g}, {f.df_den:.4g}) = {f.F:.3f}, p {p_text(f.p)} (Satterthwaite "
        f"{other.p:.3g}); Greenhouse-Geisser epsilon {exact.epsilon:.2f}, "
        f"p {p_text(exact.p_epsilon)}",
        p_careful=exact.p_epsilon,
    )


def _subject_claim(parameter: str, fit: MixedModelFit, scatter: float | None) -> Claim:
    test = fit.random_effects[0]
    if test.p is None or test.F is None:
        raise ValueError(f"factors: expected a complete table of {parameter}")
    return _factor(
        (parameter, "participant"),
        claim=f"subject, {PARAMETERS[parameter][0]}",
        p=test.p,
        scatter=scatter,
        ours=f"exact F({test.df_num:g}, {test.df_den:g}) = {test.F:.3f}, p {p_text(test.p)}; "
        f"likelihood ratio {test.likelihood_ratio:.2f}, p {p_text(test.p_mixture)} (mixture), "
        f"{test.p_chi2:.3g} (chi-squared); ICC {fit.icc.value:.2f}",
    )


def _factor(
    key: tuple[str, str],
    *,
    claim: str,
    p: float,
    scatter: float | None,
    ours: str,
    p_careful: float | None = None,
) -> Claim:
    limit = chapter4.FACTOR_P_BELOW[key].value
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


# --- the pilot's people --------------------------------------------------------------------------


def pilot_people() -> ComparedTable:
    """Return the pilot's printed numbers beside S2 and S3 of tables 4.1 to 4.4 (3.3.4)."""
    rows = []
    for parameter, printed in chapter3.PILOT_RANGES.items():
        name, unit = PARAMETERS[parameter]
        places = [chapter4.SUBJECTS.index(subject) for subject in _PILOT]
        means = published_cells(parameter)[places].mean(axis=0)
        rows += [
            Compared(
                quantity=f"{name}, {word} of the six means",
                unit=unit,
                printed=number.value,
                recommended=float(mean),
            )
            for word, number, mean in zip(
                ("largest", "smallest"), printed, (means.max(), means.min()), strict=True
            )
        ]
    vaf = {subject: column_mean(chapter4.VAF, subject) for subject in _PILOT}
    named = zip(("1", "2", "mean"), (*_PILOT, None), strict=True)
    rows += [
        Compared(
            quantity=f"VAF, participant {number}" if subject else "VAF, both",
            unit="%",
            printed=chapter3.PILOT_VAF[number].value,
            recommended=float(np.mean(list(vaf.values()))) if subject is None else vaf[subject],
            note=f"{subject} of table 4.4" if subject else "",
        )
        for number, subject in named
    ]
    return ComparedTable(
        "pilot_people",
        "The pilot's two people (3.3.4)",
        "Recommended: means of S2 and S3 of tables 4.1 to 4.4. That the pilot's numbers are "
        "theirs says that its two people are two of the ten, which the text does not: chapters III "
        "and IV are not independent.",
        tuple(rows),
    )
