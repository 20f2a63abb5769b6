from reproduction.chapter4.figures import DRAWINGS

from jointz.core.gait_phases import TIMING_POINTS
from jointz.results.figure_style import figure_style

PARAMETERS = {"stiffness_per_mass": 1.0, "damping_per_mass": 0.04, "inertia": 0.05}


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
