import numpy as np

from jointz.core.gait_phases import TIMING_POINTS
from jointz.report.style import figure_style
from jointz.reproduction.chapter4.figures import DRAWINGS

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
        "stated": {},
    }


CURVES = {
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
}


def drawn(name):
    curve, draw = DRAWINGS[name]
    with figure_style():
        figure = draw(CURVES[curve])
        figure.canvas.draw()
    return figure


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
