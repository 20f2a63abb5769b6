"""Instruments of a strapped leg: their priors by calibration, and their lags by the fit."""

from collections.abc import Iterator, Sequence

import numpy as np

from jointz.core.priors import AnyPrior, LogPrior, NormalPrior
from jointz.core.study import Calibrated, CalibrationSpec
from jointz.identify.preparation.calibration import relative_sd, value_of
from jointz.identify.preparation.cell_data import calibration_sd
from jointz.identify.preparation.raw_signals import (
    ENCODER,
    JOINT_VELOCITY,
    SHANK_VELOCITY,
    THIGH_VELOCITY,
    sensor_lag,
)
from jointz.identify.preparation.sources import FRICTION_OF_MODEL, Source
from jointz.identify.walking.posterior import LegPosterior
from jointz.identify.walking.prior import LAG_MODEL_S
from jointz.results.estimates import REACH_95, ParameterEstimate

#: Error of the friction in a torque model, as a share; its spread is that of unknown friction.
_FRICTION_ERROR = 0.1
#: Of the joint's velocity that the gyroscope on the thigh tells.
_THIGH_SHARE = 0.4


def instrument_priors(
    known: CalibrationSpec, friction_nm: float, sensors: Sequence[str]
) -> dict[str, AnyPrior]:
    """Return priors of what torque model and calibration tell, instead of the usual ones.

    ``friction_nm`` is the usual size of the friction that the torque model subtracts, 0 without.
    """
    return _of_torque_model(known, friction_nm) | _of_sensors(known, sensors)


def friction_of_model(sources: Sequence[Source]) -> float:
    """Return the usual size of the friction that the torque model subtracts, N*m; 0 without."""
    frictions = [
        np.abs(s.input.recording[FRICTION_OF_MODEL].to_numpy())
        for s in sources
        if FRICTION_OF_MODEL in s.input.recording
    ]
    return float(np.nanmedian(np.concatenate(frictions))) if frictions else 0.0


def _of_torque_model(known: CalibrationSpec, friction_nm: float) -> dict[str, AnyPrior]:
    """Return the prior of the friction that the torque model leaves."""
    if not friction_nm > 0.0:
        return {}
    gain = known.friction_gain
    error = _FRICTION_ERROR if gain is None else max(gain.sd / gain.value, 1e-3)
    return {"friction_nm": LogPrior(median=error * friction_nm, log_sd=0.7)}


def _of_sensors(known: CalibrationSpec, sensors: Sequence[str]) -> dict[str, NormalPrior]:
    """Return priors of calibrated sensors, less their values, which the signals are free of."""
    priors = {}
    if not sensors:  # the error of its gain is one of all values
        priors["goniometer_gain"] = _about_zero(0.0)
    elif known.angle_gain is not None:
        priors["goniometer_gain"] = _about_zero(relative_sd(known.angle_gain))
    for sensor in sensors:
        name, channel = _names_of(sensor)
        lag = _behind_torque(sensor_lag(known, channel), known)
        gain = getattr(known, f"{channel}_gain")
        if lag is not None:
            priors[f"{name}_delay_s"] = _about_zero(lag.sd)
        if gain is not None:
            priors[f"{name}_gain"] = _about_zero(relative_sd(gain))
    return priors


def _about_zero(sd: float) -> NormalPrior:
    return NormalPrior(mean=0.0, sd=max(sd, 1e-4))


def calibrated_lag(known: CalibrationSpec) -> Calibrated | None:
    """Return the calibrated lag of the angle behind the torque, which was shifted by its own."""
    return _behind_torque(known.angle_lag_s, known)


def _behind_torque(lag: Calibrated | None, known: CalibrationSpec) -> Calibrated | None:
    """Return a lag with the error of the torque's lag."""
    if lag is None:
        return None
    sd = float(np.hypot(lag.sd, calibration_sd(known.torque_lag_s)))
    return Calibrated(value=lag.value, sd=sd)


def lags_of_instruments(
    posterior: LegPosterior, known: CalibrationSpec
) -> Iterator[ParameterEstimate]:
    """Yield the lags of the goniometer and of further sensors, calibrated part included."""
    yield _lag("angle", posterior.lag_moments(), calibrated_lag(known), LAG_MODEL_S)
    for sensor in posterior.model.layout.sensors:
        name, channel = _names_of(sensor)
        stated, model_sd = _behind_torque(sensor_lag(known, channel), known), LAG_MODEL_S
        mean, sd = posterior.shared_moments(f"{name}_delay_s")
        if sensor == JOINT_VELOCITY:
            thigh = calibration_sd(sensor_lag(known, THIGH_VELOCITY))
            model_sd = float(np.hypot(model_sd, _THIGH_SHARE * thigh))
        yield _lag(sensor, (value_of(stated, 0.0) + mean, sd), stated, model_sd)


def _lag(
    sensor: str, moments: tuple[float, float], stated: Calibrated | None, model_sd: float
) -> ParameterEstimate:
    """Return a sensor's lag: that of the fit, less the error of the model.

    A calibration tells how much of the fit's lag that error is.
    """
    lag, sd = moments
    share = 1.0 if stated is None else stated.sd**2 / (stated.sd**2 + model_sd**2)
    if stated is not None:
        lag = share * lag + (1.0 - share) * stated.value
    reach = REACH_95 * float(np.hypot(share * sd, np.sqrt(share) * model_sd))
    return ParameterEstimate(f"{sensor}_lag", lag, lag - reach, lag + reach, "ok")


def _names_of(sensor: str) -> tuple[str, str]:
    """Return the name of a sensor's parameters, and the channel of its calibration."""
    name = "encoder" if sensor == ENCODER else "gyroscope"
    return name, SHANK_VELOCITY if sensor == JOINT_VELOCITY else sensor
