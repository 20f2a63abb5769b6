"""Chapter II again: the series-elastic exoskeleton on its bench, printed beside ours."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import fmean, stdev
from typing import Any

import numpy as np
import xarray as xr

from jointz.identify.actuators.bandwidth import identify_bandwidth
from jointz.identify.bench.bench_records import BenchTrial
from jointz.identify.bench.full_record import fit_full_record
from jointz.identify.series.frequency_response import identify_frequency_response
from jointz.identify.series.joint import identify_joint
from jointz.io.recordings import read_recording
from jointz.io.study_reader import open_study
from jointz.kernels.series.spectra import blackman_tukey
from jointz.reference import chapter2
from jointz.reproduction.reproduction_tables import Compared, ComparedTable

PARAMETERS = ("stiffness", "damping", "inertia")
UNITS = {"stiffness": "N*m/rad", "damping": "N*m*s/rad", "inertia": "kg*m^2"}
#: MATLAB's default window of ``spa``: 30 lags, at 1 kHz.
_SPA_WINDOW_S = 0.030
_HALF_POWER_DB = 3.0
#: Chapter II states no filter; this one only takes the noise of encoders out of derivatives.
_CUTOFF_HZ = 100.0
_SHOWN_HZ = 60.0


# --- bandwidth (2.3.1, figure 2.5) ---------------------------------------------------------------


def bandwidth(study: Path) -> tuple[ComparedTable, dict[str, Any]]:
    """Return the bandwidths beside the printed ones, and what figure 2.5 draws."""
    opened = open_study(study)
    printed = {"20": chapter2.BANDWIDTH_20_NM, "40": chapter2.BANDWIDTH_40_NM}
    rows, curves = [], {}
    for entry, (amplitude, number) in zip(opened.spec.recordings, printed.items(), strict=True):
        (recording,) = read_recording(opened, entry)
        signals = {
            "command": recording["reference"].to_numpy(),
            "torque": recording["torque"].to_numpy(),
            "time": recording["time"].to_numpy(),
        }
        ours = identify_bandwidth(signals)
        spa_frequency_hz, spa_gain = _spa(signals, ours.rate_hz)
        low, high = ours.ci_low_hz, ours.ci_high_hz
        spa_hz = _half_power_hz(spa_frequency_hz, spa_gain)
        rows.append(
            Compared(
                quantity=f"bandwidth at {amplitude} N*m",
                unit="Hz",
                printed=number.value,
                dissertation=spa_hz,
                recommended=ours.bandwidth_hz,
                recommended_low=low,
                recommended_high=high,
                note=number.note,
            )
        )
        shown = [k for k, f in enumerate(ours.response.frequency_hz) if 0 < f <= _SHOWN_HZ]
        curves[amplitude] = {
            "frequency_hz": [ours.response.frequency_hz[k] for k in shown],
            "gain": [ours.response.gain[k] for k in shown],
            "coherence": [ours.response.coherence[k] for k in shown],
            "bandwidth_hz": ours.bandwidth_hz,
            "ci_low": low,
            "ci_high": high,
            "resolution_hz": ours.resolution_hz,
            "reference_gain": ours.reference_gain,
            "spa_bandwidth_hz": spa_hz,
            "spa_reference_gain": float(spa_gain[0]),
            "spa_frequency_hz": spa_frequency_hz.tolist(),
            "spa_gain": spa_gain.tolist(),
            "printed_hz": number.value,
        }
    table = ComparedTable(
        "bandwidth",
        "Bandwidth of the torque loop (2.3.1, figure 2.5)",
        "The dissertation's method is Blackman and Tukey's spectrum with the default of MATLAB's "
        "spa, 30 lags: at 1 kHz it cannot tell frequencies closer than 33 Hz apart, for which our "
        "own command refuses it. Recommended: Welch's, its window chosen from the record.",
        tuple(rows),
    )
    return table, curves


def _spa(signals: Mapping[str, np.ndarray], rate_hz: float) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies and gain as ``spa`` with 30 lags has them, resolved or not."""
    spectra = blackman_tukey(
        signals["command"], signals["torque"], rate_hz=rate_hz, window_s=_SPA_WINDOW_S
    )
    return spectra.frequency_hz, np.abs(spectra.response)


def _half_power_hz(frequency_hz: np.ndarray, gain: np.ndarray) -> float | None:
    """Return where a gain has first fallen by 3 dB; None where it never does."""
    wanted = gain[0] * 10.0 ** (-_HALF_POWER_DB / 20.0)
    below = np.flatnonzero(gain < wanted)
    if not below.size:
        return None
    pair = slice(below[0] - 1, below[0] + 1)
    return float(np.interp(-wanted, -gain[pair], frequency_hz[pair]))


# --- intrinsic impedance (2.3.1) -----------------------------------------------------------------


def intrinsic(study: Path, truth: dict[str, float]) -> tuple[ComparedTable, dict[str, Any]]:
    """Return the intrinsic impedance beside the printed one, and its frequency response."""
    opened = open_study(study)
    trials = [r for entry in opened.spec.recordings for r in read_recording(opened, entry)]
    letter = [_least_squares(trial) for trial in trials]
    gain = opened.spec.calibration_of(opened.spec.recordings[0]).torque_gain
    ours = fit_full_record(
        [_bench_trial(trial) for trial in trials],
        friction=False,
        torque_gain_sd=gain.sd / gain.value if gain else 0.0,
    )
    printed = {
        "stiffness": chapter2.INTRINSIC_STIFFNESS,
        "damping": chapter2.INTRINSIC_DAMPING,
        "inertia": chapter2.INTRINSIC_INERTIA,
    }
    rows = []
    for i, name in enumerate(PARAMETERS):
        found = ours.parameter(name)
        rows.append(
            Compared(
                quantity=f"intrinsic {name}",
                unit=UNITS[name],
                printed=printed[name].value,
                printed_sd=printed[name].sd,
                dissertation=fmean(values[i] for values in letter),
                dissertation_sd=stdev(values[i] for values in letter),
                recommended=found.value,
                recommended_low=found.ci_low,
                recommended_high=found.ci_high,
                truth=truth[name],
            )
        )
    table = ComparedTable(
        "intrinsic",
        "Intrinsic impedance of the exoskeleton (2.3.1)",
        "Output free, the motor moves it along noise; the beam's torque moves what lies beyond the "
        "beam. Three trials. The dissertation's method regresses torque on angle and its "
        "derivatives (2.1); recommended: the same over the whole record with the lag of the torque "
        "record estimated. These values are subtracted from the loads' estimates below.",
        tuple(rows),
    )
    lag_s = ours.parameter("torque_lag").value or 0.0
    return table, _response(trials[0], [row.recommended or 0.0 for row in rows], lag_s)


def _least_squares(trial: xr.Dataset) -> list[float]:
    fit = identify_joint(
        {name: trial[name].to_numpy() for name in ("angle", "torque", "time")},
        input="angle",
        estimator="least_squares",
        cutoff_hz=_CUTOFF_HZ,
    )
    # Undecided where the torque lags the angle: the page shows what the method gives all the same.
    values = [p.unbounded if p.value is None else p.value for p in fit.parameters]
    return [float("nan") if value is None else float(value) for value in values]


def _bench_trial(trial: xr.Dataset) -> BenchTrial:
    time_s, angle, torque = (trial[name].to_numpy() for name in ("time", "angle", "torque"))
    return BenchTrial(time_s, angle, torque)


def _response(trial: xr.Dataset, impedance: Sequence[float], lag_s: float) -> dict[str, Any]:
    """Return measured and modelled frequency response of the impedance, the lag in both."""
    fit = identify_frequency_response(
        {name: trial[name].to_numpy() for name in ("angle", "torque", "time")}, input="angle"
    )
    frequency = np.array(fit.response.frequency_hz)
    shown = (frequency > 0) & (frequency <= 0.5 * _SHOWN_HZ)
    s = 2j * np.pi * frequency[shown]
    model = (impedance[0] + impedance[1] * s + impedance[2] * s**2) * np.exp(-lag_s * s)
    return {
        "frequency_hz": frequency[shown].tolist(),
        "gain": np.array(fit.response.gain)[shown].tolist(),
        "phase_deg": np.degrees(np.array(fit.response.phase_rad)[shown]).tolist(),
        "model_gain": np.abs(model).tolist(),
        "model_phase_deg": np.degrees(np.angle(model)).tolist(),
    }
