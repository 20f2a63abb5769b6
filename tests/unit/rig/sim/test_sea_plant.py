"""The compiled bench against its equations, written a second time and solved by scipy."""

from dataclasses import replace
from math import copysign, cos, exp, isnan, nan, pi, sin, sqrt

import numpy as np
import pytest
from scipy import signal
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from jointz.rig.sim.benches.bench_load import BenchLoad
from jointz.rig.sim.benches.sea import SeaControl, SeaErrors, sea_preset
from jointz.rig.sim.benches.sea_plant import SeaPlant

RATE_HZ = 900.0
EXACT = 1e-6  # rad
CASE_1 = BenchLoad("1", stiffness=168.0, inertia=0.0364)
CASE_4 = BenchLoad("4", stiffness=273.0, inertia=0.07)
DAMPED = BenchLoad("damper", stiffness=168.0, inertia=0.0364, damping=0.5)
LOCKED = BenchLoad("locked", locked=True)
FREE = BenchLoad("free")
TIME, STAMP, MOTOR, MOTOR_RATE, CURRENT, SUPPLY, WARM, FAULTS, ANGLE, TORQUE = range(10)


def erring(name="clean", **errors):
    """Return a preset with some error mechanisms set."""
    settings = sea_preset(name)
    return replace(settings, errors=replace(settings.errors, **errors))


def pulsed(time_s):
    """Return the reference A with one pulse, N*m."""
    pulse = np.interp(time_s, (0.3, 0.375, 0.475, 0.55), (0.0, 7.0, 7.0, 0.0))
    return 5.0 * np.sin(2.0 * pi * 1.4 * time_s) + 32.0 + pulse


def plant_of(settings, load):
    return SeaPlant(settings, load, sample_rate_hz=RATE_HZ, noise=np.random.default_rng(0))


def run(settings, load, torque, *, angle=None, rate_hz=RATE_HZ, seed=0):
    """Return the record, (sample, column)."""
    plant = SeaPlant(settings, load, sample_rate_hz=rate_hz, noise=np.random.default_rng(seed))
    if angle is None:
        rows = [plant.advance(wanted, nan) for wanted in torque]
    else:
        rows = [plant.advance(nan, wanted) for wanted in angle]
    return np.array(rows)


def run_case_1(settings, samples=900, seed=0):
    return run(settings, CASE_1, pulsed(np.arange(samples) / RATE_HZ), seed=seed)


class Mechanics:
    """The same machine by balance of forces, with its loop, one sample period after the other."""

    def __init__(self, settings, load, rate_hz):
        self.s, self.load, self.rate_hz = settings, load, rate_hz
        m = settings.machine
        self.c = m.screw_lead_m / (2.0 * pi) / m.belt_ratio
        self.y = np.zeros(4)  # rotor and output: angle, velocity
        self.measured = self.before = self.torque()
        self.motor = self.motor_before = 0.0

    def member(self, rotor, theta):
        """Return the beam's deflection, and the member's force on nut and torque on the output."""
        m, e = self.s.machine, self.s.errors
        nut = np.array([m.lever_m, m.bracket_m + m.member_m + self.c * rotor])
        along, across = np.array([cos(theta), sin(theta)]), np.array([-sin(theta), cos(theta)])
        root = m.lever_m * along + m.bracket_m * across
        # |root + bent * across - nut| = member: a quadratic
        off = root - nut
        b, c = off @ across, off @ off - m.member_m**2
        bent = -b - sqrt(b * b - c)
        tip = root + bent * across
        pull = (nut - tip) / m.member_m
        force = (m.beam_stiffness * bent) * (1.0 + e.beam_cubic_per_m2 * bent**2)
        force /= pull @ across
        return bent, -force * pull[1], force * (tip[0] * pull[1] - tip[1] * pull[0])

    def torque(self):
        return self.member(self.y[0], self.y[2])[2]

    def straight(self, rotor):
        """Return the angle at which the beam is straight, and its change with the rotor."""

        def angle(m):
            near = m * self.c / self.s.machine.lever_m
            return brentq(
                lambda q: self.member(m, q)[0], near - 0.1, near + 0.1, xtol=1e-15, rtol=1e-14
            )

        return angle(rotor), (angle(rotor + 1.0) - angle(rotor - 1.0)) / 2.0

    def current(self, wanted, speed):
        m = self.s.machine
        i = np.clip(wanted, -m.current_max_a, m.current_max_a)
        emf = m.torque_constant * speed
        return np.clip(
            i, (-m.supply_v - emf) / m.resistance_ohm, (m.supply_v - emf) / m.resistance_ohm
        )

    def slopes(self, _, y, wanted):
        m, load, e = self.s.machine, self.load, self.s.errors
        rotor, speed, theta, rate = y
        _, on_nut, on_output = self.member(rotor, theta)
        drag = m.drive_friction_nm * speed / sqrt(speed**2 + m.drive_velocity_rad_s**2)
        on_rotor = m.torque_constant * self.current(wanted, speed) - drag
        on_rotor += self.c * on_nut - m.drive_damping * speed
        if load.locked:
            return speed, on_rotor / m.rotor_inertia, 0.0, 0.0
        rest = (
            on_output - (m.stiffness + load.stiffness) * theta - (m.damping + load.damping) * rate
        )
        if load.stiffness or load.inertia:
            bend = sqrt(rate**2 + e.friction_velocity_rad_s**2)
            rest -= e.coulomb_friction_nm * rate / bend
        if abs(theta) > m.stop_rad:
            rest -= m.stop_stiffness * (theta - copysign(m.stop_rad, theta)) + m.stop_damping * rate
        return speed, on_rotor / m.rotor_inertia, rate, rest / (m.inertia + load.inertia)

    def advance(self, torque, angle):
        loop, T = self.s.control, 1.0 / self.rate_hz
        if isnan(torque):
            u = loop.position_gain * (angle - self.motor)
            u -= loop.position_rate_gain * (self.motor - self.motor_before) / T
        else:
            u = torque + loop.torque_gain * (torque - self.measured)
            u -= loop.torque_rate_gain_s * (self.measured - self.before) / T
        wanted = u * self.straight(self.y[0])[1] / self.s.machine.torque_constant
        end = solve_ivp(
            self.slopes, (0.0, T), self.y, method="DOP853", args=(wanted,), rtol=1e-11, atol=1e-12
        )
        self.y = end.y[:, -1]
        self.before, self.measured = self.measured, self.torque()
        self.motor_before, self.motor = self.motor, self.straight(self.y[0])[0]
        return self.y[2], self.motor, self.torque()


@pytest.mark.parametrize(
    ("load", "errors", "position"),
    [
        (LOCKED, {}, False),
        (CASE_1, {"coulomb_friction_nm": 0.1}, False),
        (DAMPED, {}, False),
        (FREE, {}, True),
    ],
    ids=["locked", "loaded with friction", "damped", "free in position control"],
)
def test_plant_solves_the_equations_of_motion(load, errors, position):
    settings = erring(**errors)
    slow = Mechanics(settings, load, RATE_HZ)
    plant = plant_of(settings, load)
    plant.advance(0.0, nan)
    rng = np.random.default_rng(3)
    wanted = signal.lfilter(*signal.butter(3, 20.0, fs=RATE_HZ), rng.standard_normal(120))
    wanted = 0.05 * wanted / wanted.std() if position else 20.0 + 12.0 * wanted / wanted.std()
    for command in wanted:
        commands = (nan, command) if position else (command, nan)
        row, (angle, motor, torque) = plant.advance(*commands), slow.advance(*commands)
        assert abs(row[ANGLE] - angle) < EXACT
        assert abs(row[MOTOR] - motor) < EXACT
        assert abs(row[TORQUE] - torque) < 1e-3  # N*m: 1e-6 rad times 700 N*m/rad


def bandwidth(settings, sd_nm, seed):
    """Return where the torque's response to the command is 3 dB below its low-frequency gain."""
    rng = np.random.default_rng(seed)
    wanted = signal.lfilter(*signal.butter(3, 40.0, fs=1000.0), rng.standard_normal(32_000))[2000:]
    wanted *= sd_nm / wanted.std()
    torque = run(settings, LOCKED, wanted, rate_hz=1000.0)[:, TORQUE]
    hz, cross = signal.csd(wanted, torque, fs=1000.0, nperseg=1000)
    gain = np.abs(cross / signal.welch(wanted, fs=1000.0, nperseg=1000)[1])
    down = gain[1:4].mean() * 10.0 ** (-3.0 / 20.0)
    i = np.flatnonzero((gain < down) & (hz > 3.0))[0]
    return float(np.interp(down, [gain[i], gain[i - 1]], [hz[i], hz[i - 1]]))


@pytest.mark.parametrize(("sd_nm", "printed_hz"), [(10.0, 26.8), (20.0, 17.2)])
def test_bandwidth_is_the_printed_one_at_both_amplitudes(sd_nm, printed_hz):
    found = [bandwidth(sea_preset("nominal"), sd_nm, seed) for seed in range(2)]
    assert found == pytest.approx([printed_hz] * 2, rel=0.1)


@pytest.mark.parametrize("load", [CASE_1, CASE_4, DAMPED], ids=lambda load: load.name)
@pytest.mark.parametrize("name", ["clean", "nominal", "hard"])
def test_torque_follows_the_mass_spring_references(name, load):
    wanted = pulsed(np.arange(3600) / RATE_HZ)
    record = run(sea_preset(name), load, wanted)
    error = record[900:, TORQUE] - wanted[900:]
    assert np.sqrt(np.mean(error**2)) < 1.0  # of 37 N*m
    assert not record[:, FAULTS].any()


def test_free_output_is_stopped_and_stays_finite():
    record = run(sea_preset("nominal"), FREE, np.full(1800, 20.0))
    assert 0.6 < record[-1, ANGLE] < 0.62
    assert np.isfinite(record).all()


def test_spring_moves_the_load_and_the_output_itself():
    settings = erring(coulomb_friction_nm=0.1)
    plant = SeaPlant(settings, DAMPED, sample_rate_hz=9000.0, noise=np.random.default_rng(0))
    times = np.arange(9000) / 9000.0
    found = []
    for wanted in pulsed(times):
        row = plant.advance(wanted, nan)
        assert row[TORQUE] == pytest.approx(plant.spring_torque, abs=1e-12)
        found.append((plant.spring_torque, plant.angle, plant.velocity))
    spring, angle, velocity = np.array(found)[100:].T
    acceleration = np.gradient(velocity, 1.0 / 9000.0)
    friction = 0.1 * velocity / np.sqrt(velocity**2 + 0.02**2)
    load = 168.0 * angle + 0.5 * velocity + 0.0364 * acceleration + friction
    own = settings.machine
    moved = own.stiffness * angle + own.damping * velocity + own.inertia * acceleration
    assert (spring - moved)[1:-1] == pytest.approx(load[1:-1], abs=0.01)


def open_loop(**errors):
    """Return error-free samples at 9 kHz and erring ones at 900 Hz of a constant current."""
    settings = replace(erring(**errors), control=SeaControl(0.0, 0.0))
    exact = run(
        replace(settings, errors=SeaErrors()), LOCKED, np.full(500, 20.0), rate_hz=10.0 * RATE_HZ
    )
    return exact, run(settings, LOCKED, np.full(40, 20.0))


def test_torque_lag_between_samples_is_that_of_the_physics():
    fine, _ = open_loop()
    _, late = open_loop(torque_lag_s=0.4 / RATE_HZ)
    assert late[1:, TORQUE] == pytest.approx(fine[6::10, TORQUE][: len(late) - 1], abs=0.01)


def test_torque_filter_is_a_first_order_low_pass_of_the_recorded_torque():
    clean, slow = (run_case_1(s) for s in (erring(), erring(torque_filter_hz=45.0)))
    keep = exp(-2.0 * pi * 45.0 / RATE_HZ)
    ratio = (1.0 - keep) / (2.0 * pi * 45.0 / RATE_HZ)
    wanted = signal.lfilter([1.0 - ratio, ratio - keep], [1.0, -keep], clean[:, TORQUE])
    # Straight between samples here, between substeps there: (T^2 / 12) of the second derivative.
    assert slow[50:, TORQUE] == pytest.approx(wanted[50:], abs=0.02)
    assert np.array_equal(slow[:, ANGLE], clean[:, ANGLE])


def test_stretched_clock_takes_longer_than_its_stamps_say():
    record = run_case_1(erring(clock_stretch=1.08, true_stamps=False))
    assert record[:, STAMP] == pytest.approx(np.arange(900) / 900.0)
    assert record[:, TIME] == pytest.approx(1.08 * np.arange(900) / 900.0)
    told = run_case_1(erring(clock_stretch=1.08))
    assert np.array_equal(told[:, STAMP], record[:, TIME])
    assert np.array_equal(told[:, ANGLE], record[:, ANGLE])


def test_true_stamps_tell_when_the_jittered_samples_were():
    exact, record = open_loop(clock_jitter_s=1e-4)
    at = np.interp(record[:, STAMP], exact[:, STAMP], exact[:, TORQUE])
    assert record[:, TORQUE] == pytest.approx(at, abs=0.01)


def test_beam_error_and_gain_scale_the_recorded_torque():
    settings = replace(erring(beam_error=-0.02), torque_gain=1.01)
    plant = plant_of(settings, CASE_1)
    for wanted in pulsed(np.arange(300) / RATE_HZ):
        row = plant.advance(wanted, nan)
        assert row[TORQUE] == pytest.approx(0.98 * 1.01 * plant.spring_torque, abs=1e-12)
    assert settings.total_torque_gain == pytest.approx(0.98 * 1.01)


def test_stiffening_beam_gives_more_torque_than_the_lab_thinks():
    plant = plant_of(erring(beam_cubic_per_m2=2400.0), LOCKED)
    rows = [plant.advance(40.0, nan) for _ in range(900)]
    deflection = rows[-1][TORQUE] / 0.05 / 274e3
    expected = 1.0 + 2400.0 * deflection**2
    assert plant.spring_torque / rows[-1][TORQUE] == pytest.approx(expected, rel=1e-3)


def test_encoders_round_to_their_resolution():
    steps = {"linear_step_m": 1e-6, "rotary_step_rad": 1e-4}
    plant = plant_of(erring(**steps), CASE_1)
    worst = 0.0
    for wanted in pulsed(np.arange(900) / RATE_HZ):
        row = plant.advance(wanted, nan)
        assert row[ANGLE] == pytest.approx(round(row[ANGLE] / 1e-4) * 1e-4, abs=1e-12)
        assert abs(row[ANGLE] - plant.angle) <= 0.5e-4 + 1e-12
        worst = max(worst, abs(row[TORQUE] - plant.spring_torque))
    most = 685.0 * (0.5e-4 + 0.5e-6 / 0.05)  # N*m, of both roundings together
    assert 0.8 * most < worst < most


@pytest.mark.parametrize(
    ("mechanism", "column", "sd"),
    [("torque_noise_nm", TORQUE, 0.02), ("angle_noise_rad", ANGLE, 1e-5)],
)
def test_noise_is_white_and_in_its_own_record_only(mechanism, column, sd):
    clean, noisy = (run_case_1(s, 4000) for s in (erring(), erring(**{mechanism: sd})))
    noise = noisy[:, column] - clean[:, column]
    assert noise.std() == pytest.approx(sd, rel=0.04)
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.05
    assert np.array_equal(np.delete(noisy, column, 1), np.delete(clean, column, 1))


def test_bearing_friction_belongs_to_the_load():
    errors = erring(coulomb_friction_nm=0.3)
    wanted = 0.05 * np.sin(2.0 * pi * np.arange(300) / RATE_HZ)
    assert np.array_equal(
        run(errors, FREE, None, angle=wanted), run(erring(), FREE, None, angle=wanted)
    )
    assert not np.array_equal(run_case_1(errors), run_case_1(erring()))


def test_hot_winding_is_a_fault_that_takes_the_current_away():
    settings = sea_preset("clean")
    hot = replace(settings, machine=replace(settings.machine, temperature_max_c=25.2))
    record = run(hot, LOCKED, np.full(9000, 15.0))
    tripped = np.flatnonzero(record[:, FAULTS])[0]
    assert record[tripped, WARM] > 25.2 >= record[tripped - 1, WARM]
    assert not record[tripped + 1 :, CURRENT].any()
