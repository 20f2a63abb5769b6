import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import matplotlib
import numpy as np
import pytest

from jointz.analysis.page import figure_files
from jointz.analysis.page.captions import captions
from jointz.analysis.page.event_figures import draw_onset_accuracy, draw_strides
from jointz.analysis.page.figure_files import (
    FIGURES,
    draw_figures,
    draw_picture,
)
from jointz.analysis.page.impedance_figures import draw_impedance_over_gait
from jointz.analysis.page.method_figures import draw_methods
from jointz.analysis.page.response_figures import (
    draw_response_overview,
    draw_responses,
    example_cells,
)
from jointz.core.events import PulseRecord
from jointz.report.style import new_figure, to_svg
from jointz.report.subjects import timing_points
from jointz.results.estimates import ParameterEstimate
from jointz.results.figure_style import figure_style
from jointz.results.study_analysis import StudyAnalysis


def plot(draw, analysis):
    with figure_style():
        return draw(analysis)


def labels(texts):
    return [t.get_text() for t in texts]


def only_group(analysis, person, point):
    cells = tuple(c for c in analysis.cells if c.participant == person and c.timing_point == point)
    return replace(analysis, cells=cells, population=(), comparison=(), strides=(), pulses=())


def panel(figure, heading):
    return next(a for a in figure.axes if heading in labels(a.texts))


def test_every_figure_is_well_formed_svg_without_outside_references(walking_figures):
    drawn, seconds = walking_figures
    assert seconds < 6.0  # ten people and six timing points
    assert list(drawn) == [
        "impedance_overview", "impedance_over_gait", "pulse_example", "response_overview",
        "responses", "methods", "gait", "onset_accuracy", "strides", "impedance_column",
    ]  # fmt: skip
    for name, svg in drawn.items():
        root = ET.fromstring(svg)
        assert root.tag == "{http://www.w3.org/2000/svg}svg"
        width_mm = float(root.attrib["width"].removesuffix("pt")) * 25.4 / 72.0
        assert width_mm == pytest.approx(85.0 if name.endswith("_column") else 175.0, abs=0.01)
        links = [v for e in root.iter() for k, v in e.attrib.items() if k.endswith("href")]
        assert links
        assert all(link.startswith("#") for link in links)
        assert "DOCTYPE" not in svg
        assert "<metadata" not in svg


def test_a_picture_has_a_pdf_of_its_size_with_its_fonts_and_without_a_date(recommended):
    picture, again = (draw_picture(recommended, "methods", pdf=True) for _ in range(2))
    assert (again.svg, again.pdf) == (picture.svg, picture.pdf)
    (box,) = re.findall(rb"/MediaBox \[ 0 0 ([\d.]+) [\d.]+ \]", picture.pdf)
    assert float(box) * 25.4 / 72.0 == pytest.approx(175.0, abs=0.01)
    for word in (b"CreationDate", b"ModDate", b"Producer", b"/Creator", b"/Type3"):
        assert word not in picture.pdf
    assert b"/FontFile2" in picture.pdf


def texts(figure):
    from matplotlib.text import Text

    return [t for t in figure.findobj(Text) if t.get_text().strip() and t.get_visible()]


@pytest.mark.parametrize("name", FIGURES)
def test_no_text_is_smaller_than_seven_points_at_its_printed_size(walking, recommended, name):
    with figure_style():
        drawn = [figure_files._REPORT_FIGURES[name].draw(a) for a in (walking, recommended)]
        sizes = [t.get_fontsize() for f in drawn if f is not None for t in texts(f)]
    assert sizes
    assert min(sizes) >= 7.0


def test_drawing_neither_reads_nor_changes_the_users_settings(bench):
    plain = draw_figures(bench)
    with matplotlib.rc_context({"font.size": 30.0, "axes.facecolor": "red"}):
        assert draw_figures(bench) == plain
        assert matplotlib.rcParams["font.size"] == 30.0


def test_another_font_writes_only_what_the_usual_one_lacks(monkeypatch):
    """A font that comes with matplotlib stands for one of Chinese."""
    monkeypatch.setattr(figure_files, "_OTHER_FONTS", ("No Such Font", "DejaVu Sans Mono"))
    with figure_style(), figure_files._fonts_of_any_script():
        figure = new_figure(20.0)
        figure.text(0.5, 0.5, "A\u2315B")  # a telephone recorder: in Mono only
        svg = to_svg(figure)
    fonts = re.findall(r'href="#(\w+)-', svg)
    assert fonts == ["DejaVuSans", "DejaVuSansMono", "DejaVuSans"]


def test_a_bench_study_has_its_groups_on_the_axis(bench):
    figure = plot(draw_impedance_over_gait, bench)
    assert labels(figure.axes[0].get_xticklabels()) == ["k1 I1", "k2 I1", "k1 I2", "k2 I2"]
    assert set(draw_figures(bench)) == {
        "impedance_overview", "impedance_over_gait", "responses", "impedance_column",
    }  # fmt: skip


def test_nothing_is_drawn_where_nothing_stands(failed):
    assert draw_figures(failed) == {}
    assert draw_figures(StudyAnalysis(cells=())) == {}


def test_failed_and_undecided_estimates_are_counted_not_drawn(walking):
    axes = panel(plot(draw_impedance_over_gait, walking), "Stiffness per body mass")
    assert "not drawn: 1 failed, 1 undecided" in labels(axes.texts)
    dots, triangles = axes.lines[0], axes.lines[1]
    assert len(dots.get_xdata()) == 60 - 4
    assert len(triangles.get_xdata()) == 2


def test_an_estimate_at_its_bound_hangs_from_its_upper_limit(bench):
    figure = plot(draw_impedance_over_gait, bench)
    axes = panel(figure, "Damping")
    limit = bench.cells[3].parameter("damping").ci_high
    triangles = axes.lines[1]
    assert triangles.get_marker() == "v"
    np.testing.assert_allclose(triangles.get_ydata(), [limit])


def test_one_huge_interval_does_not_flatten_the_others(bench):
    first = bench.cells[0]
    wide = replace(first.parameters[0], ci_high=1e6)
    cells = (replace(first, parameters=(wide, *first.parameters[1:])), *bench.cells[1:])
    figure = plot(draw_impedance_over_gait, replace(bench, cells=cells))
    axes = panel(figure, "Stiffness")
    assert axes.get_ylim()[1] < 1000.0
    assert "1 interval cut off" in labels(axes.texts)


def test_timing_points_about_heel_strike_are_ordered_on_the_circle(walking):
    cell = walking.cells[0]
    around = [
        replace(cell, timing_point=name, onset_gait_pct=pct)
        for name, pct in (("LRE", 7.0), ("ICO", 99.8), ("ICO", 2.4))
    ]
    assert timing_points(around) == ["ICO", "LRE"]  # the mean of 99.8 and 2.4 is 1.1


def test_responses_are_drawn_in_degrees_with_their_vaf_and_n(walking):
    one = only_group(walking, "S01", "LRE")
    figure = plot(draw_responses, one)
    angle, torque = figure.axes
    degrees = np.degrees(one.cells[0].response.angle)
    np.testing.assert_allclose(angle.lines[0].get_ydata()[:-1], degrees)
    np.testing.assert_allclose(
        torque.lines[1].get_ydata()[:-1], one.cells[0].response.fitted_torque
    )
    assert "n 48" in labels(angle.texts)
    assert f"{one.cells[0].vaf_pct:.1f} %" in labels(torque.texts)


def test_shapes_of_pulse_are_drawn_apart_and_counted_together(walking):
    (cell,) = only_group(walking, "S01", "LRE").cells
    push = replace(cell.response, n_pulses=30)
    pull = replace(push, angle=-push.angle, torque=-push.torque, n_pulses=18)
    one = replace(walking, cells=(replace(cell, response=push, other_shapes=(pull,)),))

    angle, torque = plot(draw_responses, one).axes

    n = push.angle.size + 1
    drawn = angle.lines[0].get_ydata()
    np.testing.assert_allclose(drawn[: n - 1], np.degrees(push.angle))
    np.testing.assert_allclose(drawn[n:-1], np.degrees(pull.angle))
    np.testing.assert_allclose(torque.lines[0].get_ydata()[n:-1], pull.torque)
    assert "n 48" in labels(angle.texts)
    assert "averaged apart" in captions(one)["responses"]
    assert "averaged apart" not in captions(walking)["responses"]


def test_no_mean_over_people_is_drawn_of_pulses_of_several_shapes(walking):
    cells = [replace(c, other_shapes=(c.response,)) for c in walking.cells if c.response]
    several = replace(walking, cells=tuple(cells))

    means = [plot(draw_response_overview, a).axes[0].lines[1] for a in (walking, several)]

    assert [np.size(mean.get_ydata()) > 0 for mean in means] == [True, False]
    assert "their mean" in captions(walking)["response_overview"]
    assert "their mean" not in captions(several)["response_overview"]


def test_examples_of_responses_are_the_best_the_median_and_the_worst_fit(walking):
    known = sorted(c.vaf_pct for c in walking.cells if c.response is not None)
    found = [c.vaf_pct for c in example_cells(walking.cells)]
    assert (found[0], found[-1]) == (known[-1], known[0])
    assert len(found) == 3


def test_few_people_have_no_figure_of_all_responses_together(walking):
    few = tuple(c for c in walking.cells if c.participant in ("S01", "S02", "S03"))
    assert plot(draw_response_overview, replace(walking, cells=few)) is None


def test_onset_deviations_are_taken_on_the_circle():
    pulses = tuple(
        PulseRecord("S01", "a.csv", float(i), 0.25, 17.0, "ICO", 1.0, pct)
        for i, pct in enumerate((99.0, 3.0))
    )
    figure = plot(draw_onset_accuracy, StudyAnalysis(cells=(), pulses=pulses))
    assert labels(figure.axes[0].texts)[0] == "SD 2.83 %\nmean +0.00 %\nn 2"


def test_names_with_markup_and_dollars_are_drawn_as_they_are(walking):
    one = only_group(walking, "S01", "LRE")
    cells = tuple(replace(c, participant="<script>$x_{1$") for c in one.cells)
    for svg in draw_figures(replace(one, cells=cells)).values():
        ET.fromstring(svg)
        assert "<script" not in svg


def test_methods_are_not_compared_by_means_over_unlike_loads(bench):
    cells = tuple(replace(c, participant=f"load-{k}") for k, c in enumerate(bench.cells))
    other = tuple(replace(c, method="dissertation") for c in cells)
    one = tuple(replace(c, method="dissertation") for c in bench.cells)
    assert plot(draw_methods, replace(bench, cells=cells, comparison=other)) is None
    assert plot(draw_methods, replace(bench, comparison=one)) is not None


def test_a_parameter_that_only_another_method_decides_is_drawn(walking):
    def undecided(cell):
        lost = tuple(
            replace(p, value=None, status="undecided") if p.name.startswith("stiffness") else p
            for p in cell.parameters
        )
        return replace(cell, parameters=lost)

    cells = tuple(undecided(c) for c in walking.cells)
    means = tuple(
        replace(m, value=None, status="undecided") if m.parameter.startswith("stiffness") else m
        for m in walking.population
    )
    figure = plot(draw_methods, replace(walking, cells=cells, population=means))
    stiffness = figure.axes[0]
    drawn = [line for line in stiffness.lines if line.get_marker() == "s"]
    assert len(figure.axes) == 3
    assert np.isfinite(drawn[0].get_ydata()).all()


def test_estimates_are_drawn_where_their_mean_is_undecided(walking):
    def apart(cell):
        if cell.timing_point != "MST":
            return cell
        large = 10.0 ** (cell.participant == "S01")
        return replace(cell, parameters=tuple(
            replace(p, value=large) if p.name == "stiffness_per_mass" else p
            for p in cell.parameters
        ))  # fmt: skip

    other = tuple(apart(c) for c in walking.comparison)
    axes = plot(draw_methods, replace(walking, comparison=other)).axes[0]
    dots = [line for line in axes.lines if line.get_marker() == "."]
    assert [len(line.get_ydata()) for line in dots] == [10]


def test_intervals_of_a_parameter_that_is_nothing_are_drawn_whole(bench):
    nothing = ParameterEstimate("damping", -0.004, -0.03, 0.02, "ok")
    cells = tuple(
        replace(c, parameters=(c.parameters[0], nothing, *c.parameters[2:])) for c in bench.cells
    )
    figure = plot(draw_impedance_over_gait, replace(bench, cells=cells))
    assert not any("cut off" in text for axes in figure.axes for text in labels(axes.texts))


def test_strides_that_hold_a_pulse_are_stroked_in_any_recording(walking):
    stride = next(s for s in walking.strides if s.condition == "perturbed" and not s.code)
    pulse = replace(walking.pulses[0], participant=stride.participant, recording=stride.recording,
                    onset_s=stride.start_s + 0.3)  # fmt: skip
    plain = replace(walking, strides=(stride,), pulses=(), gaps=())
    for analysis, strokes in ((plain, 0), (replace(plain, pulses=(pulse,)), 1)):
        figure = plot(draw_strides, analysis)
        legend = labels(figure.legends[0].texts)
        assert ("contains a pulse" in legend) is bool(strokes)
        rug = figure.axes[0].lines[1].get_xdata()
        assert np.isfinite(rug).sum() == 2 * strokes
