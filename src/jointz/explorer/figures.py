"""Parts that all figures of the explorer share: plain dictionaries that Plotly draws."""

from collections.abc import Mapping
from typing import Any, Final

Figure = dict[str, Any]

# Colours for light and dark pages; the style sheet colours text and grid.
BLUE: Final = "#2b86d1"
VERMILION: Final = "#e2662b"
GREEN: Final = "#1aa179"
PURPLE: Final = "#a566b5"
AMBER: Final = "#d99a1c"
GREY: Final = "#8b95a1"


def plain(text: str) -> str:
    """Return text without tags for Plotly."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def span(
    ends: tuple[float, float], *, x: str = "x", y: str = "y", colour: str = "rgba(43,134,209,0.08)"
) -> dict[str, Any]:
    """Return a shaded interval, as high as the panel."""
    return {
        "type": "rect", "xref": x, "yref": f"{y} domain", "x0": ends[0], "x1": ends[1],
        "y0": 0, "y1": 1, "fillcolor": colour, "line": {"width": 0}, "layer": "below",
    }  # fmt: skip


def axis(title: str) -> dict[str, Any]:
    """Return an axis."""
    return {
        "title": {"text": title, "font": {"size": 12}, "standoff": 6},
        "gridcolor": "rgba(139,149,161,0.18)",
        "zerolinecolor": "rgba(139,149,161,0.5)",
        "linecolor": "rgba(139,149,161,0.5)",
        "showline": True,
        "ticks": "outside",
        "ticklen": 4,
        "tickcolor": "rgba(139,149,161,0.5)",
        "tickfont": {"size": 11},
        "automargin": True,
    }


def base_layout(y: str, x: str) -> dict[str, Any]:
    """Return the layout of a figure of one panel."""
    return {
        "margin": {"l": 56, "r": 12, "t": 34, "b": 42},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"family": "Roboto, system-ui, sans-serif", "size": 12, "color": GREY},
        "xaxis": axis(x),
        "yaxis": axis(y),
        "legend": {"orientation": "h", "x": 1, "xanchor": "right", "y": 1.02, "yanchor": "bottom"},
        "hovermode": "closest",
        "hoverlabel": {"font": {"size": 12}},
        "autosize": True,
        "shapes": [],
        "annotations": [],
        # The user's zoom stays when lines change.
        "uirevision": "kept",
    }


def figure(data: list[dict[str, Any]], layout: Mapping[str, Any], *, name: str) -> Figure:
    """Return a figure; its own menu saves it as SVG."""
    return {
        "data": data,
        "layout": dict(layout),
        "config": {
            "displaylogo": False,
            "responsive": True,
            "modeBarButtonsToRemove": ["select2d", "lasso2d", "autoScale2d"],
            "toImageButtonOptions": {"format": "svg", "filename": name},
        },
    }
