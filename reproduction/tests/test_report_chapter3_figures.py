import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from reproduction import chapter3_figures
from reproduction.chapter3_figures import draw_chapter3

from jointz.results.figure_style import figure_style


def torque_models():
    """Seven torques by six speeds, as in 3.2.1, with friction of model 3.3."""
    rng = np.random.default_rng(0)
    torque, speed = np.meshgrid(np.linspace(-10, 10, 7), [-5.0, -3.0, -1.0, 0.0, 1.0, 3.0, 5.0])
    torque, speed = (np.repeat(values.ravel(), 250) for values in (torque, speed))
    friction = (0.38 + 0.09 * np.abs(torque)) * np.sign(speed)
    sensor = torque - friction + 0.3 * rng.standard_normal(torque.size)
    models = {"3.1": torque, "3.2": torque - 0.15 * speed, "3.3": torque - friction}
    return {
        "time_s": (np.arange(torque.size) / 100).tolist(),
        "speed_rad_s": speed.tolist(),
        "sensor_nm": sensor.tolist(),
        "models": {name: values.tolist() for name, values in models.items()},
        # Of the whole record, of which only some samples are drawn.
        "rms_nm": {"3.1": 1.1894, "3.2": 0.6698, "3.3": 0.3666},
    }


def chirps():
    time = np.arange(0.0, 40.0, 1e-3)
    phase = 2 * np.pi * (time % 10 + 0.45 * (time % 10) ** 2)
    amplitude = np.repeat([5.0, 7.0, 10.0, 0.0], time.size // 4)
    disturbance = 0.4 * np.sin(1.7 * phase)
    sensor = amplitude * np.sin(phase) + disturbance
    model = sensor + 0.33 * np.sqrt(2) * np.sin(2 * np.pi * 37 * time)
    return {
        "time_s": time.tolist(),
        "sensor_nm": sensor.tolist(),
        "model_nm": model.tolist(),
        "segments": [[0, 10, 5], [10, 20, 7], [20, 30, 10], [30, 40, 0]],
    }


def static():
    time = np.arange(0.0, 60.0, 0.01)
    torque = 10 * np.sin(2 * np.pi * time / 10)
    deflection = torque / 146.4
    model = 147.6 * deflection + 0.2 * np.sign(np.cos(2 * np.pi * time / 10))
    return {
        "deflection_rad": deflection.tolist(),
        "sensor_nm": (torque + 0.05 * np.sin(91 * time)).tolist(),
        "model_nm": model.tolist(),
        "sensor_stiffness": 146.4,
        "model_stiffness": 147.6,
    }


PERTURBATION = {
    "dither": 146.9,
    "positive": {"mean": 143.8, "sd": 2.9},
    "negative": {"mean": 158.4, "sd": 3.3},
    "printed": {"dither": 146.39, "positive": [145.13, 2.45], "negative": [162.57, 2.96]},
    "recommended": {"value": 147.2, "ci_low": 146.6, "ci_high": 147.8},
    "truth": 147.0,
}


@pytest.fixture(scope="module")
def curves():
    return {
        "torque_models": torque_models(),
        "chirp": chirps(),
        "static": static(),
        "perturbation": PERTURBATION,
    }


def drawn_figure(curves, name):
    curve, draw = chapter3_figures._DRAWINGS[name]
    with figure_style():
        return draw(curves[curve])


def texts(axes):
    return [text.get_text() for text in axes.texts]


def test_every_curve_gives_its_figure_in_well_formed_svg(curves):
    drawn = draw_chapter3(curves)
    assert list(drawn) == ["figure_3_3", "figure_3_4", "figure_3_5", "figure_3_6"]
    for svg in drawn.values():
        root = ET.fromstring(svg)
        assert root.attrib["width"].startswith("496.06")  # 175 mm in points
        assert "http" not in re.sub(r'xmlns(:\w+)?="[^"]*"', "", svg)
        assert len(svg) < 1e6


def test_the_lines_of_the_locked_output_have_the_slopes_found(curves):
    torques, remainders = drawn_figure(curves, "figure_3_5").axes
    slopes = [
        np.diff(line.get_ydata())[0] / np.diff(np.radians(line.get_xdata()))[0]
        for line in torques.lines
        if len(line.get_xdata()) == 2
    ]
    np.testing.assert_allclose(slopes, [146.4, 147.6])
    assert "stiffness by the model +0.82 %" in texts(remainders)


def test_printed_and_own_stiffness_stand_beside_each_other_with_their_truth(curves):
    (axes,) = drawn_figure(curves, "figure_3_6").axes
    assert texts(axes) == ["146.4", "146.9", "145.1", "143.8", "162.6", "158.4", "147.2"]
    assert axes.lines[0].get_ydata()[0] == 147.0
    low, high = axes.get_ylim()
    assert low < 143.8 - 2.9
    assert high > 162.57 + 2.96


def test_stiffness_without_a_recommended_estimate_is_drawn_without_it(curves):
    bare = {k: v for k, v in curves["perturbation"].items() if k != "recommended"}
    axes = drawn_figure({"perturbation": bare}, "figure_3_6").axes[0]
    assert "nan" not in texts(axes)
    assert "147.2" not in texts(axes)
    bare["recommended"] = {"value": 147.2, "ci_low": None, "ci_high": None}
    assert "147.2" in texts(drawn_figure({"perturbation": bare}, "figure_3_6").axes[0])
