"""What numbers of people tell: means, and the smallest differences that are found."""

import numpy as np

from jointz.identify.preparation.cell_data import PARAMETERS
from jointz.identify.strapped.estimands import ESTIMANDS, LogMoments
from jointz.kernels.statistics.power import smallest_effect
from jointz.planning.plan_result import PlannedPeople
from jointz.results.estimates import relative_half_width
from jointz.stats.expected_people import ExpectedPeople

#: Directions without information keep their matrix regular.
_LEAST_PRECISION = 1e-6


def expected_people(moments: LogMoments, gain_sd: float) -> ExpectedPeople:
    """Return people who are all measured as a leg with these moments."""
    n = len(PARAMETERS) * (moments.mean.size // len(ESTIMANDS))
    square = np.ix_(range(n), range(n))
    inverse = np.linalg.inv(moments.covariance[square])
    values, vectors = np.linalg.eigh(inverse - np.linalg.inv(moments.prior_covariance[square]))
    return ExpectedPeople(
        precision=(vectors * values.clip(_LEAST_PRECISION)) @ vectors.T,
        own_sd=np.sqrt(np.diag(moments.covariance)[:n]),
        gain_sd=gain_sd,
    )


def people_rows(expected: ExpectedPeople, n: int, power: float) -> list[PlannedPeople]:
    """Return what a number of people tells of K, B and J."""
    size = expected.own_sd.size // len(PARAMETERS)
    mean, difference, own = expected.mean_sd(n), expected.difference_sd(), expected.person_sd()
    paired = smallest_effect(n, power)
    groups = smallest_effect(n, power, design="groups")
    rows = []
    for i, parameter in enumerate(PARAMETERS):
        at = slice(i * size, (i + 1) * size)
        rows.append(
            PlannedPeople(
                participants=n,
                parameter=parameter,
                mean_pct=100.0 * relative_half_width(float(np.median(mean[at]))),
                paired_pct=100.0 * float(np.expm1(paired * np.median(difference[at]))),
                groups_pct=100.0 * float(np.expm1(groups * np.median(own[at]))),
                difference_half_width_pct=100.0
                * relative_half_width(float(np.median(difference[at])) / np.sqrt(n)),
            )
        )
    return rows
