"""References: the courses of torque or position besides the pulses, on a bench or in walking.

The table a reference stands in names quantity and unit (``torque_nm``,
``position_rad``, ``velocity_rad_s``); amplitudes and offsets are in that unit.
Frequencies are in Hz and stand in sin(2 pi f t), so that the ``sin(1.4 t)`` of
equations 2.2 to 2.6 is read as 1.4 Hz. A reference that ends begins again.
"""

from collections.abc import Iterator
from fractions import Fraction
from functools import reduce
from itertools import pairwise
from math import gcd
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from jointz.core.checked_model import Check, CheckedModel, Problem

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]

#: Standard deviations of noise that count as its largest values.
_NOISE_REACH_SD = 3.0


class _Reference(CheckedModel):
    """Base of references."""

    #: Whether it ends after one cycle, which then sets the condition's duration.
    runs_out: ClassVar[bool] = False

    @property
    def cycle_s(self) -> float | None:
        """Period, s; None if it never repeats."""
        return None

    @property
    def fastest_hz(self) -> float:
        """Highest frequency that the loop has to follow, Hz; 0 where it has none."""
        return 0.0


class Sine(_Reference):
    """``offset + amplitude * sin(2 pi frequency_hz t)``."""

    kind: Literal["sine"]
    amplitude: Positive
    frequency_hz: Positive
    offset: float = 0.0

    @property
    def cycle_s(self) -> float:
        """One period, s."""
        return 1.0 / self.frequency_hz

    @property
    def fastest_hz(self) -> float:
        """Its frequency, Hz."""
        return self.frequency_hz

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest value."""
        return self.offset - self.amplitude, self.offset + self.amplitude


class SineTerm(CheckedModel):
    """One sine of a sum."""

    amplitude: Positive
    frequency_hz: Positive


class SumOfSines(_Reference):
    """``offset + sum of amplitude * sin(2 pi frequency_hz t)``."""

    kind: Literal["sum_of_sines"]
    terms: tuple[SineTerm, ...] = Field(min_length=1, strict=False)
    offset: float = 0.0

    @property
    def cycle_s(self) -> float:
        """Time after which all terms have gone through whole periods, s."""
        # str gives the decimal as written: 1.4 is 7/5 and not the nearest binary fraction.
        rates = [Fraction(str(term.frequency_hz)) for term in self.terms]
        return float(1 / reduce(_common_divisor, rates))

    @property
    def fastest_hz(self) -> float:
        """Highest frequency of a term, Hz."""
        return max(term.frequency_hz for term in self.terms)

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest value that the terms could add up to."""
        reach = sum(term.amplitude for term in self.terms)
        return self.offset - reach, self.offset + reach


class Sweep(CheckedModel):
    """One chirp: frequency and amplitude go from start to end, linearly in time."""

    amplitude: tuple[NotNegative, NotNegative] = Field(strict=False)
    frequency_hz: tuple[Positive, Positive] = Field(strict=False)
    duration_s: Positive


class Chirps(_Reference):
    """Sweeps, one after the other."""

    runs_out: ClassVar[bool] = True

    kind: Literal["chirps"]
    sweeps: tuple[Sweep, ...] = Field(min_length=1, strict=False)
    offset: float = 0.0

    @property
    def cycle_s(self) -> float:
        """Duration of all sweeps, s."""
        return sum(sweep.duration_s for sweep in self.sweeps)

    @property
    def fastest_hz(self) -> float:
        """Highest frequency of a sweep, Hz."""
        return max(max(sweep.frequency_hz) for sweep in self.sweeps)

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest value."""
        reach = max(max(sweep.amplitude) for sweep in self.sweeps)
        return self.offset - reach, self.offset + reach


class Noise(_Reference):
    """Gaussian white noise through a Butterworth low-pass, ``sd`` after the filter.

    An amplitude of noise in the dissertation (2.2.2) is read as two standard deviations.
    """

    kind: Literal["noise"]
    sd: Positive
    cutoff_hz: Positive
    order: Annotated[int, Field(ge=1, le=10)]
    offset: float = 0.0

    @property
    def fastest_hz(self) -> float:
        """The cutoff, Hz."""
        return self.cutoff_hz

    @property
    def bounds(self) -> tuple[float, float]:
        """Three standard deviations below and above the offset."""
        reach = _NOISE_REACH_SD * self.sd
        return self.offset - reach, self.offset + reach


class Steps(_Reference):
    """Levels, each held for the same time."""

    runs_out: ClassVar[bool] = True

    kind: Literal["steps"]
    levels: tuple[float, ...] = Field(min_length=1, strict=False)
    hold_s: Positive

    @property
    def cycle_s(self) -> float:
        """Duration of all levels, s."""
        return len(self.levels) * self.hold_s

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest level."""
        return min(self.levels), max(self.levels)


class Trajectory(_Reference):
    """One recorded cycle, as samples evenly spaced over it; the first follows the last."""

    kind: Literal["trajectory"]
    samples: tuple[float, ...] = Field(min_length=4, strict=False)
    duration_s: Positive

    def checks(self) -> tuple[Check, ...]:
        """Return the check of the samples."""
        return (self._moves,)

    def _moves(self) -> Iterator[Problem]:
        if all(a == b for a, b in pairwise(self.samples)):
            yield Problem(("samples",), 'all are the same. Give kind = "steps" for a constant.')

    @property
    def cycle_s(self) -> float:
        """Duration of the recorded cycle, s."""
        return self.duration_s

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest sample."""
        return min(self.samples), max(self.samples)


Reference = Annotated[
    Sine | SumOfSines | Chirps | Noise | Steps | Trajectory, Field(discriminator="kind")
]


def _common_divisor(a: Fraction, b: Fraction) -> Fraction:
    return Fraction(
        gcd(a.numerator * b.denominator, b.numerator * a.denominator),
        a.denominator * b.denominator,
    )
