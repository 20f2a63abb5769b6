"""Checks of responses before anything is fitted to them."""

from collections import Counter
from collections.abc import Mapping

import numpy as np
from scipy.stats import chi2

from jointz.core.codes import Failure

#: Probability with which walking alone makes as large a response.
_NO_RESPONSE = 1e-3
#: The response of a stiff joint (N*m/rad) must exceed so many sds of walking.
_CLEAR, _STIFF = 4.0, 300.0


def smallest_response(n_samples: int) -> float:
    """Return the weighted sum of squares below which a response may be walking alone."""
    return float(chi2.ppf(1.0 - _NO_RESPONSE, n_samples))


def shows_stiff_joint(noise: np.ndarray, torque: np.ndarray) -> bool:
    """Return whether walking, of this covariance, does not hide the response of a stiff joint."""
    error = _CLEAR * float(np.sqrt(np.diag(noise).max()))
    return error < float(np.abs(torque).max()) / _STIFF


def common_failure(failures: Mapping[str, Failure | None]) -> dict[str, Failure | None]:
    """Return failures with the most frequent one for all, if half of the timing points fail.

    All share sensors and actuator, so that the others are no more reliable. If most do not move
    in response, a wrong sign is due to chance.
    """
    counts = Counter(failure for failure in failures.values() if failure is not None)
    if 2 * counts.total() < len(failures):
        return dict(failures)
    usual = counts.most_common(1)[0][0]
    by_chance = Failure.OPPOSITE_SIGN if usual is Failure.CONSTANT_ANGLE else None
    return {
        label: usual if failure in (None, by_chance) else failure
        for label, failure in failures.items()
    }
