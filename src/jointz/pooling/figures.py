"""Forest plots of pooled results, one figure a parameter."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from jointz.pooling.pooled_result import UNDECIDED, PooledStudies, cell_text, studies_of
from jointz.report.style import new_figure, place_axes, to_svg
from jointz.report.wording import format_interval, parameter_label
from jointz.results.figure_style import BLUE, FAINT, INK, MUTED, WIDTH_MM, figure_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LINE_MM: Final = 4.6
_LEFT_MM, _RIGHT_MM, _TOP_MM, _BELOW_MM = 58.0, 42.0, 2.0, 11.0
_LONGEST: Final = 30

_Row = Mapping[Any, Any]


def draw_forests(pooled: PooledStudies) -> dict[str, str]:
    """Return the forest plot of each parameter with a value, as SVG."""
    with figure_style():
        return {
            f"forest_{name}": to_svg(_forest(rows, pooled.studies))
            for name, rows in pooled.table.groupby("parameter", sort=False)
            if rows["value"].notna().any()
        }


def _forest(rows: pd.DataFrame, studies: pd.DataFrame) -> "Figure":
    """Draw the cells of a parameter below each other, with a common axis."""
    cells = [(row, _used(studies, row)) for row in rows[rows["value"].notna()].to_dict("records")]
    n_lines = sum(len(used) + 2.4 - (row["n_studies"] == 1) for row, used in cells)
    height = _LINE_MM * n_lines
    figure = new_figure(height + _TOP_MM + _BELOW_MM)
    axes = place_axes(
        figure, _LEFT_MM, _TOP_MM, width_mm=WIDTH_MM - _LEFT_MM - _RIGHT_MM, height_mm=height
    )
    y = 0.5
    for row, used in cells:
        y = _draw_cell(axes, row, used, y)
    axes.set_ylim(n_lines, 0.0)
    ends = np.concatenate([used[["ci_low", "ci_high"]].to_numpy().ravel() for _, used in cells])
    margin = 0.04 * float(np.ptp(ends)) or 1.0
    axes.set_xlim(float(ends.min()) - margin, float(ends.max()) + margin)
    if ends.min() < 0.0 < ends.max():
        axes.axvline(0.0, color=FAINT, lw=0.8, zorder=0)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    first = cells[0][0]
    axes.set_xlabel(parameter_label(first["parameter"]))
    return figure


def _used(studies: pd.DataFrame, row: _Row) -> pd.DataFrame:
    used = studies_of(studies, row)
    return used[used["status"] == "ok"]


def _draw_cell(axes: "Axes", row: _Row, used: pd.DataFrame, y: float) -> float:
    """Draw the studies of a cell and their mean; return the height of the next cell."""
    _text(axes, y, cell_text(row), "", fontweight="bold")
    for study in used.to_dict("records"):
        y += 1.0
        weight = 100.0 if np.isnan(study["weight_pct"]) else study["weight_pct"]
        axes.plot([study["ci_low"], study["ci_high"]], [y, y], color=MUTED, lw=1.0)
        axes.plot(study["value"], y, "s", color=INK, ms=2.0 + 0.035 * weight)
        _text(axes, y, f"{_short(study['study'])} ({study['n_people']})", _interval(study))
    if row["n_studies"] > 1:
        y += 1.0
        is_undecided = row["status"] == UNDECIDED
        color, undecided = (MUTED, ", undecided") if is_undecided else (BLUE, "")
        axes.plot([row["prediction_low"], row["prediction_high"]], [y, y], color=color, lw=0.8)
        across = [row["ci_low"], row["value"], row["ci_high"], row["value"]]
        axes.fill(across, [y, y - 0.3, y, y + 0.3], color=color, lw=0)
        label = f"Mean over {row['n_studies']} studies{undecided}"
        _text(axes, y, label, _interval(row), color=color)
    return y + 1.4


def _text(axes: "Axes", y: float, left: str, right: str, **style: Any) -> None:
    place = {"transform": axes.get_yaxis_transform(), "va": "center", **style}
    axes.text(-_LEFT_MM / (WIDTH_MM - _LEFT_MM - _RIGHT_MM), y, left, ha="left", **place)
    axes.text(1.03, y, right, ha="left", **place)


def _interval(row: _Row) -> str:
    return format_interval(row["value"], row["ci_low"], row["ci_high"])


def _short(name: str) -> str:
    return name if len(name) <= _LONGEST else f"{name[: _LONGEST - 1]}\N{HORIZONTAL ELLIPSIS}"
