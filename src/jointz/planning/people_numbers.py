"""Half-widths of means, and the smallest differences that are found, by number of people."""

import numpy as np

from jointz.identify.preparation.cell_data import PARAMETERS
from jointz.identify.walking.estimands import LogMoments
from jointz.kernels.statistics.power import smallest_effect
from jointz.planning.plan_result import PlannedPeople
from jointz.results.estimates import relative_half_width
from jointz.stats.expected_people import ExpectedPeople

#: Directions without information keep their matrix regular.
_LEAST_PRECISION = 1e-6


def expected_people(
    moments: LogMoments, decided: np.ndarray, gain_sd: float
) -> ExpectedPeople | None:
    """Return people who are all measured as a leg with these moments; None if nothing is decided.

    ``decided`` (parameter, point): others have no mean that an analysis would give.
    """
    kept = np.flatnonzero(decided.ravel())
    if not kept.size:
        return None
    square = np.ix_(kept, kept)
    shares = moments.shares[kept]
    relative = np.outer(shares, shares)
    inverse = np.linalg.inv(moments.covariance[square] / relative)
    prior_inverse = np.linalg.inv(moments.prior_covariance[square] / relative)
    values, vectors = np.linalg.eigh(inverse - prior_inverse)
    n_points = decided.shape[1]
    return ExpectedPeople(
        parameters=kept // n_points,
        places=kept % n_points,
        precision=(vectors * values.clip(_LEAST_PRECISION)) @ vectors.T,
        own_sd=np.sqrt(np.diag(moments.covariance)[kept]) / shares,
        gain_sd=gain_sd,
    )


def people_rows(expected: ExpectedPeople | None, n: int, power: float) -> list[PlannedPeople]:
    """Return what a number of people tells of K, B and J, of those that are decided."""
    if expected is None:
        return []
    mean, difference, own = expected.mean_sd(n), expected.difference_sd(), expected.person_sd()
    paired, groups = smallest_effect(n, power), smallest_effect(n, power, design="groups")
    rows = []
    for number in np.unique(expected.parameters):
        at = expected.parameters == number
        rows.append(
            PlannedPeople(
                participants=n,
                parameter=PARAMETERS[number],
                mean_pct=100.0 * relative_half_width(float(np.median(mean[at]))),
                paired_pct=100.0 * float(np.expm1(paired * np.median(difference[at]))),
                groups_pct=100.0 * float(np.expm1(groups * np.median(own[at]))),
                difference_half_width_pct=100.0
                * relative_half_width(float(np.median(difference[at])) / np.sqrt(n)),
            )
        )
    return rows
