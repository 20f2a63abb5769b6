"""Estimates of single pulses of a bench by errors-in-variables likelihood."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from jointz.core.errors import DataError, EstimationError
from jointz.core.events import PulseEstimate
from jointz.core.method_names import FULL_RECORD, PULSE_LIKELIHOOD
from jointz.core.recording import deflection
from jointz.core.study import Calibrated, PerturbationsSpec, TorqueModelSpec
from jointz.identify.bench.pulse_likelihood import fit_pulse
from jointz.identify.preparation.conditioning import torque_from_current
from jointz.identify.preparation.sources import RecordingInput
from jointz.report.wording import ABSOLUTE
from jointz.results.estimates import CellEstimate

#: Name of the method in ``single_pulses.csv``.
#: Damping and inertia are barely identifiable in 100 ms, but are in 250 ms.
_WINDOW_S = 0.25
#: Margin on either side of the window that the likelihood may use.
_MARGIN_S = 0.03
_TWO_SIDED_Z = 1.96


class _Trial(NamedTuple):
    time_s: np.ndarray
    angle: np.ndarray  # rad: deflection over the angle's gain
    torque: np.ndarray  # N*m: torque over the torque's gain


def likelihood_pulses(
    recordings: Sequence[RecordingInput],
    single: Sequence[PulseEstimate],
    cells: Sequence[CellEstimate],
    *,
    perturbations: PerturbationsSpec,
    torque_model: TorqueModelSpec | None,
) -> tuple[PulseEstimate, ...]:
    """Estimate each pulse of the cases that were estimated from whole trials.

    Uses :func:`jointz.identify.bench.pulse_likelihood.fit_pulse` over 250 ms of the raw signals,
    divided by their gains, with the lag estimated from the whole trials of the case. The
    intrinsic impedance is not subtracted. Friction biases the result.
    """
    lags = {c.timing_point: _lag_of(c) for c in cells if c.method == FULL_RECORD}
    files = {p.recording for p in single if p.timing_point in lags}
    trials = {
        (r.file, str(r.recording.attrs["trial"])): _trial(r, perturbations, torque_model)
        for r in recordings
        if r.file in files
    }
    estimates = (
        _estimate(p, trials, lags[p.timing_point]) if p.timing_point in lags else p for p in single
    )
    return tuple(p for p in estimates if p is not None)


def _trial(
    source: RecordingInput, perturbations: PerturbationsSpec, model: TorqueModelSpec | None
) -> _Trial:
    recording, known = source.recording, source.calibration
    if "torque" not in recording and model is not None:
        cutoff_hz = perturbations.cutoff_hz
        torque, _ = torque_from_current(recording, model, cutoff_hz=cutoff_hz, known=known)
    else:
        torque = recording["torque"].to_numpy()
    return _Trial(
        recording["time"].to_numpy(),
        deflection(recording) / _gain(known.angle_gain),
        torque / _gain(known.torque_gain),
    )


def _gain(known: Calibrated | None) -> float:
    return 1.0 if known is None else known.value


def _estimate(
    pulse: PulseEstimate,
    trials: Mapping[tuple[str, str], _Trial],
    lag: tuple[float, float] | None,
) -> PulseEstimate | None:
    trial = trials[pulse.recording, pulse.trial]
    ends = [pulse.onset_s - _MARGIN_S, pulse.onset_s + _WINDOW_S + _MARGIN_S]
    first, last = np.searchsorted(trial.time_s, ends)
    try:
        fit = fit_pulse(
            trial.time_s[first:last],
            trial.angle[first:last],
            trial.torque[first:last],
            onset_s=pulse.onset_s,
            window_s=_WINDOW_S,
            signal="raw",
            lag=lag,
        )
    except (DataError, EstimationError):
        return None
    # One pulse seldom tells a damping from zero; without such pulses a mean would be too large.
    parameters = [fit.parameter(name) for name in ABSOLUTE]
    stiffness, damping, inertia = (p.unbounded if p.value is None else p.value for p in parameters)
    if stiffness is None or damping is None or inertia is None:
        return None
    return replace(
        pulse,
        stiffness=stiffness,
        damping=damping,
        inertia=inertia,
        vaf_pct=fit.vaf_pct,
        method=PULSE_LIKELIHOOD,
    )


def _lag_of(cell: CellEstimate) -> tuple[float, float] | None:
    """Return the lag of a case's torque record and its sd, if it was estimated."""
    lag = next((p for p in cell.nuisance if p.name == "torque_lag"), None)
    if lag is None or lag.value is None or lag.ci_high is None:
        return None
    return lag.value, (lag.ci_high - lag.value) / _TWO_SIDED_Z
