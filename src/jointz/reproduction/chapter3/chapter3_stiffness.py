"""Chapter III again: the stiffness of the bench, printed beside ours."""

from pathlib import Path
from statistics import fmean, stdev
from typing import Any

import numpy as np
import xarray as xr

from jointz.analysis.analyze import analyze
from jointz.core.errors import DataError
from jointz.identify.bench.dither_stiffness import identify_dither_stiffness
from jointz.identify.bench.paired_runs import identify_paired_runs
from jointz.identify.bench.static_stiffness import identify_static_stiffness
from jointz.identify.preparation.conditioning import torque_from_current
from jointz.io.study_reader import open_study
from jointz.kernels.filtering import lowpass_zero_phase
from jointz.reference import chapter3
from jointz.reproduction.chapter3.chapter3_numbers import GEAR, INERTIA, modelled, thin
from jointz.reproduction.reproduction_tables import Compared, ComparedTable
from jointz.results.bench.actuator_fit import ActuatorFit
from jointz.results.bench.paired_runs_fit import PairedPulse, PairedRunsFit
from jointz.results.bench.stiffness_fit import StiffnessFit
from jointz.results.estimates import ParameterEstimate

#: Low-pass of the dither test (3.2.3), and the slow sine of torque that it leaves.
_SLOW_HZ = 5.0**0.5
_TORQUE_HZ = 0.1
_TWO_SIDED_Z = 1.96


def static_stiffness(
    recording: xr.Dataset, fit: ActuatorFit, truth: float, *, gain_sd: float
) -> tuple[ComparedTable, dict[str, Any]]:
    """Return the stiffness with a locked output (3.3.2, figure 3.5)."""
    angle, sensor = recording["angle"].to_numpy(), recording["sensor_torque"].to_numpy()
    torque = modelled(recording, fit, INERTIA)
    time = recording["time"].to_numpy()
    measured = identify_static_stiffness(angle=angle, torque=sensor, time=time)
    modelled_fit = identify_static_stiffness(angle=angle, torque=torque, time=time)
    by_sensor, by_model = _value(measured), _value(modelled_fit)
    ours = _stiffness_with_friction(recording, fit)
    known = _value(ours)
    low, high = _interval(ours.parameter("stiffness"), gain_sd)
    by_sensor_low, by_sensor_high = _interval(measured.parameter("stiffness"), gain_sd)
    table = ComparedTable(
        "static",
        "Stiffness with a locked output (3.3.2, figure 3.5)",
        "Slow sine of torque. The dissertation's method: slope of the modelled torque over the "
        "angle, against that of the torque sensor; its friction has the sign of the measured "
        "velocity, which is as often noise as motion here. Recommended: friction is fitted in the "
        "same record, by the direction of the low-passed angle, so that loading and unloading "
        "nearly cancel it. Intervals hold the sd of the torque sensor's calibration.",
        (
            Compared(
                quantity="stiffness by the torque sensor",
                unit="N*m/rad",
                dissertation=by_sensor,
                recommended=by_sensor,
                recommended_low=by_sensor_low,
                recommended_high=by_sensor_high,
                truth=truth,
            ),
            Compared(
                quantity="stiffness by the model",
                unit="N*m/rad",
                dissertation=by_model,
                recommended=known,
                recommended_low=low,
                recommended_high=high,
                truth=truth,
                note="cogging, and friction that so slow a motion has only in part, leave the "
                "recommended one 0.1 to 0.9 % high (10 seeds)",
            ),
            Compared(
                quantity="difference from the torque sensor",
                unit="%",
                printed=chapter3.STATIC_STIFFNESS_ERROR.value,
                dissertation=100.0 * (by_model / by_sensor - 1.0),
                recommended=100.0 * (known / by_sensor - 1.0),
                note="printed without a sign",
            ),
        ),
    )
    curves = {
        "deflection_rad": thin(angle),
        "sensor_nm": thin(sensor),
        "model_nm": thin(torque),
        "sensor_stiffness": by_sensor,
        "model_stiffness": by_model,
    }
    return table, curves


def _value(fit: StiffnessFit) -> float:
    """Return the stiffness, decided or not: the page prints what the method gives."""
    stiffness = fit.parameter("stiffness")
    value = stiffness.value if stiffness.value is not None else stiffness.unbounded
    return float("nan") if value is None else value


def _interval(found: ParameterEstimate, gain_sd: float) -> tuple[float | None, float | None]:
    """Return the interval of a stiffness, the sd of the torque's gain added to it."""
    if found.value is None or found.ci_low is None or found.ci_high is None:
        return None, None
    half = 0.5 * (found.ci_high - found.ci_low)
    wider = float(np.hypot(half, _TWO_SIDED_Z * gain_sd * found.value))
    return found.value - wider, found.value + wider


def _stiffness_with_friction(recording: xr.Dataset, fit: ActuatorFit) -> StiffnessFit:
    constant = fit.parameter("torque_constant").value or 0.0
    angle, time = recording["angle"].to_numpy(), recording["time"].to_numpy()
    rate_hz = (time.size - 1) / (time[-1] - time[0])
    # Not the command's: the spring stands for a while after the command has turned.
    motion = np.gradient(lowpass_zero_phase(angle, cutoff_hz=_SLOW_HZ, rate_hz=rate_hz))
    return identify_static_stiffness(
        angle=angle,
        torque=GEAR * constant * recording["current"].to_numpy(),
        time=time,
        direction=motion,
    )


def dither_stiffness(
    recording: xr.Dataset, fit: ActuatorFit, truth: float, *, gain_sd: float
) -> ComparedTable:
    """Return the stiffness in motion, both sides moving (3.3.3)."""
    time = recording["time"].to_numpy()
    deflection = recording["angle"].to_numpy() - recording["position"].to_numpy()
    torques = (recording["sensor_torque"].to_numpy(), modelled(recording, fit, INERTIA))
    by_sensor, by_model = (
        identify_static_stiffness(angle=deflection, torque=torque, time=time, cutoff_hz=_SLOW_HZ)
        for torque in torques
    )
    ours = identify_dither_stiffness(
        angle=deflection, torque=torques[0], time=time, frequency_hz=_TORQUE_HZ
    ).parameter("stiffness")
    low, high = _interval(ours, gain_sd)
    printed = chapter3.DITHER_STIFFNESS
    return ComparedTable(
        "dither",
        "Stiffness of the bench in motion (3.3.3)",
        "The dissertation's method: low-passed at the square root of 5 Hz, which leaves the slow "
        "sine of torque, slope of torque over deflection. Recommended: the ratio of both at the "
        "frequency of that sine, its interval with the sd of the torque sensor's calibration. The "
        "independent characterisation is by the torque sensor.",
        (
            Compared(
                quantity="stiffness, dither",
                unit="N*m/rad",
                printed=printed.value,
                dissertation=_value(by_sensor),
                recommended=ours.value,
                recommended_low=low,
                recommended_high=high,
                truth=truth,
                note=printed.note,
            ),
            Compared(
                quantity="the same by the torque model",
                unit="N*m/rad",
                dissertation=_value(by_model),
                truth=truth,
            ),
        ),
    )


def perturbation(study: Path, dither: float, truth: float) -> tuple[ComparedTable, dict[str, Any]]:
    """Return the stiffness out of pulses along a knee trajectory (3.3.3, figure 3.6)."""
    analysis = analyze(study, method="recommended", resamples=1000)
    means = {sign: _of_sign(_paired_runs(study).pulses, sign) for sign in (1, -1)}
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
            note=f"recommended: method {analysis.cells[0].method}",
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


def _of_sign(pulses: tuple[PairedPulse, ...], sign: int) -> tuple[float, float]:
    values = [p.stiffness for p in pulses if p.sign == sign]
    return fmean(values), stdev(values)
