"""The population and its instruments."""

import numpy as np
import pytest

from jointz.core.errors import DataError
from jointz.core.gait_phases import TIMING_POINTS
from jointz.rig.sim.people import draw_instruments, draw_person
from jointz.rig.sim.presets import GoniometerSettings, ReflexSettings, preset


@pytest.fixture(scope="module")
def people():
    return [draw_person(number, seed=7) for number in range(400)]


def test_people_have_the_means_and_the_spread_of_the_population(people):
    for i, name in enumerate(TIMING_POINTS):
        stiffness = np.array([p.stiffness_per_mass[name] for p in people])
        damping = np.array([p.damping_per_mass[name] for p in people])
        # 400 people: a mean is known to 1.3 %, a coefficient of variation to about 5 %.
        assert stiffness.mean() == pytest.approx((2.0, 0.65, 1.15, 1.15, 0.32, 0.38)[i], rel=0.05)
        assert damping.mean() == pytest.approx((0.035, 0.04, 0.05, 0.03, 0.036, 0.027)[i], rel=0.05)
        assert stiffness.std() / stiffness.mean() == pytest.approx(0.25, rel=0.2)
        assert np.log(damping).std() == pytest.approx(0.246, rel=0.15)


def test_bodies_lie_within_the_stated_ranges(people):
    mass = np.array([p.mass_kg for p in people])
    assert mass.mean() == pytest.approx(73.0, abs=1.7)  # clipped a little from above
    assert 52.0 <= mass.min() < mass.max() <= 100.0
    assert all(1.55 <= p.height_m <= 1.95 for p in people)
    assert all(0.03 <= p.inertia <= 0.07 for p in people)
    assert [p.id for p in people[:2]] == ["S01", "S02"]


def test_a_person_comes_back_from_seed_and_number_alone(people):
    assert draw_person(300, seed=7) == people[300]
    assert draw_person(300, seed=8) != people[300]
    assert len({p.mass_kg for p in people}) == len(people)


@pytest.mark.parametrize("name", ["nominal", "hard"])
def test_instruments_err_as_much_as_the_preset_says(people, name):
    one = preset(name)
    drawn = [draw_instruments(p, one) for p in people]
    for field, sd in (
        ("torque_gain", one.actuator.gain_error_sd),
        ("angle_gain", one.goniometer.gain_error_sd),
        ("friction_gain", one.actuator.friction_error_sd),
    ):
        values = np.array([getattr(d, field) for d in drawn])
        assert values.mean() == pytest.approx(1.0, abs=4 * sd / 20)
        assert values.std() == pytest.approx(sd, rel=0.15)
    lag = np.array([d.angle_lag_s for d in drawn])
    low, high = one.goniometer.lag_range_s
    assert low <= lag.min() < low + 0.05 * (high - low)
    assert high - 0.05 * (high - low) < lag.max() <= high
    assert {d.strap_stiffness for d in drawn} == {0.0}


def test_a_strap_and_tissue_of_their_own_lie_in_their_ranges(people):
    drawn = [draw_instruments(p, preset("anthropometric")) for p in people]
    assert all(300 <= d.strap_stiffness <= 1000 and 20 <= d.tissue_hz <= 40 for d in drawn)


def test_settings_that_do_not_exist_are_refused():
    with pytest.raises(DataError, match="easy"):
        preset("easy")
    for wrong in ({"lag_range_s": (0.001, 0.001)}, {"lag_range_s": (0.012, 0.004)}):
        with pytest.raises(DataError, match="lag_range_s"):
            GoniometerSettings(**wrong)
    for wrong in ({"tissue_range_hz": (40.0, 20.0)}, {"tissue_range_hz": (0.0, 20.0)}):
        with pytest.raises(DataError, match="tissue_range_hz"):
            GoniometerSettings(**wrong)
    with pytest.raises(DataError, match="latency_s"):
        ReflexSettings(latency_s=0.2)
