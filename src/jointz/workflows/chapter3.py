"""Chapter III again: the quasi-direct-drive actuator on its bench, printed beside ours."""

from collections.abc import Mapping
from pathlib import Path
from statistics import fmean, stdev
from typing import Any, Literal

import numpy as np
import xarray as xr
from scipy.signal import butter, sosfiltfilt

from jointz.core.actuator_fit import ActuatorFit
from jointz.core.events import PulseEstimate
from jointz.core.reproduction import Compared, ComparedTable
from jointz.identify.actuator import identify_actuator
from jointz.io.study import open_study
from jointz.reference import chapter3
from jointz.workflows.analysis import analyze

_MODELS: Mapping[str, Literal["current", "motor", "friction"]] = {
    "3.1": "current",
    "3.2": "motor",
    "3.3": "friction",
}
_UNITS = {
    "bias": "N*m",
    "torque_constant": "N*m/A",
    "viscous_friction": "N*m*s/rad",
    "coulomb_friction": "N*m",
    "gear_friction": "N*m/A",
    "rotor_inertia": "kg*m^2",
}
_GEAR = chapter3.TORQUE_MODELS["3.3"]["gear_ratio"].value
_INERTIA = chapter3.TORQUE_MODELS["3.3"]["rotor_inertia"].value
#: Of the acceleration, which is differentiated velocity.
_ACCELERATION_HZ = 40.0
#: Of the dither test (3.2.3), and what its filter spoils at both ends.
_DITHER_HZ = 5.0**0.5
_DITHER_EDGE_S = 2.0
_SHOWN = 3000


def recorded(study: Path) -> xr.Dataset:
    """Return the one recording of a protocol.

    Parameters
    ----------
    study : pathlib.Path
        Of the protocol.
    """
    (entry,) = open_study(study).spec.recordings
    # As it was written: a motor that turns for ever has no joint's angle to be checked.
    return xr.load_dataset(study / entry.file, engine="h5netcdf")


def torque_models(
    levels: xr.Dataset, truth: Mapping[str, float]
) -> tuple[ComparedTable, dict[str, Any], ActuatorFit]:
    """Return table 3.1 beside ours, what figure 3.3 draws, and model 3.3 as fitted.

    Parameters
    ----------
    levels : xarray.Dataset
        Of ``qdd-torque-speed``.
    truth : mapping of str to float
        Constants as the torque sensor of the simulated bench would read them.
    """
    signals = {
        "current": levels["current"].to_numpy(),
        "velocity": levels["motor_velocity"].to_numpy(),
        "torque": levels["sensor_torque"].to_numpy(),
        "time": levels["time"].to_numpy(),
    }
    rows, drawn, fits = [], {}, {}
    for number, model in _MODELS.items():
        given = _INERTIA if model == "friction" else None
        fit = identify_actuator(signals, gear_ratio=_GEAR, model=model, rotor_inertia=given)
        fits[number] = fit
        drawn[number] = _thin(modelled(levels, fit, given))
        rows += _model_rows(number, fit, truth)
    table = ComparedTable(
        "torque_models",
        "Torque models (table 3.1)",
        "Seven torques by six speeds. The dissertation's method is least squares; recommended is "
        "the same with an interval from blocks of the record. The inertia of model 3.3 is given, "
        "from earlier work. Truth: the constants of the simulated motor as its torque sensor, "
        "calibrated to half a percent, reads them.",
        tuple(rows),
    )
    curves = {
        "time_s": _thin(signals["time"]),
        "speed_rad_s": _thin(signals["velocity"]),
        "sensor_nm": _thin(signals["torque"]),
        "models": drawn,
    }
    return table, curves, fits["3.3"]


def _model_rows(number: str, fit: ActuatorFit, truth: Mapping[str, float]) -> list[Compared]:
    printed = chapter3.TORQUE_MODELS[number]
    rms = chapter3.TORQUE_RMS[number]
    rows = []
    for p in fit.parameters:
        told = printed.get(p.name)
        rows.append(
            Compared(
                quantity=f"model {number}: {p.name.replace('_', ' ')}",
                unit=_UNITS[p.name],
                printed=told.value if told else None,
                dissertation=p.value,
                recommended=p.value if number == "3.3" else None,
                recommended_low=p.ci_low if number == "3.3" else None,
                recommended_high=p.ci_high if number == "3.3" else None,
                truth=truth.get(p.name) if number == "3.3" else None,
                note=told.note if told else "",
            )
        )
    rows.append(
        Compared(
            quantity=f"model {number}: RMS error",
            unit="N*m",
            printed=rms.value,
            dissertation=fit.rms_error_nm,
            recommended=fit.rms_error_nm if number == "3.3" else None,
        )
    )
    return rows


def modelled(recording: xr.Dataset, fit: ActuatorFit, inertia: float | None) -> np.ndarray:
    """Return the torque that a fitted model makes of current and velocity, N*m.

    Parameters
    ----------
    recording : xarray.Dataset
        With ``current`` and ``motor_velocity``.
    fit : ActuatorFit
        The model.
    inertia : float or None, kg*m^2
        Given; the fitted one by default.
    """
    values = {p.name: p.value or 0.0 for p in fit.parameters}
    current, velocity = recording["current"].to_numpy(), recording["motor_velocity"].to_numpy()
    time = recording["time"].to_numpy()
    rate_hz = (time.size - 1) / (time[-1] - time[0])
    friction = values.get("coulomb_friction", 0.0) + values.get("gear_friction", 0.0) * np.abs(
        current
    )
    torque = values["bias"] + _GEAR * values["torque_constant"] * current
    torque = torque - friction * np.sign(velocity)
    torque = torque - values.get("viscous_friction", 0.0) * velocity
    used = values.get("rotor_inertia", 0.0) if inertia is None else inertia
    if used:
        smooth = _low_passed(velocity, _ACCELERATION_HZ, rate_hz)
        torque = torque - used * np.gradient(smooth, 1.0 / rate_hz)
    return np.asarray(torque)


def _low_passed(values: np.ndarray, cutoff_hz: float, rate_hz: float) -> np.ndarray:
    return np.asarray(sosfiltfilt(butter(4, cutoff_hz, fs=rate_hz, output="sos"), values))


def chirp(recording: xr.Dataset, fit: ActuatorFit) -> tuple[ComparedTable, dict[str, Any]]:
    """Return the RMS error along chirps (figure 3.4).

    Parameters
    ----------
    recording : xarray.Dataset
        Of ``qdd-chirp``.
    fit : ActuatorFit
        Model 3.3.
    """
    torque, sensor = modelled(recording, fit, _INERTIA), recording["sensor_torque"].to_numpy()
    time = recording["time"].to_numpy() - float(recording["time"][0])
    rms = float(np.sqrt(np.mean((torque - sensor) ** 2)))
    # Beside the dissertation's own check, one without the sensor's white noise.
    rate_hz = (time.size - 1) / time[-1]
    smooth = _low_passed(torque - sensor, _ACCELERATION_HZ, rate_hz)
    table = ComparedTable(
        "chirp",
        "Torque tracking along chirps (3.3.1, figure 3.4)",
        "Model 3.3 with the constants above against the torque sensor. Recommended: the error "
        f"below {_ACCELERATION_HZ:g} Hz, without the sensor's white noise.",
        (
            Compared(
                quantity="RMS error, chirps",
                unit="N*m",
                printed=chapter3.CHIRP_RMS.value,
                dissertation=rms,
                recommended=float(np.sqrt(np.mean(smooth**2))),
                note=chapter3.CHIRP_RMS.note,
            ),
        ),
    )
    ends = np.arange(0.0, 41.0, 10.0)
    curves = {
        "time_s": time.tolist(),
        "sensor_nm": sensor.tolist(),
        "model_nm": torque.tolist(),
        "segments": [
            [float(a), float(b), size]
            for a, b, size in zip(ends[:-1], ends[1:], (5.0, 7.0, 10.0, 0.0), strict=True)
        ],
    }
    return table, curves


def static_stiffness(
    recording: xr.Dataset, fit: ActuatorFit, truth: float
) -> tuple[ComparedTable, dict[str, Any]]:
    """Return the stiffness with a locked output (3.3.2, figure 3.5).

    Parameters
    ----------
    recording : xarray.Dataset
        Of ``qdd-static``.
    fit : ActuatorFit
        Model 3.3.
    truth : float, N*m/rad
        Of the spring.
    """
    angle, sensor = recording["angle"].to_numpy(), recording["sensor_torque"].to_numpy()
    torque = modelled(recording, fit, _INERTIA)
    by_sensor, by_model = _slope(angle, sensor), _slope(angle, torque)
    ours = _stiffness_with_friction(recording, fit)
    table = ComparedTable(
        "static",
        "Stiffness with a locked output (3.3.2, figure 3.5)",
        "Slow sine of torque. The dissertation's method: slope of the modelled torque over the "
        "angle, against that of the torque sensor. Recommended: friction estimated in the same "
        "record, one constant a direction of the command, because the sign of so slow a velocity "
        "says little.",
        (
            Compared("stiffness by the torque sensor", "N*m/rad", None, by_sensor, None, truth),
            Compared(
                quantity="stiffness by the model",
                unit="N*m/rad",
                dissertation=by_model,
                recommended=ours,
                truth=truth,
                note="motion is so slow that friction is not fully there: a constant a direction "
                "takes too much of it, the sign of a noisy velocity too little",
            ),
            Compared(
                quantity="difference from the torque sensor",
                unit="%",
                printed=chapter3.STATIC_STIFFNESS_ERROR.value,
                dissertation=100.0 * (by_model / by_sensor - 1.0),
                recommended=100.0 * (ours / by_sensor - 1.0),
                note="printed without a sign",
            ),
        ),
    )
    curves = {
        "deflection_rad": _thin(angle),
        "sensor_nm": _thin(sensor),
        "model_nm": _thin(torque),
        "sensor_stiffness": by_sensor,
        "model_stiffness": by_model,
    }
    return table, curves


def _slope(x: np.ndarray, y: np.ndarray) -> float:
    return float(np.polyfit(x, y, 1)[0])


def _stiffness_with_friction(recording: xr.Dataset, fit: ActuatorFit) -> float:
    angle, current = recording["angle"].to_numpy(), recording["current"].to_numpy()
    way = np.sign(np.gradient(recording["reference"].to_numpy()))
    constant = next(p.value for p in fit.parameters if p.name == "torque_constant") or 0.0
    columns = np.stack([angle, way, way * np.abs(current), np.ones(angle.size)], axis=1)
    values, *_ = np.linalg.lstsq(columns, _GEAR * constant * current, rcond=None)
    return float(values[0])


def dither_stiffness(recording: xr.Dataset, fit: ActuatorFit, truth: float) -> ComparedTable:
    """Return the stiffness in motion, both sides moving (3.3.3).

    Parameters
    ----------
    recording : xarray.Dataset
        Of ``qdd-dither``.
    fit : ActuatorFit
        Model 3.3.
    truth : float, N*m/rad
        Of the spring.
    """
    time = recording["time"].to_numpy()
    rate_hz = (time.size - 1) / (time[-1] - time[0])
    edge = round(_DITHER_EDGE_S * rate_hz)
    deflection = recording["angle"].to_numpy() - recording["position"].to_numpy()
    slow = [
        _low_passed(values, _DITHER_HZ, rate_hz)[edge:-edge]
        for values in (
            deflection,
            recording["sensor_torque"].to_numpy(),
            modelled(recording, fit, _INERTIA),
        )
    ]
    printed = chapter3.DITHER_STIFFNESS
    return ComparedTable(
        "dither",
        "Stiffness of the bench in motion (3.3.3)",
        "Low-passed at the square root of 5 Hz, torque over deflection. The independent "
        "characterisation is by the torque sensor.",
        (
            Compared(
                quantity="stiffness, dither",
                unit="N*m/rad",
                printed=printed.value,
                dissertation=_slope(slow[0], slow[1]),
                recommended=_slope(slow[0], slow[1]),
                truth=truth,
                note=printed.note,
            ),
            Compared(
                quantity="the same by the torque model",
                unit="N*m/rad",
                dissertation=_slope(slow[0], slow[2]),
                truth=truth,
            ),
        ),
    )


def perturbation(study: Path, dither: float, truth: float) -> tuple[ComparedTable, dict[str, Any]]:
    """Return the stiffness out of pulses along a knee trajectory (3.3.3, figure 3.6).

    Parameters
    ----------
    study : pathlib.Path
        Of ``qdd-perturbation``.
    dither, truth : float, N*m/rad
        The independent characterisation, and the spring's.
    """
    analysis = analyze(study, method="recommended", resamples=1000)
    means = {sign: _of_sign(analysis.single, sign) for sign in (1, -1)}
    printed = {1: chapter3.POSITIVE_PULSE_STIFFNESS, -1: chapter3.NEGATIVE_PULSE_STIFFNESS}
    names = {1: "positive", -1: "negative"}
    ours = analysis.cells[0].parameter("stiffness")
    rows = [
        Compared(
            quantity=f"stiffness, {names[sign]} pulses",
            unit="N*m/rad",
            printed=printed[sign].value,
            printed_sd=printed[sign].sd,
            dissertation=means[sign][0],
            dissertation_sd=means[sign][1],
            truth=truth,
        )
        for sign in (1, -1)
    ]
    errors = [100.0 * (means[sign][0] / dither - 1.0) for sign in (1, -1)]
    number = chapter3.DYNAMIC_STIFFNESS_ERROR
    rows += [
        Compared(
            quantity="stiffness, all pulses",
            unit="N*m/rad",
            dissertation=fmean(m for m, _ in means.values()),
            recommended=ours.value if ours else None,
            recommended_low=ours.ci_low if ours else None,
            recommended_high=ours.ci_high if ours else None,
            truth=truth,
            note=f"recommended is {analysis.cells[0].method} here",
        ),
        Compared(
            quantity="average error against the dither test",
            unit="%",
            printed=number.value,
            dissertation=fmean(abs(e) for e in errors),
            recommended=(
                100.0 * abs(ours.value / dither - 1.0) if ours and ours.value is not None else None
            ),
            note=number.note,
        ),
    ]
    table = ComparedTable(
        "perturbation",
        "Stiffness out of pulses on a moving bench (3.3.3, figure 3.6)",
        "Torque from the current by model 3.3. The dissertation's method: every pulse by least "
        "squares over 100 ms of the perturbed minus the unperturbed trial; after the plus-minus "
        "sign the standard deviation over pulses.",
        tuple(rows),
    )
    curves = {
        "dither": dither,
        "positive": {"mean": means[1][0], "sd": means[1][1]},
        "negative": {"mean": means[-1][0], "sd": means[-1][1]},
        "printed": {
            "dither": chapter3.DITHER_STIFFNESS.value,
            "positive": [printed[1].value, printed[1].sd],
            "negative": [printed[-1].value, printed[-1].sd],
        },
        "truth": truth,
    }
    if ours and ours.value is not None:
        curves["recommended"] = {
            "value": ours.value,
            "ci_low": ours.ci_low,
            "ci_high": ours.ci_high,
        }
    return table, curves


def _of_sign(single: tuple[PulseEstimate, ...], sign: int) -> tuple[float, float]:
    values = [p.stiffness for p in single if p.sign == sign]
    return fmean(values), stdev(values)


def other_devices() -> ComparedTable:
    """Return what the dissertation compares itself with (3.4)."""
    return ComparedTable(
        "other_devices",
        "Other devices (3.4)",
        "Largest errors of others as the dissertation prints them, with its own citation numbers.",
        tuple(
            Compared(
                quantity=f"{d.quantity} [{', '.join(map(str, d.citations))}]",
                unit=d.unit,
                printed=d.high,
                note=d.note,
            )
            for d in chapter3.OTHER_DEVICES
        ),
    )


def _thin(values: np.ndarray) -> list[float]:
    every = max(1, values.size // _SHOWN)
    thinned: list[float] = values[::every].tolist()
    return thinned
