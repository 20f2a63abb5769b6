"""Chapter IV again: gait with and without exoskeleton, stiffness and quasi-stiffness.

Neither gait curves nor quasi-stiffness are printed (4.3.1, 4.3.2.3): what the printed numbers imply
is solved for, and what cannot be checked is said.
"""

from typing import Final

import numpy as np
from scipy.optimize import brentq
from scipy.special import stdtr, stdtrit

from jointz.kernels.statistics.random_field import SearchRegion, critical_height
from jointz.kernels.statistics.repeated_measures import paired_t_test
from jointz.reference import chapter4, row_mean
from jointz.reproduction.reproduction_tables import Claim, ClaimTable
from jointz.stats import compare_quasi_stiffness

#: Nodes of a gait cycle, 0 to 100 %.
_NODES: Final = 101
#: Half of the last printed digit of the threshold.
_ROUNDING: Final = 0.0005


def spm_threshold(fwhm_nodes: float, *, df: float = 9.0, n_nodes: int = _NODES) -> float:
    """Return the threshold of a two-tailed t over a curve, by random field theory, at 0.05."""
    region = SearchRegion(fwhm_nodes, (n_nodes - 1) / fwhm_nodes, n_nodes)
    return critical_height(chapter4.SIGNIFICANCE_LEVEL / 2.0, df=df, region=region)


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
    printed = chapter4.SPM_THRESHOLD.value
    people = int(chapter4.N_PARTICIPANTS.value)
    width = implied_fwhm(printed)
    narrow, wide = implied_fwhm(printed + _ROUNDING), implied_fwhm(printed - _ROUNDING)
    nodewise = float(-stdtrit(people - 1, chapter4.SIGNIFICANCE_LEVEL / 2.0 / _NODES))
    rows = (
        Claim(
            "4.3.1, figure 4.3",
            "threshold of the paired two-tailed t, alpha 0.05",
            f"t = ±{printed:g}",
            f"±{spm_threshold(width):.3f} at df {people - 1}, {_NODES} nodes and a width (FWHM) "
            f"of {width:.3f} nodes ({(_NODES - 1) / width:.2f} resels)",
            "worth knowing",
            "the width is solved from the threshold, so that this is no test of it; rounding "
            f"allows {narrow:.2f} to {wide:.2f} nodes. Separate nodes (Bonferroni) would give "
            f"{nodewise:.3f}",
        ),
        Claim(
            "4.3.1, figure 4.3",
            "gait with and without exoskeleton (ENP, NWC)",
            "t nowhere beyond the threshold: not different",
            "",
            "not tested",
            "the curves are not printed",
        ),
        Claim(
            "4.3.1",
            "'gait was not affected by donning the exoskeleton'",
            "the null hypothesis is accepted",
            f"a mean difference of up to {printed / people**0.5:.2f} SD of a person's difference "
            "would not have been found",
            "not shown",
            f"no rejection is no equality: the interval reaches {printed:g} / sqrt({people}) = "
            f"{printed / people**0.5:.2f} SD to both sides of the mean that was seen; what "
            "difference does not matter is not printed",
        ),
    )
    return ClaimTable(
        "spm",
        "Gait with and without the exoskeleton (4.3.1)",
        "What the printed threshold of statistical parametric mapping implies, by the theory that "
        "spm1d uses.",
        rows,
    )


def quasi_stiffness_table() -> ClaimTable:
    """Return what is printed of quasi-stiffness (4.3.2.3) beside ours."""
    stiffness = {point: row_mean(row) for point, row in chapter4.STIFFNESS.items()}
    implied = chapter4.implied_quasi_stiffness()
    found = compare_quasi_stiffness(implied, stiffness)
    printed = chapter4.QUASI_STIFFNESS_P.value
    n, unit = found.n, found.unit
    pooled = 2.0 * float(stdtr(2 * n - 2, -abs(found.statistic)))
    paired = paired_t_test(
        np.array([implied[point] for point in stiffness]), np.array(list(stiffness.values()))
    )
    apart = [d.value for d in chapter4.QUASI_STIFFNESS_DIFFERENCES.values()]
    mean = sum(stiffness.values()) / n
    rows = (
        Claim(
            "4.3.2.3",
            "quasi-stiffness Q at the six timing points",
            ", ".join(f"{d:g}" for d in apart) + " % from stiffness",
            ", ".join(f"{value:.3f}" for value in implied.values()) + f" {unit}",
            "worth knowing",
            "Q is not printed; implied by 100 (Q - K) / K with K the means of table 4.1",
        ),
        Claim(
            "4.3.2.3",
            "unpaired t-test of Q against K",
            f"p = {printed:g}",
            f"p = {found.p:.4f}: t = {found.statistic:.3f}, df {found.df:.2f}, n = {n} and {n}",
            "reproduced" if abs(found.p - printed) < 5e-5 else "not reproduced",
            f"by Welch's test; with equal variances p = {pooled:.4f}. The {n} rows of each kind "
            "are timing points of one joint, not people, and belong together in pairs: paired "
            f"p = {paired.p:.3f}. What varies between timing points counts as error",
        ),
        Claim(
            "4.3.2.3",
            "'further statistical analysis showed the results to be similar'",
            "similar",
            f"Q - K = {found.difference:.2f} [{found.ci_low:.2f}, {found.ci_high:.2f}] {unit} "
            f"beside a mean K of {mean:.2f}",
            "not shown",
            "a test that did not reject; its interval holds differences as large as K itself",
        ),
        Claim(
            "4.3.2.3, 4.4",
            "Q beside K",
            "'closely match ... for most of the gait cycle'",
            f"{min(apart):.0f} to {max(apart):.0f} % apart; {sum(abs(d) <= 20 for d in apart)} of "
            f"{n} within 20 %, {sum(q < 0 for q in implied.values())} of the other sign",
            "contradiction",
            "",
        ),
    )
    return ClaimTable(
        "quasi_stiffness",
        "Stiffness and quasi-stiffness (4.3.2.3)",
        "From the printed percentages and table 4.1; Winter's data, from which the dissertation "
        "takes quasi-stiffness, are not part of this package.",
        rows,
    )
