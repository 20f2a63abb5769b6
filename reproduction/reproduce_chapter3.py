"""Chapter III: torque models and stiffness of the quasi-direct-drive actuator's bench."""

import tempfile
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from statistics import fmean, stdev
from typing import Any, Literal, NamedTuple

import numpy as np
import xarray as xr
from scipy.signal import butter, sosfiltfilt

from jointz.analysis.analyze import analyze
from jointz.core.channels import PARAMETER_UNITS
from jointz.core.errors import DataError
from jointz.identify.actuators.actuator import identify_actuator
from jointz.identify.bench.dither_stiffness import identify_dither_stiffness
from jointz.identify.bench.paired_runs import identify_paired_runs
from jointz.identify.bench.static_stiffness import identify_static_stiffness
from jointz.identify.preparation.conditioning import torque_from_current
from jointz.io.study_reader import open_study
from jointz.kernels.filtering import lowpass_zero_phase
from jointz.reference import Printed, chapter3
from jointz.results.bench.actuator_fit import ActuatorFit
from jointz.results.bench.paired_runs_fit import PairedRunsFit
from jointz.results.bench.stiffness_fit import StiffnessFit
from jointz.results.estimates import ParameterEstimate
from jointz.tasks.engine import Task
from jointz.tasks.progress import Progress
from reproduction import literature, printed_numbers
from reproduction.chapter_runs import in_processes, run_study, study_truth
from reproduction.printed_settings import MODEL, SENSOR_NOISE, SPRING, printed_settings
from reproduction.reproduction_result import Reproduction
from reproduction.reproduction_tables import (
    Compared,
    ComparedTable,
    audit_claims,
    compare,
    compared_table,
    device_table,
)

_PROTOCOLS = ("qdd-torque-speed", "qdd-chirp", "qdd-static", "qdd-dither", "qdd-perturbation")
_MODELS: Mapping[str, Literal["current", "motor", "friction"]] = {
    "3.1": "current",
    "3.2": "motor",
    "3.3": "friction",
}
#: Of model 3.3, not fitted.
_GEAR = chapter3.TORQUE_MODELS["3.3"]["gear_ratio"].value
_INERTIA = chapter3.TORQUE_MODELS["3.3"]["rotor_inertia"].value
#: Of the acceleration, which is differentiated velocity.
_ACCELERATION_HZ = 40.0
_SHOWN = 3000
#: Low-pass of the dither test (3.2.3), and the slow sine of torque that it leaves.
_SLOW_HZ = 5.0**0.5
_TORQUE_HZ = 0.1
_TWO_SIDED_Z = 1.96
_UNIT = "N*m/rad"
_SIGNS = {"positive": 1, "negative": -1}


class BenchRecord(NamedTuple):
    """A recording of the bench with the torque of model 3.3."""

    recording: xr.Dataset
    modelled: np.ndarray  # torque of the model, N*m
    torque_per_current: float  # at the output, N*m/A

    def channel(self, name: str) -> np.ndarray:
        """Return a channel as an array."""
        return np.asarray(self.recording[name].to_numpy())


def thin(values: np.ndarray) -> list[float]:
    """Return as many values as a figure can show."""
    every = max(1, values.size // _SHOWN)
    thinned: list[float] = values[::every].tolist()
    return thinned


def reproduce_chapter3(seed: int, preset: str, tell: Progress) -> Reproduction:
    """Run the protocols of chapter III on the simulated bench and set the numbers beside."""
    with tempfile.TemporaryDirectory() as folder:
        tasks = [Task(name, partial(run_study, folder, name, seed, preset)) for name in _PROTOCOLS]
        studies: dict[str, Path] = dict(in_processes(tasks, tell))
        truth = study_truth(studies["qdd-static"], "springs")
        spring, gain_sd = truth["load"]["stiffness"], truth["errors"]["sensor_gain_sd"]
        models, model_curves, fit = torque_models(
            _recording(studies["qdd-torque-speed"]), _as_sensed(truth)
        )
        chirp_table, chirp_curves = chirp(_recording(studies["qdd-chirp"]), fit)
        static, static_curves = static_stiffness(
            _bench_record(studies["qdd-static"], fit), spring, gain_sd=gain_sd
        )
        dither = dither_stiffness(
            _bench_record(studies["qdd-dither"], fit), spring, gain_sd=gain_sd
        )
        by_sensor = dither.rows[0].dissertation or spring
        pulses, pulse_curves = perturbation(studies["qdd-perturbation"], by_sensor, spring)
    settings = printed_settings(3, preset)
    devices = device_table(3, literature.DEVICES_3)
    return Reproduction.of_chapter(
        3,
        (settings, models, chirp_table, static, dither, pulses, devices, audit_claims(3)),
        {
            "torque_models": model_curves,
            "chirp": chirp_curves,
            "static": static_curves,
            "perturbation": pulse_curves,
        },
        seed=seed,
        preset=preset,
    )


def _recording(study: Path) -> xr.Dataset:
    """Return the one recording of a protocol."""
    (entry,) = open_study(study).spec.recordings
    # As it was written: a motor that turns for ever has no joint's angle to be checked.
    return xr.load_dataset(study / entry.file, engine="h5netcdf")


def _bench_record(study: Path, fit: ActuatorFit) -> BenchRecord:
    recording = _recording(study)
    constant = _GEAR * (fit.parameter("torque_constant").value or 0.0)
    return BenchRecord(recording, modelled(recording, fit, _INERTIA), constant)


def _as_sensed(truth: Mapping[str, Any]) -> dict[str, float]:
    """Return the motor's constants as the torque sensor, with its gain, reads them."""
    machine, errors, gain = truth["machine"], truth["errors"], truth["sensor_gain"]
    constant = machine["torque_constant"] * (1.0 + errors["torque_constant_error"])
    names = ("coulomb_friction", "gear_friction", "rotor_inertia")
    return {
        "bias": errors["sensor_bias_nm"],
        "torque_constant": gain * constant,
        **{name: gain * machine[name] for name in names},
    }


# --- torque models (table 3.1, figure 3.3) -------------------------------------------------------


def torque_models(
    levels: xr.Dataset, truth: Mapping[str, float]
) -> tuple[ComparedTable, dict[str, Any], ActuatorFit]:
    """Return table 3.1 beside ours, what figure 3.3 draws, and model 3.3 as fitted."""
    channels = {
        "current": "current",
        "velocity": "motor_velocity",
        "torque": "sensor_torque",
        "time": "time",
    }
    signals = {name: levels[channel].to_numpy() for name, channel in channels.items()}
    rows, torques, fits = [], {}, {}
    for number, model in _MODELS.items():
        inertia = _INERTIA if model == "friction" else None
        fit = identify_actuator(signals, gear_ratio=_GEAR, model=model, rotor_inertia=inertia)
        fits[number] = fit
        torques[number] = thin(modelled(levels, fit, inertia))
        rows += _model_rows(number, fit, truth if number == "3.3" else {})
    curves = {
        "time_s": thin(signals["time"]),
        "speed_rad_s": thin(signals["velocity"]),
        "sensor_nm": thin(signals["torque"]),
        "models": torques,
        "rms_nm": {number: fit.rms_error_nm for number, fit in fits.items()},
    }
    return compared_table(3, "torque_models", rows), curves, fits["3.3"]


def _model_rows(number: str, fit: ActuatorFit, truth: Mapping[str, float]) -> list[Compared]:
    printed = chapter3.TORQUE_MODELS[number]
    rows = [
        compare(
            f"model {number}: {p.name.replace('_', ' ')}",
            PARAMETER_UNITS[p.name],
            printed.get(p.name),
            p.value,
            p,
            truth=truth.get(p.name),
            built_in=MODEL,
        )
        for p in fit.parameters
    ]
    error, rms = fit.rms_error_nm, chapter3.TORQUE_RMS[number]
    return [*rows, compare(f"model {number}: RMS error", "N*m", rms, error, error, built_in=MODEL)]


def modelled(recording: xr.Dataset, fit: ActuatorFit, inertia: float | None) -> np.ndarray:
    """Return the torque that a fitted model makes of current and velocity, N*m."""
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
        torque = torque - used * np.gradient(_low_passed(velocity, rate_hz), 1.0 / rate_hz)
    return np.asarray(torque)


def _low_passed(values: np.ndarray, rate_hz: float) -> np.ndarray:
    sections = butter(4, _ACCELERATION_HZ, fs=rate_hz, output="sos")
    return np.asarray(sosfiltfilt(sections, values))


def chirp(recording: xr.Dataset, fit: ActuatorFit) -> tuple[ComparedTable, dict[str, Any]]:
    """Return the RMS error along chirps (figure 3.4)."""
    torque, sensor = modelled(recording, fit, _INERTIA), recording["sensor_torque"].to_numpy()
    time = recording["time"].to_numpy() - float(recording["time"][0])
    rms = float(np.sqrt(np.mean((torque - sensor) ** 2)))
    # Beside the dissertation's own check, one without the sensor's white noise.
    smooth = _low_passed(torque - sensor, (time.size - 1) / time[-1])
    smooth_rms = float(np.sqrt(np.mean(smooth**2)))
    row = compare(
        "RMS error, chirps",
        "N*m",
        printed_numbers.CHIRP_RMS,
        rms,
        smooth_rms,
        built_in=SENSOR_NOISE,
    )
    curves = {
        "time_s": time.tolist(),
        "sensor_nm": sensor.tolist(),
        "model_nm": torque.tolist(),
        "segments": [[0.0, 10.0, 5.0], [10.0, 20.0, 7.0], [20.0, 30.0, 10.0], [30.0, 40.0, 0.0]],
    }
    return compared_table(3, "chirp", (row,), cutoff_hz=_ACCELERATION_HZ), curves


# --- stiffness of the bench (3.3.2, 3.3.3) -------------------------------------------------------


def static_stiffness(
    record: BenchRecord, truth: float, *, gain_sd: float
) -> tuple[ComparedTable, dict[str, Any]]:
    """Return the stiffness with a locked output (3.3.2, figure 3.5)."""
    angle, sensor, time = (record.channel(name) for name in ("angle", "sensor_torque", "time"))
    torques = {"sensor": sensor, "model": record.modelled}
    fits = {
        name: identify_static_stiffness(angle=angle, torque=torque, time=time)
        for name, torque in torques.items()
    }
    by_sensor, by_model = (_value(fit) for fit in fits.values())
    rate_hz = (time.size - 1) / (time[-1] - time[0])
    # Not the command's: the spring stands for a while after the command has turned.
    motion = np.gradient(lowpass_zero_phase(angle, cutoff_hz=_SLOW_HZ, rate_hz=rate_hz))
    ours = identify_static_stiffness(
        angle=angle,
        torque=record.torque_per_current * record.channel("current"),
        time=time,
        direction=motion,
    )
    known = _value(ours)
    rows = (
        compare(
            "stiffness by the torque sensor",
            _UNIT,
            dissertation=by_sensor,
            recommended=(by_sensor, *_interval(fits["sensor"].stiffness, gain_sd)),
            truth=truth,
        ),
        compare(
            "stiffness by the model",
            _UNIT,
            dissertation=by_model,
            recommended=(known, *_interval(ours.stiffness, gain_sd)),
            truth=truth,
            note="cogging, and friction that so slow a motion has only in part, leave the "
            "recommended one 0.1 to 0.9 % high (10 seeds)",
        ),
        compare(
            "size of the difference from the torque sensor",
            "%",
            chapter3.STATIC_STIFFNESS_ERROR,
            100.0 * abs(by_model / by_sensor - 1.0),
            100.0 * abs(known / by_sensor - 1.0),
        ),
    )
    curves: dict[str, Any] = {"deflection_rad": thin(angle)}
    for name, torque in torques.items():
        curves |= {f"{name}_nm": thin(torque), f"{name}_stiffness": _value(fits[name])}
    return compared_table(3, "static", rows), curves


def _value(fit: StiffnessFit) -> float:
    """Return the stiffness, decided or not: the page prints what the method gives."""
    stiffness = fit.stiffness
    value = stiffness.value if stiffness.value is not None else stiffness.unbounded
    return float("nan") if value is None else value


def _interval(stiffness: ParameterEstimate, gain_sd: float) -> tuple[float | None, float | None]:
    """Return the interval of a stiffness, the sd of the torque's gain added to it."""
    if stiffness.value is None or stiffness.ci_low is None or stiffness.ci_high is None:
        return None, None
    half = 0.5 * (stiffness.ci_high - stiffness.ci_low)
    wider = float(np.hypot(half, _TWO_SIDED_Z * gain_sd * stiffness.value))
    return stiffness.value - wider, stiffness.value + wider


def dither_stiffness(record: BenchRecord, truth: float, *, gain_sd: float) -> ComparedTable:
    """Return the stiffness in motion, both sides moving (3.3.3)."""
    time, sensor = record.channel("time"), record.channel("sensor_torque")
    deflection = record.channel("angle") - record.channel("position")
    by_sensor, by_model = (
        _value(
            identify_static_stiffness(
                angle=deflection, torque=torque, time=time, cutoff_hz=_SLOW_HZ
            )
        )
        for torque in (sensor, record.modelled)
    )
    ours = identify_dither_stiffness(
        angle=deflection, torque=sensor, time=time, frequency_hz=_TORQUE_HZ
    ).stiffness
    rows = (
        compare(
            "stiffness, dither",
            _UNIT,
            chapter3.DITHER_STIFFNESS,
            by_sensor,
            (ours.value, *_interval(ours, gain_sd)),
            truth=truth,
            built_in=SPRING,
        ),
        compare("the same by the torque model", _UNIT, dissertation=by_model, truth=truth),
    )
    return compared_table(3, "dither", rows)


def perturbation(study: Path, dither: float, truth: float) -> tuple[ComparedTable, dict[str, Any]]:
    """Return the stiffness out of pulses along a knee trajectory (3.3.3, figure 3.6)."""
    analysis = analyze(study, method="recommended", resamples=1000)
    pulses = _paired_runs(study).pulses
    values = {name: [p.stiffness for p in pulses if p.sign == s] for name, s in _SIGNS.items()}
    means = {name: (fmean(group), stdev(group)) for name, group in values.items()}
    printed = {
        "positive": printed_numbers.POSITIVE_PULSE_STIFFNESS,
        "negative": printed_numbers.NEGATIVE_PULSE_STIFFNESS,
    }
    ours = analysis.cells[0].parameter("stiffness")
    value = ours.value if ours else None
    errors = [100.0 * (mean / dither - 1.0) for mean, _ in means.values()]
    given: dict[str, Any] = {"truth": truth, "built_in": SPRING}
    rows = [
        *(
            compare(f"stiffness, {name} pulses", _UNIT, number, means[name], **given)
            for name, number in printed.items()
        ),
        compare(
            "negative over positive pulses",
            "",
            Printed(round(printed["negative"].value / printed["positive"].value, 3)),
            means["negative"][0] / means["positive"][0],
        ),
        compare(
            "stiffness, all pulses",
            _UNIT,
            dissertation=fmean(mean for mean, _ in means.values()),
            recommended=ours,
            truth=truth,
            note=f"recommended: method {analysis.cells[0].method}",
        ),
        compare(
            "average error against the dither test",
            "%",
            printed_numbers.DYNAMIC_STIFFNESS_ERROR,
            fmean(map(abs, errors)),
            None if value is None else 100.0 * abs(value / dither - 1.0),
        ),
    ]
    curves: dict[str, Any] = {
        "dither": dither,
        **{name: {"mean": mean, "sd": sd} for name, (mean, sd) in means.items()},
        "printed": {
            "dither": chapter3.DITHER_STIFFNESS.value,
            **{name: [number.value, number.sd] for name, number in printed.items()},
        },
        "truth": truth,
    }
    if ours and value is not None:
        limits = {"ci_low": ours.ci_low, "ci_high": ours.ci_high}
        curves["recommended"] = {"value": value, **limits}
    return compared_table(3, "perturbation", rows), curves


def _paired_runs(study: Path) -> PairedRunsFit:
    """Return the perturbed less the unperturbed run, torque by the model that the study states."""
    spec = open_study(study).spec
    if spec.torque_model is None:
        raise DataError(f"{study}: no [torque_model]; expected that of qdd-perturbation.")
    cutoff_hz = spec.perturbations.cutoff_hz
    runs = {}
    for entry in spec.recordings:
        run = xr.load_dataset(study / entry.file, engine="h5netcdf")
        torque, _ = torque_from_current(run, spec.torque_model, cutoff_hz=cutoff_hz)
        runs[entry.condition] = run.assign(torque=("time", torque))
    return identify_paired_runs(
        [(runs["unperturbed"], runs["perturbed"])],
        align="reference_position",
        window_s=spec.perturbations.window_s,
        cutoff_hz=cutoff_hz,
    )
