"""Error to expect: bias, RMSE and coverage of simulated people."""

import numpy as np
import pytest

from jointz.results.certificate_result import (
    Certificate,
    ComparedStatistic,
    VirtualEstimate,
    expected_errors,
)


def estimated(truth, value, *, half=5.0, point="LRE", person="V01", **more):
    decided = value is not None
    return VirtualEstimate(
        participant=person,
        timing_point=point,
        parameter=more.get("parameter", "stiffness"),
        truth=truth,
        value=value,
        ci_low=value - half if decided else None,
        ci_high=value + half if decided else None,
        status=more.get("status", "ok" if decided else "undecided"),
    )


def certificate(estimates, comparisons=()) -> Certificate:
    return Certificate("bayesian", expected_errors(estimates), tuple(estimates), 2, comparisons)


def test_bias_rmse_and_coverage_are_those_of_the_relative_errors():
    rows = certificate([estimated(100.0, 104.0), estimated(50.0, 45.0), estimated(20.0, 40.0)])

    found = rows.error("stiffness")

    assert found.bias_pct == pytest.approx(100.0 * (0.04 - 0.1 + 1.0) / 3)
    assert found.rmse_pct == pytest.approx(100.0 * np.sqrt((0.04**2 + 0.1**2 + 1.0) / 3))
    assert found.rmse == pytest.approx(np.sqrt((16.0 + 25.0 + 400.0) / 3))
    assert found.coverage == pytest.approx(2 / 3)
    assert found.width_pct == pytest.approx(20.0)


def test_a_truth_of_zero_has_no_relative_error_and_an_undecided_one_none_at_all():
    estimates = [estimated(0.0, 3.0, status="at_bound"), estimated(100.0, 90.0)]
    assert certificate(estimates).error("stiffness").undecided_pct == 0.0
    found = certificate([*estimates, estimated(100.0, None), estimated(100.0, None)])
    assert found.error("stiffness").rmse_pct == pytest.approx(10.0)
    assert found.error("stiffness").undecided_pct == 50.0
    assert found.error("stiffness").rmse_sd_pct is None
    assert certificate([estimated(100.0, None)]).error("stiffness").rmse_pct is None


def test_a_truth_of_nearly_nothing_is_told_in_si_only():
    """Off by 2 N*m/rad is no error of 20000 %."""
    usual = [estimated(100.0, 103.0), estimated(80.0, 80.0), estimated(60.0, 57.0)]
    rows = certificate(
        [*usual, estimated(0.01, 2.01, point="ISW"), estimated(9.0, 9.9, point="PSW")]
    )

    alone = rows.error("stiffness", "ISW")
    assert (alone.bias_pct, alone.rmse_pct, alone.rmse_sd_pct, alone.width_pct) == (None,) * 4
    assert (alone.rmse, alone.coverage, alone.n_small) == (pytest.approx(2.0), 1.0, 1)
    # A tenth of 60, the median, and not of 100, the largest.
    assert rows.error("stiffness", "PSW").rmse_pct == pytest.approx(10.0)
    all_points = rows.error("stiffness")
    assert all_points.n_small == 1
    relative = np.array([0.03, 0.0, -0.05, 0.1])
    assert all_points.bias_pct == pytest.approx(100.0 * relative.mean())
    assert all_points.rmse_pct == pytest.approx(100.0 * np.sqrt((relative**2).mean()))
    assert all_points.rmse == pytest.approx(np.sqrt((9.0 + 9.0 + 4.0 + 0.81) / 5))


def test_where_every_truth_is_small_beside_its_error_none_is_told_in_percent():
    rows = certificate([estimated(0.01, 2.01), estimated(0.02, 1.52, point="ISW")])

    found = rows.error("stiffness")

    assert found.rmse_pct is None
    assert found.n_small == 2
    assert found.rmse == pytest.approx(np.sqrt((4.0 + 2.25) / 2))
    assert "1.77 N*m/rad" in rows.summary()


def test_a_certificate_that_did_not_count_small_truths_can_still_be_read():
    data = certificate([estimated(10.0, 11.0)]).to_dict()
    for row in data["errors"]:
        del row["n_small"]

    assert Certificate.from_dict(data).error("stiffness").n_small == 0


def test_timing_points_stand_beside_their_pool():
    rows = certificate([estimated(10.0, 11.0), estimated(10.0, 13.0, point="MST")])

    assert rows.error("stiffness", "LRE").rmse_pct == pytest.approx(10.0)
    assert rows.error("stiffness", "MST").rmse_pct == pytest.approx(30.0)
    assert rows.error("stiffness").n == 2


def test_the_rmse_is_known_as_well_as_independent_people_tell_it():
    """Squared normal errors: the sd of a RMSE from n of them is rmse / sqrt(2 n)."""
    rng = np.random.default_rng(0)
    errors = 0.1 * rng.standard_normal(2000)
    alone = [estimated(1.0, 1.0 + e, person=f"V{k}") for k, e in enumerate(errors)]
    # The same error at six timing points tells no more than once.
    shared = [
        estimated(1.0, 1.0 + e, person=f"V{k}", point=f"P{i}")
        for k, e in enumerate(errors[:500])
        for i in range(6)
    ]

    assert certificate(alone).error("stiffness").rmse_sd_pct == pytest.approx(
        10.0 / np.sqrt(2 * 2000), rel=0.1
    )
    assert certificate(shared).error("stiffness").rmse_sd_pct == pytest.approx(
        10.0 / np.sqrt(2 * 500), rel=0.15
    )


def test_a_study_unlike_the_simulated_people_gets_no_promise():
    alike = ComparedStatistic("misfit", 1.1, 1.0, 0.7, 1.4)
    unlike = ComparedStatistic("unpredictability_deg", 3.0, 1.0, 0.5, 2.0)
    promised = certificate([estimated(100.0, 104.0)], (alike,))
    refused = certificate([estimated(100.0, 104.0)], (alike, unlike))

    assert (promised.status, refused.status) == ("promised", "cannot_promise")
    assert "Cannot promise" not in promised.summary()
    assert "Cannot promise: Your strides are less predictable" in refused.summary()
    assert "unpredictability of a stride 3 deg; simulated 0.5 to 2" in refused.summary()
    assert set(refused.to_frame()["status"]) == {"cannot_promise"}
    assert refused.to_frame()["reasons"].str.contains("less predictable").all()
    below = ComparedStatistic("unpredictability_deg", 0.1, 1.0, 0.5, 2.0)
    assert "more predictable" in below.sentence


def test_without_a_comparison_nothing_is_promised():
    assert "Too few simulated people" in certificate([estimated(100.0, 104.0)]).reasons[0]


def test_where_the_protocol_decides_nothing_nothing_is_promised():
    alike = ComparedStatistic("misfit", 1.1, 1.0, 0.7, 1.4)
    never = certificate([estimated(100.0, None), estimated(90.0, None)], (alike,))
    assert never.status == "cannot_promise"
    assert "decides no value" in never.reasons[0]
