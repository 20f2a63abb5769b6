"""The unperturbed path of a joint in a calibration: still, or a hinge swung by hand."""

from math import cos, exp, log, pi, radians

import numpy as np

from jointz.sim.gait_motion import Stride, make_stride
from jointz.sim.layout import HARMONICS

# By hand: from slow to fast and back, never twice the same.
_SLOWEST_HZ, _FASTEST_HZ = 0.5, 3.0
_SWEEP_S = 20.0
_FREQUENCY_SD, _SIZE_SD = 0.06, 0.1  # of log frequency; of the amplitude, share
_HALF_SWING_RAD = radians(20.0)
_SHAPE_SD = 0.04  # of the second harmonic, share of the amplitude
_LARGEST_DEVIATION = 2.5  # sd
_STILL_S = 1.0


class StillMotion:
    """A path that does not move."""

    def __init__(self, angle_rad: float) -> None:
        self._curve = np.zeros((2, HARMONICS))
        self._curve[0, 0] = angle_rad
        self._start_s = 0.0

    def next(self) -> Stride:
        """Return the next second of it."""
        durations = (_STILL_S, _STILL_S, _STILL_S)
        stride = make_stride(self._start_s, durations, (self._curve, self._curve))
        self._start_s += _STILL_S
        return stride


class HandSwing:
    """A hinge swung by hand about an angle: 0.5 to 3 Hz, about 40 degrees from end to end."""

    def __init__(self, centre_rad: float, rng: np.random.Generator) -> None:
        self._centre_rad, self._rng = centre_rad, rng
        self._start_s = 0.0
        self._durations = (1.0 / _SLOWEST_HZ, 1.0 / _SLOWEST_HZ, 1.0 / _SLOWEST_HZ)
        self._curve = self._new_curve()

    def next(self) -> Stride:
        """Return the next swing, there and back."""
        curve, following = self._curve, self._new_curve()
        stride = make_stride(self._start_s, self._durations, (curve, following))
        self._start_s = stride.end_s
        _, previous_s, duration_s = self._durations
        self._durations = previous_s, duration_s, self._duration_at(stride.end_s + duration_s)
        self._curve = following
        return stride

    def _duration_at(self, time_s: float) -> float:
        """Return how long a swing that begins then lasts, s."""
        middle, half = log(_SLOWEST_HZ * _FASTEST_HZ) / 2.0, log(_FASTEST_HZ / _SLOWEST_HZ) / 2.0
        slowly = middle - half * cos(2.0 * pi * time_s / _SWEEP_S)
        return exp(-slowly - _FREQUENCY_SD * self._drawn())

    def _new_curve(self) -> np.ndarray:
        """Return Fourier coefficients, (2, HARMONICS): cosines and sines, rad."""
        size = _HALF_SWING_RAD * (1.0 + _SIZE_SD * self._drawn())
        curve = np.zeros((2, HARMONICS))
        curve[0, 0], curve[0, 1] = self._centre_rad, -size
        curve[:, 2] = _SHAPE_SD * size * np.array([self._drawn(), self._drawn()])
        return curve

    def _drawn(self) -> float:
        normal = float(self._rng.standard_normal())
        return min(max(normal, -_LARGEST_DEVIATION), _LARGEST_DEVIATION)
