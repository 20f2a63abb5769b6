"""Errors of means and differences over people that a typical person's likelihood lets expect."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from jointz.kernels.statistics.people_model import (
    RESPONSE_SD,
    PeopleData,
    PeopleVariances,
    people_evidence,
)
from jointz.stats.people_together import LEVEL_SD, POINT_SD, SHARED

#: Median of a half-normal prior over its scale.
_MEDIAN = 0.674
_PARAMETERS = ("stiffness", "damping", "inertia")


@dataclass(frozen=True, slots=True, eq=False)
class ExpectedPeople:
    """Sds of logarithms over people with the same likelihood, by parameter and timing point.

    People differ by the medians of the priors of the model of people.
    """

    precision: np.ndarray  # (d, d) of a person's likelihood: K of all points, then B, then J
    own_sd: np.ndarray  # (d,) of a person's own estimates
    gain_sd: float  # of the gains, the same for everybody

    def mean_sd(self, n_people: int) -> np.ndarray:
        """Return the sds of means over people, with what does not average out."""
        variance = np.diag(self._covariance(1)) / n_people
        return np.asarray(np.sqrt(variance + (SHARED * self.own_sd) ** 2 + self.gain_sd**2))

    def difference_sd(self) -> np.ndarray:
        """Return the sds of one person's difference between two conditions, response included."""
        d = self.own_sd.size
        covariance = self._covariance(2)
        first, second = covariance[:d, :d], covariance[d:, d:]
        return np.asarray(np.sqrt(np.diag(first + second - 2.0 * covariance[:d, d:])))

    def person_sd(self) -> np.ndarray:
        """Return the sds over people of one person's estimates, errors included."""
        return np.asarray(np.sqrt(np.diag(self._covariance(1))))

    def _covariance(self, conditions: int) -> np.ndarray:
        """Return the covariance of the means if one person is measured."""
        n_points = self.own_sd.size // len(_PARAMETERS)
        kinds = np.repeat(np.arange(len(_PARAMETERS)), n_points)
        places = np.tile(np.arange(n_points), len(_PARAMETERS))
        data = PeopleData(
            precision=block_diag(*[self.precision] * conditions)[None],
            weighted=np.zeros((1, conditions * kinds.size)),
            kinds=np.tile(kinds, conditions),
            places=np.tile(places, conditions),
            level_sd=np.array([LEVEL_SD[name] for name in _PARAMETERS]),
            place_sd=np.array([POINT_SD[name] for name in _PARAMETERS]),
            conditions=np.repeat(np.arange(conditions), kinds.size),
        )
        variances = PeopleVariances(
            level_sd=_MEDIAN * data.level_sd,
            place_sd=_MEDIAN * data.place_sd,
            correlation=np.eye(len(_PARAMETERS)),
            response=np.full(len(_PARAMETERS), _MEDIAN * RESPONSE_SD),
        )
        return people_evidence(data, variances).covariance
