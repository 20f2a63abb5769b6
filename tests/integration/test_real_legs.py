"""The method strapped on recorded studies of another simulator, whose truth is known."""

import pytest
from benchmarks.real_legs import scores, studies

FOLDER = studies.real_legs_folder()
#: Study -> smallest shares of decided K and B. Of B 26 of 36 were decided in B and C before its
#: intervals had the error of the model; 25 and 24 are.
DECIDED = {"A": (0.0, 0.0), "B": (0.85, 0.65), "C": (0.75, 0.65)}


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.skipif(not FOLDER.is_dir(), reason=f"no recorded studies in {FOLDER}")
@pytest.mark.parametrize("study", DECIDED)
def test_what_is_decided_holds_the_truth(study, tmp_path):
    world = studies.recorded_world(FOLDER, study, None, tmp_path)
    found = {s.parameter: s for s in scores.scores(studies.analyzed(world, "strapped").rows)}

    for name, least in zip(
        ("stiffness", "damping", "inertia"), (*DECIDED[study], 1.0), strict=True
    ):
        assert found[name].decided.rate >= least
        if found[name].decided.rate > 0.1:
            assert found[name].coverage.rate >= 0.9
