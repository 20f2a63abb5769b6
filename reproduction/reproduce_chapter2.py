"""Chapter II: every table and figure of the series-elastic exoskeleton's bench."""

import tempfile
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from statistics import fmean, stdev
from typing import Any

import numpy as np
import xarray as xr

from jointz.core.channels import PARAMETER_UNITS
from jointz.identify.actuators.bandwidth import identify_bandwidth
from jointz.identify.bench.bench_records import BenchTrial
from jointz.identify.bench.full_record import fit_full_record
from jointz.identify.record.joint import fit_frequency_response, identify_joint
from jointz.identify.record.joint_record import JointRequest
from jointz.io.protocols import load_protocol
from jointz.io.recordings import read_recording
from jointz.io.study_reader import open_study
from jointz.kernels.series.spectra import blackman_tukey
from jointz.reference import chapter2
from jointz.tasks.engine import Task
from jointz.tasks.progress import Progress
from reproduction import chapter2_loads, literature
from reproduction.chapter2_loads import PARAMETERS
from reproduction.chapter2_mechanisms import mechanism_errors, mechanism_table, mechanisms
from reproduction.chapter_runs import in_processes, run_study, study_truth
from reproduction.printed_settings import TORQUE_LOOP, printed_settings
from reproduction.reproduction_result import Reproduction
from reproduction.reproduction_tables import (
    ComparedTable,
    audit_claims,
    compare,
    compared_table,
    device_table,
)

_Numbers = tuple[ComparedTable, dict[str, Any]]

#: MATLAB's default window of ``spa``: 30 lags, at 1 kHz.
_SPA_WINDOW_S = 0.030
_HALF_POWER_DB = 3.0
#: Chapter II states no filter; this one only takes the noise of encoders out of derivatives.
_CUTOFF_HZ = 100.0
_SHOWN_HZ = 60.0


def reproduce_chapter2(seed: int, preset: str, tell: Progress) -> Reproduction:
    """Run the protocols of chapter II on the simulated bench and set the numbers beside."""
    loads = [load.name for load in load_protocol("sea-mass-spring").loads]
    causes = mechanisms()
    with tempfile.TemporaryDirectory() as folder:
        tasks: list[Task[Any]] = [
            *(Task(load, partial(_load, folder, load, seed, preset)) for load in loads),
            Task("bandwidth", partial(_bandwidth, folder, seed, preset)),
            Task("intrinsic impedance", partial(_intrinsic, folder, seed, preset)),
            *(Task(cause.name, partial(mechanism_errors, cause, seed=seed)) for cause in causes),
        ]
        done = dict(in_processes(tasks, tell))
    studies = {load: done[load] for load in loads}
    pairs = [pair for study in studies.values() for pair in study.pairs]
    cases = [pair for pair in pairs if pair.case != "damper"]
    claims, notes = chapter2_loads.claim_tables(
        cases,
        [p for study in studies.values() for p in study.single],
        [p for study in studies.values() for p in study.recommended_single],
    )
    errors = {cause.name: done[cause.name] for cause in causes}
    bandwidth_table, bandwidth_curves = done["bandwidth"]
    intrinsic_table, intrinsic_curves = done["intrinsic impedance"]
    names = {"stiffness": "stiffness_pct", "damping": "damping", "inertia": "inertia_pct"}
    return Reproduction.of_chapter(
        2,
        (
            printed_settings(2, preset),
            bandwidth_table,
            intrinsic_table,
            *chapter2_loads.error_tables(cases, studies[loads[0]].torque_gain),
            chapter2_loads.vaf_table(studies),
            claims,
            mechanism_table(errors),
            chapter2_loads.pair_table(pairs),
            device_table(2, literature.DEVICES_2),
            audit_claims(2),
        ),
        {
            "bandwidth": bandwidth_curves,
            "intrinsic": intrinsic_curves,
            "loads": [pair._asdict() for pair in pairs],
            "mechanisms": [
                {"mechanism": cause} | {names[key]: value for key, value in values.items()}
                for cause, values in errors.items()
            ],
        },
        seed=seed,
        preset=preset,
        notes=notes,
    )


def _load(folder: str, load: str, seed: int, preset: str) -> chapter2_loads.LoadStudy:
    study = run_study(folder, "sea-mass-spring", seed, preset, load=load)
    return chapter2_loads.analyze_load(study, load, study_truth(study, load), seed)


def _bandwidth(folder: str, seed: int, preset: str) -> _Numbers:
    return bandwidth(run_study(folder, "sea-bandwidth", seed, preset))


def _intrinsic(folder: str, seed: int, preset: str) -> _Numbers:
    study = run_study(folder, "sea-intrinsic", seed, preset)
    return intrinsic(study, study_truth(study, "free")["intrinsic"])


# --- bandwidth (2.3.1, figure 2.5) ---------------------------------------------------------------


def bandwidth(study: Path) -> _Numbers:
    """Return the bandwidths beside the printed ones, and what figure 2.5 draws."""
    opened = open_study(study)
    printed = {"20": chapter2.BANDWIDTH_20_NM, "40": chapter2.BANDWIDTH_40_NM}
    rows, curves = [], {}
    for entry, (amplitude, number) in zip(opened.spec.recordings, printed.items(), strict=True):
        (recording,) = read_recording(opened, entry)
        channels = {"command": "reference", "torque": "torque", "time": "time"}
        signals = {name: recording[channel].to_numpy() for name, channel in channels.items()}
        ours = identify_bandwidth(signals)
        # As ``spa`` with 30 lags has them, resolved or not.
        spectra = blackman_tukey(
            signals["command"], signals["torque"], rate_hz=ours.rate_hz, window_s=_SPA_WINDOW_S
        )
        spa_gain = np.abs(spectra.response)
        spa_hz = _half_power_hz(spectra.frequency_hz, spa_gain)
        interval = (ours.bandwidth_hz, ours.ci_low_hz, ours.ci_high_hz)
        name = f"bandwidth at {amplitude} N*m"
        rows.append(compare(name, "Hz", number, spa_hz, interval, built_in=TORQUE_LOOP))
        response = ours.response
        shown = [k for k, f in enumerate(response.frequency_hz) if 0 < f <= _SHOWN_HZ]
        curves[amplitude] = {
            "frequency_hz": [response.frequency_hz[k] for k in shown],
            "gain": [response.gain[k] for k in shown],
            "coherence": [response.coherence[k] for k in shown],
            **dict(zip(("bandwidth_hz", "ci_low", "ci_high"), interval, strict=True)),
            "resolution_hz": ours.resolution_hz,
            "reference_gain": ours.reference_gain,
            "spa_bandwidth_hz": spa_hz,
            "spa_reference_gain": float(spa_gain[0]),
            "spa_frequency_hz": spectra.frequency_hz.tolist(),
            "spa_gain": spa_gain.tolist(),
            "printed_hz": number.value,
        }
    return compared_table(2, "bandwidth", rows), curves


def _half_power_hz(frequency_hz: np.ndarray, gain: np.ndarray) -> float | None:
    """Return where a gain has first fallen by 3 dB; None where it never does."""
    limit = gain[0] * 10.0 ** (-_HALF_POWER_DB / 20.0)
    below = np.flatnonzero(gain < limit)
    if not below.size:
        return None
    pair = slice(below[0] - 1, below[0] + 1)
    return float(np.interp(-limit, -gain[pair], frequency_hz[pair]))


# --- intrinsic impedance (2.3.1) -----------------------------------------------------------------


def intrinsic(study: Path, truth: Mapping[str, float]) -> _Numbers:
    """Return the intrinsic impedance beside the printed one, and its frequency response."""
    opened = open_study(study)
    trials = [
        _signals(trial)
        for entry in opened.spec.recordings
        for trial in read_recording(opened, entry)
    ]
    published = [_least_squares(trial) for trial in trials]
    gain = opened.spec.calibration_of(opened.spec.recordings[0]).torque_gain
    ours = fit_full_record(
        [BenchTrial(trial["time"], trial["angle"], trial["torque"]) for trial in trials],
        friction=False,
        torque_gain_sd=gain.sd / gain.value if gain else 0.0,
    )
    printed = (
        chapter2.INTRINSIC_STIFFNESS,
        chapter2.INTRINSIC_DAMPING,
        chapter2.INTRINSIC_INERTIA,
    )
    rows = [
        compare(
            f"intrinsic {name}",
            PARAMETER_UNITS[name],
            number,
            (fmean(values), stdev(values)),
            ours.parameter(name),
            truth=truth[name],
            built_in=f"intrinsic {name}",
        )
        for name, number, values in zip(
            PARAMETERS, printed, zip(*published, strict=True), strict=True
        )
    ]
    lag_s = ours.parameter("torque_lag").value or 0.0
    response = _response(trials[0], [row.recommended or 0.0 for row in rows], lag_s)
    return compared_table(2, "intrinsic", rows), response


def _signals(trial: xr.Dataset) -> dict[str, np.ndarray]:
    return {name: trial[name].to_numpy() for name in ("angle", "torque", "time")}


def _least_squares(trial: Mapping[str, np.ndarray]) -> list[float]:
    fit = identify_joint(trial, input="angle", estimator="least_squares", cutoff_hz=_CUTOFF_HZ)
    # Undecided where the torque lags the angle: the page prints what the method gives all the same.
    values = [p.unbounded if p.value is None else p.value for p in fit.parameters]
    return [float("nan") if value is None else float(value) for value in values]


def _response(
    trial: Mapping[str, np.ndarray], impedance: Sequence[float], lag_s: float
) -> dict[str, Any]:
    """Return measured and modelled frequency response of the impedance, the lag in both."""
    response = fit_frequency_response(JointRequest.of(trial, input="angle")).response
    frequency = np.array(response.frequency_hz)
    shown = (frequency > 0) & (frequency <= 0.5 * _SHOWN_HZ)
    s = 2j * np.pi * frequency[shown]
    model = (impedance[0] + impedance[1] * s + impedance[2] * s**2) * np.exp(-lag_s * s)
    return {
        "frequency_hz": frequency[shown].tolist(),
        "gain": np.array(response.gain)[shown].tolist(),
        "phase_deg": np.degrees(np.array(response.phase_rad)[shown]).tolist(),
        "model_gain": np.abs(model).tolist(),
        "model_phase_deg": np.degrees(np.angle(model)).tolist(),
    }
