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
    """Draw the figures whose curves are there.

    Parameters
    ----------
    drawings : mapping of str to (str, callable)
        Figure -> name of its curve, and what draws it.
    curves : mapping
        Name -> plain values, as a :class:`~jointz.core.reproduction.Reproduction` holds them.

    Returns
    -------
    dict of str to str
        Name of the figure -> SVG text, 180 mm wide; a figure without a curve is not in it.
    """
    with figure_style():
        return {
            name: to_svg(draw(curves[curve]))
            for name, (curve, draw) in drawings.items()
            if curves.get(curve)
        }


def numbers(values: Sequence[float | None] | float | None) -> np.ndarray:
    """Return plain values as an array, NaN where there is none.

    Parameters
    ----------
    values : sequence of float or None
        As read from JSON.

    Examples
    --------
    >>> numbers([1, None])
    array([ 1., nan])
    """
    return np.asarray(values, dtype=float)


def every(size: int, *, most: int = MOST_POINTS) -> slice:
    """Return which samples to draw of a long record.

    Parameters
    ----------
    size : int
        Samples of the record.
    most : int
        Points to draw at most.

    Examples
    --------
    >>> every(10, most=5), every(11, most=5)
    (slice(None, None, 2), slice(None, None, 3))
    """
    return slice(None, None, max(1, -(-size // most)))
