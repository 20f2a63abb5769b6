"""A short simulated study of chapter IV, and a short pilot: every table and figure comes out."""

import pytest
from reproduction.chapter4.figures import DRAWINGS, draw_chapter4
from reproduction.chapter4.reproduce_chapter4 import (
    pilot_results,
    pilot_study,
    simulated_chapter,
)
from reproduction.chapter4.walking import walking_study
from reproduction.reproduction_result import Reproduction

from jointz.io.protocols import load_protocol

pytestmark = pytest.mark.slow
PEOPLE, STRIDES = 3, 10


@pytest.fixture(scope="module", autouse=True)
def in_one_process():
    """Hide all cores but one: to start workers takes longer than a small study."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("os.cpu_count", lambda: 1)
        patch.setattr("os.sched_getaffinity", lambda _: {0}, raising=False)
        yield


def short_protocol(name, *, people):
    """Return a walking protocol with few strides and two pulses a timing point."""
    whole = load_protocol(name)
    made = []
    for condition in whole.conditions:
        few = {"strides": STRIDES}
        if condition.perturbations is not None:
            pulses = condition.perturbations.model_copy(update={"count_per_point": 2})
            few = {"perturbations": pulses}
        made.append(condition.model_copy(update=few))
    return whole.model_copy(update={"conditions": tuple(made), "participants": people})


@pytest.fixture(scope="module")
def walked(tmp_path_factory):
    calls = []
    found = walking_study(
        tmp_path_factory.mktemp("walking"),
        1,
        "nominal",
        lambda *call: calls.append(call),
        protocol=short_protocol("walking", people=PEOPLE),
        resamples=5,
    )
    return found, calls


@pytest.fixture(scope="module")
def pilot(tmp_path_factory):
    protocol = short_protocol("walking-pilot", people=2)
    return pilot_study(tmp_path_factory.mktemp("pilot"), 1, "nominal", protocol=protocol)


def test_all_tables_and_figures_of_the_simulated_chapter_come_out(walked, pilot):
    found, calls = walked
    tables, curves = simulated_chapter(found)
    pilot_table, curves["pilot"] = pilot_results(pilot)
    made = Reproduction(4, "Walking", (*tables, pilot_table), curves)
    assert Reproduction.from_dict(made.to_dict()) == made
    assert list(draw_chapter4(curves)) == [
        f for f, (curve, _) in DRAWINGS.items() if curve in curves
    ]
    assert calls[-1] == (PEOPLE, PEOPLE, "done")


def test_both_methods_and_the_truth_are_there_for_every_cell(walked):
    found, _ = walked
    counts = found.estimates.groupby(["source", "parameter"]).size()
    assert (counts == 6 * PEOPLE).all()
    assert len(counts) == 9
    assert found.of("truth", "inertia")["value"].between(0.03, 0.07).all()


def test_unperturbed_strides_are_there_without_and_with_the_device(walked):
    found, _ = walked
    for person in found.gait.values():
        assert abs(len(person.no_device) - STRIDES) <= 1
        assert person.device.shape == person.torque.shape
        # A knee of walking: bent by some 60 degrees at most; a device of little torque.
        assert 0.7 < person.device.mean(axis=0).max() < 1.4
        assert abs(person.torque).max() < 5.0
