"""Prediction of the knee angle without the pulse, and the displacement from it."""

from collections import deque
from math import isfinite

import numpy as np

from jointz.rig.experiment.gait.phase_predictor import StridePhase

#: Strides in the mean, and the fewest from which an angle is predicted.
_STRIDES_IN_MEAN = 10
_FEWEST_STRIDES = 3
_BINS = 100
_GRID = np.linspace(0.0, 1.0, _BINS + 1)
#: A stride that lasts longer is no accepted one.
_LONGEST_STRIDE_NS = 2_500_000_000
#: A stride is early or late within its cycle. How much is fitted at an onset to the velocity of
#: this time before it: where the knee flexes at 6 rad/s, 20 ms are 0.12 rad.
_FITTED_NS = 100_000_000
_SHIFTS_PCT = np.linspace(-12.0, 12.0, 49)
#: Stride times of a walking adult vary by 2 to 3 %: a shift is expected within this (SD),
_SHIFT_SD_PCT = 3.0
#: and velocities at one phase differ from stride to stride by this beside the shift (SD).
_VELOCITY_SD_RAD_S = 0.3


class UnperturbedAngle:
    """Mean angle of the last unperturbed strides by gait phase, shifted to fit at an onset.

    A stride with a pulse in it and the stride after it are left out. All memory is taken at
    the beginning; the mean is computed once a stride. From an onset on the phase runs on at the
    mean stride time: a pulse may change when the heel strikes. ``displacement`` and ``rate`` are
    measured minus predicted angle and velocity since :meth:`begin`; ``known`` tells whether there
    are enough strides to predict from.
    """

    def __init__(self, period_ns: int) -> None:
        samples = _LONGEST_STRIDE_NS // period_ns + 1
        self._period_ns = period_ns
        self._elapsed_ns = np.zeros(samples)
        self._samples = np.zeros((2, samples))  # angle, velocity
        self._curves = np.zeros((_STRIDES_IN_MEAN, 2, _BINS + 1))
        self._replaced = np.zeros((2, _BINS + 1))
        self._mean_angle = [0.0] * (_BINS + 1)
        self._mean_velocity = [0.0] * (_BINS + 1)
        fitted = max(2, _FITTED_NS // period_ns)
        self._before = deque([0.0] * fitted, maxlen=fitted)  # velocities, the newest last
        self._count = self._stored = self._strike_ns = self._onset_ns = 0
        self._clean = self._perturbed = self._fresh = self.known = False
        self._offset = self._onset_place = self._place_per_ns = 0.0
        self.displacement = self.rate = 0.0

    def learn(
        self,
        slot_ns: int,
        strides: StridePhase,
        measured: tuple[float, float],
        *,
        accepted: bool,
        retracted: bool,
        pulse: bool,
    ) -> None:
        """Process angle and velocity of a tick.

        ``accepted`` says whether an accepted stride ended in it, ``retracted`` whether the strike
        before was none, ``pulse`` whether a pulse is on.
        """
        if retracted:
            self._take_back()
        self._append(slot_ns, measured)
        if strides.last_strike_ns != self._strike_ns:
            if accepted:
                self._store(strides.last_strike_ns - self._strike_ns)
            self._strike_ns = strides.last_strike_ns
            self._count = 0
            self._append(slot_ns, measured)
            self._clean, self._perturbed = not self._perturbed, False
        if pulse or retracted:
            self._perturbed = True
        self._before.append(measured[1])

    def begin(self, slot_ns: int, strides: StridePhase, measured: tuple[float, float]) -> None:
        """Shift the prediction in time and in angle so that it fits at the onset of a pulse."""
        self._onset_ns = slot_ns
        self._place_per_ns = _BINS / strides.mean_ns
        place = strides.phase_pct(slot_ns) * (0.01 * _BINS)
        self._onset_place = place + self._shift(place)
        self._offset = 0.0
        self.follow(slot_ns, measured)
        self._offset, self.displacement = self.displacement, 0.0

    def follow(self, slot_ns: int, measured: tuple[float, float]) -> None:
        """Compute displacement and rate of a tick since the onset."""
        place = (self._onset_place + (slot_ns - self._onset_ns) * self._place_per_ns) % _BINS
        low = min(int(place), _BINS - 1)  # just below 0, the remainder rounds up to 100
        share = place - low
        angle, velocity = self._mean_angle, self._mean_velocity
        predicted = angle[low] + share * (angle[low + 1] - angle[low])
        self.displacement = measured[0] - predicted - self._offset
        self.rate = measured[1] - velocity[low] - share * (velocity[low + 1] - velocity[low])

    def _append(self, slot_ns: int, measured: tuple[float, float]) -> None:
        count = self._count
        if count < self._elapsed_ns.size:
            self._elapsed_ns[count] = slot_ns - self._strike_ns
            self._samples[0, count], self._samples[1, count] = measured
            self._count = count + 1

    def _shift(self, place: float) -> float:
        """Return the shift of the phase, in bins, that explains the velocity before an onset."""
        measured = np.array(self._before)
        ticks = np.arange(1 - measured.size, 1)
        shifts = _SHIFTS_PCT * (0.01 * _BINS)
        places = place + shifts[:, None] + ticks * (self._period_ns * self._place_per_ns)
        predicted = np.interp(places % _BINS, _GRID * _BINS, self._mean_velocity)
        misfit = ((measured - predicted) ** 2).mean(axis=1) / _VELOCITY_SD_RAD_S**2
        return float(shifts[np.argmin(misfit + (_SHIFTS_PCT / _SHIFT_SD_PCT) ** 2)])

    def _store(self, duration_ns: int) -> None:
        """Take the stride that ended into the mean, unless a pulse is in it or before it."""
        count = self._count
        self._fresh = False
        if not self._clean or self._perturbed or count == self._elapsed_ns.size:
            return
        at_ns, elapsed_ns = _GRID * duration_ns, self._elapsed_ns[:count]
        curves = [np.interp(at_ns, elapsed_ns, values[:count]) for values in self._samples]
        if not isfinite(sum(float(curve.sum()) for curve in curves)):
            return
        row = self._curves[self._stored % _STRIDES_IN_MEAN]
        self._replaced[:] = row
        row[:] = curves
        self._fresh = True
        self._stored += 1
        self._average()

    def _take_back(self) -> None:
        """Forget the last stride: the strike at its end was none."""
        if self._fresh:
            self._fresh = False
            self._stored -= 1
            self._curves[self._stored % _STRIDES_IN_MEAN] = self._replaced
            self._average()

    def _average(self) -> None:
        filled = min(self._stored, _STRIDES_IN_MEAN)
        self.known = filled >= _FEWEST_STRIDES
        if self.known:
            angle, velocity = self._curves[:filled].mean(axis=0).tolist()
            self._mean_angle, self._mean_velocity = angle, velocity
