"""The leg by de Leva's table, beside sums over its segments by hand."""

import pytest

from jointz.reference.body_segments import MEN, WOMEN, leg_beyond


def test_the_leg_below_the_knee_has_the_mass_moment_and_inertia_of_shank_and_foot():
    # One man and one woman of 70 kg and 1.7 m, by hand: shank and foot about the knee.
    man = 70 * (0.0433 * 0.4238**2 * (0.4459**2 + 0.249**2) + 0.0137 * (0.4638**2 + 0.0482**2
        + 0.0617**2))  # fmt: skip
    woman = 70 * (0.0481 * 0.4236**2 * (0.4416**2 + 0.267**2) + 0.0129 * (0.4636**2 + 0.0339**2
        + 0.0624**2))  # fmt: skip
    leg = leg_beyond("knee", 70.0, 1.7)
    assert leg.mass_kg == pytest.approx(70 * (0.0433 + 0.0137 + 0.0481 + 0.0129) / 2)
    assert leg.inertia == pytest.approx((man + woman) / 2, rel=1e-3)
    moment = 9.81 * 70 * (0.0433 * 0.4459 * 0.4238 + 0.0137 * 0.4638
        + 0.0481 * 0.4416 * 0.4236 + 0.0129 * 0.4636) / 2  # fmt: skip
    assert leg.moment_nm == pytest.approx(moment, rel=1e-3)


def test_the_leg_beyond_the_hip_is_the_thigh_and_what_it_carries():
    hip, knee = leg_beyond("hip", 70.0, 1.7), leg_beyond("knee", 70.0, 1.7)
    thighs = (MEN["thigh"], WOMEN["thigh"])
    assert hip.mass_kg - knee.mass_kg == pytest.approx(35 * sum(t.mass for t in thighs))
    assert hip.inertia > knee.inertia + knee.mass_kg * (0.36 + knee.centre_m) ** 2


@pytest.mark.parametrize("table", [MEN, WOMEN])
def test_shares_are_of_a_body(table):
    assert sum(segment.mass for segment in table.values()) == pytest.approx(0.2, abs=0.01)
    assert sum(table[name].length for name in ("thigh", "shank")) == pytest.approx(0.48, abs=0.02)
