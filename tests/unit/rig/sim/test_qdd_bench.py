"""Settings of the quasi-direct-drive bench."""

from dataclasses import replace

import numpy as np
import pytest

from jointz.core.errors import DataError
from jointz.rig.sim.benches.bench_load import BenchLoad
from jointz.rig.sim.benches.qdd_bench import (
    COMMANDS,
    QddMachine,
    QddParam,
    QddSettings,
    draw_mounting,
    pack_qdd,
    qdd_preset,
)

SPRING = BenchLoad("springs", stiffness=146.39)


def packed(machine, rate_hz=500.0):
    return pack_qdd(QddSettings("own", machine=machine), SPRING, sample_rate_hz=rate_hz)


def test_mounting_draws_gain_and_phase_and_leaves_the_rest():
    hard = qdd_preset("hard")
    drawn = [draw_mounting(hard, np.random.default_rng(seed)) for seed in range(400)]
    gains = np.array([settings.sensor_gain for settings in drawn])
    phases = np.array([settings.ripple_phase_rad for settings in drawn])
    assert gains.mean() == pytest.approx(1.0, abs=4.0 * 0.01 / 20.0)
    assert gains.std() == pytest.approx(0.01, rel=0.15)
    assert phases.min() >= 0.0
    assert phases.max() <= 2.0 * np.pi
    assert phases.mean() == pytest.approx(np.pi, abs=4.0 * 2.0 * np.pi / np.sqrt(12.0 * 400.0))
    assert replace(drawn[0], sensor_gain=1.0, ripple_phase_rad=0.0) == hard


def test_the_torque_constant_in_error_is_the_motors_and_not_the_drives():
    settings = qdd_preset("clean")
    weak = replace(settings, errors=replace(settings.errors, torque_constant_error=-0.05))
    p = pack_qdd(weak, SPRING, sample_rate_hz=500.0)
    assert p[QddParam.AMPERE_PER_TORQUE] == pytest.approx(1.0 / 0.99)
    assert p[QddParam.TORQUE_PER_AMPERE] == pytest.approx(0.95 * 0.99)


@pytest.mark.parametrize("rate_hz", [100.0, 900.0, 20_000.0])
def test_physics_is_fast_enough_for_friction_about_standstill(rate_hz):
    for machine in (
        QddMachine(),
        QddMachine(sign_velocity_rad_s=0.005),
        QddMachine(sign_velocity_rad_s=0.5),
    ):
        p = packed(replace(machine, delay_s=0.0005), rate_hz)
        physics_hz = rate_hz * p[QddParam.SUBSTEPS]
        most = machine.coulomb_friction + machine.gear_friction * machine.current_max_a
        assert physics_hz >= 5000.0
        assert most / machine.sign_velocity_rad_s / machine.rotor_inertia < 2.785 * physics_hz


@pytest.mark.parametrize("rate_hz", [100.0, 20_000.0])
def test_the_drives_delay_is_that_of_the_settings(rate_hz):
    p = packed(QddMachine(), rate_hz)
    delay_s = p[QddParam.COMMAND_DELAY] * p[QddParam.PERIOD_S] / p[QddParam.SUBSTEPS]
    assert delay_s == pytest.approx(0.002, abs=0.5 / 5000.0)


def test_a_delay_too_long_to_be_kept_is_refused():
    with pytest.raises(DataError, match="delay_s"):
        packed(QddMachine(delay_s=0.05))
    with pytest.raises(DataError, match="delay_s"):
        packed(QddMachine(delay_s=-0.001))
    assert packed(QddMachine(delay_s=0.021))[QddParam.COMMAND_DELAY] < COMMANDS
