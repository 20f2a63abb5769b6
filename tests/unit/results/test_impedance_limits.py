"""No stiffness, damping or inertia is ``ok`` that may be negative, whatever was corrected."""

import pytest

from jointz.results.estimates import ParameterEstimate
from jointz.results.impedance_limits import without_negative


@pytest.mark.parametrize(
    "name",
    ["stiffness", "inertia", "damping_per_mass", "stiffness_onset", "stiffness_gravity_corrected"],
)
@pytest.mark.parametrize(
    ("estimate", "expected"),
    [
        ((-0.024, -0.035, -0.013, "ok"), (None, None, None, "failed:below_zero")),
        ((0.02, -0.01, 0.05, "ok"), (None, -0.01, 0.05, "undecided")),
        ((0.02, 0.0, 0.05, "ok"), (None, 0.0, 0.05, "undecided")),
        ((0.02, 0.01, 0.05, "ok"), (0.02, 0.01, 0.05, "ok")),
        ((-0.03, -0.03, -0.01, "at_bound"), (None, None, None, "failed:below_zero")),
        ((-0.03, -0.03, 0.01, "at_bound"), (0.0, 0.0, 0.01, "at_bound")),
        ((0.0, 0.0, 0.01, "at_bound"), (0.0, 0.0, 0.01, "at_bound")),
    ],
)
def test_what_may_be_negative_is_not_ok(name, estimate, expected):
    value, low, high, status = estimate
    found = without_negative(ParameterEstimate(name, value, low, high, status))
    assert (found.value, *found.ci, found.status) == expected


def test_a_lag_may_be_negative():
    lag = ParameterEstimate("torque_lag", -0.001, -0.002, 0.001, "ok")
    assert without_negative(lag) is lag
