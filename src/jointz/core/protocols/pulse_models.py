"""Pulses of a protocol: shapes of torque over time, their sizes and signs.

A shape is a course: parts of time in each of which the torque goes linearly from one share
of the amplitude to another.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import isclose
from typing import Annotated, Literal

from pydantic import Field

from jointz.core.checked_model import Check, CheckedModel, Problem
from jointz.core.study import Name, name_problem

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(ge=-1, le=1)]
Direction = Literal["positive", "negative", "both"]
_LONGEST_NAME = 64
#: What times and shares of a protocol may differ by.
_ROUNDING = 1e-9


def printable_name_problem(name: str) -> str:
    """Return what is wrong with a name that stands in tables and names no file, "" if nothing."""
    if name.isprintable() and name == name.strip() and 0 < len(name) <= _LONGEST_NAME:
        return ""
    return (
        f"expected a name of at most {_LONGEST_NAME} characters that print, without space around it"
    )


@dataclass(frozen=True, slots=True)
class TorquePart:
    """A part of a pulse in which torque changes linearly."""

    duration_s: float
    begin: float  # shares of the amplitude
    end: float


@dataclass(frozen=True, slots=True)
class PulseVariant:
    """One of the pulses that a timing point gets equally often."""

    shape: str  # name of the shape; "" for the only pulse of a protocol
    amplitude_nm: float  # signed


class _Pulse(CheckedModel):
    """Base of pulses.

    Beside its course, each has ``sizes_nm`` (amplitudes without signs) under ``size_key``,
    ``timed_parts`` (key and duration, s, of each part that a loop has to follow) and ``changes``
    of torque (key, share of the amplitude and duration, s).
    """

    direction: Direction = "positive"

    @property
    def course(self) -> tuple[TorquePart, ...]:
        """The parts, one after the other; torque is zero before and after."""
        raise NotImplementedError

    @property
    def length_s(self) -> float:
        """Time from the onset to the end, s."""
        return sum(part.duration_s for part in self.course)

    @property
    def signs(self) -> tuple[float, ...]:
        """Directions that take turns."""
        return {"positive": (1.0,), "negative": (-1.0,), "both": (1.0, -1.0)}[self.direction]


class _Trapezoid(_Pulse):
    """Base of trapezoids."""

    ramp_up_s: NotNegative = 0.0
    hold_s: NotNegative = 0.0
    ramp_down_s: NotNegative = 0.0

    @property
    def course(self) -> tuple[TorquePart, ...]:
        """Ramp up, hold, ramp down, as far as they last."""
        parts = (
            TorquePart(self.ramp_up_s, 0.0, 1.0),
            TorquePart(self.hold_s, 1.0, 1.0),
            TorquePart(self.ramp_down_s, 1.0, 0.0),
        )
        return tuple(part for part in parts if part.duration_s > 0.0)

    @property
    def timed_parts(self) -> tuple[tuple[str, float], ...]:
        """Ramps and hold."""
        keys = "ramp_up_s", "hold_s", "ramp_down_s"
        return tuple((key, getattr(self, key)) for key in keys)

    @property
    def changes(self) -> tuple[tuple[str, float, float], ...]:
        """Both ramps."""
        return ("ramp_up_s", 1.0, self.ramp_up_s), ("ramp_down_s", 1.0, self.ramp_down_s)


class PulseSpec(_Trapezoid):
    """The only pulse of a protocol, a trapezoid of torque: ramp up, hold, ramp down."""

    amplitude_nm: Positive
    duration_s: Positive
    hold_s: NotNegative

    def checks(self) -> tuple[Check, ...]:
        """Return the checks between the parts."""
        return (self._parts_add_up,)

    @property
    def sizes_nm(self) -> tuple[float, ...]:
        """The amplitude."""
        return (self.amplitude_nm,)

    @property
    def size_key(self) -> str:
        """The key of the amplitude."""
        return "amplitude_nm"

    @property
    def length_s(self) -> float:
        """Time from the onset to the end, s."""
        return self.duration_s

    def _parts_add_up(self) -> Iterator[Problem]:
        parts = self.ramp_up_s + self.hold_s + self.ramp_down_s
        if not isclose(parts, self.duration_s, abs_tol=_ROUNDING):
            yield Problem(
                ("duration_s",),
                f"expected ramp_up_s + hold_s + ramp_down_s = {parts:g} s, got "
                f"{self.duration_s:g} s. Correct the part that is wrong.",
            )


class _NamedPulse(_Pulse):
    """Base of the pulses of which a protocol may have several."""

    name: Name
    amplitudes_nm: tuple[Positive, ...] = Field(min_length=1, max_length=8, strict=False)

    @property
    def sizes_nm(self) -> tuple[float, ...]:
        """The amplitudes, without signs."""
        return self.amplitudes_nm

    @property
    def size_key(self) -> str:
        """The key of the amplitudes."""
        return "amplitudes_nm"

    def checks(self) -> tuple[Check, ...]:
        """Return the checks of name and sizes."""
        return self._named, self._sizes_differ

    def _named(self) -> Iterator[Problem]:
        problem = printable_name_problem(self.name) or name_problem(self.name)
        if problem:
            yield Problem(("name",), f"{problem}; got {self.name[:80]!r}.")

    def _sizes_differ(self) -> Iterator[Problem]:
        if len(set(self.amplitudes_nm)) < len(self.amplitudes_nm):
            yield Problem(
                ("amplitudes_nm",),
                f"expected different amplitudes, got {list(self.amplitudes_nm)}: every one is "
                "fired equally often.",
            )


class TrapezoidPulse(_Trapezoid, _NamedPulse):
    """Ramp up, hold, ramp down; without ramps a hold, without hold and ramp down a ramp."""

    kind: Literal["trapezoid"]

    def checks(self) -> tuple[Check, ...]:
        """Return the checks of sizes and parts."""
        return (*super().checks(), self._lasts)

    def _lasts(self) -> Iterator[Problem]:
        if not self.course:
            message = "missing; give it, ramp_up_s or ramp_down_s: the pulse has no duration."
            yield Problem(("hold_s",), message)


class DoubletPulse(_NamedPulse):
    """Two levels, one after the other; of opposite sign, they move the joint there and back."""

    kind: Literal["doublet"]
    durations_s: tuple[Positive, Positive] = Field(strict=False)
    second_level: Share = -1.0

    def checks(self) -> tuple[Check, ...]:
        """Return the checks of sizes and levels."""
        return (*super().checks(), self._two_levels)

    @property
    def course(self) -> tuple[TorquePart, ...]:
        """The two levels."""
        first_s, second_s = self.durations_s
        level = self.second_level
        return TorquePart(first_s, 1.0, 1.0), TorquePart(second_s, level, level)

    @property
    def timed_parts(self) -> tuple[tuple[str, float], ...]:
        """Both levels."""
        return tuple(("durations_s", duration_s) for duration_s in self.durations_s)

    @property
    def changes(self) -> tuple[tuple[str, float, float], ...]:
        """The largest of its steps."""
        return (("second_level", max(1.0, abs(1.0 - self.second_level)), 0.0),)

    def _two_levels(self) -> Iterator[Problem]:
        if self.second_level in (0.0, 1.0):
            yield Problem(
                ("second_level",),
                f"{self.second_level:g} makes one level of two. Give a share of the amplitude "
                'between -1 and 1, or kind = "trapezoid".',
            )


class SampledPulse(_NamedPulse):
    """A table of torque over time, linear between its rows."""

    kind: Literal["samples"]
    times_s: tuple[NotNegative, ...] = Field(min_length=2, max_length=1000, strict=False)
    shares: tuple[Share, ...] = Field(min_length=2, max_length=1000, strict=False)

    def checks(self) -> tuple[Check, ...]:
        """Return the checks of sizes and table."""
        return (*super().checks(), self._times_increase, self._as_long, self._reaches_amplitude)

    @property
    def course(self) -> tuple[TorquePart, ...]:
        """One part between two rows."""
        # Not strict: checks run on tables that lack a row, too, which one of them reports.
        rows = pairwise(zip(self.times_s, self.shares, strict=False))
        return tuple(TorquePart(t1 - t0, s0, s1) for (t0, s0), (t1, s1) in rows)

    @property
    def timed_parts(self) -> tuple[tuple[str, float], ...]:
        """The time between rows."""
        return tuple(("times_s", part.duration_s) for part in self.course)

    @property
    def changes(self) -> tuple[tuple[str, float, float], ...]:
        """Steps at onset and end, and what lies between rows."""
        ends = ("shares", abs(self.shares[0]), 0.0), ("shares", abs(self.shares[-1]), 0.0)
        between = (("shares", abs(s.end - s.begin), s.duration_s) for s in self.course)
        return *ends, *between

    def _times_increase(self) -> Iterator[Problem]:
        times = self.times_s
        if times[0] != 0.0 or any(b <= a for a, b in pairwise(times)):
            yield Problem(("times_s",), "expected times that increase from 0, the onset.")

    def _as_long(self) -> Iterator[Problem]:
        if len(self.shares) != len(self.times_s):
            yield Problem(
                ("shares",),
                f"expected {len(self.times_s)}, one for each of times_s, got {len(self.shares)}.",
            )

    def _reaches_amplitude(self) -> Iterator[Problem]:
        largest = max(map(abs, self.shares))
        if not isclose(largest, 1.0, abs_tol=_ROUNDING):
            yield Problem(
                ("shares",),
                f"expected 1 or -1 somewhere, where the amplitude is reached; the largest is "
                f"{largest:g}. Divide them by it.",
            )


#: One of several pulses of a protocol.
NamedPulse = Annotated[TrapezoidPulse | DoubletPulse | SampledPulse, Field(discriminator="kind")]
#: Any pulse.
Pulse = PulseSpec | TrapezoidPulse | DoubletPulse | SampledPulse


def variants_of(pulses: tuple[Pulse, ...]) -> tuple[PulseVariant, ...]:
    """Return every shape in every size and direction."""
    return tuple(
        PulseVariant(name_of(pulse), sign * size)
        for pulse in pulses
        for size in pulse.sizes_nm
        for sign in pulse.signs
    )


def name_of(pulse: Pulse) -> str:
    """Return the name of a pulse; "" for the only one of a protocol."""
    return "" if isinstance(pulse, PulseSpec) else pulse.name
