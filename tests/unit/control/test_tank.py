"""Energy tank: spring and tank never hold more than the port gave; controllers with it."""

import numpy as np
import pytest

from jointz.control.profile_file import write_profile
from jointz.control.rendering.tank import EnergyTank
from jointz.core.protocols.protocol_models import ControllerSpec
from jointz.io.protocols import load_protocol
from jointz.rig.devices.interface import Wearer
from jointz.rig.experiment.controllers import ControlState, make_controller

STEP_S = 0.002


def ledger(tank, stiffness, damping, deviation):
    """Return what the port gave in each tick beyond what spring and tank gained, J."""
    used, level, rows = [], [], []
    rate = np.diff(deviation, prepend=deviation[0]) / STEP_S
    for k, b, x, v in zip(stiffness, damping, deviation, rate, strict=True):
        used.append(tank.limit(k, b, deviation=x, rate=v, elapsed_s=STEP_S))
        level.append(tank.energy_j)
    for i in range(1, deviation.size):
        # The law of the last tick holds over the motion to this one.
        spring = 0.5 * used[i - 1] * (deviation[i] ** 2 - deviation[i - 1] ** 2)
        port = spring + damping[i - 1] * rate[i] ** 2 * STEP_S
        stored = 0.5 * used[i] * deviation[i] ** 2 - 0.5 * used[i - 1] * deviation[i - 1] ** 2
        rows.append(port - stored - (level[i] - level[i - 1]))
    return np.array(rows), np.array(used), np.array(level)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("size_j", [0.001, 0.1, 5.0])
def test_no_tick_makes_energy(seed, size_j):
    rng = np.random.default_rng(seed)
    n = 3000
    deviation = np.cumsum(rng.normal(0.0, 0.01, n)) * rng.uniform(0.1, 2.0)
    stiffness = rng.uniform(0.0, 300.0, n) if seed % 2 else 150 + 140 * np.sin(np.arange(n) / 40)
    damping = rng.uniform(0.0, 5.0, n)
    rest, used, level = ledger(EnergyTank(size_j), stiffness, damping, deviation)
    assert rest.min() >= -1e-12
    assert level.min() >= 0.0
    assert level.max() <= size_j
    assert used.min() >= 0.0
    assert (used <= np.maximum.accumulate(stiffness) + 1e-9).all()


def test_stiffness_stays_when_the_tank_is_empty_and_follows_when_it_is_free():
    tank = EnergyTank(0.1)
    tank.limit(50.0, 0.0, deviation=0.2, rate=0.0, elapsed_s=STEP_S)
    first = tank.limit(100.0, 0.0, deviation=0.2, rate=0.0, elapsed_s=STEP_S)
    assert first == pytest.approx(50.0 + 0.1 / (0.5 * 0.2**2))
    assert tank.energy_j == 0.0
    assert tank.limit(100.0, 0.0, deviation=0.2, rate=0.0, elapsed_s=STEP_S) == first
    assert tank.limit(100.0, 0.0, deviation=0.0, rate=0.0, elapsed_s=STEP_S) == 100.0
    assert tank.limit(20.0, 0.0, deviation=0.2, rate=0.0, elapsed_s=STEP_S) == 20.0
    assert tank.energy_j == 0.1  # no more than its size


def controller(name, file, **settings):
    spec = ControllerSpec(name=name, profile=str(file), settings={"share": 1.0, **settings})
    protocol = load_protocol("knee_controller")
    return make_controller(spec, protocol=protocol, wearer=Wearer("S01", 75.0))


def torques(made, profile, off):
    at = np.arange(0.0, 200.0, 0.2)
    states = zip(at, profile.at("angle", at) + off, profile.at("angle", at) * 0.0, strict=True)
    return np.array(
        [
            made.torque(ControlState(phase * 0.011, phase % 100.0, a, v, 0.0, 5), {"share": 1.0})
            for phase, a, v in states
        ]
    )


@pytest.mark.parametrize(
    "name", ["impedance_constant", "impedance_per_phase", "impedance_continuous"]
)
def test_controllers_with_a_tank(name, profile, tmp_path):
    file = write_profile(profile, tmp_path / "S01.json")
    plain, ample, small = (
        controller(name, file, **more) for more in ({}, {"tank_j": 50.0}, {"tank_j": 0.01})
    )
    wanted = torques(plain, profile, 0.2)
    np.testing.assert_allclose(torques(ample, profile, 0.2), wanted, atol=1e-9)
    held = torques(small, profile, 0.2)
    if name == "impedance_constant":  # its stiffness never rises
        np.testing.assert_allclose(held, wanted, atol=1e-9)
    else:
        assert np.abs(held - wanted).max() > 1.0
        assert (np.abs(held) <= np.abs(wanted) + 1e-9).all()
    assert small.describe()["tank_j"] == 0.01
    assert "tank_j" not in plain.describe()
