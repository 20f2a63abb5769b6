"""Expected errors of means and differences over people, from a typical person's likelihood."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from jointz.kernels.statistics.people_model import (
    RESPONSE_SD,
    PeopleData,
    PeopleVariances,
    people_evidence,
)
from jointz.stats.people_likelihoods import PARAMETERS
from jointz.stats.people_together import LEVEL_SD, POINT_SD, SHARED


@dataclass(frozen=True, slots=True, eq=False)
class ExpectedPeople:
    """SDs of logarithms over people with the same likelihood, element by element.

    The SD between people is the root mean square of its prior in the model of people: few people
    hold little information about it.
    """

    parameters: np.ndarray  # (d,) number of the parameter of each element: K, B, J
    places: np.ndarray  # (d,) number of its timing point
    precision: np.ndarray  # (d, d) of a person's likelihood
    own_sd: np.ndarray  # (d,) of a person's own estimates
    gain_sd: float  # of the gains, the same for everybody

    def mean_sd(self, n_people: int) -> np.ndarray:
        """Return the SDs of means over people, with the errors that do not average out."""
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
        n = len(PARAMETERS)
        data = PeopleData(
            precision=block_diag(*[self.precision] * conditions)[None],
            weighted=np.zeros((1, conditions * self.parameters.size)),
            kinds=np.tile(self.parameters, conditions),
            places=np.tile(self.places, conditions),
            level_sd=np.array([LEVEL_SD[name] for name in PARAMETERS]),
            place_sd=np.array([POINT_SD[name] for name in PARAMETERS]),
            conditions=np.repeat(np.arange(conditions), self.parameters.size),
        )
        variances = PeopleVariances(
            level_sd=data.level_sd,
            place_sd=data.place_sd,
            correlation=np.eye(n),
            response=np.full(n, RESPONSE_SD),
        )
        return people_evidence(data, variances).covariance
