"""Decisions on the pulses to come, from estimates of those so far.

A decision is asked for at one stride, from the records up to then, and takes effect at a later one.
Question and decision stand in the journal: a resumed session goes on with what was decided, and
the same records give the same decision again.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from jointz.core.protocols.protocol_models import LiveSpec
from jointz.core.protocols.pulse_models import PulseVariant
from jointz.rig.experiment.files.journal import (
    Event,
    pulses_begun,
    pulses_done,
    pulses_withdrawn,
)
from jointz.rig.experiment.plan import PlannedPulse

#: Strides from a question to its effect: an estimate takes some seconds.
STRIDES_TO_DECIDE = 20
#: A decision moves the pulses until so many times the next question; those beyond stay as planned,
#: in case there is no further decision.
_AHEAD = 2
Variant = tuple[str, str, float]
#: What a decision changes of a pulse.
_STEERED = ("timing_point", "gait_pct", "shape", "amplitude_nm")


@dataclass(frozen=True, slots=True)
class Decision:
    """Decision of an estimate on the pulses to come."""

    stop: bool = False  # whether they are not needed
    # timing point -> share of the pulses to come; empty: as planned
    shares: Mapping[str, float] = field(default_factory=dict)
    about: Mapping[str, Any] = field(default_factory=dict)  # numbers behind it, for the journal


class Advisor(Protocol):
    """Estimates beside the session, without holding it up."""

    def ask(self, question: Event) -> None:
        """Begin an estimate from the records up to the slot of a question."""
        ...

    def answer(self, *, wait: bool) -> Decision | None:
        """Return the decision, None while there is none; ``wait`` until there is."""
        ...


@dataclass(slots=True)
class PulseHistory:
    """Pulses of a trial that were done, begun and withdrawn, earlier stretches included."""

    done: Counter[Variant] = field(default_factory=Counter)  # without shams
    begun: set[int] = field(default_factory=set)  # numbers of those that began
    withdrawn: set[Variant] = field(default_factory=set)

    @classmethod
    def of_journal(
        cls, plan: Sequence[PlannedPulse], events: Sequence[Event], condition: str
    ) -> "PulseHistory":
        """Return the history of a trial that is taken up again."""
        numbers = pulses_done(events, condition)
        withdrawn = pulses_withdrawn(events, condition)
        return cls(
            Counter(p.variant for p in plan if p.number in numbers and not p.sham),
            set(pulses_begun(events, condition)),
            {p.variant for p in plan if p.number in withdrawn},
        )


@dataclass(frozen=True, slots=True)
class DecisionSettings:
    """How a trial decides."""

    spec: LiveSpec
    advisor: Advisor
    waits: bool  # whether time stands still until there is an answer
    rng: Callable[[int], np.random.Generator]  # random numbers of a decision, by its number
    history: PulseHistory
    variants: Sequence[PulseVariant]  # shapes, sizes and signs that every timing point gets
    asked: int = 0  # questions so far, of earlier stretches
    pulses_at_last: int = 0  # pulses that were done at the question of the last decision
    stopped: bool = False  # whether one of them has ended the pulses


class Decisions:
    """Asks every so many pulses, and returns every decision at the stride of its effect."""

    def __init__(self, settings: DecisionSettings, points: Mapping[str, float]) -> None:
        self._settings = settings
        self._points = points
        self.history = settings.history
        self._number = settings.asked
        self._at_question = settings.pulses_at_last  # pulses that were done then
        self._question: Event | None = None
        self._over = settings.stopped

    @property
    def is_due(self) -> bool:
        """True when enough pulses were done since the last question."""
        spec, n_done = self._settings.spec, self.history.done.total()
        if self._over or self._question is not None:
            return False
        first = spec.fewest_pulses * len(self._points)
        if "steer" in spec.may:  # which points will need more is known before they have enough
            first //= 2
        return n_done >= first and n_done - self._at_question >= spec.every_pulses

    def ask(self, question: Event) -> Event:
        """Ask a question and return it with its number."""
        self._number += 1
        self._at_question = self.history.done.total()
        self._question = {**question, "number": self._number, "n_done": self._at_question}
        self._settings.advisor.ask(self._question)
        return self._question

    def answered(self, stride: int) -> tuple[Event, Decision] | None:
        """Return question and decision if one takes effect at this stride."""
        question = self._question
        if question is None or stride < question["stride"] + STRIDES_TO_DECIDE:
            return None
        decision = self._settings.advisor.answer(wait=self._settings.waits)
        if decision is None:
            return None
        self._question, self._over = None, decision.stop
        return question, decision

    def steered(self, decision: Decision, queue: Iterable[PlannedPulse]) -> list[PlannedPulse]:
        """Return the queue with the next pulses at the timing points that want them.

        Gaps, shams and numbers stay as planned, and pulses that began before; every timing point
        gets the shapes, sizes and signs next that it has had least often.
        """
        rng, history = self._settings.rng(self._number), self.history
        ahead = _AHEAD * self._settings.spec.every_pulses
        pulses = list(queue)
        places = [i for i, pulse in enumerate(pulses[:ahead]) if pulse.number not in history.begun]
        counts = history.done.copy()
        for i, point in zip(places, _spread(decision.shares, len(places), rng), strict=True):
            moved = replace(pulses[i], timing_point=point, gait_pct=self._points[point])
            if not moved.sham:
                every = ((point, one.shape, one.amplitude_nm) for one in self._settings.variants)
                variants = [variant for variant in every if variant not in history.withdrawn]
                if not variants:  # this knee is too soft for any pulse there
                    continue
                fewest = min(counts[variant] for variant in variants)
                rarest = [variant for variant in variants if counts[variant] == fewest]
                _, shape, amplitude_nm = chosen = rarest[rng.integers(len(rarest))]
                counts[chosen] += 1
                moved = replace(moved, shape=shape, amplitude_nm=amplitude_nm)
            pulses[i] = moved
        return pulses


def _spread(shares: Mapping[str, float], count: int, rng: np.random.Generator) -> list[str]:
    """Return timing points in their shares, each spread over the whole, in a random order."""
    total = sum(shares.values())
    exact = {point: count * share / total for point, share in shares.items()}
    numbers = {point: int(one) for point, one in exact.items()}
    by_rest = sorted(exact, key=lambda point: numbers[point] - exact[point])
    for point in by_rest[: count - sum(numbers.values())]:
        numbers[point] += 1
    places = [((k + rng.random()) / n, point) for point, n in numbers.items() for k in range(n)]
    return [point for _, point in sorted(places)]


def as_decided(plan: Sequence[Any], events: Sequence[Event], condition: str) -> tuple[Any, ...]:
    """Return the plan of a trial with what was decided since; on a bench that is nothing."""
    changes: dict[int, dict[str, Any]] = {}
    for event in events:
        if event["condition"] != condition:
            continue
        if event["event"] == "decided":
            changes |= {one["number"]: one for one in event["pulses"]}
        elif event["event"] == "pulse_started" and "timing_point" in event:
            changes[event["pulse"]] = {name: event[name] for name in _STEERED if name in event}
    return tuple(replace(p, **changes[p.number]) if p.number in changes else p for p in plan)


def pulses_needed(plan: Iterable[Any], events: Sequence[Event], condition: str) -> set[int]:
    """Return the pulses of a trial that were not withdrawn, nor ended by a decision."""
    needed = {pulse.number for pulse in plan} - pulses_withdrawn(events, condition)
    stops = [place for place, event in enumerate(events) if is_stop(event, condition)]
    return needed & set(pulses_done(events[: stops[0]], condition)) if stops else needed


def is_stop(event: Event, condition: str) -> bool:
    """Return whether an event is the decision that ends the pulses of a trial."""
    return (event["event"], event["condition"]) == ("decided", condition) and event["stop"]
