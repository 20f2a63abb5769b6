"""Torque model of an actuator from a bench record with a torque sensor."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr

from jointz.core import provenance
from jointz.core.errors import DataError, EstimationError
from jointz.identify.actuators.actuator_record import (
    ActuatorRecord,
    gather_actuator,
    velocity_noise,
)
from jointz.identify.actuators.actuator_terms import MODEL_TERMS, Terms, find_terms, rest_share
from jointz.identify.bench.bench_estimates import is_constant
from jointz.identify.record.block_regression import BlockRegression, regress
from jointz.identify.record.joint_record import check_choice, check_level
from jointz.results.bench.actuator_fit import ActuatorFit, ActuatorSeries
from jointz.results.estimates import ParameterEstimate

Model = Literal["current", "motor", "friction"]

_WHERE = "identify_actuator"
_SERIES_POINTS = 1500


def identify_actuator(  # noqa: PLR0913 - the fixed public signature of identify
    recording: xr.Dataset | Mapping[str, npt.ArrayLike] | pd.DataFrame | None = None,
    *,
    current: npt.ArrayLike | None = None,
    velocity: npt.ArrayLike | None = None,
    torque: npt.ArrayLike | None = None,
    acceleration: npt.ArrayLike | None = None,
    time: npt.ArrayLike | None = None,
    rate_hz: float | None = None,
    gear_ratio: float,
    model: Model = "friction",
    torque_sign: float = 1.0,
    rotor_inertia: float | None = None,
    smooth_velocity_rad_s: float | None = None,
    ci_level: float = 0.95,
) -> ActuatorFit:
    """Fit a torque model (3.1, 3.2 or 3.3) to a bench record.

    Parameters
    ----------
    recording : xarray.Dataset, mapping or pandas.DataFrame, optional
        Channels ``current``, ``torque`` and, where there are, ``velocity``,
        ``acceleration`` and ``time``, in SI. Either this or the arrays.
    current : (n,) float, A, optional
        Q-axis current of the motor.
    velocity : (n,) float, rad/s, optional
        Of the output; ``current`` does without.
    torque : (n,) float, N*m, optional
        Of the torque sensor.
    acceleration : (n,) float, rad/s^2, optional
        Of the output. Without it, the central difference of the velocity where
        time or rate is given.
    time : (n,) float, s, optional
        Time stamps. Jitter is resampled linearly; with a gap they are left out.
    rate_hz : float, optional
        Sampling rate, where there are no time stamps. Neither is needed but for
        the acceleration.
    gear_ratio : float
        Motor turns a turn of the output.
    model : str
        ``current``: torque = bias + G kt I (3.1). ``motor``: less viscous
        friction * velocity and rotor inertia * acceleration (3.2).
        ``friction``: less (Coulomb + gear friction * abs(I)) * sign(velocity)
        and rotor inertia * acceleration (3.3).
    torque_sign : float
        -1 where the sensor's torque counts against the motor's; it is turned.
    rotor_inertia : float, kg*m^2, optional
        Referred to the output (G^2 times the motor's); given, it is not fitted.
    smooth_velocity_rad_s : float, optional
        s: tanh(velocity / s) takes the place of sign(velocity).
    ci_level : float
        Level of the intervals.

    Returns
    -------
    ActuatorFit
        Parameters with intervals, RMS error, warnings. A parameter that the
        record does not support is None with status ``undecided``; where the record
        is only too short for an interval, ``undecided`` has a value without one.

    Raises
    ------
    DataError
        When the samples cannot be trusted: missing channel, unequal lengths,
        NaN, changing rate, values that no actuator reaches; settings that
        contradict each other.
    EstimationError
        ``constant_current`` or ``constant_torque``.
    ValueError
        Unknown model; the message lists the choices.

    Notes
    -----
    Ordinary least squares; intervals from a block sandwich
    (:func:`jointz.kernels.block_sandwich.block_sandwich`), Student's t. They do not
    know the sensor's gain or lag, nor that the true friction may have another
    shape: the residual of such a shape is part of ``rms_error_nm``.

    A term stays out, with a warning, where the record cannot decide it: Coulomb
    friction where less than 1 % of the samples lie on the rarer side of a dead
    band (5 % of the 95th percentile of the speed); any term of whose regressor
    the others explain all but 0.1 %; the inertia where over 10 % of the
    variance of a differenced velocity is noise (from its third differences), or
    where its interval does not lie above zero. Up to that the inertia reads low by
    the share of noise. A late torque record, and a spring between motor and
    sensor, read as inertia and friction too.

    Examples
    --------
    >>> t = np.arange(20_000) / 1000.0
    >>> current = 5 * np.sin(2 * np.pi * 0.31 * t)
    >>> velocity = 3 * np.cos(2 * np.pi * 0.77 * t)
    >>> torque = 9 * 0.11 * current - 0.38 * np.sign(velocity)
    >>> fit = identify_actuator(current=current, velocity=velocity, torque=torque, gear_ratio=9)
    >>> round(fit.parameter("torque_constant").value, 4)
    0.11
    """
    check_choice("model", model, get_args(Model))
    _check_settings(model, gear_ratio, torque_sign, rotor_inertia, smooth_velocity_rad_s)
    check_level(_WHERE, ci_level)
    record = gather_actuator(
        recording,
        {
            "current": current,
            "velocity": velocity,
            "torque": torque,
            "acceleration": acceleration,
            "time": time,
        },
        rate_hz=rate_hz,
        needs_velocity=model != "current",
        torque_sign=torque_sign,
    )
    _check_moves(record)
    measured = record.torque - _known_torque(record, rotor_inertia)
    settings = {
        "gear_ratio": float(gear_ratio),
        "smooth_velocity_rad_s": smooth_velocity_rad_s,
        "torque_sign": torque_sign,
        "rotor_inertia_given": rotor_inertia,
        "acceleration_from": record.acceleration_from,
        "acceleration_noise_share": record.acceleration_noise_share,
        "ci_level": ci_level,
        "sha256": record.sha256,
        "jointz": provenance.software()["jointz"],
    }
    terms = find_terms(
        record,
        model,
        gear_ratio=float(gear_ratio),
        smooth_velocity_rad_s=smooth_velocity_rad_s,
        skip=() if rotor_inertia is None else ("rotor_inertia",),
    )
    fit = regress(measured, terms.columns, record.rate_hz, ci_level)
    unbounded: dict[str, float] = {}
    if (why := _inertia_doubt(fit)) is not None:
        unbounded["rotor_inertia"] = fit.value("rotor_inertia")
        terms = terms.without("rotor_inertia", why)
        fit = regress(measured, terms.columns, record.rate_hz, ci_level)
    parameters = tuple(_parameter(name, fit, unbounded, settings) for name in MODEL_TERMS[model])
    undecided = [p.name for p in parameters if not p.available]
    if record.acceleration_from == "none" and "rotor_inertia" in undecided:
        undecided.remove("rotor_inertia")  # it could not be measured
    centred = record.torque - record.torque.mean()
    return ActuatorFit(
        model=model,
        parameters=parameters,
        rms_error_nm=float(np.sqrt(np.mean(fit.residual**2))),
        vaf_pct=100.0 * (1.0 - float(np.sum(fit.residual**2) / np.sum(centred**2))),
        status="undecided" if undecided else "ok",
        gear_ratio=float(gear_ratio),
        torque_sign=torque_sign,
        n_samples=record.torque.size,
        rate_hz=record.rate_hz,
        condition_number=fit.condition_number,
        covariance=tuple(tuple(row) for row in fit.covariance.tolist()),
        fitted=fit.names,
        ci_method=fit.ci_method,
        settings=settings,
        warnings=tuple(actuator_warnings(record, terms, fit, gear_ratio=float(gear_ratio))),
        series=_series(record, record.torque - fit.residual),
    )


def _check_settings(
    model: str,
    gear_ratio: float,
    torque_sign: float,
    rotor_inertia: float | None,
    smooth: float | None,
) -> None:
    """Refuse settings out of range, all in one message."""
    inertia = rotor_inertia
    checks = [
        (
            0.0 < gear_ratio < np.inf,
            f"gear_ratio: expected > 0 (motor turns a turn of the output), got {gear_ratio:g}. "
            "Give the direction with torque_sign.",
        ),
        (torque_sign in (1.0, -1.0), f"torque_sign: expected 1 or -1, got {torque_sign:g}."),
        (
            inertia is None or 0.0 <= inertia < np.inf,
            f"rotor_inertia: expected >= 0 kg*m^2, got {inertia or 0.0:g}.",
        ),
        (
            inertia is None or "rotor_inertia" in MODEL_TERMS[model],
            f"rotor_inertia: model {model} has no inertia. Take motor or friction.",
        ),
        (
            smooth is None or 0.0 < smooth < np.inf,
            f"smooth_velocity_rad_s: expected > 0 rad/s, got {smooth or 0.0:g}.",
        ),
        (
            smooth is None or model == "friction",
            f"smooth_velocity_rad_s: model {model} has no sign. Take friction.",
        ),
    ]
    problems = [problem for fine, problem in checks if not fine]
    if problems:
        raise DataError(f"{_WHERE}: " + " ".join(problems))


def _check_moves(record: ActuatorRecord) -> None:
    for name, values in (("current", record.current), ("torque", record.torque)):
        if is_constant(values):
            raise EstimationError(
                f"constant_{name}",
                f"the {name} is constant ({values[0]:.6g}): no torque constant can be found. "
                "Check the column, or record several levels.",
            )


def _known_torque(record: ActuatorRecord, rotor_inertia: float | None) -> np.ndarray:
    """Return the torque that a given inertia takes."""
    if rotor_inertia is None:
        return np.zeros_like(record.torque)
    if record.acceleration is None:
        raise DataError(
            f"{_WHERE}: rotor_inertia is given, but no acceleration to multiply it with. "
            "Give acceleration, or time or rate to difference the velocity."
        )
    return -rotor_inertia * record.acceleration


def _inertia_doubt(fit: BlockRegression) -> str | None:
    """Return why a fitted inertia is implausible, None if it is plausible."""
    if "rotor_inertia" not in fit.names or fit.is_saturated:
        return None
    low, high = fit.interval("rotor_inertia")
    if low > 0.0:
        return None
    reason = "the record hardly accelerates, or the torque record is late"
    if fit.doubt:
        reason = "the record is too short"
    elif high < 0.0:
        reason = "a sign of acceleration, speed or torque is turned"
    return (
        f"acceleration cannot be fitted: the interval of the inertia, {low:.2g} to {high:.2g} "
        f"kg*m^2, does not lie above zero: {reason}. The inertia itself can be given"
    )


def _parameter(
    name: str,
    fit: BlockRegression,
    unbounded: Mapping[str, float],
    settings: Mapping[str, Any],
) -> ParameterEstimate:
    level, inertia = settings["ci_level"], settings["rotor_inertia_given"]
    if name == "rotor_inertia" and inertia is not None:
        return ParameterEstimate(name, inertia, None, None, "ok", level, "given, not fitted")
    undecided = ParameterEstimate(name, None, None, None, "undecided", level, "none")
    if name not in fit.names:
        return replace(undecided, unbounded=unbounded.get(name))
    value = fit.value(name)
    if name == "torque_constant" and explains_nothing(fit):
        return replace(undecided, ci_method=fit.ci_method, unbounded=value)
    if fit.doubt:
        return replace(undecided, value=None if fit.is_saturated else value)
    return ParameterEstimate(name, value, *fit.interval(name), "ok", level, fit.ci_method)


def _series(record: ActuatorRecord, modelled: np.ndarray) -> ActuatorSeries:
    """Thin the record for a figure."""
    shown = slice(None, None, max(1, -(-record.torque.size // _SERIES_POINTS)))
    velocity = () if record.velocity is None else tuple(record.velocity[shown].tolist())
    return ActuatorSeries(
        position=tuple(record.time[shown].tolist()),
        measured=tuple(record.torque[shown].tolist()),
        modelled=tuple(modelled[shown].tolist()),
        velocity=velocity,
        in_seconds=record.rate_hz is not None,
    )


#: Torque constants of motors in robot joints and exoskeletons, N*m/A on the motor's side.
PLAUSIBLE_TORQUE_CONSTANT = (0.02, 0.5)
#: Inertia of such motors, kg*m^2 on the motor's side, and the fastest that their outputs turn.
PLAUSIBLE_ROTOR_INERTIA = (1e-7, 1e-2)
FASTEST_OUTPUT_RAD_S = 30.0
#: Above this share of noise in a differenced speed the bias of the inertia is told.
_NOTED_NOISE_SHARE = 0.01
#: Above this share of samples at rest static friction is in the fit; above that one of samples
#: whose speed is smaller than its noise their sign is a guess too often.
_NOTED_REST_SHARE = 0.1
_NOTED_GUESSED_SHARE = 0.01
_FRICTIONS = ("viscous_friction", "coulomb_friction")
_PROPORTIONAL = 1e-9


def explains_nothing(fit: BlockRegression) -> bool:
    """Return whether the current explains none of the torque."""
    if fit.is_saturated:
        return False
    low, high = fit.interval("torque_constant")
    return low <= 0.0 <= high


def actuator_warnings(
    record: ActuatorRecord, terms: Terms, fit: BlockRegression, *, gear_ratio: float
) -> Iterator[str]:
    """Yield all that a reader of the numbers must know."""
    if fit.doubt:
        missing = "there are no values" if fit.is_saturated else "the values have no interval"
        yield f"undecided, {missing}: {fit.doubt}"
    if record.n_gaps:
        yield f"time has {record.n_gaps} gap(s) and is left out: only an inertia would need it"
    if fit.caution:
        yield fit.caution
    for name, why in terms.left_out.items():
        yield f"{name} is undecided: {why}"
    if record.velocity is not None:
        yield from _on_speed(record.velocity, fit)
    if not fit.is_saturated:
        yield from _on_constant(fit)
        if not fit.doubt:
            yield from _on_signs(record, fit)
        if "rotor_inertia" in fit.names:
            yield from _on_inertia(record, fit, gear_ratio)


def _on_constant(fit: BlockRegression) -> Iterator[str]:
    """Judge the torque constant: its sign, and whether a motor has such a one."""
    value, (low, high) = fit.value("torque_constant"), PLAUSIBLE_TORQUE_CONSTANT
    if explains_nothing(fit):
        lowest, highest = fit.interval("torque_constant")
        yield (
            f"torque_constant is undecided: its interval, {lowest:.2g} to {highest:.2g} N*m/A, "
            "holds zero: the current explains none of the torque. Check both columns"
        )
    elif value < 0.0 and not fit.doubt:
        yield (
            f"the torque constant is negative ({value:.3g} N*m/A): the sensor counts against the "
            "current. Turn it with torque_sign -1 (--torque-sign -1), or 1 if it was -1"
        )
    elif not low <= value <= high:
        yield (
            f"the torque constant of {value:.3g} N*m/A is implausible: motors of robot joints have "
            f"{low:g} to {high:g} N*m/A. Check gear_ratio and the units of current and torque; if "
            "the motor's data sheet agrees, all is well"
        )


def _is_current(record: ActuatorRecord) -> bool:
    """Return whether the torque is a multiple of the current, up to rounding."""
    torque = record.torque - record.torque.mean()
    current = record.current - record.current.mean()
    rest = torque - current * float(torque @ current) / float(current @ current)
    return bool(np.linalg.norm(rest) <= _PROPORTIONAL * np.linalg.norm(torque))


def _on_signs(record: ActuatorRecord, fit: BlockRegression) -> Iterator[str]:
    if _is_current(record):
        yield (
            "the torque is the current times a number: one and the same signal, or a torque that "
            "was computed. Give the torque sensor's column"
        )
        return
    if fit.value("torque_constant") <= 0.0:
        return
    for name in _FRICTIONS:
        if name not in fit.names or fit.value(name) >= 0.0:
            continue
        if fit.interval(name)[1] < 0.0:
            yield (
                f"{name} is negative: the speed counts against the current. Turn the sign of the "
                "speed"
            )
        else:
            yield (
                f"{name} is negative ({fit.value(name):.2g}), which no friction is, though "
                "its interval reaches zero: the record hardly tells it, or something moves the "
                "torque that the model lacks. Check the columns of speed and torque"
            )


def _on_speed(velocity: np.ndarray, fit: BlockRegression) -> Iterator[str]:
    speed = np.abs(velocity)
    fastest = float(np.quantile(speed, 0.95))
    if fastest > FASTEST_OUTPUT_RAD_S:
        yield (
            f"the speed reaches {fastest:.3g} rad/s, faster than outputs of joint actuators turn "
            f"({FASTEST_OUTPUT_RAD_S:g} rad/s): is it the motor's, before the gear, or in deg/s or "
            "rpm? Viscous friction and inertia go with it. Give the unit (COL:deg/s), or the "
            "output's speed"
        )
    if "coulomb_friction" not in fit.names:
        return
    at_rest = rest_share(velocity)
    if at_rest > _NOTED_REST_SHARE:
        yield (
            f"{100 * at_rest:.0f} % of the samples stand nearly still: friction there is whatever "
            "holds, which the model has not, so torque_constant and friction read low. Leave these "
            "samples out, or keep the output moving"
        )
    guessed = float(np.mean((speed < velocity_noise(velocity)) & (speed > 0.0)))
    if guessed > _NOTED_GUESSED_SHARE:
        yield (
            f"at {100 * guessed:.1f} % of the samples the speed is smaller than its noise and its "
            "sign a guess: coulomb_friction may read low by up to as much. Filter the speed, or "
            "move faster"
        )


def _on_inertia(record: ActuatorRecord, fit: BlockRegression, gear_ratio: float) -> Iterator[str]:
    noise = record.acceleration_noise_share
    if noise > _NOTED_NOISE_SHARE:
        yield (
            f"the acceleration is a difference of the speed, about {100 * noise:.0f} % of its "
            "variance is noise: rotor_inertia reads low by about as much"
        )
    at_motor = fit.value("rotor_inertia") / gear_ratio**2
    low, high = PLAUSIBLE_ROTOR_INERTIA
    if not fit.doubt and not low <= at_motor <= high:
        yield (
            f"the rotor inertia of {at_motor:.2g} kg*m^2 at the motor is implausible: motors of "
            f"robot joints have {low:g} to {high:g} kg*m^2. Check rate, the units of speed and "
            "time, and gear_ratio"
        )
