"""Trends over the gait cycle and fits that the text states, from the published tables."""

from typing import Final

import numpy as np
from scipy.stats import binomtest, spearmanr

from jointz.reference import chapter4
from reproduction import printed_numbers
from reproduction.chapter4.replicates import published_cells
from reproduction.reproduction_tables import Claim, ClaimTable, Verdict, claim_table

#: Who of tables 4.1 to 4.4 took part in the pilot; see the audit.
PILOT: Final = ("S2", "S3")
_SHOWN: Final[tuple[Verdict, Verdict]] = ("not shown", "reproduced")


def stated_trends() -> ClaimTable:
    """Return the trends of 3.4 and 4.4, and what is said of the VAF of others."""
    people = np.array([published_cells(name) for name in printed_numbers.PARAMETER_NAMES])
    rows = (*_antagonism(people[:2]), *_fit(people[1], published_cells("vaf")))
    return claim_table(4, "trends", rows, people=" and ".join(PILOT))


def _antagonism(people: np.ndarray) -> tuple[Claim, Claim]:
    pilot = people[:, [chapter4.SUBJECTS.index(subject) for subject in PILOT], :3]
    k, b = (", ".join(f"{value:.3g}" for value in row) for row in pilot.mean(axis=1))
    means, each = (np.diff(cells).prod(axis=0) < 0 for cells in (pilot.mean(axis=1), pilot))
    verdict = _SHOWN[int(each.all())] if means.all() else "not reproduced"
    ours = f"K {k}; B {b}: steps of means opposite in {means.sum()} of {means.size}, of people in "
    remark = f"{(pilot[1] < chapter4.NUMERICALLY_ZERO).sum()} of these B is at its bound of 0"
    late = people[:, :, 1:4]
    inverse = [np.corrcoef(late[:, k])[0, 1] < 0 for k in range(late.shape[1])]
    n, of, p = sum(inverse), len(inverse), binomtest(sum(inverse), len(inverse)).pvalue
    who, what = f"inverse in {n} of {of} people (p = {p:.2f})", "stiffness and damping"
    stance = "antagonistic at LRE, MST, TST, as at the ankle"
    alike = "the inverse relation at the ankle is not mirrored"
    ours += f"{each.sum()} of {each.size}"
    return (
        Claim("3.4", f"{what} of the pilot in stance", stance, ours, verdict, remark),
        Claim("4.4", f"{what}, mid to late stance", alike, who, _SHOWN[int(2 * n <= of)]),
    )


def _fit(damping: np.ndarray, vaf: np.ndarray) -> tuple[Claim, ...]:
    other, limit = printed_numbers.OTHER_VAF.value, printed_numbers.SECOND_ORDER_VAF.value
    low, own = vaf <= other, f"{vaf.mean():.2f} % in table 4.4"
    printed = f"about {other:g} %, ours about {printed_numbers.VAF_MEAN_ROUNDED.value:g} %"
    ours = f"ours {own}; {low.sum()} of {vaf.size} fits at or below {other:g} %"
    rank, p = spearmanr(vaf.ravel(), damping.ravel())
    explains = _SHOWN[int(rank > 0 and p < printed_numbers.SIGNIFICANCE_LEVEL)]
    found = f"rank correlation of VAF and damping {rank:.2f} (p = {p:.2f}) over {vaf.size} fits"
    second: Verdict = "reproduced" if vaf.mean() > limit else "not reproduced"
    above = f"{(vaf > limit).sum()} of {vaf.size} fits above"
    earlier = f"above {limit:g} % in earlier work"
    why, missing = "differences in fit can explain it", "their data are not in this package"
    where, low_b = "3.4, 4.4", "lower damping of studies with a lower VAF"
    return (
        Claim(where, "average VAF of Tucker's study", printed, ours, "not tested", missing),
        Claim(where, low_b, why, found, explains),
        Claim("3.4.1, 4.4.1", "VAF of second-order models", earlier, f"{above}; {own}", second),
    )
