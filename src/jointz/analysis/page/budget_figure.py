"""Figure of the error budget: the sources of the uncertainty of K, B and J."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from jointz.analysis.page.details_tables import SOURCES, variance_shares
from jointz.analysis.summary import counted_people
from jointz.report.style import new_figure, panel_heading, place_legend, place_panels
from jointz.report.subjects import subjects, timing_points
from jointz.report.wording import ABSOLUTE, parameter_name
from jointz.results.estimates import CellEstimate
from jointz.results.figure_style import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    MUTED,
    ORANGE,
    PANEL,
    PURPLE,
    SKY,
    SMALL_PT,
    VERMILION,
)
from jointz.results.person_estimates import person_cells
from jointz.results.study_analysis import StudyAnalysis

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Source -> (name in words, colour, hatch). Neighbours in the stack differ by their hatch, as
#: eleven colours cannot be told apart in a grey print.
_LOOKS: Final[Mapping[str, tuple[str, str, str]]] = {
    "noise": ("strides that differ", BLUE, ""),
    "lag": ("lag and resonance of the sensor", VERMILION, "////"),
    "friction": ("friction model", ORANGE, "||||"),
    "cross_talk": ("torque seen as angle", "#c9b458", "++"),
    "inertia_model": ("inertia over the cycle", GREEN, "\\\\\\\\"),
    "drift": ("K and B inside the window", SKY, ""),
    "reflex": ("reflexes of the muscles", "#8c6d5a", "----"),
    "prior": ("prior knowledge", FAINT, "...."),
    "model": ("which model holds", PURPLE, "xxxx"),
    "gain": ("gains of angle and torque", MUTED, "++++"),
    "intrinsic": ("impedance of the device", INK, "||||"),
}
_OTHERS: Final = ("all others", PANEL, "")
#: Sources that never reach this share are drawn together.
_SMALL: Final = 0.02
_LEFT_MM: Final = 12.0
_LEGEND_COLUMNS: Final = 4
_LEGEND_ROW_MM: Final = 4.6


def source_name(source: str) -> str:
    """Return the name of a source of uncertainty in words.

    Parameters
    ----------
    source : str
        A key of :attr:`~jointz.results.estimates.CellEstimate.budget`.

    Examples
    --------
    >>> source_name("lag"), source_name("moon_phase")
    ('lag and resonance of the sensor', 'moon phase')
    """
    return _LOOKS[source][0] if source in _LOOKS else source.replace("_", " ")


def mean_shares(cells: Sequence[CellEstimate], parameter: str) -> dict[str, float]:
    """Return the mean share of each source in the variance over cells."""
    shares = [s for c in cells if (s := variance_shares(c, parameter))]
    if not shares:
        return {}
    names = [*SOURCES, *(n for n in shares[0] if n not in SOURCES)]
    return {name: float(np.mean([s.get(name, 0.0) for s in shares])) for name in names}


def draw_budget(analysis: StudyAnalysis) -> "Figure | None":
    """Draw the share of each source in the variance, stacked, by timing point and parameter."""
    budgeted = person_cells([c for c in analysis.cells if c.budget])
    names = timing_points(budgeted)
    by_parameter = {
        parameter: [
            mean_shares([c for c in budgeted if c.timing_point == name], parameter)
            for name in names
        ]
        for parameter in ABSOLUTE
    }
    shown = _shown([shares for rows in by_parameter.values() for shares in rows])
    if not shown:
        return None
    lines = int(np.ceil((len(shown) + 1) / _LEGEND_COLUMNS))
    top = 7.0 + lines * _LEGEND_ROW_MM
    figure = new_figure(top + 51.0)
    panels = place_panels(figure, len(ABSOLUTE), left_mm=_LEFT_MM, top_mm=top, height_mm=43.0)
    for axes, (parameter, rows) in zip(panels, by_parameter.items(), strict=True):
        _draw_bars(axes, rows, shown)
        sizes = [_relative_sd(budgeted, name, parameter) for name in names]
        _finish(axes, names, sizes, first=axes is panels[0])
        panel_heading(axes, parameter_name(parameter))
    place_legend(figure, _legend(shown), columns=_LEGEND_COLUMNS)
    return figure


def budget_caption(analysis: StudyAnalysis) -> str:
    """Return the caption of the figure."""
    return (
        "Error budget: share of each source in the variance of the estimates, mean over "
        f"{subjects(analysis).many}, undecided estimates included. Above the bars: standard "
        "deviation, % of the estimate (median). Strides that differ: errors of the predicted "
        "unperturbed motion, including the uncertainty of the lag that they cause; more pulses or "
        "a measured lag reduce them. Prior knowledge: what the data leave to prior assumptions. "
        f"n: {counted_people(analysis)}."
    )


def _shown(every: Sequence[Mapping[str, float]]) -> list[str]:
    return [n for n in _LOOKS if any(shares.get(n, 0.0) >= _SMALL for shares in every)]


def _draw_bars(axes: "Axes", rows: Sequence[Mapping[str, float]], shown: Sequence[str]) -> None:
    at = np.arange(len(rows))
    foot = np.zeros(len(rows))
    for name in (*shown, "other"):
        if name == "other":
            heights = np.array([1.0 if r else 0.0 for r in rows]) - foot
            _, colour, hatch = _OTHERS
        else:
            heights = np.array([r.get(name, 0.0) for r in rows])
            _, colour, hatch = _LOOKS[name]
        axes.bar(
            at, 100.0 * heights, bottom=100.0 * foot, width=0.72, color=colour,
            edgecolor="white", linewidth=0.4, hatch=hatch,
        )  # fmt: skip
        foot = foot + heights


def _relative_sd(cells: Sequence[CellEstimate], name: str, parameter: str) -> float:
    """Return the median over people of the whole sd over the size of the estimate."""
    sizes = []
    for cell in cells:
        estimate = cell.parameter(parameter)
        if cell.timing_point == name and estimate is not None and estimate.unbounded:
            sd = float(np.linalg.norm(list(cell.budget[parameter].values())))
            sizes.append(sd / abs(estimate.unbounded))
    return float(np.median(sizes)) if sizes else np.nan


def _finish(axes: "Axes", names: Sequence[str], sizes: Sequence[float], *, first: bool) -> None:
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.set_xticks(range(len(names)), names, rotation=45 if len(names) > 8 else 0)
    axes.tick_params(axis="x", labelsize=SMALL_PT, length=0)
    axes.set_ylim(0.0, 108.0)
    axes.set_yticks([0, 25, 50, 75, 100])
    if first:
        axes.set_ylabel("Share of the variance (%)")
    for at, size in enumerate(sizes):
        if np.isfinite(size):
            axes.text(
                at, 101.5, f"{100 * size:.2g}", ha="center", va="bottom",
                fontsize=SMALL_PT, color=MUTED,
            )  # fmt: skip


def _legend(shown: Sequence[str]) -> "list[Artist]":
    from matplotlib.patches import Patch

    looks = [*(_LOOKS[name] for name in shown), _OTHERS]
    return [
        Patch(facecolor=colour, label=text, hatch=hatch, edgecolor="white", linewidth=0.4)
        for text, colour, hatch in looks
    ]
