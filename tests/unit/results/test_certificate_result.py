"""Error to expect: bias, RMSE and coverage out of injected responses."""

import numpy as np
import pytest

from jointz.results.certificate_result import Certificate, VirtualEstimate, expected_errors


def injected(truth, value, *, half=5.0, point="LRE", person="S01", replicate=0, **more):
    decided = value is not None
    return VirtualEstimate(
        participant=person,
        replicate=replicate,
        timing_point=point,
        parameter=more.get("parameter", "stiffness"),
        truth=truth,
        value=value,
        ci_low=value - half if decided else None,
        ci_high=value + half if decided else None,
        status=more.get("status", "ok" if decided else "undecided"),
    )


def certificate(estimates) -> Certificate:
    return Certificate("rigid", expected_errors(estimates), tuple(estimates), 1, 2)


def test_bias_rmse_and_coverage_are_those_of_the_relative_errors():
    rows = certificate([injected(100.0, 104.0), injected(50.0, 45.0), injected(20.0, 40.0)])

    found = rows.error("stiffness")

    assert found.bias_pct == pytest.approx(100.0 * (0.04 - 0.1 + 1.0) / 3)
    assert found.rmse_pct == pytest.approx(100.0 * np.sqrt((0.04**2 + 0.1**2 + 1.0) / 3))
    assert found.rmse == pytest.approx(np.sqrt((16.0 + 25.0 + 400.0) / 3))
    assert found.coverage == pytest.approx(2 / 3)
    assert found.width_pct == pytest.approx(20.0)


def test_a_truth_of_zero_has_no_relative_error_and_an_undecided_one_none_at_all():
    estimates = [injected(0.0, 3.0, status="at_bound"), injected(100.0, 90.0)]
    assert certificate(estimates).error("stiffness").undecided_pct == 0.0
    found = certificate([*estimates, injected(100.0, None), injected(100.0, None)])
    assert found.error("stiffness").rmse_pct == pytest.approx(10.0)
    assert found.error("stiffness").undecided_pct == 50.0
    assert found.error("stiffness").rmse_sd_pct is None
    assert certificate([injected(100.0, None)]).error("stiffness").rmse_pct is None


def test_a_truth_of_nearly_nothing_is_told_in_si_only():
    """Off by 2 N*m/rad is no error of 20000 %."""
    usual = [injected(100.0, 103.0), injected(80.0, 80.0), injected(60.0, 57.0)]
    rows = certificate([*usual, injected(0.01, 2.01, point="ISW"), injected(9.0, 9.9, point="PSW")])

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
    rows = certificate([injected(0.01, 2.01), injected(0.02, 1.52, point="ISW")])

    found = rows.error("stiffness")

    assert found.rmse_pct is None
    assert found.n_small == 2
    assert found.rmse == pytest.approx(np.sqrt((4.0 + 2.25) / 2))
    assert "1.77 N*m/rad" in rows.summary()


def test_a_certificate_that_did_not_count_small_truths_can_still_be_read():
    data = certificate([injected(10.0, 11.0)]).to_dict()
    for row in data["errors"]:
        del row["n_small"]

    assert Certificate.from_dict(data).error("stiffness").n_small == 0


def test_timing_points_stand_beside_their_pool():
    rows = certificate([injected(10.0, 11.0), injected(10.0, 13.0, point="MST")])

    assert rows.error("stiffness", "LRE").rmse_pct == pytest.approx(10.0)
    assert rows.error("stiffness", "MST").rmse_pct == pytest.approx(30.0)
    assert rows.error("stiffness").n == 2


def test_the_rmse_is_known_as_well_as_independent_people_tell_it():
    """Squared normal errors: the sd of a RMSE from n of them is rmse / sqrt(2 n)."""
    rng = np.random.default_rng(0)
    errors = 0.1 * rng.standard_normal(2000)
    alone = [injected(1.0, 1.0 + e, replicate=k) for k, e in enumerate(errors)]
    # The same error at six timing points tells no more than once.
    shared = [
        injected(1.0, 1.0 + e, replicate=k, point=f"P{i}")
        for k, e in enumerate(errors[:500])
        for i in range(6)
    ]

    assert certificate(alone).error("stiffness").rmse_sd_pct == pytest.approx(
        10.0 / np.sqrt(2 * 2000), rel=0.1
    )
    assert certificate(shared).error("stiffness").rmse_sd_pct == pytest.approx(
        10.0 / np.sqrt(2 * 500), rel=0.15
    )
