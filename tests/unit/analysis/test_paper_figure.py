"""Figures of the report from Python."""

from dataclasses import fields

import pytest
from tests.unit.analysis.studies import bayesian_analysis

from jointz.analysis.page.figure_files import FIGURES
from jointz.analysis.saved_analysis import Analysis
from jointz.core.errors import DataError
from jointz.results.figure_style import MM_PER_INCH


def analysis():
    made = bayesian_analysis()
    return Analysis(**{name: getattr(made, name) for name in (f.name for f in fields(made))})


def test_the_impedance_has_the_panels_and_the_width_that_were_asked_for():
    figure = analysis().figure("impedance", parameters=("stiffness", "inertia"), width_mm=120.0)
    assert figure.get_size_inches()[0] * MM_PER_INCH == pytest.approx(120.0)
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels == ["K (N·m/rad)", "J (kg·m²)"]


def test_every_figure_of_the_report_can_be_drawn_by_its_name():
    made = analysis()
    drawn = [name for name in FIGURES if has_data(made, name)]
    assert {"impedance_overview", "impedance_over_gait", "responses", "methods"} <= set(drawn)


def has_data(made, name):
    try:
        return bool(made.figure(name).axes)
    except DataError:
        return False


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ({"name": "nothing"}, "expected one of impedance, impedance_overview"),
        ({"name": "strides", "width_mm": 85.0}, "are for 'impedance'"),
        ({"parameters": ("stiffness", "rigidity")}, "expected some of damping, inertia, stiffness"),
        ({"parameters": "stiffness"}, "expected some of"),
        ({"width_mm": 0.0}, "width_mm: expected 60 to 400, got 0"),
    ],
)
def test_what_no_figure_has_is_refused(asked, told):
    with pytest.raises(ValueError, match=told):
        analysis().figure(**asked)
