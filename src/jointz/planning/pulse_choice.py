"""Pulses that a plan may choose from, as large as torque and motion allow."""

from collections.abc import Iterator, Sequence
from math import floor

import numpy as np

from jointz.core.limits import ACTUATOR_LATE_S, LOOK_AHEAD_S
from jointz.core.protocols.pulse_models import (
    DoubletPulse,
    Pulse,
    PulseSpec,
    SampledPulse,
    TrapezoidPulse,
    name_of,
)
from jointz.core.protocols.pulse_waveform import PulseWaveform
from jointz.planning.laboratory import Laboratory
from jointz.planning.plan_result import PlannedCourse
from jointz.planning.predicted_estimates import planned_model
from jointz.planning.predicted_responses import Design

#: A step and its reversal leave the joint with little motion if the second lasts .55 of the first.
_SHORT_S, _LONG_S = (0.040, 0.022), (0.092, 0.050)
_PUSH_S, _HOLD_S = 0.06, 0.25
#: Sizes of a shape over the largest: two sizes reveal nonlinear responses.
_SIZES = (0.6, 1.0)
#: Amplitudes are multiples of this.
_STEP_NM = 0.5
LEAST_NM = 1.0
#: Motion is that which this share of legs does not exceed, at the softest timing point.
_MOTION_SHARE = 0.9
_PASSES = 6
#: More pulses than this are described together.
_MOST_NAMED = 3


def candidates(
    lab: Laboratory, legs: Sequence[np.ndarray], window_s: float, motion_rad: float
) -> Iterator[Design]:
    """Yield designs within the limits; ``legs`` are parameters of drawn legs."""
    for name, pulses in (
        ("two doublets", (_doublet("short", _SHORT_S), _doublet("long", _LONG_S))),
        ("short pushes", (_trapezoid("push", _PUSH_S),)),
        ("holds", (_trapezoid("hold", _HOLD_S),)),
    ):
        scaled = tuple(
            p for pulse in pulses if (p := _scaled(lab, legs, pulse, window_s, motion_rad))
        )
        if scaled:
            yield Design(name, scaled, window_s)


def _doublet(name: str, durations_s: tuple[float, float]) -> DoubletPulse:
    return DoubletPulse(
        name=name, kind="doublet", amplitudes_nm=(1.0,), durations_s=durations_s, direction="both"
    )


def _trapezoid(name: str, hold_s: float) -> TrapezoidPulse:
    return TrapezoidPulse(
        name=name, kind="trapezoid", amplitudes_nm=(1.0,), hold_s=hold_s, direction="both"
    )


def _scaled(
    lab: Laboratory, legs: Sequence[np.ndarray], pulse: Pulse, window_s: float, motion_rad: float
) -> Pulse | None:
    """Return the pulse in two sizes, the larger as large as the limits allow; None if too small."""
    size = lab.actuator.torque_nm
    for _ in range(_PASSES):
        one = pulse.model_copy(update={"amplitudes_nm": (size,)})
        peak = peak_rad(lab, legs, Design("", (one,), window_s))
        # A leg softens: the motion grows faster than the torque.
        if peak <= motion_rad:
            break
        size *= motion_rad / peak
    size = floor(size / _STEP_NM) * _STEP_NM
    if size < LEAST_NM:
        return None
    sizes = dict.fromkeys(max(_STEP_NM, round(s * size / _STEP_NM) * _STEP_NM) for s in _SIZES)
    return pulse.model_copy(update={"amplitudes_nm": tuple(sizes)})


def peak_rad(lab: Laboratory, legs: Sequence[np.ndarray], design: Design) -> float:
    """Return the motion that :data:`_MOTION_SHARE` of legs does not exceed at the softest point."""
    model = planned_model(lab, design)
    theta = np.stack(legs)
    points = range(len(model.points))
    peaks = [np.abs(model.bone(theta, k)).max(axis=(1, 2)) for k in points]
    return float(np.quantile(np.max(peaks, axis=0), _MOTION_SHARE))


def aborted_share(
    lab: Laboratory, legs: Sequence[np.ndarray], design: Design, limit_rad: float, inertia: float
) -> float:
    """Return the share of pulses that the safety gate will cut for their displacement.

    The gate looks ahead: it cuts a pulse if a joint of this inertia would go too far both without
    the rest of the pulse and with it. Its errors are those of the estimator's prediction then.
    """
    model, shares = planned_model(lab, design), []
    courses = {name_of(pulse): PulseWaveform(pulse) for pulse in design.pulses}
    for k, point in enumerate(model.points):
        displacement = model.bone(np.stack(legs), k)
        rate = np.gradient(displacement, point.period_s, axis=-1)
        coasting = displacement + LOOK_AHEAD_S * rate
        for i, v in enumerate(design.variants):
            rest = courses[v.shape].displacements(
                ahead_s=LOOK_AHEAD_S, actuator_lag_s=ACTUATOR_LATE_S
            )
            at = np.flatnonzero((point.time_s >= 0.0) & (point.time_s < 1e-3 * len(rest)))
            to_come = np.array(rest)[(1000.0 * point.time_s[at]).astype(int)] / inertia
            later = np.minimum(at + round(LOOK_AHEAD_S / point.period_s), point.time_s.size - 1)
            ahead = coasting[:, None, i, at] + point.prediction_errors[:, 0, later]
            nearer = np.minimum(np.abs(ahead), np.abs(ahead + v.amplitude_nm * to_come))
            shares.append(np.mean(nearer.max(axis=-1) > limit_rad))
    return float(np.mean(shares))


def planned_course(pulse: Pulse) -> PlannedCourse:
    """Return the commanded torque of a pulse over time."""
    times, shares, at = [0.0], [0.0], 0.0
    for part in pulse.course:
        times += [at, at + part.duration_s]
        shares += [part.begin, part.end]
        at += part.duration_s
    return PlannedCourse(
        name_of(pulse), (*times, at), (*shares, 0.0), tuple(pulse.sizes_nm), tuple(pulse.signs)
    )


def text_of(pulses: Sequence[Pulse]) -> str:
    """Return shapes, sizes and directions in words."""
    if len(pulses) > _MOST_NAMED:
        lengths = sorted({round(1000.0 * pulse.length_s) for pulse in pulses})
        sizes = sorted({size for pulse in pulses for size in pulse.sizes_nm})
        times = " and ".join(map(str, lengths))
        return f"{len(pulses)} kinds of pulse: {times} ms, {sizes[0]:g} to {sizes[-1]:g} N*m"
    return "; ".join(_words(pulse) for pulse in pulses)


def _words(pulse: Pulse) -> str:
    sizes = " and ".join(f"{size:g}" for size in pulse.sizes_nm)
    kind = "doublet" if isinstance(pulse, DoubletPulse) else "pulse"
    durations_s = [part.duration_s for part in pulse.course]
    if isinstance(pulse, SampledPulse):
        kind, durations_s = "sampled pulse", [pulse.length_s]
    times = " + ".join(f"{1000.0 * duration_s:.0f}" for duration_s in durations_s)
    way = {"both": "both signs", "positive": "positive", "negative": "negative"}[pulse.direction]
    name = "" if isinstance(pulse, PulseSpec) else f"{name_of(pulse)}: "
    return f"{name}{kind} of {times} ms, {sizes} N*m, {way}"
