"""The rigs of a calibration against equations written again here, and against walking."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jointz.core.clock import VirtualClock
from jointz.core.errors import DataError
from jointz.core.protocols.protocol_models import LoadSpec
from jointz.core.study import Calibrated
from jointz.io.protocols import load_protocol
from jointz.rig.sim.calibration_benches.calibration_rig import (
    CalibrationRig,
    HandSwing,
    calibration_rig,
)
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import PRESETS, preset
from jointz.rig.sim.rig import SimulatedRig, simulated_rig
from jointz.rig.sim.walking.layout import Gait, Param
from jointz.rig.sim.walking.path import path
from jointz.rig.sim.walking.plant_build import Grid

RATE_HZ = 500.0
PERIOD_NS = 2_000_000
WEIGHT = load_protocol("calibration-leg").loads
SPRING = load_protocol("calibration-spring").loads
CONDITIONS = {
    "zero": ("straight",),
    "footswitch": ("walking",),
    "hinge": ("swing",),
    "frame": ("pulses",),
    "leg": ("bare", "weighted"),
    "torsion": ("locked",),
    "spring": ("spring",),
}
LOADS = {"leg": WEIGHT, "spring": SPRING}


def record(rig, condition, seconds, command=lambda _: 0.0):
    """Return time, encoder, current and goniometer, and the footswitch where there is one."""
    clock = VirtualClock(0)
    devices = rig.open(condition, worn=True, segment=0, clock=clock)
    for device in devices.all():
        device.configure()
    for device in devices.all():
        device.activate()
    motor, angle, contact = [], [], []
    for k in range(round(seconds * RATE_HZ)):
        clock.wait_until_ns(k * PERIOD_NS)
        motor += devices.actuator.read()
        angle += devices.angle.read()
        if devices.contact is not None:
            contact += devices.contact.read()
        devices.actuator.command_torque(command(k / RATE_HZ))
    time = np.array([one.device_time_ns for one in motor]) * 1e-9
    return (
        time,
        np.array([one.angle for one in motor]),
        np.array([one.current for one in motor]),
        np.array([one.value for one in angle]),
        np.array([one.value for one in contact]),
    )


def quiet(name="clean", *, friction=True, goniometer_of=None):
    """Return a preset without noise; with the goniometer of another if wanted."""
    made = preset(name)
    actuator = replace(made.actuator, torque_error_sd_nm=0.0, angle_step_rad=0.0)
    if not friction:
        actuator = replace(actuator, coulomb_friction=0.0, gear_friction=0.0)
    shown = replace(
        preset(goniometer_of or name).goniometer,
        white_sd_rad=0.0,
        coloured_sd_rad=0.0,
        tissue_range_hz=None,
    )
    return replace(made, actuator=actuator, goniometer=shown)


def rig_of(step, *, number=0, seed=3, using=None, loads=None):
    walking = SimulatedRig(draw_person(number, seed=seed), using or quiet(), grid=Grid(RATE_HZ))
    return CalibrationRig(walking, step, LOADS.get(step, ()) if loads is None else loads)


def push(amplitude_nm, seconds, *, at=0.1):
    return lambda t: amplitude_nm if at <= t < at + seconds else 0.0


class TestHangingLeg:
    @pytest.mark.parametrize(("number", "condition"), [(0, "bare"), (1, "weighted")])
    def test_it_swings_freely_with_the_period_and_decay_of_its_impedance(self, number, condition):
        rig = rig_of("leg", number=number, using=quiet(friction=False))
        truth = rig.bench_truth()
        added = truth["loads"]["weighted"] if condition == "weighted" else None
        inertia = truth["device"]["limb_and_device_inertia"] + (added["inertia"] if added else 0.0)
        stiffness = truth["limb"]["stiffness"] + truth["limb"]["gravity_stiffness"]
        stiffness += added["stiffness"] if added else 0.0
        sigma = truth["limb"]["damping"] / (2.0 * inertia)
        period = 2.0 * np.pi / np.sqrt(stiffness / inertia - sigma**2)

        time, angle, *_ = record(rig, condition, 5.0, push(0.2, 0.06))
        moved = angle - angle[0]
        free = np.flatnonzero(time > 0.5)
        up = free[(moved[free - 1] < 0.0) & (moved[free] >= 0.0)]
        crossings = time[up] - moved[up] / (moved[up] - moved[up - 1]) / RATE_HZ
        peaks = [moved[a:b].max() for a, b in pairwise(up)]

        assert np.abs(moved).max() < 0.05  # small: gravity is linear to 4e-4
        assert np.diff(crossings).mean() == pytest.approx(period, rel=5e-4)
        decay = np.log(peaks[0] / peaks[-1]) / (len(peaks) - 1)
        assert decay == pytest.approx(sigma * period, rel=2e-3)

    def test_a_pulse_moves_it_as_the_equation_with_friction_and_gravity_says(self):
        rig = rig_of("leg", using=quiet("hard"))
        truth, settings = rig.bench_truth(), rig.walking.preset.actuator
        limb, device = truth["limb"], truth["device"]
        command = push(5.0, 0.06)

        def slopes(t, y):
            x, v, current = y
            asked = command(t - settings.delay_s - 1e-9) / (9.0 * 0.11)
            friction = device["coulomb_friction"] + device["gear_friction"] * abs(current)
            motor = device["torque_per_ampere"] * current
            motor -= friction * np.tanh(v / settings.sign_velocity_rad_s)
            own = limb["damping"] * v + limb["stiffness"] * x
            own += limb["gravity_stiffness"] * np.sin(x)
            return v, (motor - own) / device["limb_and_device_inertia"], (asked - current) / 0.012

        time, angle, _, _, _ = record(rig, "bare", 1.5, command)
        there = solve_ivp(
            slopes, (0.0, time[-1]), (0.0, 0.0, 0.0), t_eval=time, max_step=2e-4, rtol=1e-8
        )
        assert np.ptp(angle) > 0.2
        # A command acts from the sample at which it is given: as late as in the physics.
        assert np.abs(angle - angle[0] - there.y[0]).max() < 2e-3

    def test_its_mass_is_that_of_walking(self):
        nominal, anthropometric = (
            calibration_rig(1, "leg", loads=WEIGHT, preset=name, seed=3)
            for name in ("nominal", "anthropometric")
        )
        person = simulated_rig(1, seed=3).person
        assert nominal.bench_truth()["limb"]["inertia"] == person.inertia
        # Winter's table for the mass and height of the person, mass * (gyration * length)^2.
        expected = 0.061 * person.mass_kg * (0.735 * 0.246 * person.height_m) ** 2
        truth = anthropometric.bench_truth()
        assert truth["limb"]["inertia"] == pytest.approx(expected, rel=1e-12)
        assert truth["device"]["inertia"] == pytest.approx(92e-4 + 1.0 * 0.18**2, rel=1e-12)


class TestSpring:
    def test_what_is_hooked_in_differs_from_what_is_stated_by_its_sd(self):
        drawn = np.array(
            [
                calibration_rig(n, "spring", loads=SPRING, seed=s).loads["spring"].stiffness
                for n in range(10)
                for s in range(20)
            ]
        )
        stated = SPRING[0].stiffness
        z = (drawn - stated.value) / stated.sd
        assert abs(z.mean()) < 4.0 / np.sqrt(z.size)
        assert z.std() == pytest.approx(1.0, abs=0.2)

    def test_without_a_spring_there_is_no_rig(self):
        weight = LoadSpec(name="weighted", inertia=Calibrated(value=0.1, sd=0.0))
        with pytest.raises(DataError, match="expected the load 'spring'"):
            calibration_rig(0, "spring", loads=(weight,))


class TestHinge:
    @pytest.mark.parametrize(("name", "number"), [("nominal", 0), ("hard", 2)])
    def test_the_goniometer_is_late_and_long_by_what_is_planted(self, name, number):
        rig = rig_of("hinge", number=number, using=quiet(goniometer_of=name))
        entries = rig.bench_truth()["entries"]
        time, encoder, _, angle, _ = record(rig, "swing", 24.0)
        # At slow speed only: there delay and first order are one lag, to (2 pi f lag)^2 / 3.
        slow = slice(round(0.5 * RATE_HZ), round(4.0 * RATE_HZ))
        lags = np.arange(0.0, 0.04, 2e-4)
        left = []
        for lag in lags:
            moved = np.interp(time[slow] - lag, time, encoder)
            design = np.column_stack([moved, np.ones_like(moved)])
            left.append(np.linalg.lstsq(design, angle[slow], rcond=None))
        best = int(np.argmin([one[1][0] for one in left]))
        assert lags[best] == pytest.approx(entries["angle_lag_s"], abs=3e-4)
        assert left[best][0][0] == pytest.approx(entries["angle_gain"], rel=2e-3)

    def test_a_hand_swings_smoothly_between_half_and_three_hertz(self):
        swing = HandSwing(0.9, np.random.default_rng(1))
        strides = [swing.next() for _ in range(200)]
        ends = [(path(a.row, b.start_s), path(b.row, b.start_s)) for a, b in pairwise(strides)]
        for before, after in ends:
            assert before == pytest.approx(after, abs=1e-9)
        rates = np.array([1.0 / one.duration_s for one in strides])
        assert rates.min() > 0.4
        assert rates.max() < 3.6
        assert rates.max() / rates.min() > 4.0
        sizes = np.array([np.ptp([path(s.row, t)[0] for t in times(s)]) for s in strides])
        assert np.degrees(sizes).mean() == pytest.approx(40.0, abs=3.0)
        for stride in strides:  # forward in time, whatever the neighbours are
            u = np.linspace(0.0, 1.0, 50)
            phase = stride.cycles(stride.start_s + u * stride.duration_s)
            assert (np.diff(phase) > 0.0).all()
            assert stride.row[Gait.RATE_HZ] == 1.0 / stride.duration_s

    def test_strap_tissue_and_torsion_stay_on_the_leg(self):
        hard = preset("hard").goniometer
        using = replace(
            preset("anthropometric"), goniometer=replace(hard, tissue_range_hz=(20, 40))
        )
        places = [Param.STRAP_STIFFNESS, Param.TISSUE_RATE, Param.TORSION, Param.EXO_GRAVITY]
        walking = rig_of("hinge", using=using).walking.build(worn=True).params
        assert (walking[places] > 0.0).all()
        assert (rig_of("hinge", using=using).build("swing").params[places] == 0.0).all()
        leg = rig_of("leg", using=using).build("bare").params
        assert (leg[places] == walking[places]).all()


def times(stride):
    return np.linspace(stride.start_s, stride.end_s, 100)


class TestZero:
    def test_walking_is_zeroed_unless_a_calibration_knows_the_zero(self):
        zeroed, own = simulated_rig(0, seed=3), simulated_rig(0, seed=3, not_zeroed=("S01",))
        other = simulated_rig(0, seed=3, not_zeroed=("S02",))
        shown = [record(rig, "unperturbed", 1.0)[3] for rig in (zeroed, own, other)]
        planted = calibration_rig(0, "zero", seed=3).bench_truth()["entries"]["angle_zero_rad"]
        assert shown[1] - shown[0] == pytest.approx(planted, abs=1e-12)
        assert (shown[2] == shown[0]).all()


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("step", CONDITIONS)
def test_instruments_are_those_of_walking(step, name):
    rig = calibration_rig(2, step, loads=LOADS.get(step, ()), preset=name, seed=7)
    walking = simulated_rig(2, preset=name, seed=7).build(worn=True)
    for condition in CONDITIONS[step]:
        assert rig.build(condition).instruments == walking.instruments
    entries = rig.bench_truth()["entries"]
    for key in ("angle_lag_s", "angle_gain", "torque_gain", "friction_gain", "tissue_hz"):
        assert entries[key] == getattr(walking.instruments, key)
