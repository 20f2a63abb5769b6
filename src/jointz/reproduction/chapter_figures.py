"""What the figures of all chapters share: which of them to draw, and how densely."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from jointz.report.style import figure_style, to_svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: More points than these no page shows and no printer prints.
MOST_POINTS: Final = 3000

#: Figure -> the curve it shows, and what draws it.
Drawings = Mapping[str, tuple[str, "Callable[[Any], Figure]"]]


def draw_given(drawings: Drawings, curves: Mapping[str, Any]) -> dict[str, str]:
    """Draw the figures whose curves are there."""
    with figure_style():
        return {
            name: to_svg(draw(curves[curve]))
            for name, (curve, draw) in drawings.items()
            if curves.get(curve)
        }


def numbers(values: Sequence[float | None] | float | None) -> np.ndarray:
    """Return plain values as an array, NaN where there is none."""
    return np.asarray(values, dtype=float)


def every(size: int, *, most: int = MOST_POINTS) -> slice:
    """Return which samples to draw of a long record."""
    return slice(None, None, max(1, -(-size // most)))
