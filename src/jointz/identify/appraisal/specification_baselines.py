"""Recommended method with the baselines of other methods: responses, and their misses."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from jointz.identify.methods.cell_windows import WindowCutter
from jointz.identify.preparation.assignment import Candidate
from jointz.identify.preparation.baselines import N_MATCHES
from jointz.identify.preparation.raw_signals import COMMAND, raw_signals
from jointz.identify.preparation.sources import ParticipantSettings, Source
from jointz.identify.recommended.unperturbed_prediction import LEAD_SAMPLES, PREDICTED, Predicted
from jointz.identify.recommended.walking_responses import PredictedCell, alike

#: So many unperturbed strides tell what a baseline misses.
_VIRTUAL = 200
_FEWEST_STRIDES = 12


def with_baseline(
    cell: PredictedCell, sources: Sequence[Source], settings: ParticipantSettings, baseline: str
) -> PredictedCell | None:
    """Return a timing point with another baseline than the predicted one.

    What a baseline misses is measured at virtual onsets in the strides it is made of. The mean
    of another condition is thereby blind to its own fault, the shift between the conditions:
    its intervals are too narrow, as the dissertation's are.
    """
    # Strides of another rate are brought to that of the pulses.
    rate = 1.0 / cell.period_s
    raw = [replace(s, signals=raw_signals(s, target_hz=rate)) for s in sources]
    # As long as what is predicted, both ends in it.
    window_s = cell.predicted.responses.shape[2] * cell.period_s
    cutter = WindowCutter(raw, settings, baseline=baseline, window_s=window_s)
    used = cell.used
    early = [_advanced(c, LEAD_SAMPLES * cell.period_s) for c in used]
    windows, unperturbed = cutter.cut(early)
    fine = unperturbed.valid.any(axis=1) & np.isfinite(windows).all(axis=(1, 2))
    if not fine.any():
        return None
    if baseline == "unperturbed_mean":
        valid = unperturbed.valid[fine].all(axis=0)
        middle = unperturbed.windows[fine].mean(axis=0)[valid]
        misses, strides = middle - middle.mean(axis=0), np.flatnonzero(valid)
    else:
        misses, strides = _matched_misses(cutter, early, sources)
    if strides.size < _FEWEST_STRIDES:
        return None
    used = [c for c, keep in zip(used, fine, strict=True) if keep]
    signs = np.array([c.pulse.sign for c in used])
    responses = (windows - unperturbed.mean())[fine][:, PREDICTED] * signs[:, None, None]
    predicted = Predicted(
        responses=responses,
        misses=misses[:, PREDICTED],
        strides=strides,
        codes=("",) * len(used),
        posture_rad=cell.predicted.posture_rad,
    )
    return replace(cell, candidates=used, predicted=predicted, kept=alike(predicted))


def _advanced(candidate: Candidate, lead_s: float) -> Candidate:
    """Return a pulse whose window begins earlier."""
    pulse = replace(candidate.pulse, onset_s=candidate.pulse.onset_s - lead_s)
    return replace(candidate, pulse=pulse, elapsed_s=candidate.elapsed_s - lead_s)


def _matched_misses(
    cutter: WindowCutter, used: Sequence[Candidate], sources: Sequence[Source]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the misses of matched strides at virtual onsets, and their strides."""
    first = used[0]
    source = sources[first.source]
    if source.strides is None:
        return np.empty((0, COMMAND + 1, 1)), np.empty(0, int)
    quiet = np.flatnonzero(source.undisturbed & np.append(False, source.undisturbed[:-1]))
    chosen = quiet[:: max(1, quiet.size // _VIRTUAL)]
    elapsed = float(np.median([c.elapsed_s for c in used]))
    virtual = [
        replace(
            first,
            pulse=replace(first.pulse, onset_s=float(start) + elapsed),
            elapsed_s=elapsed,
        )
        for start in source.strides.start_s[chosen]
    ]
    windows, unperturbed = cutter.cut(virtual)
    fine = unperturbed.valid.any(axis=1) & np.isfinite(windows).all(axis=(1, 2))
    # The best match of an unperturbed stride is itself, one of so many.
    own = 1.0 / N_MATCHES
    undone = np.sqrt((1.0 + own) / (1.0 - own))
    return undone * (windows - unperturbed.mean())[fine], chosen[fine]
