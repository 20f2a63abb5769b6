"""Wishes of a plan, and their ranges."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import ceil, floor, log10
from typing import Any

from jointz.core.errors import DataError
from jointz.identify.preparation.cell_data import PARAMETERS
from jointz.results.estimates import WIDEST

MOST_PEOPLE, MOST_MINUTES = 200, 600.0
MOST_MEAN_PCT, MOST_DIFFERENCE_PCT = 100.0, 300.0


@dataclass(frozen=True, slots=True)
class Wishes:
    """Wanted half-widths, differences and limits; percentages are of the value.

    Parameters
    ----------
    half_width_pct : float, optional
        Half of the 95 % interval of a participant's estimates at every timing point.
    parameters : tuple of str
        Of which of ``stiffness``, ``damping`` and ``inertia``.
    share : float
        Share of legs that shall reach it; also the power of a difference.
    minutes : float, optional
        Walking of a participant, at most; without a wanted half-width, the most precise plan
        of that length.
    participants : int, optional
        At most; by default the protocol's, or as many as the other wishes need.
    mean_pct : float, optional
        Half-width of the mean over people.
    difference_pct : float, optional
        Difference between two conditions of the same people that shall be found.
    motion_deg : float
        Motion of the joint that nine of ten legs may not exceed.
    """

    half_width_pct: float | None = None
    parameters: tuple[str, ...] = ("stiffness", "damping")
    share: float = 0.8
    minutes: float | None = None
    participants: int | None = None
    mean_pct: float | None = None
    difference_pct: float | None = None
    motion_deg: float = 15.0

    def __post_init__(self) -> None:
        problems = out_of_range(
            ("half_width_pct", self.half_width_pct, 1.0, 100.0 * WIDEST, ""),
            ("share", self.share, 0.5, 0.95, ""),
            ("minutes", self.minutes, 1.0, MOST_MINUTES, ""),
            ("participants", self.participants, 1, MOST_PEOPLE, ""),
            ("mean_pct", self.mean_pct, 1.0, MOST_MEAN_PCT, ""),
            ("difference_pct", self.difference_pct, 1.0, MOST_DIFFERENCE_PCT, ""),
            ("motion_deg", self.motion_deg, 0.5, 18.0, ""),
        )
        if self.participants is not None and int(self.participants) != self.participants:
            problems.append(f"participants: expected a whole number, got {self.participants:g}")
        unknown = [name for name in self.parameters if name not in PARAMETERS]
        if unknown or not self.parameters:
            problems.append(f"parameters: expected some of {', '.join(PARAMETERS)}, got {unknown}")
        if problems:
            raise DataError("plan: " + "; ".join(problems) + ".")


def rounded_up(value: float) -> float:
    """Return a number of three digits that can be named and typed, a little above ``value``."""
    digits = 2 - floor(log10(value))
    # Above it even if it has three digits: the last bit of a float must not matter.
    return round(ceil(value * 10.0**digits + 1e-6) / 10.0**digits, digits)


def out_of_range(*numbers: tuple[str, float | None, float, float, str]) -> list[str]:
    """Return what is wrong with numbers: name, value, least, largest and unit of each."""
    return [
        f"{name}: expected {low:g} to {high:g}{unit}, got {value:g}"
        for name, value, low, high, unit in numbers
        if value is not None and not low <= value <= high
    ]


def made_wishes(wishes: Mapping[str, Any]) -> Wishes:
    """Return wishes by name; raise DataError for a name that is none."""
    names = [f.name for f in fields(Wishes)]
    if unknown := sorted(set(wishes) - set(names)):
        raise DataError(
            f"plan: expected wishes among {', '.join(names)}, got {', '.join(unknown)}."
        )
    return Wishes(**wishes)
