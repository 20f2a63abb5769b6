"""A certificate of a whole study."""

import pytest

from jointz.analysis.certify import certify, checked_injection
from jointz.core.errors import DataError

from .studies import without_recordings


@pytest.fixture(scope="module")
def whole(small_study_source):
    told = []
    found = certify(
        small_study_source, stiffness=80.0, replicates=1, seed=3, progress=lambda *a: told.append(a)
    )
    return found, told


def test_every_participant_parameter_and_timing_point_is_certified(whole):
    found, told = whole

    assert found.n_participants == 2
    assert found.left_out == {}
    assert len(found.estimates) == 2 * 6 * 3
    table = found.to_frame()
    assert set(table["parameter"]) == {"stiffness", "damping", "inertia"}
    assert list(table["timing_point"].unique()) == ["all", "LRE", "MST", "TST", "PSW", "ISW", "MSW"]
    assert [t[:2] for t in told] == [(0, 2), (1, 2), (2, 2)]


def test_what_was_given_is_what_was_injected(whole):
    found, _ = whole
    truths = [e.truth for e in found.estimates if e.parameter == "stiffness"]

    assert truths == pytest.approx([80.0] * 12)
    assert found.injected["stiffness"] == "80"
    assert found.injected["lag_s"] == "found"


def test_a_participant_without_pulses_is_left_out_by_name(small_study):
    without_recordings(small_study, "S02", "perturbed")

    found = certify(small_study.root, replicates=1)

    assert list(found.left_out) == ["S02"]
    assert found.n_participants == 1


def test_a_bench_study_is_refused(small_study):
    small_study.edit_toml('kind = "walking"\ncoupling = "rigid"', 'kind = "bench"')

    with pytest.raises(ValueError, match="expected a walking study"):
        certify(small_study.root)


@pytest.mark.parametrize(
    ("given", "place"),
    [
        ({"stiffness": -1.0}, "stiffness: .*-1.0"),
        ({"damping": float("nan")}, "damping: "),
        ({"damping": {"XYZ": 1.0}}, "damping: .*XYZ"),
        ({"lag_s": 5.0}, "lag_s: .*5.0"),
    ],
)
def test_values_that_make_no_sense_are_refused(given, place):
    asked = {"stiffness": None, "damping": None, "inertia": None} | given
    lag_s = asked.pop("lag_s", None)

    with pytest.raises(ValueError, match=place):
        checked_injection(**asked, lag_s=lag_s, timing_points=["LRE"])


def test_a_study_of_a_strapped_device_has_no_certificate(small_study):
    small_study.edit_toml('coupling = "rigid"', 'coupling = "strap"')

    with pytest.raises(DataError, match=r'of the method rigid, .* by strapped.*coupling = "rigid"'):
        certify(small_study.root, replicates=1)
