"""Every pulse of a bench by itself (2.2.3), for the statistics of 2.2.4."""

from collections.abc import Sequence

import numpy as np

from jointz.core.events import PulseEstimate
from jointz.identify.preparation.assignment import Candidate
from jointz.identify.preparation.conditioning import TORQUE
from jointz.identify.preparation.sources import Source
from jointz.kernels.bounded_lsq import least_squares, normal_equations

#: The slope of a reference is that over so long before the onset: no pulse is in it.
_SLOPE_S = 0.02


def pulse_estimates(
    participant: str,
    candidates: Sequence[Candidate],
    responses: np.ndarray,
    sources: Sequence[Source],
) -> tuple[PulseEstimate, ...]:
    """Fit torque = K*angle + B*velocity + J*acceleration to every response by itself."""
    gram, moment, power = normal_equations(responses)
    values = least_squares(gram, moment)
    fitted = np.einsum("pk,pkt->pt", values, responses[:, :TORQUE])
    error = ((fitted - responses[:, TORQUE]) ** 2).sum(axis=1)
    vaf_pct = 100.0 * (1.0 - error / power)
    return tuple(
        PulseEstimate(
            participant=participant,
            timing_point=candidate.record.timing_point,
            recording=candidate.record.recording,
            trial=str(sources[candidate.source].given.recording.attrs["trial"]),
            onset_s=candidate.pulse.onset_s,
            sign=int(candidate.pulse.sign),
            direction=_direction(candidate, sources[candidate.source]),
            stiffness=float(row[0]),
            damping=float(row[1]),
            inertia=float(row[2]),
            vaf_pct=float(vaf),
        )
        for candidate, row, vaf in zip(candidates, values, vaf_pct, strict=True)
        if np.isfinite(row).all()
    )


def _direction(candidate: Candidate, source: Source) -> str:
    """Tell whether a pulse goes with the reference or against it."""
    recording = source.given.recording
    if "reference" not in recording:
        return ""
    onset = candidate.pulse.onset_s
    at = np.searchsorted(recording["time"].to_numpy(), [onset - _SLOPE_S, onset])
    before, now = recording["reference"].to_numpy()[at.clip(0, recording.sizes["time"] - 1)]
    slope = candidate.pulse.sign * (now - before)
    if not np.isfinite(slope) or slope == 0.0:
        return ""
    return "with" if slope > 0.0 else "against"
