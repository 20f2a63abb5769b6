"""The benchmark of certificates: how it scores, and what it finds in a few small studies."""

import pytest
from benchmarks.certificate import main, scored

from jointz.results.certificate_result import PARAMETERS, VirtualEstimate


def estimates(*pairs):
    return [
        VirtualEstimate("S01", 0, "LRE", name, truth, value, value - 1.0, value + 1.0, "ok")
        for truth, value in pairs
        for name in PARAMETERS
    ]


def test_errors_are_relative_to_the_truth():
    scores = scored(estimates((10.0, 11.0), (10.0, 7.0)))

    assert scores["stiffness"]["rmse"] == pytest.approx(100.0 * (0.05) ** 0.5)
    assert scores["stiffness"]["bias"] == pytest.approx(-10.0)
    assert scores["damping"]["coverage"] == 0.5


@pytest.mark.slow
def test_a_planted_lag_is_seen_and_an_honest_certificate_is_near_the_truth():
    """Twenty people each; the bands are wide of what so few tell: a RMSE to 20 %."""
    few = ["--studies", "5", "--participants", "4", "--replicates", "3", "--seed", "9100"]
    honest = main([*few, "--rows", "nominal-lag-0.5ms"])["all"]
    planted = main([*few[:1], "1", *few[2:], "--rows", "nominal-lag-0.5ms",
                    "--planted-lag-s", "0.005"])["all"]  # fmt: skip

    for name in PARAMETERS:
        assert 0.6 < honest["virtual"][name]["rmse"] / honest["real"][name]["rmse"] < 1.6
    assert planted["virtual"]["inertia"]["bias"] > 15.0
