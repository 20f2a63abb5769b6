"""The unperturbed knee of a walker, stride after stride without end.

The phase of a stride is a quintic polynomial of time whose rate at a heel
strike is the mean of the neighbouring strides' rates and whose second
derivative is zero there; the knee curve of a stride turns into that of the
next over the stride by a quintic smoothstep of phase. The angle is thus twice
continuously differentiable.
"""

from dataclasses import dataclass
from math import exp, pi, sqrt

import numpy as np

from jointz.core.gait_phases import REFERENCE_SPEED_M_S
from jointz.rig.sim.presets import GaitSettings
from jointz.rig.sim.walking.knee_joint import knee_angle
from jointz.rig.sim.walking.layout import GAIT_SIZE, HARMONICS, Gait

_LARGEST_DEVIATION = 3.0  # sd; of what changes from stride to stride
#: The first stride has gone so far when a recording begins: in swing, before a heel strike.
_BEGUN_CYCLES = 0.75
_SAMPLES = 16  # of a cycle: enough for its Fourier series
_KNEE_GROWTH_S_M = 0.15  # share of the knee curve per m/s


@dataclass(frozen=True, slots=True)
class ConditionShift:
    """Difference between the knee of one condition and the person's."""

    offset_rad: float = 0.0  # offset of the angle
    amplitude: float = 0.0  # relative change of the size of the curve
    phase_cycles: float = 0.0  # advance of the curve, cycles


def draw_shift(settings: GaitSettings, rng: np.random.Generator) -> ConditionShift:
    """Draw the shift of one condition; two conditions differ by the settings' sd."""
    offset, amplitude, phase = (rng.standard_normal(3) / sqrt(2.0)).tolist()
    return ConditionShift(
        settings.condition_offset_sd_rad * offset,
        settings.condition_amplitude_sd * amplitude,
        settings.condition_phase_sd * phase,
    )


@dataclass(frozen=True, slots=True)
class Stride:
    """One stride."""

    start_s: float  # heel strike, on the device's clock
    duration_s: float  # time to the next heel strike
    # polynomial of phase and Fourier coefficients, see :class:`jointz.rig.sim.walking.layout.Gait`
    row: np.ndarray

    @property
    def end_s(self) -> float:
        """The next heel strike, s."""
        return self.start_s + self.duration_s

    def cycles(self, time_s: np.ndarray) -> np.ndarray:
        """Return the phase since the heel strike, in cycles."""
        u = (time_s - self.start_s) / self.duration_s
        r = self.row
        higher = r[Gait.CUBIC] + u * (r[Gait.QUARTIC] + u * r[Gait.QUINTIC])
        return np.asarray(u * (r[Gait.LINEAR] + u * u * higher))


def knee_size_at(speed_m_s: float) -> float:
    """Return the size of the knee curve at a speed of walking over that at 1.2 m/s.

    That the knee bends more in faster walking is known (Fukuchi et al. 2019, Systematic Reviews
    8:153, doi 10.1186/s13643-019-1063-z); 15 % per m/s is a round number that keeps the peak
    of swing between 50 and 70 degrees. Misleads about single phases: in truth stance and swing
    do not grow by the same share.
    """
    return 1.0 + _KNEE_GROWTH_S_M * (speed_m_s - REFERENCE_SPEED_M_S)


def make_stride(
    start_s: float,
    durations_s: tuple[float, float, float],
    curves: tuple[np.ndarray, np.ndarray],
) -> Stride:
    """Return a stride that its neighbours join twice continuously differentiable."""
    previous_s, duration, following_s = durations_s
    row = np.zeros(GAIT_SIZE)
    first = 0.5 * (duration / previous_s + 1.0)
    last = 0.5 * (duration / following_s + 1.0)
    row[Gait.START_S], row[Gait.RATE_HZ] = start_s, 1.0 / duration
    row[Gait.LINEAR] = first
    row[Gait.CUBIC] = 10.0 - 6.0 * first - 4.0 * last
    row[Gait.QUARTIC] = -15.0 + 8.0 * first + 7.0 * last
    row[Gait.QUINTIC] = 6.0 - 3.0 * first - 3.0 * last
    curve, following = curves
    row[Gait.COSINES : Gait.COSINES + HARMONICS] = curve[0]
    row[Gait.SINES : Gait.SINES + HARMONICS] = curve[1]
    row[Gait.COSINE_CHANGES : Gait.COSINE_CHANGES + HARMONICS] = following[0] - curve[0]
    row[Gait.SINE_CHANGES : Gait.SINE_CHANGES + HARMONICS] = following[1] - curve[1]
    return Stride(start_s, duration, row)


class GaitMotion:
    """Generates strides in order."""

    def __init__(
        self,
        settings: GaitSettings,
        *,
        stride_time_s: float,
        knee_size: float = 1.0,
        shift: ConditionShift,
        rng: np.random.Generator,
        stumbles: dict[int, float] | None = None,
    ) -> None:
        self._settings = settings
        self._mean_s = stride_time_s
        self._shift = shift
        self._rng = rng
        self._stumbles = stumbles if stumbles is not None else {}
        self._mean = knee_size * _advanced(_mean_curve(), shift.phase_cycles)
        self._number = 0
        self._slow = rng.standard_normal(2)
        self._quick = rng.standard_normal(2)
        self._previous_s = self._duration()
        self._duration_s = self._duration()
        self._following_s = self._duration()
        self._start_s = -_BEGUN_CYCLES * self._duration_s
        self._curve = self._new_curve()

    def next(self) -> Stride:
        """Return the next stride."""
        duration = self._duration_s
        curve, following = self._curve, self._new_curve()
        durations = self._previous_s, duration, self._following_s
        stride = make_stride(self._start_s, durations, (curve, following))
        self._start_s += duration
        self._previous_s, self._duration_s = duration, self._following_s
        self._following_s = self._duration()
        self._curve = following
        return stride

    def _duration(self) -> float:
        settings = self._settings
        keep = exp(-1.0 / settings.drift_strides)
        self._slow = keep * self._slow + sqrt(1.0 - keep**2) * self._rng.standard_normal(2)
        quick = min(max(self._rng.standard_normal(), -_LARGEST_DEVIATION), _LARGEST_DEVIATION)
        factor = self._stumbles.get(self._number - 1, 1.0)  # one is drawn before the first stride
        self._number += 1
        change = settings.duration_sd * quick + settings.duration_drift_sd * float(self._slow[0])
        return self._mean_s * factor * (1.0 + change)

    def _new_curve(self) -> np.ndarray:
        """Return Fourier coefficients, (2, HARMONICS): cosines and sines, rad."""
        settings, shift = self._settings, self._shift
        keep = settings.memory
        self._quick = keep * self._quick + sqrt(1.0 - keep**2) * self._rng.standard_normal(2)
        drift = settings.offset_drift_sd_rad * float(self._slow[1])
        size = 1.0 + shift.amplitude + settings.amplitude_sd * float(self._quick[0])
        curve = size * self._mean
        curve[0, 0] += shift.offset_rad + settings.offset_sd_rad * float(self._quick[1]) + drift
        # n cosines and n sines of the same sd s have RMS s sqrt(n).
        n = settings.shape_harmonics
        changes = self._rng.standard_normal((2, n))
        curve[:, 1 : 1 + n] += settings.shape_sd_rad / sqrt(n) * changes
        return curve


def _mean_curve() -> np.ndarray:
    """Return the Fourier coefficients of the mean knee, (2, HARMONICS), rad."""
    series = np.fft.rfft(knee_angle(np.arange(_SAMPLES) / _SAMPLES))[:HARMONICS] * 2.0 / _SAMPLES
    series[0] /= 2.0
    return np.array([series.real, -series.imag])


def _advanced(curve: np.ndarray, cycles: float) -> np.ndarray:
    """Return the coefficients of the curve at a later phase."""
    turn = 2.0 * pi * cycles * np.arange(HARMONICS)
    cosines, sines = curve
    return np.array(
        [
            cosines * np.cos(turn) + sines * np.sin(turn),
            sines * np.cos(turn) - cosines * np.sin(turn),
        ]
    )
