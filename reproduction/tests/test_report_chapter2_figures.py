import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from reproduction import chapter2_figures
from reproduction.chapter2_figures import draw_chapter2

from jointz.results.figure_style import figure_style

TRUTH = {
    "stiffness": dict(zip("12345", (165.0, 279.0, 165.0, 279.0, 165.0), strict=True)),
    "inertia": dict(zip("12345", (0.0364, 0.0364, 0.07, 0.07, 0.0364), strict=True)),
    "damping": dict(zip("12345", (0.08, 0.08, 0.09, 0.09, 1.5), strict=True)),
}
BIAS = {"stiffness": 0.975, "inertia": 0.86, "damping": 0.9}
MECHANISMS = (
    ("none", 0.0, 0.000, 0.0),
    ("torque record 2.2 ms late", -2.1, -0.352, -13.9),
    ("zero-phase 20 Hz filter inside the window", -0.4, 0.021, -16.2),
    ("bearing friction 0.15 N*m", 3.3, 0.102, -1.1),
)


def low_pass(frequency, corner):
    return 1 / np.sqrt(1 + (frequency / corner) ** 4)


def bandwidth_curve(corner, printed):
    frequency = np.arange(1.0, 61.0)
    lags = np.arange(0.0, 61.0, 16.7)[1:]
    coherence = 0.999 - 0.9 * (frequency > 40) * (frequency - 40) / 20
    return {
        "frequency_hz": frequency.tolist(),
        "gain": (0.82 * low_pass(frequency, corner)).tolist(),
        "reference_gain": 0.82,
        "coherence": coherence.tolist(),
        "bandwidth_hz": corner,
        "ci_low": corner - 0.8,
        "ci_high": corner + 0.9,
        "resolution_hz": 1.02,
        "spa_frequency_hz": lags.tolist(),
        "spa_gain": (0.5 * low_pass(lags, corner + 9)).tolist(),
        "spa_reference_gain": 0.5,
        "spa_bandwidth_hz": corner + 9,
        "printed_hz": printed,
    }


def intrinsic_curve():
    frequency = np.arange(0.5, 30.5, 0.5)
    s = 2j * np.pi * frequency
    model = 0.388 + 0.163 * s + 0.001 * s**2
    measured = model * (1 + 0.06 * np.sin(7 * frequency)) * np.exp(0.05j * np.cos(5 * frequency))
    return {
        "frequency_hz": frequency.tolist(),
        "gain": np.abs(measured).tolist(),
        "phase_deg": np.degrees(np.angle(measured)).tolist(),
        "model_gain": np.abs(model).tolist(),
        "model_phase_deg": np.degrees(np.angle(model)).tolist(),
    }


def load_rows():
    rng = np.random.default_rng(0)
    rows = []
    for case in "12345":
        for trajectory in "ABCDE":
            for parameter, truths in TRUTH.items():
                truth = truths[case]
                wide = 0.1 if parameter == "damping" else 0.03 * truth
                value = truth * (1 + 0.003 * rng.standard_normal())
                rows.append({
                    "case": "damper" if case == "5" else case, "trajectory": trajectory,
                    "parameter": parameter, "truth": truth, "dissertation_sd": wide,
                    "dissertation": truth * BIAS[parameter] + wide * rng.standard_normal(),
                    "recommended": value, "ci_low": value - 0.2 * wide,
                    "ci_high": value + 0.2 * wide,
                })  # fmt: skip
    return rows


@pytest.fixture(scope="module")
def curves():
    return {
        "bandwidth": {"20": bandwidth_curve(26.8, 26.8), "40": bandwidth_curve(17.2, 17.2)},
        "intrinsic": intrinsic_curve(),
        "loads": load_rows(),
        "mechanisms": [
            {"mechanism": name, "stiffness_pct": k, "damping": b, "inertia_pct": j}
            for name, k, b, j in MECHANISMS
        ],
    }


def drawn_figure(curves, name):
    curve, draw = chapter2_figures._DRAWINGS[name]
    with figure_style():
        return draw(curves[curve])


def line_at(axes, marker):
    return [line for line in axes.lines if line.get_marker() == marker]


def test_every_curve_gives_its_figure_in_well_formed_svg(curves):
    drawn = draw_chapter2(curves)
    assert list(drawn) == ["figure_2_5", "figure_intrinsic", "figure_2_6", "figure_mechanisms"]
    for svg in drawn.values():
        root = ET.fromstring(svg)
        assert root.attrib["width"].startswith("496.06")  # 175 mm in points
        assert "http" not in re.sub(r'xmlns(:\w+)?="[^"]*"', "", svg)


def test_gain_is_drawn_in_decibels_with_the_bandwidths_at_half_power(curves):
    gain, coherence = drawn_figure(curves, "figure_2_5").axes
    # The bandwidth counts from the gain at low frequency, which is not one: so must the curve.
    expected = 20 * np.log10(np.array(curves["bandwidth"]["20"]["gain"]) / 0.82)
    ours = next(line for line in gain.lines if len(line.get_xdata()) == 60)
    np.testing.assert_allclose(ours.get_ydata(), expected)
    assert [line.get_xdata()[0] for line in line_at(gain, "o")] == [26.8, 17.2]
    assert {line.get_ydata()[0] for line in line_at(gain, "o")} == {-3.0}
    assert [line.get_xdata()[0] for line in line_at(gain, "v")] == [26.8, 17.2]  # printed
    assert [line.get_xdata()[0] for line in line_at(gain, "x")] == pytest.approx([35.8, 26.2])
    assert gain.get_xlim() == coherence.get_xlim() == (1.0, 60.0)


def test_every_load_has_a_panel_for_each_parameter_on_one_scale_in_percent(curves):
    figure = drawn_figure(curves, "figure_2_6")
    assert len(figure.axes) == 3 * 5
    for row, parameter in ((0, "stiffness"), (2, "inertia")):
        shares = [
            np.array(axes.get_ylim()) / TRUTH[parameter][case]
            for axes, case in zip(figure.axes[5 * row : 5 * row + 5], "12345", strict=True)
        ]
        np.testing.assert_allclose(shares, np.tile(shares[0], (5, 1)))
    spans = [np.ptp(axes.get_ylim()) for axes in figure.axes[5:10]]
    np.testing.assert_allclose(spans, spans[0])


def test_a_load_without_recommended_estimate_is_still_drawn(curves):
    rows = [row | {"recommended": None, "ci_low": None} for row in curves["loads"][:15]]
    assert list(draw_chapter2({"loads": rows})) == ["figure_2_6"]
