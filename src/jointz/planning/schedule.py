"""Timing points, numbers of pulses and strides of a protocol, or of a study as it was recorded."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from jointz.core.errors import DataError
from jointz.core.protocols.protocol import Protocol
from jointz.core.protocols.pulse_models import NamedPulse
from jointz.planning.predicted_responses import Design

_WINDOW_S, _LONGEST_WINDOW_S = 0.15, 0.25
#: Strides that a pulse disturbs, its own and the next: the prediction does not learn from them.
_DISTURBED_STRIDES = 2.0
_FEWEST_STRIDES = 20


@dataclass(frozen=True, slots=True)
class Schedule:
    """Timing points, numbers of pulses and strides of an experiment."""

    name: str
    timing_points: Mapping[str, float]  # in the order of the cycle -> % of the gait cycle
    counts: Mapping[str, int]  # pulses of a participant at each, in each condition
    repeats: Mapping[str, int]  # conditions that have the timing point
    design: Design
    gap_strides: float  # mean strides from a pulse to the next
    other_strides: float  # before the first pulse, and of walks without pulses
    sham_share: float
    participants: int
    asked_window_s: float  # which may be longer than that of the method
    displacement_rad: float | None = None  # of the joint, that trips the device

    def strides(self, counts: Mapping[str, float]) -> float:
        """Return the strides of a participant."""
        pulses = sum(n * self.repeats[name] for name, n in counts.items())
        fired = pulses / (1.0 - self.sham_share)
        return self.other_strides + fired * self.gap_strides

    @property
    def teaching_strides(self) -> int:
        """Strides between the pulses, from which unperturbed walking is learned."""
        left = max(self.gap_strides - _DISTURBED_STRIDES, 0.0)
        return max(_FEWEST_STRIDES, round(sum(self.counts.values()) * left))


def schedule_of_protocol(spec: Protocol) -> Schedule:
    """Return the schedule of a walking protocol; raise DataError without pulses."""
    plans = [c.perturbations for c in spec.conditions if c.perturbations is not None]
    if spec.kind != "walking" or not plans:
        raise DataError(
            f"plan: {spec.name} has no pulses in walking. Give a protocol with them, such as "
            "walking_doublets; on a bench, measure loads of known impedance instead."
        )
    if spec.joint != "knee":
        raise DataError(f"plan: the priors are of a knee, and {spec.name} is of the {spec.joint}.")
    points = spec.timing_points
    counts = dict.fromkeys(sorted(points, key=lambda name: points[name]), 0)
    repeats = dict(counts)
    for p in plans:
        for name in p.timing_points or {}:
            counts[name] = max(counts[name], p.counts[name])
            repeats[name] += 1
    return Schedule(
        name=spec.name,
        timing_points={name: points[name] for name in counts},
        counts=counts,
        repeats=repeats,
        design=Design(
            "as in the protocol", spec.shapes, min(spec.window_s or _WINDOW_S, _LONGEST_WINDOW_S)
        ),
        gap_strides=float(np.mean([p.gap_strides or (1, 1) for p in plans])),
        other_strides=float(
            sum(p.warm_up_strides for p in plans) + sum(c.strides or 0 for c in spec.conditions)
        ),
        sham_share=float(np.mean([p.sham_share for p in plans])),
        participants=spec.participants,
        asked_window_s=spec.window_s or _WINDOW_S,
        displacement_rad=spec.safety.displacement_rad,
    )


def recorded_schedule(
    name: str,
    pulses: tuple[NamedPulse, ...],
    timing_points: Mapping[str, float],
    counts: Mapping[str, int],
    gap_strides: tuple[int, int],
    *,
    window_s: float,
    strides: float,
    participants: int,
) -> Schedule:
    """Return the schedule of a recorded study; ``strides`` are those of a participant."""
    return Schedule(
        name=name,
        timing_points=dict(timing_points),
        counts=dict(counts),
        repeats=dict.fromkeys(counts, 1),
        design=Design("as recorded", pulses, min(window_s, _LONGEST_WINDOW_S)),
        gap_strides=float(np.mean(gap_strides)),
        other_strides=max(0.0, strides - sum(counts.values()) * float(np.mean(gap_strides))),
        sham_share=0.0,
        participants=participants,
        asked_window_s=window_s,
    )
