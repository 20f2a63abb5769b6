"""Torque model of an actuator from a bench record with a torque sensor."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr

from jointz.core import provenance
from jointz.core.errors import DataError, EstimationError
from jointz.identify.actuators.actuator_notes import actuator_warnings, explains_nothing
from jointz.identify.actuators.actuator_record import ActuatorRecord, gather_actuator
from jointz.identify.actuators.actuator_terms import MODEL_TERMS, find_terms
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
    """Say why a fitted inertia cannot be one; None where it can."""
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
    step = max(1, -(-record.torque.size // _SERIES_POINTS))
    shown = slice(None, None, step)
    velocity = () if record.velocity is None else tuple(record.velocity[shown].tolist())
    return ActuatorSeries(
        position=tuple(record.time[shown].tolist()),
        measured=tuple(record.torque[shown].tolist()),
        modelled=tuple(modelled[shown].tolist()),
        velocity=velocity,
        in_seconds=record.rate_hz is not None,
    )
