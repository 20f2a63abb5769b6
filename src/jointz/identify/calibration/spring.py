r"""Gain of the torque and friction of the actuator against a known spring.

.. math:: k(\theta - \theta_0) = a\,c\,i - f\,(f_c + f_g|i|)\,s(\dot\theta) + e

with the torque per ampere c and the frictions as stated: :math:`1/a` is measured over true
torque, f is true over stated friction. The motor pulls, the spring follows: the error e of the
torque is in the angle, not in the current, so that the angle is what is regressed.
"""

from dataclasses import dataclass

import numpy as np

from jointz.core.calibration_fit import (
    CalibrationEntry,
    CalibrationFailure,
    CalibrationFit,
    CalibrationSeries,
    decided,
    failed,
)
from jointz.core.study import Calibrated, TorqueModelSpec
from jointz.identify.calibration.steady_fit import (
    RefusedError,
    SteadyFit,
    checked_channels,
    linear_fit,
    thinned,
)
from jointz.kernels.block_sandwich import correlation_time

_NAMES = ("torque_gain", "friction_gain")
_NOTHING = Calibrated(value=0.0, sd=0.0)
#: Velocities at which friction is taken to have grown to three quarters, rad/s; 0: a step.
_SMOOTHNESS_RAD_S = (0.0, 0.005, 0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15)
_SMOOTHING_S = 0.006
_LEAST_MOTION_RAD = 0.02
_LEAST_TORQUE_NM = 2.0
_BOTH_WAYS = 0.3
_GAIN_RANGE = (0.5, 2.0)
_LARGEST_GAIN_SD, _LARGEST_FRICTION_SD = 0.1, 0.3
#: The slopes of the two directions may differ by so much of their mean.
_UNLIKE = 0.1
_METHOD = "regression of the spring's torque on current and friction; block sandwich"


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    fit: SteadyFit
    chance: float
    smooth_rad_s: float
    sign: np.ndarray


def fit_spring(
    time: np.ndarray,
    motor_angle: np.ndarray,
    current: np.ndarray,
    *,
    model: TorqueModelSpec,
    stiffness: Calibrated,
    intrinsic_stiffness: Calibrated = _NOTHING,
) -> CalibrationFit:
    """Find gain of the torque and friction from slow motion against a known spring.

    Parameters
    ----------
    time : (n,) float, s
        Increasing time stamps.
    motor_angle : (n,) float, rad
        Of the encoder, at the output.
    current : (n,) float, A
        Of the motor.
    model : TorqueModelSpec
        Torque per ampere and frictions as stated.
    stiffness : Calibrated, N*m/rad
        Of the spring, with its sd.
    intrinsic_stiffness : Calibrated, N*m/rad
        Of what hangs on the actuator besides, such as the weight of its frame.

    Returns
    -------
    CalibrationFit
        ``torque_gain`` (measured over true) and ``friction_gain`` (true over stated); beside
        them torque constant and frictions of their own.

    Raises
    ------
    DataError
        When lengths differ or time does not increase.

    Notes
    -----
    Viscous friction is taken as stated, inertia as nothing: the motion is slow. Friction grows
    with a tanh of the velocity, how fast is weighed by the data. The sd of the spring enters
    both gains in full.
    """
    known = Calibrated(
        value=stiffness.value + intrinsic_stiffness.value,
        sd=float(np.hypot(stiffness.sd, intrinsic_stiffness.sd)),
    )
    try:
        channels = checked_channels(time, motor_angle=motor_angle, current=current)
        return _fitted(channels, model, known)
    except RefusedError as refused:
        return CalibrationFit("spring", failed(_NAMES, refused.code, refused.detail))


def _fitted(
    channels: tuple[np.ndarray, ...], model: TorqueModelSpec, stiffness: Calibrated
) -> CalibrationFit:
    time, angle, current = channels
    drive = model.gear_ratio * model.torque_constant * current
    _check_motion(angle, drive)
    velocity = _velocity(time, angle)
    spring = stiffness.value * angle + model.viscous_friction * velocity
    size = model.coulomb_friction + model.gear_friction * np.abs(current)
    _check_linear(spring, drive, -size * np.sign(velocity))
    candidates = _candidates(time, spring, drive, (velocity, -size))
    entries = _entries(candidates, stiffness)
    best = max(candidates, key=lambda c: c.chance)
    modelled = spring - best.fit.residual
    return CalibrationFit(
        step="spring",
        entries=entries,
        reported=_constants(time, spring, (drive, current, candidates), (model, stiffness)),
        method=_METHOD,
        n_samples=time.size,
        notes=(f"Friction grows to three quarters within {best.smooth_rad_s:g} rad/s.",),
        settings={"stiffness": stiffness.value, "stiffness_sd": stiffness.sd},
        series=CalibrationSeries(
            x=thinned(drive),
            measured=thinned(spring),
            modelled=thinned(modelled),
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


def _candidates(
    time: np.ndarray,
    spring: np.ndarray,
    drive: np.ndarray,
    friction: tuple[np.ndarray, np.ndarray],
) -> list[_Candidate]:
    """Return the fits for every smoothness of the friction, with their chances."""
    velocity, stated = friction
    found = []
    for smooth in _SMOOTHNESS_RAD_S:
        sign = np.tanh(velocity / smooth) if smooth else np.sign(velocity)
        columns = np.column_stack([drive, stated * sign, np.ones(time.size)])
        found.append((linear_fit(time, spring, columns), smooth, sign))
    sums = np.array([float(fit.residual @ fit.residual) for fit, _, _ in found])
    best = found[int(np.argmin(sums))][0].residual
    rate = (time.size - 1) / float(time[-1] - time[0])
    alike = max(1.0, 2.0 * rate * correlation_time(best, rate_hz=rate))  # samples that say the same
    logs = -0.5 * time.size / alike * np.log(np.maximum(sums, 1e-300) / max(sums.min(), 1e-300))
    chances = np.exp(logs) / np.exp(logs).sum()
    return [
        _Candidate(fit, float(chance), smooth, sign)
        for (fit, smooth, sign), chance in zip(found, chances, strict=True)
    ]


def _entries(
    candidates: list[_Candidate], stiffness: Calibrated
) -> tuple[CalibrationEntry, CalibrationEntry]:
    chances = np.array([c.chance for c in candidates])
    values = np.array([c.fit.values[:2] for c in candidates])
    values[:, 0] = 1.0 / values[:, 0]
    sds = np.array([[c.fit.sd(0), c.fit.sd(1)] for c in candidates])
    sds[:, 0] *= values[:, 0] ** 2
    mean = chances @ values
    noise, between = np.sqrt(chances @ sds**2), np.sqrt(chances @ (values - mean) ** 2)
    of_spring = np.abs(mean) * stiffness.sd / stiffness.value
    low, high = _GAIN_RANGE
    if not low <= mean[0] <= high:
        detail = f"torque_gain {mean[0]:.3g}, expected {low:g} to {high:g}"
        raise RefusedError(CalibrationFailure.GAIN_OUT_OF_RANGE, detail)

    def entry(i: int, largest_sd: float) -> CalibrationEntry:
        parts = {"noise": noise[i], "friction_model": between[i], "spring": of_spring[i]}
        return decided(_NAMES[i], float(mean[i]), parts, largest_sd=largest_sd)

    return entry(0, _LARGEST_GAIN_SD), entry(1, _LARGEST_FRICTION_SD)


def _constants(
    time: np.ndarray,
    spring: np.ndarray,
    drives: tuple[np.ndarray, np.ndarray, list[_Candidate]],
    known: tuple[TorqueModelSpec, Calibrated],
) -> tuple[CalibrationEntry, ...]:
    """Return torque constant and both frictions, each by itself."""
    drive, current, candidates = drives
    model, stiffness = known
    fits = []
    for one in candidates:
        columns = [drive, -one.sign, -one.sign * np.abs(current), np.ones(time.size)]
        fits.append(linear_fit(time, spring, np.column_stack(columns)))
    chances = np.array([one.chance for one in candidates])
    scales = np.array([abs(model.torque_constant), 1.0, 1.0])
    values = scales * np.array([fit.values[:3] for fit in fits])
    sds = scales * np.array([[fit.sd(i) for i in range(3)] for fit in fits])
    mean = chances @ values
    noise, between = np.sqrt(chances @ sds**2), np.sqrt(chances @ (values - mean) ** 2)
    of_spring = np.abs(mean) * stiffness.sd / stiffness.value
    return tuple(
        decided(
            name, mean[i], {"noise": noise[i], "friction_model": between[i], "spring": of_spring[i]}
        )
        for i, name in enumerate(("torque_constant", "coulomb_friction", "gear_friction"))
    )


def _check_motion(angle: np.ndarray, drive: np.ndarray) -> None:
    moved = float(np.subtract(*np.quantile(angle, [0.98, 0.02])))
    low, high = (float(v) for v in np.quantile(drive, [0.02, 0.98]))
    if high - low < _LEAST_TORQUE_NM:
        detail = f"torque from {low:.3g} to {high:.3g} N*m, expected {_LEAST_TORQUE_NM:g} or more"
        raise RefusedError(CalibrationFailure.NO_TORQUE, detail)
    if high < _BOTH_WAYS * -low or -low < _BOTH_WAYS * high:
        detail = f"torque from {low:.3g} to {high:.3g} N*m"
        raise RefusedError(CalibrationFailure.ONE_DIRECTION, detail)
    if moved < _LEAST_MOTION_RAD:
        detail = f"the spring moves by {moved:.2g} rad, expected {_LEAST_MOTION_RAD:g} or more"
        raise RefusedError(CalibrationFailure.NO_MOTION, detail)
    together = float(np.corrcoef(angle, drive)[0, 1])
    if together < 0.0:
        detail = f"correlation of angle and torque {together:.2f}"
        raise RefusedError(CalibrationFailure.OPPOSITE_SIGN, detail)


def _check_linear(spring: np.ndarray, drive: np.ndarray, friction: np.ndarray) -> None:
    """Refuse a spring with slack or an end stop: the two directions have different slopes."""
    columns = [np.maximum(drive, 0.0), np.minimum(drive, 0.0), friction, np.ones(drive.size)]
    up, down, *_ = np.linalg.lstsq(np.column_stack(columns), spring, rcond=None)[0].tolist()
    apart = abs(up - down) / (0.5 * abs(up + down))
    if apart > _UNLIKE:
        detail = f"the slopes of the two directions differ by {apart:.0%}"
        raise RefusedError(CalibrationFailure.NOT_LINEAR, detail)
