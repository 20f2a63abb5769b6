import xml.etree.ElementTree as ET

import pytest
from reproduction.chapter4.published_statistics import published_statistics
from reproduction.chapter4.statistics_figures import STATISTICS_DRAWINGS as DRAWINGS
from reproduction.chapter_page import draw_figures

from jointz.results.figure_style import figure_style


@pytest.fixture(scope="module")
def curves():
    return published_statistics(4, n_simulations=100)[1]


def drawn(curves, name):
    curve, draw = DRAWINGS[name]
    with figure_style():
        return draw(curves[curve])


def texts(axes):
    return [text.get_text() for text in axes.texts]


def test_both_figures_are_well_formed_and_small(curves):
    made = draw_figures(DRAWINGS, curves)
    assert list(made) == ["figure_pairs", "figure_replicates"]
    for svg in made.values():
        assert ET.fromstring(svg).attrib["width"].startswith("496.06")  # 175 mm in points
        assert len(svg) < 150e3
    assert draw_figures(DRAWINGS, curves) == made


def test_every_pair_stands_at_its_difference_in_its_panel(curves):
    figure = drawn(curves, "figure_pairs")
    for axes, curve in zip(figure.axes, curves["pairs"].values(), strict=True):
        marks = [line for line in axes.lines if len(line.get_xdata()) == 1]
        assert [line.get_xdata()[0] for line in marks] == [p["difference"] for p in curve["pairs"]]
        low, high = axes.get_xlim()
        assert low < min(p["ci_low"] for p in curve["pairs"])
        assert high > max(p["ci_high"] for p in curve["pairs"])


def test_marks_are_full_where_a_pair_differs_here(curves):
    axes = drawn(curves, "figure_pairs").axes[0]
    marks = [line for line in axes.lines if len(line.get_xdata()) == 1]
    full = [line.get_markerfacecolor() == line.get_color() for line in marks]
    pairs = curves["pairs"]["stiffness_per_mass"]["pairs"]
    assert full == [pair["p"] < 0.05 for pair in pairs]
    assert sum(full) == 3
