import re

import numpy as np
import pytest

from jointz.core.gait_phases import TIMING_POINTS
from jointz.report.style import figure_style
from jointz.reproduction.chapter4.figures import DRAWINGS, draw_chapter4

PARAMETERS = {"stiffness_per_mass": 1.0, "damping_per_mass": 0.04, "inertia": 0.05}
GAIT = np.linspace(0.0, 100.0, 101)
ANGLE = 0.5 - 0.4 * np.cos(2 * np.pi * GAIT / 100)


def bars(base):
    return [
        {"point": point, "value": base * (6 - i), "low": 0.8 * base, "high": 7.0 * base}
        for i, point in enumerate(TIMING_POINTS)
    ]


def sources(base, refused=False):
    found = {name: bars(base) for name in ("printed", "dissertation", "recommended", "truth")}
    if refused:
        found["recommended"][0] = {"point": "LRE", "value": None, "low": None, "high": None}
    return found


def impedance():
    return {
        "onset_pct": dict(TIMING_POINTS),
        "parameters": {name: sources(base, name == "inertia") for name, base in PARAMETERS.items()},
        "quasi_stiffness": {point: 0.5 - i for i, point in enumerate(TIMING_POINTS)},
        "stated": {
            "stiffness_per_mass": [{"study": "Pfeifer", "point": "MSW", "low": 0.8, "high": 1.1}]
        },
    }


def literature():
    words = dict.fromkeys(TIMING_POINTS, "") | {"MSW": "higher, 2 times", "LRE": "similar"}
    return {
        "onset_pct": dict(TIMING_POINTS),
        "stiffness": sources(1.0),
        "stated": [{"study": "Pfeifer", "point": "MSW", "low": 0.8, "high": 1.1}],
        "studies": [
            {"name": "Tucker", "approach": "perturbation", "words": words},
            {"name": "Pfeifer", "approach": "model", "words": words},
        ],
    }


def pilot():
    person = {point: [1.0, 0.8, 1.2] for point in TIMING_POINTS}
    other = {point: [None, None, None] for point in TIMING_POINTS}
    mean = dict.fromkeys(TIMING_POINTS, 1.1)
    return {
        "onset_pct": dict(TIMING_POINTS),
        "people": ["S01", "S02"],
        "printed_range": {name: [2.99, 0.11] for name in PARAMETERS},
        "parameters": {
            name: {
                "pilot": {"people": [person, person], "mean": mean},
                "recommended": {"people": [person, other], "mean": {}},
                "truth": {"people": [person, person], "mean": mean},
            }
            for name in PARAMETERS
        },
    }


CURVES = {
    "strides": {
        "person": "S09",
        "gait_pct": GAIT.tolist(),
        "angle_rad": [(ANGLE + 0.01 * k).tolist() for k in range(60)],
        "torque_nm": [(np.sin(GAIT) + 0.01 * k).tolist() for k in range(60)],
    },
    "device_effect": {
        "gait_pct": GAIT.tolist(),
        "t": (4.0 * np.sin(GAIT / 8.0)).tolist(),
        "threshold": 3.3,
        "flip_threshold": 3.0,
        "printed_threshold": 4.299,
        "no_device_rad": ANGLE.tolist(),
        "device_rad": (ANGLE + 0.02).tolist(),
        "difference_rad": [-0.02] * 101,
        "low_rad": [-0.05] * 101,
        "high_rad": [0.01] * 101,
        "margin_rad": 0.087,
        "n_people": 10,
    },
    "impedance": impedance(),
    "literature": literature(),
    "pilot": pilot(),
}


#: Those of the published tables have tests of their own.
SIMULATED = [name for name, (curve, _) in DRAWINGS.items() if curve in CURVES]


def drawn(name):
    curve, draw = DRAWINGS[name]
    with figure_style():
        figure = draw(CURVES[curve])
        figure.canvas.draw()
    return figure


def test_every_curve_gives_a_small_figure_of_double_column_width():
    figures = draw_chapter4(CURVES)
    assert list(figures) == SIMULATED
    for svg in figures.values():
        width = float(re.search(r'width="([\d.]+)pt"', svg).group(1))
        assert width == pytest.approx(180.0 / 25.4 * 72.0, abs=0.1)
        assert len(svg) < 300_000


@pytest.mark.parametrize("name", SIMULATED)
def test_nothing_reaches_beyond_the_edge_or_into_the_legend(name):
    figure = drawn(name)
    edge = figure.bbox
    legend = figure.legends[0].get_window_extent()
    assert legend.x0 >= edge.x0
    assert legend.x1 <= edge.x1
    for axes in figure.axes:
        box = axes.get_tightbbox()
        assert box.x0 >= edge.x0 - 0.5
        assert box.x1 <= edge.x1 + 0.5
        assert box.y0 >= edge.y0 - 0.5
        assert box.y1 <= legend.y0


def test_a_refused_estimate_has_no_mark():
    stiffness, _, inertia = drawn("figure_4_4").axes
    diamonds = [
        sum(line.get_marker() == "D" for line in axes.get_lines()) for axes in (stiffness, inertia)
    ]
    assert diamonds == [6, 5]


def test_what_is_beyond_the_threshold_stands_out():
    upper = drawn("figure_4_3").axes[0]
    beyond = upper.get_lines()[-1].get_ydata()
    assert np.isfinite(beyond).sum() == (np.abs(CURVES["device_effect"]["t"]) > 3.3).sum()
