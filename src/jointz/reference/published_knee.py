"""Published figures of walking: mean knee angle and moment, and the dissertation's impedance."""

from collections.abc import Mapping
from typing import Final

import numpy as np
from scipy.interpolate import PchipInterpolator

#: Landmarks of the mean curves of able-bodied people at their natural cadence: maxima, minima and
#: crossings (Winter 1991, The biomechanics and motor control of human gait), % of the gait cycle
#: -> knee flexion, degrees, and internal flexion moment, N*m/kg.
_ANGLE_DEG: Final[Mapping[float, float]] = {
    0.0: 4.0, 14.0: 21.7, 40.0: 7.7, 60.0: 38.7, 72.0: 64.9, 82.0: 47.6, 90.0: 17.3, 97.0: 0.8,
}  # fmt: skip
_MOMENT_NM_KG: Final[Mapping[float, float]] = {
    2.0: 0.28, 14.0: -0.62, 27.5: 0.0, 43.0: 0.27, 52.0: 0.0, 59.0: -0.16, 76.5: 0.0, 95.5: 0.26,
}  # fmt: skip
#: Between people: round figures of that order, since the sources print several.
ANGLE_SD_RAD: Final = 0.09
MOMENT_SD_NM_KG: Final = 0.2
STRIDE_S: Final = 1.14
SOURCE: Final = (
    "published: Winter 1991, knee at natural cadence, through eight landmarks; SD between people "
    "{sd} (assumed)"
)


def _through(landmarks: Mapping[float, float], gait_pct: np.ndarray) -> np.ndarray:
    at, values = np.array(list(landmarks)), np.array(list(landmarks.values()))
    around = np.concatenate([at - 100.0, at, at + 100.0])
    return np.asarray(PchipInterpolator(around, np.tile(values, 3))(gait_pct))


def published_angle(gait_pct: np.ndarray) -> np.ndarray:
    """Return the published mean knee flexion, rad."""
    return np.asarray(np.radians(_through(_ANGLE_DEG, gait_pct)))


def published_moment(gait_pct: np.ndarray) -> np.ndarray:
    """Return the published mean internal flexion moment of the knee, N*m/kg."""
    return _through(_MOMENT_NM_KG, gait_pct)
