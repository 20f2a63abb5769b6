"""The audit of chapter IV; see :mod:`jointz.reference.audit`.

What needs a test statistic stands here as a number, since this floor computes none; the tests
recompute it from the tables.
"""

from collections.abc import Iterable, Mapping
from itertools import combinations
from statistics import fmean, stdev
from types import MappingProxyType
from typing import Final

from jointz.reference import Finding, Printed, chapter3, chapter4, row_mean

#: p of F(5, 45), one value a participant and timing point.
POINT_P: Final[Mapping[str, float]] = MappingProxyType(
    {"stiffness_per_mass": 8.08391e-5, "damping_per_mass": 0.0997869, "inertia": 0.384703}
)
#: p of F(9, 45), from the same table.
PARTICIPANT_P: Final[Mapping[str, float]] = MappingProxyType(
    {"stiffness_per_mass": 0.0198999, "damping_per_mass": 0.0128900, "inertia": 0.0326164}
)
#: Pairs of timing points with p < 0.05, pooled error and Bonferroni over the 15 pairs.
BONFERRONI_PAIRS: Final[Mapping[str, Mapping[tuple[str, str], float]]] = MappingProxyType(
    {
        "stiffness_per_mass": MappingProxyType(
            {
                ("LRE", "MST"): 0.00247592,
                ("LRE", "ISW"): 0.000173207,
                ("LRE", "MSW"): 0.000312595,
            }
        ),
        "damping_per_mass": MappingProxyType({}),
        "inertia": MappingProxyType({}),
    }
)


def column_mean(table: Mapping[str, Mapping[str, Printed]], subject: str) -> float:
    """Return the mean of one person's numbers over the timing points of a printed table."""
    return fmean(row[subject].value for row in table.values())


def chapter4_findings() -> tuple[Finding, ...]:
    """Return what is inconsistent in chapter IV, in the order of the text."""
    return (*_tables(), *_averages(), *_statistics(), *_quasi_stiffness())


# --- tables --------------------------------------------------------------------------


def _tables() -> Iterable[Finding]:
    terminal = chapter4.INERTIA["TST"]
    mean = row_mean(terminal)
    as_printed = mean + (0.14 - terminal["S4"].value) / len(terminal)
    yield Finding(
        "Table 4.3",
        "inertia of S4 at TST",
        f"0.14 kg*m^2 in a row of mean {chapter4.INERTIA_MEANS['TST'].value:g}",
        f"mean {as_printed:.3f} with 0.14, {mean:.3f} with 0.014",
        "contradiction",
        "0.014 is used here; 0.14 of S4 at MST fits the mean of its row and stands",
    )
    yield _at_the_bound()
    yield _repeated_vaf()
    pilot = ", ".join(f"{column_mean(chapter4.VAF, s):.2f}" for s in ("S2", "S3"))
    yield Finding(
        "3.3.4, Table 4.4",
        "the two people of the pilot",
        f"mean VAF {chapter3.PILOT_VAF['1'].value:g} and {chapter3.PILOT_VAF['2'].value:g} %",
        f"S2 and S3 of table 4.4: {pilot} %",
        "worth knowing",
        "the pilot's people are two of the ten, which the text does not say: chapters III and IV "
        "are not independent",
    )


def _cells_below(low: float, high: float) -> set[tuple[str, str]]:
    tables = (chapter4.STIFFNESS, chapter4.DAMPING, chapter4.INERTIA)
    return {
        (point, subject)
        for table in tables
        for point, row in table.items()
        for subject, cell in row.items()
        if low <= cell.value < high
    }


def _at_the_bound() -> Finding:
    zero = _cells_below(0.0, chapter4.NUMERICALLY_ZERO)
    nearly = _cells_below(chapter4.NUMERICALLY_ZERO, chapter4.NEARLY_ZERO)
    cells = len(chapter4.STIFFNESS) * len(chapter4.SUBJECTS)
    return Finding(
        "Tables 4.1 to 4.3",
        "estimates at the bound",
        "numbers such as 2.12e-14, without a word",
        f"{len(zero)} of {cells} fits have one, {len(nearly)} more nearly",
        "worth knowing",
        "the bounded regression ended at K, B or J = 0: not estimates of 0, and averaged as if",
    )


def _repeated_vaf() -> Finding:
    of_s7 = {point: row["S7"].value for point, row in chapter4.VAF.items()}
    pairs = [(a, b) for a, b in combinations(of_s7, 2) if of_s7[a] == of_s7[b]]
    found = "; ".join(f"{of_s7[a]:g} % at {a} and {b}" for a, b in pairs)
    shared = [
        f"{row['S7'].value:g} % at {point} as S9"
        for point, row in chapter4.VAF.items()
        if row["S7"].value == row["S9"].value
    ]
    return Finding(
        "Table 4.4",
        "VAFs of S7",
        "six values",
        "; ".join([found, *shared]),
        "worth knowing",
        "alike to four digits: some may be copies",
    )


# --- text ----------------------------------------------------------------------------


def _averages() -> Iterable[Finding]:
    damping = {point: cell.value for point, cell in chapter4.DAMPING_MEANS.items()}
    lowest = min(damping, key=damping.__getitem__)
    yield Finding(
        "4.3.2.1, Table 4.2",
        "lowest mean damping",
        f"{chapter4.RANGES['damping_per_mass'][1].value:.3f} N*m*s/rad/kg",
        f"{damping[lowest]:.3f} N*m*s/rad/kg, at {lowest}",
        "contradiction",
        "",
    )
    stance = ("LRE", "MST", "TST", "PSW")
    yield Finding(
        "4.3.2.1, Table 4.2",
        "damping in stance",
        "'linearly increasing'",
        " ".join(f"{damping[point]:.3f}" for point in stance) + f" at {', '.join(stance)}",
        "contradiction",
        "it falls again in pre-swing, and rises by 0.003 and 0.011 over steps of 14.5 and 19 % of "
        "the cycle before",
    )
    means = [row_mean(row) for row in chapter4.VAF.values()]
    entries = [cell.value for row in chapter4.VAF.values() for cell in row.values()]
    yield Finding(
        "4.3.2.1, Table 4.4",
        "SD of the VAF 'across all subjects and timing points'",
        f"{chapter4.VAF_MEAN.sd:g} %",
        f"{stdev(means):.2f} % over the six timing-point means, {stdev(entries):.2f} % over all "
        f"{len(entries)}",
        "ambiguous",
        "the printed SD says nothing of people",
    )


def _statistics() -> Iterable[Finding]:
    remark = "consistent with replicates taken as people; no proof of it"
    factors = (("timing_point", "timing point", POINT_P), ("participant", "subject", PARTICIPANT_P))
    for parameter, name in chapter4.PARAMETER_NAMES.items():
        for factor, word, p_values in factors:
            limit, p = chapter4.FACTOR_P_BELOW[parameter, factor].value, p_values[parameter]
            if p >= limit:
                yield Finding(
                    "4.3.2.2",
                    f"effect of {word} on {name}",
                    f"p < {limit:g}",
                    f"p = {p:.3f} from tables 4.1 to 4.3",
                    "not reproduced",
                    remark,
                )
    for parameter, name in chapter4.PARAMETER_NAMES.items():
        claims = [pair for pair, say in chapter4.PAIRS[parameter].items() if say == "different"]
        found = BONFERRONI_PAIRS[parameter]
        listed = ", ".join("-".join(pair) for pair in found) or "none"
        yield Finding(
            "4.3.2.2",
            f"timing points whose {name} differs",
            f"{len(claims)} of 15 pairs stated",
            f"{len(found)} of 15: {listed}",
            "not reproduced",
            remark + "; pairs called similar are not shown to be alike by a test that did not "
            "reject",
        )


def _quasi_stiffness() -> Iterable[Finding]:
    differences = chapter4.QUASI_STIFFNESS_DIFFERENCES
    yield Finding(
        "4.3.2.3, 4.4",
        "quasi-stiffness and stiffness",
        "'closely match ... for most of the gait cycle'",
        ", ".join(f"{d.value:.0f}" for d in differences.values()) + " % apart",
        "contradiction",
        "one of six is within 50 %, and two have the other sign; no rejection at 6 against 6 "
        "values is no match",
    )
    yield Finding(
        "4.3.2.3",
        "result of the unpaired test",
        "'not found to not be statistically different'",
        "",
        "ambiguous",
        "read as not found to be different (p = 0.3374)",
    )
    implied = chapter4.implied_quasi_stiffness()
    yield Finding(
        "4.2.4, 4.3.2.3",
        "quasi-stiffness 'from Winter's data'",
        "not printed",
        ", ".join(f"{value:.3f}" for value in implied.values()) + " N*m/rad/kg implied",
        "not reproduced",
        "no slope of moment over angle that was tried gives these; a secant has their signs",
    )
