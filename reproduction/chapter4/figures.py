"""The figures of chapter IV and 3.7 again: impedance over the cycle beside print and truth."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from jointz.core.channels import axis_label
from jointz.report.style import legend_line, new_figure, place_axes, place_legend, shade_phases
from jointz.report.wording import DASH
from jointz.results.figure_style import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    MUTED,
    PANEL,
    PURPLE,
    SKY,
    SMALL_PT,
    VERMILION,
)
from reproduction.chapter4 import statistics_figures
from reproduction.chapter_page import Drawings, draw_figures, mark

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_Rows = Sequence[Mapping[str, Any]]
#: Source -> its place beside the timing point (% of the cycle), colour and marker.
_LOOKS: Final[Mapping[str, tuple[float, str, Mapping[str, Any]]]] = {
    "printed": (
        -2.4,
        MUTED,
        {"marker": "v", "markersize": 5.0, "markeredgewidth": 0.8, "markerfacecolor": "white"},
    ),
    "dissertation": (-0.8, VERMILION, {"marker": "o", "markersize": 4.6, "markeredgewidth": 0.8}),
    "recommended": (0.8, BLUE, {"marker": "D", "markersize": 4.2, "markeredgewidth": 0.8}),
}
_LABELS: Final = {
    "printed": "printed",
    "dissertation": "dissertation\N{RIGHT SINGLE QUOTATION MARK}s method",
    "recommended": "recommended",
}
#: How far the truth reaches to both sides of a timing point, % of the cycle.
_TRUTH_REACH: Final = 3.2
_QUASI_PLACE: Final = 2.4
_STATED_PLACE: Final = 4.2
_TRUTH_LOOK: Final[Mapping[str, Any]] = {"linewidth": 2.2, "solid_capstyle": "butt"}
_QUASI_LOOK: Final[Mapping[str, Any]] = {"marker": "x", "markersize": 4.6, "linestyle": "none"}
_PANEL_MM: Final = 44.0
_PITCH_MM: Final = 50.0
#: Below a legend of two rows.
_TOP_MM: Final = 15.0
_LEGEND_COLUMNS: Final = 3


def draw_chapter4(curves: Mapping[str, Any]) -> dict[str, str]:
    """Draw the figures of chapter IV and 3.7 as far as the curves allow."""
    return draw_figures(DRAWINGS, curves)


# --- figure 4.4 ----------------------------------------------------------------------------------


def _draw_impedance(curve: Mapping[str, Any]) -> "Figure":
    figure = new_figure(_TOP_MM + 5.0 + 3 * _PITCH_MM)
    onsets: Mapping[str, float] = curve["onset_pct"]
    panels = _panels(figure, curve["parameters"], left_mm=15.0, top_mm=_TOP_MM)
    for name, axes in panels.items():
        _draw_sources(axes, curve["parameters"][name], onsets)
        _draw_stated(axes, curve["stated"].get(name, ()), onsets)
    _draw_quasi(panels["stiffness_per_mass"], curve["quasi_stiffness"], onsets)
    for axes in panels.values():
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
        if axes.get_ylim()[0] < 0.0:
            axes.axhline(0.0, color=MUTED, linewidth=0.6, zorder=1)
    place_legend(
        figure,
        [
            *_source_handles(),
            legend_line("quasi-stiffness, implied by print", GREEN, **_QUASI_LOOK),
            legend_line("Pfeifer, as stated", PURPLE, linewidth=2.6),
        ],
        columns=_LEGEND_COLUMNS,
    )
    return figure


def _panels(
    figure: "Figure", parameters: Iterable[str], *, left_mm: float, top_mm: float
) -> "dict[str, Axes]":
    """Place a panel a parameter over the gait cycle, one below the other."""
    names = list(parameters)
    panels = {}
    for row, name in enumerate(names):
        axes = place_axes(
            figure, left_mm, top_mm + row * _PITCH_MM,
            width_mm=177.0 - left_mm, height_mm=_PANEL_MM,
        )  # fmt: skip
        _over_cycle(axes, names=row == 0, labelled=row == len(names) - 1)
        axes.set_ylabel(axis_label(name))
        panels[name] = axes
    return panels


def _over_cycle(axes: "Axes", *, names: bool, labelled: bool) -> None:
    shade_phases(axes, names=names)
    axes.set_xlim(0.0, 100.0)
    axes.margins(y=0.1)
    axes.set_xlabel("Gait cycle (%)" if labelled else "")
    axes.tick_params(labelbottom=labelled)


def _source_handles(sources: Iterable[str] = tuple(_LOOKS)) -> list[Any]:
    handles = [
        legend_line(_LABELS[source], _LOOKS[source][1], linestyle="none", **_LOOKS[source][2])
        for source in sources
    ]
    return [*handles, legend_line("truth", FAINT, linewidth=2.2)]


def _draw_sources(axes: "Axes", sources: Mapping[str, _Rows], onsets: Mapping[str, float]) -> None:
    for row in sources["truth"]:
        if row["value"] is not None:
            at = onsets[row["point"]]
            ends = [at - _TRUTH_REACH, at + _TRUTH_REACH]
            axes.plot(ends, [row["value"]] * 2, color=FAINT, zorder=1.5, **_TRUTH_LOOK)
    for source, (shift, colour, look) in _LOOKS.items():
        for row in sources[source]:
            bar = (row["value"], row["low"], row["high"])
            mark(axes, onsets[row["point"]] + shift, bar, colour, **look)


def _draw_stated(axes: "Axes", rows: _Rows, onsets: Mapping[str, float]) -> None:
    for row in rows:
        at = onsets[row["point"]] + _STATED_PLACE
        axes.vlines(at, row["low"], row["high"], colors=PURPLE, linewidth=2.6, zorder=2)


def _draw_quasi(axes: "Axes", quasi: Mapping[str, float], onsets: Mapping[str, float]) -> None:
    at = [onsets[point] + _QUASI_PLACE for point in quasi]
    axes.plot(at, list(quasi.values()), color=GREEN, zorder=3, **_QUASI_LOOK)


# --- figure A.1 ----------------------------------------------------------------------------------

_CELL_PCT: Final = 11.8
_CELL_COLOURS: Final = {"similar": "#d6e7f2", "higher": "#f0dcea", "different": PANEL}


def _draw_literature(curve: Mapping[str, Any]) -> "Figure":
    onsets: Mapping[str, float] = curve["onset_pct"]
    studies: _Rows = curve["studies"]
    words_mm = 9.0 * len(studies)
    figure = new_figure(78.0 + words_mm + 3.0)
    left, width = 38.0, 139.0
    axes = place_axes(figure, left, 11.0, width_mm=width, height_mm=52.0)
    _over_cycle(axes, names=True, labelled=True)
    _draw_sources(axes, curve["stiffness"], onsets)
    _draw_stated(axes, curve["stated"], onsets)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel(axis_label("stiffness_per_mass"))
    below = place_axes(figure, left, 78.0, width_mm=width, height_mm=words_mm)
    _draw_words(below, studies, onsets)
    place_legend(
        figure, [*_source_handles(), legend_line("Pfeifer, as stated", PURPLE, linewidth=2.6)]
    )
    return figure


def _draw_words(axes: "Axes", studies: _Rows, onsets: Mapping[str, float]) -> None:
    axes.set_xlim(0.0, 100.0)
    axes.set_ylim(len(studies) - 0.5, -0.5)
    for row, study in enumerate(studies):
        for point, said in study["words"].items():
            start = onsets[point] - 0.5 * _CELL_PCT
            colour = _CELL_COLOURS.get(said.split(",")[0], "white")
            axes.broken_barh([(start, _CELL_PCT)], (row - 0.44, 0.88), facecolor=colour)
            axes.text(
                onsets[point], row, said.replace(", ", "\n") or DASH, ha="center", va="center",
                fontsize=SMALL_PT, color=INK if said else MUTED, linespacing=1.15,
            )  # fmt: skip
    names = [f"{study['name']}\n({_APPROACHES[study['approach']]})" for study in studies]
    axes.set_yticks(range(len(studies)), names)
    axes.set_xticks(list(onsets.values()), list(onsets))
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    for side in axes.spines.values():
        side.set_visible(False)


_APPROACHES: Final = {"perturbation": "perturbations", "model": "EMG model"}

# --- figure 3.7 ----------------------------------------------------------------------------------

#: Source -> places of the two people and of their mean, % of the cycle from the timing point.
_PILOT_PLACES: Final[Mapping[str, tuple[tuple[float, ...], float]]] = {
    "pilot": ((-4.3, -3.2), -1.8),
    "recommended": ((1.0, 2.1), 3.5),
}
_PILOT_LOOKS: Final = {"pilot": "dissertation", "recommended": "recommended"}
_PILOT_LABELS: Final = {
    "pilot": "pilot\N{RIGHT SINGLE QUOTATION MARK}s method",
    "recommended": "recommended",
}
#: Names of the phases stand along the upper edge.
_HEADROOM: Final = 1.06
_PERSON_COLOURS: Final = {"pilot": "#f0b48a", "recommended": SKY}
_SHORT_REACH: Final = 0.55


def _draw_pilot(curve: Mapping[str, Any]) -> "Figure":
    figure = new_figure(_TOP_MM + 5.0 + 3 * _PITCH_MM)
    onsets: Mapping[str, float] = curve["onset_pct"]
    panels = _panels(figure, curve["parameters"], left_mm=15.0, top_mm=_TOP_MM)
    for name, axes in panels.items():
        sources = curve["parameters"][name]
        for source in _PILOT_PLACES:
            _draw_two_people(axes, source, sources, onsets)
        for value in curve["printed_range"][name]:
            axes.axhline(value, color=MUTED, linewidth=0.8, dashes=(4, 3), zorder=1.2)
        axes.set_ylim(0.0, _HEADROOM * axes.get_ylim()[1])
    handles = []
    for source, label in _PILOT_LABELS.items():
        _, colour, look = _LOOKS[_PILOT_LOOKS[source]]
        small = {**look, "markersize": 3.2}
        handles.append(legend_line(f"{label}, mean", colour, linestyle="none", **look))
        handles.append(
            legend_line(f"{label}, each person", _PERSON_COLOURS[source], linestyle="none", **small)
        )
    handles.append(legend_line("truth", FAINT, linewidth=2.2))
    handles.append(
        legend_line("printed largest and smallest average", MUTED, linewidth=0.8, dashes=(4, 3))
    )
    place_legend(figure, handles, columns=_LEGEND_COLUMNS)
    return figure


def _draw_two_people(
    axes: "Axes", source: str, sources: Mapping[str, Any], onsets: Mapping[str, float]
) -> None:
    places, mean_place = _PILOT_PLACES[source]
    _, colour, look = _LOOKS[_PILOT_LOOKS[source]]
    pairs = zip(places, sources[source]["people"], sources["truth"]["people"], strict=False)
    for place, person, true in pairs:
        for point, bar in person.items():
            at = onsets[point] + place
            _short_truth(axes, at, true[point][0])
            mark(axes, at, bar, _PERSON_COLOURS[source], **{**look, "markersize": 3.2})
    for point, value in sources[source]["mean"].items():
        at = onsets[point] + mean_place
        _short_truth(axes, at, sources["truth"]["mean"].get(point))
        mark(axes, at, (value, None, None), colour, **look)


def _short_truth(axes: "Axes", at: float, value: float | None) -> None:
    if value is not None:
        ends = [at - _SHORT_REACH, at + _SHORT_REACH]
        axes.plot(ends, [value, value], color=FAINT, zorder=1.5, **_TRUTH_LOOK)


#: Figures of the simulated studies of chapters III and IV.
DRAWINGS: Final[Drawings] = {
    **statistics_figures.GAIT_DRAWINGS,
    "figure_4_4": ("impedance", _draw_impedance),
    "figure_a_1": ("literature", _draw_literature),
    "figure_3_7": ("pilot", _draw_pilot),
    **statistics_figures.STATISTICS_DRAWINGS,
}
