r"""Gain of the torque and friction of the actuator against a known spring.

.. math:: k(\theta - \theta_0) = a\,c\,i - f\,(f_c + f_g|i|)\,s(\dot\theta) + e

with the torque per ampere c and the frictions as stated: :math:`1/a` is measured over true
torque, f is true over stated friction. The motor pulls, the spring follows: the error e of the
torque is in the angle, not in the current, so that the angle is what is regressed.

The error also turns the motion about, where it is slow: it goes along with the direction
:math:`s(\dot\theta)`, and least squares would find too little friction (by one to three sd). The
motion that the current alone would give serves as instrument.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import tanh

import numpy as np
from scipy.stats import t as student_t

from jointz.core.study import Calibrated, TorqueModelSpec
from jointz.identify.calibration.calibration_step import (
    RefusedError,
    calibration_step,
    check_same_sign,
    check_torque,
    checked_channels,
    middle_range,
    step_series,
    weighted_moments,
)
from jointz.identify.calibration.steady_fit import blocks_for
from jointz.results.bench.calibration_failure import CalibrationFailure
from jointz.results.bench.calibration_fit import CalibrationEntry, CalibrationFit, decided
from jointz.results.estimates import REACH_95

#: Added to the moments' covariance before it is inverted, share of its trace.
_EVEN_SHARE = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class InstrumentedFit:
    """A linear fit."""

    values: np.ndarray  # coefficients
    # chi squared of the moments; degrees of freedom: number of instruments minus number of
    # coefficients
    distance: float
    residual: np.ndarray  # measured minus modelled


class Instruments:
    """Instruments of one signal, for any number of models of it."""

    def __init__(self, time: np.ndarray, y: np.ndarray, columns: np.ndarray) -> None:
        self._time, self._y = time, y
        self._z = columns / np.sqrt(np.mean(columns**2, axis=0))
        self._weights = np.linalg.inv(self._z.T @ self._z)
        self._starts = np.zeros(1, dtype=int)
        self._lost = 0

    def weigh(self, residual: np.ndarray, *, fitted: int) -> None:
        """Weigh the moments by their covariance."""
        n_blocks = blocks_for(self._time, residual, size=float(np.std(self._y)), fitted=fitted)
        self._starts = np.arange(n_blocks) * residual.size // n_blocks
        self._lost = fitted
        sums = np.add.reduceat(self._z * residual[:, None], self._starts, axis=0)
        covariance = sums.T @ sums * n_blocks / (n_blocks - fitted)
        size = float(np.trace(covariance))
        if size > 0.0:  # else nothing is left that could be weighed
            even = _EVEN_SHARE * size * np.eye(len(covariance))
            self._weights = np.linalg.inv(covariance + even)

    @cached_property
    def _against_signal(self) -> np.ndarray:
        return np.asarray(self._z.T @ self._y)

    def fit(self, regressors: np.ndarray) -> InstrumentedFit:
        """Fit the signal by regressors."""
        cross = self._z.T @ regressors
        values = self._solved(cross, self._against_signal)
        missed = self._against_signal - cross @ values
        residual = self._y - regressors @ values
        return InstrumentedFit(values, float(missed @ self._weights @ missed), residual)

    def sds(self, regressors: np.ndarray) -> np.ndarray:
        """Return the sd of the coefficients."""
        n = self._starts.size
        ends = [*self._starts[1:], len(self._y)]
        parts = [slice(a, b) for a, b in zip(self._starts, ends, strict=True)]
        cross = np.array([self._z[part].T @ regressors[part] for part in parts])
        signal = np.array([self._z[part].T @ self._y[part] for part in parts])
        without = np.array(
            [
                self._solved(cross.sum(axis=0) - block, signal.sum(axis=0) - moment)
                for block, moment in zip(cross, signal, strict=True)
            ]
        )
        scatter = np.sqrt((n - 1) / n * np.sum((without - without.mean(axis=0)) ** 2, axis=0))
        return np.asarray(scatter * student_t.ppf(0.975, n - self._lost) / REACH_95)

    def _solved(self, cross: np.ndarray, signal: np.ndarray) -> np.ndarray:
        leaning = cross.T @ self._weights
        return np.asarray(np.linalg.solve(leaning @ cross, leaning @ signal))


#: Velocities at which friction is taken to have grown to three quarters, rad/s.
_SMOOTHNESS_RAD_S = np.geomspace(0.003, 0.2, 22)
#: The same for the instruments: two, that tell level and smoothness apart.
_INSTRUMENTS_RAD_S = (0.02, 0.12)
_DRIVEN_RAD_S = 0.03
_FITTED = 4  # gain, friction, its smoothness, offset
_WEIGHINGS = 2
_SMOOTHING_S = 0.006
_LEAST_MOTION_RAD = 0.02
_GAIN_RANGE = (0.5, 2.0)
_LARGEST_SDS = {"torque_gain": 0.1, "friction_gain": 0.3}
#: The slopes of the two directions may differ by so much of their mean.
_UNLIKE = 0.1
_METHOD = (
    "regression of the spring's torque on current and friction, the motion by the current alone "
    "as instrument; sd by leaving out blocks"
)


@dataclass(frozen=True, slots=True, eq=False)
class _Pull:
    """A record: torque of the spring and of the current, velocity and friction."""

    time: np.ndarray  # s
    spring: np.ndarray  # torque of the spring, N*m
    drive: np.ndarray  # torque by the current, without friction, N*m
    current: np.ndarray  # A
    velocity: np.ndarray  # rad/s
    driven: np.ndarray  # velocity by the current alone, rad/s
    friction: np.ndarray  # size of the stated friction, N*m

    def columns(self, sign: np.ndarray) -> np.ndarray:
        """Return regressors: torque, friction, offset."""
        return np.column_stack([self.drive, -self.friction * sign, np.ones(sign.size)])

    def apart(self, sign: np.ndarray) -> np.ndarray:
        """Return regressors with the two frictions apart: torque, both, offset."""
        ampere = np.abs(self.current)
        return np.column_stack([self.drive, -sign, -ampere * sign, np.ones(sign.size)])

    def driven_signs(self) -> list[np.ndarray]:
        """Return the direction of the motion that the current alone would give."""
        return [np.tanh(self.driven / smooth) for smooth in _INSTRUMENTS_RAD_S]


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    fit: InstrumentedFit
    sds: np.ndarray  # of the coefficients
    chance: float  # probability of this smoothness
    smooth_rad_s: float  # velocity over which the friction changes its sign
    sign: np.ndarray  # smooth sign of the velocity


@calibration_step("spring", *_LARGEST_SDS)
def fit_spring(
    time: np.ndarray,
    motor_angle: np.ndarray,
    current: np.ndarray,
    *,
    model: TorqueModelSpec,
    stiffness: Calibrated,
) -> CalibrationFit:
    """Estimate gain of the torque and friction from slow motion against a known spring.

    Viscous friction is taken as stated and inertia as zero: the motion is slow. Friction grows
    with a tanh of the velocity; how fast is weighted by the data. The sd of the spring enters
    both gains in full.
    """
    time, angle, current = checked_channels(time, motor_angle=motor_angle, current=current)
    drive = model.gear_ratio * model.torque_constant * current
    _check_motion(angle, drive)
    velocity = _velocity(time, angle)
    spring = stiffness.value * angle + model.viscous_friction * velocity
    friction = model.coulomb_friction + model.gear_friction * np.abs(current)
    _check_linear(spring, drive, -friction * np.sign(velocity))
    driven = driven_velocity(
        time, drive, friction, stiffness=stiffness.value, smooth_rad_s=_DRIVEN_RAD_S
    )
    pull = _Pull(time, spring, drive, current, velocity, driven, friction)
    candidates = _candidates(pull)
    best = max(candidates, key=lambda c: c.chance)
    return CalibrationFit(
        step="spring",
        entries=_gains(candidates, stiffness),
        reported=_constants(pull, candidates, model, stiffness),
        method=_METHOD,
        n_samples=time.size,
        notes=(f"Friction grows to three quarters within {best.smooth_rad_s:.2g} rad/s.",),
        settings={"stiffness": stiffness.value, "stiffness_sd": stiffness.sd},
        series=step_series(
            drive,
            spring,
            spring - best.fit.residual,
            x_label="torque by the current, without friction (N*m)",
            y_label="torque of the spring (N*m)",
        ),
    )


def _velocity(time: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return the velocity by straight lines over 12 ms: an encoder's steps hardly show."""
    before = np.interp(time - _SMOOTHING_S, time, angle)
    after = np.interp(time + _SMOOTHING_S, time, angle)
    span = np.minimum(time + _SMOOTHING_S, time[-1]) - np.maximum(time - _SMOOTHING_S, time[0])
    return np.asarray((after - before) / span)


def _candidates(pull: _Pull) -> list[_Candidate]:
    """Return the fits for every smoothness of the friction, with their chances."""
    signs = [np.tanh(pull.velocity / smooth) for smooth in _SMOOTHNESS_RAD_S]
    columns = [pull.columns(sign) for sign in signs]
    by_current = [pull.columns(sign)[:, 1] for sign in pull.driven_signs()]
    columns_of_instruments = np.column_stack([pull.drive, np.ones(pull.time.size), *by_current])
    instruments = Instruments(pull.time, pull.spring, columns_of_instruments)
    for _ in range(_WEIGHINGS):
        best = min((instruments.fit(c) for c in columns), key=lambda fit: fit.distance)
        instruments.weigh(best.residual, fitted=_FITTED)
    fits = [instruments.fit(c) for c in columns]
    distances = np.array([fit.distance for fit in fits])
    chances = np.exp(-0.5 * (distances - distances.min()))
    return [
        _Candidate(fit, instruments.sds(c), float(chance), float(smooth), sign)
        for fit, c, chance, smooth, sign in zip(
            fits, columns, chances / chances.sum(), _SMOOTHNESS_RAD_S, signs, strict=True
        )
    ]


def _gains(candidates: list[_Candidate], stiffness: Calibrated) -> tuple[CalibrationEntry, ...]:
    values = np.array([c.fit.values[:2] for c in candidates])
    sds = np.array([c.sds[:2] for c in candidates])
    values[:, 0] = 1.0 / values[:, 0]
    sds[:, 0] *= values[:, 0] ** 2
    entries = _entries(_LARGEST_SDS, candidates, values, sds, stiffness)
    gain, (low, high) = entries[0].value or 0.0, _GAIN_RANGE
    if not low <= gain <= high:
        detail = f"torque_gain {gain:.3g}, expected {low:g} to {high:g}"
        raise RefusedError(CalibrationFailure.GAIN_OUT_OF_RANGE, detail)
    return entries


def _entries(
    largest_sds: Mapping[str, float | None],
    candidates: list[_Candidate],
    values: np.ndarray,
    sds: np.ndarray,
    stiffness: Calibrated,
) -> tuple[CalibrationEntry, ...]:
    """Return entries by name: means over the candidates, and the budgets of their sd."""
    chances = np.array([c.chance for c in candidates])
    mean, noise, between = weighted_moments(chances, values, sds**2)
    of_spring = np.abs(mean) * stiffness.sd / stiffness.value
    return tuple(
        decided(
            name,
            float(mean[i]),
            {"noise": noise[i], "friction_model": between[i], "spring": of_spring[i]},
            largest_sd=largest_sd,
        )
        for i, (name, largest_sd) in enumerate(largest_sds.items())
    )


def _constants(
    pull: _Pull, candidates: list[_Candidate], model: TorqueModelSpec, stiffness: Calibrated
) -> tuple[CalibrationEntry, ...]:
    """Return torque constant and both frictions, each by itself."""
    by_current = [pull.apart(sign)[:, 1:3] for sign in pull.driven_signs()]
    columns_of_instruments = np.column_stack([pull.drive, np.ones(pull.time.size), *by_current])
    instruments = Instruments(pull.time, pull.spring, columns_of_instruments)
    best = max(candidates, key=lambda c: c.chance)
    instruments.weigh(best.fit.residual, fitted=_FITTED + 1)
    columns = [pull.apart(c.sign) for c in candidates]
    scales = np.array([abs(model.torque_constant), 1.0, 1.0])
    values = scales * np.array([instruments.fit(c).values[:3] for c in columns])
    sds = scales * np.array([instruments.sds(c)[:3] for c in columns])
    names = ("torque_constant", "coulomb_friction", "gear_friction")
    return _entries(dict.fromkeys(names), candidates, values, sds, stiffness)


def _check_motion(angle: np.ndarray, drive: np.ndarray) -> None:
    check_torque(drive)
    moved = middle_range(angle)
    if moved < _LEAST_MOTION_RAD:
        detail = f"the spring moves by {moved:.2g} rad, expected {_LEAST_MOTION_RAD:g} or more"
        raise RefusedError(CalibrationFailure.NO_MOTION, detail)
    check_same_sign(angle, drive, "torque")


def _check_linear(spring: np.ndarray, drive: np.ndarray, friction: np.ndarray) -> None:
    """Refuse a spring with slack or an end stop: the two directions have different slopes."""
    columns = [np.maximum(drive, 0.0), np.minimum(drive, 0.0), friction, np.ones(drive.size)]
    up, down, *_ = np.linalg.lstsq(np.column_stack(columns), spring, rcond=None)[0].tolist()
    apart = abs(up - down) / (0.5 * abs(up + down))
    if apart > _UNLIKE:
        detail = f"the slopes of the two directions differ by {apart:.0%}"
        raise RefusedError(CalibrationFailure.NOT_LINEAR, detail)


_STEP_S = 0.01
_SMALL_RAD = 1e-9
_PASSES = 30


def driven_velocity(
    time: np.ndarray,
    drive: np.ndarray,
    friction: np.ndarray,
    *,
    stiffness: float,
    smooth_rad_s: float,
) -> np.ndarray:
    """Return the velocity that torque and friction give, rad/s."""
    grid = np.arange(time[0], time[-1] + _STEP_S, _STEP_S)
    pulls, holds = (np.interp(grid, time, values).tolist() for values in (drive, friction))
    angle, velocity = pulls[0] / stiffness, []
    for pull, hold in zip(pulls, holds, strict=True):
        step = _step(pull - stiffness * angle, hold, stiffness, _STEP_S * smooth_rad_s)
        angle += step
        velocity.append(step / _STEP_S)
    return np.asarray(np.interp(time, grid, velocity))


def _step(pull: float, hold: float, stiffness: float, smooth_rad: float) -> float:
    """Return the root of ``stiffness * x + hold * tanh(x / smooth_rad) = pull``.

    By Newton's method from zero, of the size: there the left side is steepest, so that no step
    passes the root.
    """
    x, size = 0.0, abs(pull)
    for _ in range(_PASSES):
        share = tanh(x / smooth_rad)
        slope = stiffness + hold * (1.0 - share**2) / smooth_rad
        change = (size - stiffness * x - hold * share) / slope
        x += change
        if change < _SMALL_RAD:
            break
    return x if pull > 0.0 else -x
