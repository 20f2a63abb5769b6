"""The benchmark of profiles runs, and finds what it should of one person."""

import pytest
from benchmarks.control_profiles import coverage, people, torque_errors


@pytest.mark.slow
def test_one_person_without_noise():
    (one,) = people("clean", 1, per_point=10, seed=5)
    rms, between = torque_errors(one)
    assert rms < max(2.0, between)
    shares = coverage([one])
    assert list(shares) == ["stiffness", "damping", "equilibrium"]
    assert all(0.5 < everywhere <= 1.0 for everywhere, _ in shares.values())
