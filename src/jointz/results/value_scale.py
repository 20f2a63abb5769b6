"""Scales on which values are estimated: a logarithm, or the inverse hyperbolic sine."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from jointz.results.estimates import relative_half_width


@dataclass(frozen=True, slots=True)
class ValueScale:
    """``log(value)``, or ``asinh(value / unit)``, on which a value may be zero or negative.

    The two differ by a constant where values are large. Values may be numbers or arrays.
    """

    unit: float = 0.0  # of the values; 0 for the logarithm

    def of(self, value: Any) -> Any:
        """Return the place of a value on the scale."""
        return np.arcsinh(value / self.unit) if self.unit else np.log(value)

    def value(self, place: Any) -> Any:
        """Return the value at a place."""
        return self.unit * np.sinh(place) if self.unit else np.exp(place)

    def slope(self, value: Any) -> Any:
        """Return the derivative of the value by its place."""
        return np.hypot(value, self.unit)

    def moved(self, value: Any, by: Any) -> Any:
        """Return the value that lies so far from another on the scale."""
        return self.value(self.of(value) + by) if self.unit else value * np.exp(by)

    def share(self, value: Any) -> Any:
        """Return the sd on the scale over the relative sd of a value: 1 for a logarithm.

        0 for values of zero and below, which have no relative sd.
        """
        return np.maximum(value, 0.0) / self.slope(value)

    def half_width(self, value: float, sd: float) -> float:
        """Return half of the 95 % interval over the value; endless at zero and below."""
        share = float(self.share(value))
        return relative_half_width(sd) / share if share > 0.0 else np.inf


LOGARITHM = ValueScale()


def shares_at(scales: Iterable[ValueScale], places: np.ndarray) -> np.ndarray:
    """Return the sd on its scale over the relative sd of the value at each place, (n,)."""
    return np.array([s.share(s.value(place)) for s, place in zip(scales, places, strict=True)])
