"""Classical values stand beside the joint's own where these are not available."""

import re
from dataclasses import replace
from io import BytesIO

import numpy as np
import pandas as pd
import pytest
from tests.unit.analysis.studies import bayesian_analysis

from jointz.analysis.classical import MEAN, classical_analysis, comparison_table, pulse_kind
from jointz.analysis.page.captions import captions
from jointz.analysis.page.first_page import first_page
from jointz.analysis.page.impedance_figures import draw_impedance_overview
from jointz.analysis.page.published_values import published_clause
from jointz.analysis.results_folder import csv_bytes
from jointz.reference.classical_errors import RMS_PCT

HELD = ("stiffness", "damping", "stiffness_per_mass", "damping_per_mass")


def undecided(analysis):
    """Return an analysis whose own K and B nobody's data decide."""

    def cell(one):
        parameters = tuple(
            replace(p, value=None, status="undecided") if p.name in HELD else p
            for p in one.parameters
        )
        return replace(one, parameters=parameters)

    population = tuple(
        replace(m, value=None, status="undecided") if m.parameter in HELD else m
        for m in analysis.population
    )
    return replace(analysis, cells=tuple(map(cell, analysis.cells)), population=population)


@pytest.fixture(scope="module")
def held():
    return undecided(bayesian_analysis(coupling="strap"))


def values_of(analysis, point, name):
    cells = [c for c in analysis.comparison if c.timing_point == point]
    return np.array([c.parameter(name).value for c in cells if c.parameter(name).available])


def test_the_first_page_has_classical_means_beside_what_is_undecided(held):
    table = first_page(held)["table"]
    row = table["rows"][0]
    stiffness, _, inertia = row["cells"]
    assert stiffness["text"] == "undecided"
    assert inertia["classical"] == ""
    shown = float(re.match(r"[\d.]+", stiffness["classical"])[0])
    assert shown == pytest.approx(values_of(held, "LRE", "stiffness").mean(), rel=0.01)
    assert "not corrected for strap, lag and baseline" in table["classical"]
    low, high = RMS_PCT["hold"]["stiffness"]
    assert f"{low:.0f} to {high:.0f} % in K" in table["classical"]


def test_what_is_available_has_no_classical_value_beside_it():
    table = first_page(bayesian_analysis())["table"]
    assert table["classical"] == ""
    assert {c["classical"] for row in table["rows"] for c in row["cells"]} == {""}


def test_one_person_has_the_classical_values_of_that_person(held):
    def of_first(cells):
        return tuple(c for c in cells if c.participant == "S01")

    alone = replace(
        held, cells=of_first(held.cells), comparison=of_first(held.comparison), population=()
    )
    row = first_page(alone)["table"]["rows"][0]
    assert row["cells"][0]["text"] == "undecided"
    assert "[" in row["cells"][0]["classical"]


def test_the_figure_says_which_values_are_classical(held):
    figure = draw_impedance_overview(held)
    assert "classical" in [t.get_text() for t in figure.legends[0].get_texts()]
    assert len(figure.axes) == 3  # without them there would be inertia alone
    assert "classical values" in captions(held)["impedance_overview"]
    assert "classical" not in captions(bayesian_analysis())["impedance_overview"]


def test_published_values_are_compared_with_classical_ones(held):
    assert published_clause(held).startswith("Classical stiffness per body mass")


def test_the_means_stand_below_the_estimates_of_the_other_methods(held):
    before, table = held.comparison_frame(), comparison_table(held)
    added = table[table["method"] == MEAN]
    assert len(table) == len(before) + len(added)
    assert set(added["participant"]) == {""}
    lre = added[(added["timing_point"] == "LRE") & (added["parameter"] == "stiffness")].iloc[0]
    values = values_of(held, "LRE", "stiffness")
    assert lre["value"] == pytest.approx(values.mean())
    half = 4.3027 * values.std(ddof=1) / 3**0.5  # Student's t of 2 degrees of freedom
    assert lre["ci_high"] - lre["value"] == pytest.approx(half, rel=1e-3)
    written = csv_bytes(table)
    assert written.startswith(csv_bytes(before))
    assert pd.read_csv(BytesIO(written))["n_used"].isna().sum() == len(added)


def test_sessions_of_a_person_are_one_person_in_a_classical_mean(held):
    def in_sessions(cells):
        return tuple(replace(c, session=name) for name in ("day1", "day2") for c in cells)

    twice = replace(held, cells=in_sessions(held.cells), comparison=in_sessions(held.comparison))
    once, both = (classical_analysis(a).population[0] for a in (held, twice))
    assert (both.n_participants, both.value) == (once.n_participants, pytest.approx(once.value))
    assert both.ci_high == pytest.approx(once.ci_high)


def test_without_a_joints_own_method_nothing_is_classical(held):
    assert classical_analysis(replace(held, settings={"method": "dissertation"})) is None
    assert classical_analysis(replace(held, comparison=())) is None


@pytest.mark.parametrize(
    ("shape", "kind"),
    [
        (lambda t: 1.0 - np.exp(-t / 0.02), "hold"),
        (lambda t: np.where(t < 0.06, 1.0, 0.0), "short"),
        (lambda t: np.where(t < 0.05, 1.0, np.where(t < 0.08, -1.0, 0.0)), "doublet"),
    ],
)
def test_the_kind_of_pulse_is_that_of_the_torque(held, shape, kind):
    cells = tuple(
        replace(c, response=replace(c.response, torque=shape(c.response.time_s)))
        for c in held.comparison
    )
    assert pulse_kind(cells) == kind


def test_without_responses_no_kind_of_pulse_is_claimed(held):
    bare = tuple(replace(c, response=None) for c in held.comparison)
    assert pulse_kind(bare) is None
    table = first_page(replace(held, comparison=bare))["table"]
    assert "not corrected" in table["classical"]
    assert "simulated people" not in table["classical"]


def test_a_study_without_any_own_value_is_drawn_with_classical_ones(held):
    def cell(one):
        none = (replace(p, value=None, status="undecided") for p in one.parameters)
        return replace(one, parameters=tuple(none))

    nobody = replace(held, cells=tuple(map(cell, held.cells)), population=())

    figure = draw_impedance_overview(nobody)
    labels = [t.get_text() for t in figure.legends[0].get_texts()]

    assert labels == ["classical"]
