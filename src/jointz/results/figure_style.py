"""Style of figures at the widths of journals, and axes in it."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from functools import wraps
from typing import TYPE_CHECKING, Any, Final, TypeVar, cast

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Axes
    from matplotlib.figure import Figure as Figure
else:  # matplotlib is loaded when a result is drawn
    Axes = Figure = Any

_Plot = TypeVar("_Plot", bound=Callable[..., Any])

#: Double and single column of most journals, mm.
WIDTH_MM: Final = 175.0
COLUMN_MM: Final = 85.0
MM_PER_INCH: Final = 25.4

# Okabe and Ito's palette, safe for colour-blind readers; each differs from the others in
# lightness as well, and marks differ in shape, so that grey prints stay readable.
INK: Final = "#1b1f24"
MUTED: Final = "#5f6872"
FAINT: Final = "#b9c0c8"
GREY: Final = "#8f98a1"
PANEL: Final = "#eff2f5"
BLUE: Final = "#0072b2"
SKY: Final = "#7fb2d3"
VERMILION: Final = "#d55e00"
ORANGE: Final = "#e69f00"
GREEN: Final = "#009e73"
PURPLE: Final = "#a0508c"

_CYCLE: Final = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, INK)

#: Smallest size of text that journals accept, pt.
SMALL_PT: Final = 7.0

_RC: Mapping[str, Any] = {
    # DejaVu Sans comes with matplotlib: outlines drawn from it look the same everywhere.
    "font.family": "DejaVu Sans",
    "font.size": 8.0,
    "axes.labelsize": 8.0,
    "axes.titlesize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": MUTED,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.unicode_minus": True,
    "legend.frameon": False,
    "lines.linewidth": 1.0,
    "hatch.linewidth": 0.4,
    "text.parse_math": False,  # a participant may be called "$1"
    "svg.fonttype": "path",
    "svg.hashsalt": "jointz",
    "pdf.fonttype": 42,  # TrueType: journals refuse Type 3, and text can be searched
}


@contextmanager
def figure_style() -> Iterator[None]:
    """Set the style of figures drawn inside, and restore the user's afterwards."""
    import matplotlib
    from cycler import cycler

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        settings: Any = matplotlib.rcParams  # its stubs allow literal keys only
        settings.update(_RC)
        settings["axes.prop_cycle"] = cycler(color=_CYCLE)
        yield


def in_figure_style(plot: _Plot) -> _Plot:
    """Let a method ``plot`` draw a new figure in this style; axes that are given keep theirs."""

    @wraps(plot)
    def styled(self: Any, ax: "Axes | None" = None, **options: Any) -> "Axes":
        with figure_style() if ax is None else nullcontext():
            return cast("Axes", plot(self, ax, **options))

    return cast("_Plot", styled)


def axes_or_new(ax: "Axes | None", size: tuple[float, float]) -> "Axes":
    """Return the axes, or those of a new figure, as wide as a page and of this shape, if None."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    width = WIDTH_MM / MM_PER_INCH
    shape = (width, width * size[1] / size[0])
    return plt.subplots(figsize=shape, layout="constrained")[1]
