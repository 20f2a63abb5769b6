"""The quasi-direct-drive bench obeys its equations, and every error does what it says."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal
from scipy.integrate import solve_ivp

from jointz.core.errors import DataError
from jointz.rig.sim.benches.bench_load import BenchLoad
from jointz.rig.sim.benches.qdd_bench import QddMachine, qdd_preset
from jointz.rig.sim.benches.qdd_bench_plant import QddBenchPlant

SPRING = BenchLoad("springs", stiffness=146.39)
RATE = 500.0
EXACT = 1e-6
ANGLE, VELOCITY, CURRENT, SUPPLY, SENSOR, FAR = range(6)


def bench(load=SPRING, *, rate_hz=RATE, seed=1, machine=None, preset="clean", **errors):
    settings = qdd_preset(preset)
    settings = replace(
        settings, machine=machine or settings.machine, errors=replace(settings.errors, **errors)
    )
    noise = np.random.default_rng(seed)
    return QddBenchPlant(settings, load, sample_rate_hz=rate_hz, noise=noise)


def run(plant, torque, position):
    return np.array([plant.advance(t, p) for t, p in zip(torque, position, strict=True)])


def solved(load, torque, position, *, machine, cogging=0.0):
    """Solve the bench's equations again, written from scratch, sample by sample."""
    m, dt = machine, 1.0 / RATE
    servo = 2 * np.pi * m.far_hz
    stated = m.gear_ratio * m.torque_constant
    wanted = np.clip(np.asarray(torque) / stated, -m.current_max_a, m.current_max_a)

    def slopes(time, y):
        theta, omega, far, far_rate, current = y
        k = min(int(np.floor(time / dt + 1e-9)), len(position) - 2)
        late = int(np.floor((time - m.delay_s) / dt + 1e-9))
        command = wanted[late + 1] if late >= 0 else 0.0
        rate = (position[k + 1] - position[k]) / dt
        goal = position[k] + rate * (time - k * dt)
        tau = load.stiffness * (theta - far) + m.spring_damping * (omega - far_rate)
        friction = (m.coulomb_friction + m.gear_friction * abs(current)) * np.tanh(
            omega / m.sign_velocity_rad_s
        )
        motor = stated * current - friction + cogging * np.sin(378.0 * theta)
        acceleration = (motor - tau) / m.rotor_inertia
        push = m.far_inertia * servo**2 * (goal - far)
        push += 2 * m.far_damping * m.far_inertia * servo * (rate - far_rate)
        far_acceleration = (push + tau) / m.far_inertia
        if load.locked:
            far_rate, far_acceleration = 0.0, 0.0
        return [
            omega,
            acceleration,
            far_rate,
            far_acceleration,
            (command - current) / m.time_constant_s,
        ]

    y, states = np.zeros(5), [np.zeros(5)]
    for k in range(len(torque) - 1):
        # A little less than a sample: nothing is asked for beyond its end.
        end = (k + 1) * dt - 1e-12
        part = solve_ivp(slopes, (k * dt, end), y, method="DOP853", rtol=1e-11, atol=1e-12)
        y = part.y[:, -1]
        states.append(y)
    return np.array(states)


@pytest.mark.parametrize(("locked", "cogging"), [(False, 0.05), (True, 0.0)])
def test_the_compiled_bench_solves_the_equations_of_motion(locked, cogging):
    machine = QddMachine(sign_velocity_rad_s=0.3)
    load = replace(SPRING, locked=locked)
    time = np.arange(150) / RATE
    torque = 6.0 * np.sin(2 * np.pi * 3.0 * time)
    position = 0.05 * np.sin(2 * np.pi * 5.0 * time)
    rows = run(bench(load, machine=machine, cogging_nm=cogging), torque, position)
    states = solved(load, torque, position, machine=machine, cogging=cogging)

    assert np.ptp(states[:, 0]) > 0.05  # it moved
    np.testing.assert_allclose(rows[:, ANGLE], states[:, 0], rtol=0, atol=EXACT)
    np.testing.assert_allclose(rows[:, FAR], states[:, 2], rtol=0, atol=EXACT)
    np.testing.assert_allclose(rows[:, CURRENT], states[:, 4], rtol=0, atol=1e-4)


@pytest.mark.parametrize(
    ("error", "column", "size"),
    [
        ({"sensor_bias_nm": -0.58}, SENSOR, -0.58),
        ({"sensor_noise_nm": 0.3}, SENSOR, 0.3),
        ({"velocity_noise_rad_s": 0.05}, VELOCITY, 0.05),
        ({"current_noise_a": 0.2}, CURRENT, 0.2),
    ],
)
def test_an_error_of_a_measurement_is_in_that_measurement_alone(error, column, size):
    time = np.arange(4000) / RATE
    torque = 5.0 * np.sin(2 * np.pi * time)
    clean, wrong = (run(bench(**e), torque, np.zeros(4000)) for e in ({}, error))
    others = [c for c in range(6) if c != column]
    assert (clean[:, others] == wrong[:, others]).all()
    difference = (wrong - clean)[:, column]
    found = difference.mean() if size < 0 else difference.std()
    assert found == pytest.approx(size, rel=0.05)


def test_friction_that_is_not_the_same_both_ways_moves_the_centre():
    turning = 2.0 * np.arange(3000) / RATE
    forth = run(bench(friction_asymmetry=0.3), np.zeros(3000), turning)[-500:, SENSOR].mean()
    back = run(bench(friction_asymmetry=0.3), np.zeros(3000), -turning)[-500:, SENSOR].mean()
    assert forth == pytest.approx(-0.38 * 1.3, rel=0.02)
    assert back == pytest.approx(0.38 * 0.7, rel=0.02)


def test_model_3_3_leaves_what_table_3_1_prints():
    """Least squares written here, on the torques and speeds of 3.2.1."""
    levels = np.repeat([-10.0, -6.667, -3.333, 0.0, 3.333, 6.667, 10.0], 6 * 1000)
    speeds = np.tile(np.repeat([-5.0, -3.0, -1.0, 1.0, 3.0, 5.0], 1000), 7)
    rows = run(bench(preset="nominal"), levels, np.cumsum(speeds) / RATE)
    current, sign = rows[:, CURRENT], np.sign(rows[:, VELOCITY])
    steady = (np.arange(levels.size) % 1000) > 200
    columns = np.stack([np.ones_like(current), 9 * current, -sign, -np.abs(current) * sign], axis=1)
    sensed = rows[:, SENSOR] + 92e-4 * np.gradient(rows[:, VELOCITY], 1 / RATE)
    values, *_ = np.linalg.lstsq(columns[steady], sensed[steady], rcond=None)
    assert values == pytest.approx([-0.58, 0.11, 0.38, 0.09], rel=0.05)
    rms = np.sqrt(np.mean((sensed[steady] - columns[steady] @ values) ** 2))
    assert 0.33 < rms < 0.38


def test_a_load_without_a_spring_is_refused():
    with pytest.raises(DataError, match="has no stiffness; a spring couples"):
        bench(BenchLoad("free"))


def waving(samples, rate_hz=RATE):
    """Return torques that never rest, N*m."""
    time = np.arange(samples) / rate_hz
    return 6.0 * np.sin(2 * np.pi * 1.3 * time) + 3.0 * np.sin(2 * np.pi * 4.1 * time)


def test_a_sharper_friction_is_stepped_finer_and_does_not_dither():
    machine = QddMachine(sign_velocity_rad_s=0.002)
    rows = run(bench(replace(SPRING, locked=True), machine=machine), [24.0] * 1000, [0.0] * 1000)
    assert np.abs(np.diff(rows[500:, VELOCITY])).max() < 1e-4


def test_current_is_limited_and_waits_for_its_delay():
    rows = run(bench(replace(SPRING, locked=True), rate_hz=1000.0), [100.0] * 300, [0.0] * 300)
    assert (rows[:3, CURRENT] == 0.0).all()  # 2 ms
    time = np.arange(3, 300) * 1e-3 - 0.002
    expected = 25.0 * (1.0 - np.exp(-time / 0.002))
    assert rows[3:, CURRENT] == pytest.approx(expected, abs=1e-3)


def test_sensor_reads_the_springs_torque_by_its_gain():
    settings = replace(qdd_preset("clean"), sensor_gain=1.02)
    noise = np.random.default_rng(0)
    plant = QddBenchPlant(settings, SPRING, sample_rate_hz=RATE, noise=noise)
    for torque in waving(300):
        assert plant.advance(torque, 0.0)[SENSOR] == pytest.approx(1.02 * plant.spring_torque)


def test_sensor_lag_is_a_first_order_low_pass_of_the_reading_alone():
    rate_hz, lag_s = 5000.0, 0.003
    torque, still = waving(4000, rate_hz), np.zeros(4000)
    clean, late = (
        run(bench(rate_hz=rate_hz, sensor_lag_s=lag), torque, still) for lag in (0.0, lag_s)
    )
    assert (np.delete(clean, SENSOR, 1) == np.delete(late, SENSOR, 1)).all()
    b, a = signal.bilinear([1.0], [lag_s, 1.0], rate_hz)
    expected = signal.lfilter(b, a, clean[:, SENSOR])
    assert late[:, SENSOR] == pytest.approx(expected, abs=5e-3)
    assert np.abs(late - clean)[:, SENSOR].max() > 0.2


def loop(peak_rad, period_s, half_width=0.2):
    """Return deflection and hysteresis torque over the last of three slow swings of torque."""
    samples = round(period_s * RATE)
    machine = QddMachine(spring_damping=0.0, coulomb_friction=0.0, gear_friction=0.0)
    plant = bench(machine=machine, spring_hysteresis_nm=half_width)
    wanted = 146.39 * peak_rad * np.sin(2 * np.pi * np.arange(3 * samples) / samples)
    rows = run(plant, wanted, np.zeros(3 * samples))[-samples:]
    bent = rows[:, ANGLE] - rows[:, FAR]
    return bent, rows[:, SENSOR] - 146.39 * bent


def test_spring_hysteresis_has_its_width_whatever_the_speed():
    for period_s in (4.0, 8.0):
        bent, extra = loop(0.06, period_s)
        middle = np.abs(bent) < 0.003
        assert np.abs(extra[middle]) == pytest.approx(np.full(middle.sum(), 0.2), abs=0.004)
        rising = np.gradient(bent) > 0.0
        assert (extra[middle & rising] > 0.0).all()
        assert (extra[middle & ~rising] < 0.0).all()


def test_jitter_moves_the_sample_times_and_keeps_their_rate_and_order():
    plant = bench(clock_jitter_s=2e-4)
    times = []
    for torque in waving(4000):
        plant.advance(torque, 0.0)
        times.append(plant.time_s)
    off = np.array(times) - np.arange(4000) / RATE
    assert off[0] == 0.0
    assert off.std() == pytest.approx(2e-4, rel=0.05)
    assert abs(off.mean()) < 4.0 * 2e-4 / np.sqrt(4000.0)
    assert np.diff(times).min() > 0.0
