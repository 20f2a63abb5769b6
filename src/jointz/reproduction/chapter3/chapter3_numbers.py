"""Chapter III again: the torque of the quasi-direct-drive actuator, printed beside ours."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
import xarray as xr
from scipy.signal import butter, sosfiltfilt

from jointz.identify.actuators.actuator import identify_actuator
from jointz.io.study_reader import open_study
from jointz.reference import chapter3
from jointz.reproduction.reproduction_tables import Compared, ComparedTable
from jointz.results.bench.actuator_fit import ActuatorFit

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
#: Of model 3.3, not fitted.
GEAR = chapter3.TORQUE_MODELS["3.3"]["gear_ratio"].value
INERTIA = chapter3.TORQUE_MODELS["3.3"]["rotor_inertia"].value
#: Of the acceleration, which is differentiated velocity.
_ACCELERATION_HZ = 40.0
_SHOWN = 3000


def recorded(study: Path) -> xr.Dataset:
    """Return the one recording of a protocol."""
    (entry,) = open_study(study).spec.recordings
    # As it was written: a motor that turns for ever has no joint's angle to be checked.
    return xr.load_dataset(study / entry.file, engine="h5netcdf")


def torque_models(
    levels: xr.Dataset, truth: Mapping[str, float]
) -> tuple[ComparedTable, dict[str, Any], ActuatorFit]:
    """Return table 3.1 beside ours, what figure 3.3 draws, and model 3.3 as fitted."""
    signals = {
        "current": levels["current"].to_numpy(),
        "velocity": levels["motor_velocity"].to_numpy(),
        "torque": levels["sensor_torque"].to_numpy(),
        "time": levels["time"].to_numpy(),
    }
    rows, drawn, rms, fits = [], {}, {}, {}
    for number, model in _MODELS.items():
        given = INERTIA if model == "friction" else None
        fit = identify_actuator(signals, gear_ratio=GEAR, model=model, rotor_inertia=given)
        fits[number] = fit
        drawn[number] = thin(modelled(levels, fit, given))
        rms[number] = fit.rms_error_nm
        rows += _model_rows(number, fit, truth)
    table = ComparedTable(
        "torque_models",
        "Torque models (table 3.1)",
        "Seven torques by six speeds. The dissertation's method is least squares; recommended is "
        "the same with an interval from blocks of the record. The inertia of model 3.3 is given, "
        "from earlier work. Models 3.1 and 3.2 lack friction, so that no constant of theirs is "
        "the motor's and the intervals hold what the record tells of the model, not of the motor. "
        "Truth: the constants of the simulated motor as its torque sensor, "
        "calibrated to half a percent, reads them.",
        tuple(rows),
    )
    curves = {
        "time_s": thin(signals["time"]),
        "speed_rad_s": thin(signals["velocity"]),
        "sensor_nm": thin(signals["torque"]),
        "models": drawn,
        "rms_nm": rms,
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
                recommended=p.value,
                recommended_low=p.ci_low,
                recommended_high=p.ci_high,
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
            recommended=fit.rms_error_nm,
        )
    )
    return rows


def modelled(recording: xr.Dataset, fit: ActuatorFit, inertia: float | None) -> np.ndarray:
    """Return the torque that a fitted model makes of current and velocity, N*m."""
    values = {p.name: p.value or 0.0 for p in fit.parameters}
    current, velocity = recording["current"].to_numpy(), recording["motor_velocity"].to_numpy()
    time = recording["time"].to_numpy()
    rate_hz = (time.size - 1) / (time[-1] - time[0])
    friction = values.get("coulomb_friction", 0.0) + values.get("gear_friction", 0.0) * np.abs(
        current
    )
    torque = values["bias"] + GEAR * values["torque_constant"] * current
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
    """Return the RMS error along chirps (figure 3.4)."""
    torque, sensor = modelled(recording, fit, INERTIA), recording["sensor_torque"].to_numpy()
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


def thin(values: np.ndarray) -> list[float]:
    """Return as many values as a figure can show."""
    every = max(1, values.size // _SHOWN)
    thinned: list[float] = values[::every].tolist()
    return thinned
