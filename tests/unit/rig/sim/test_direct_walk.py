"""A walk without runtime against the devices that an experiment is handed."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from jointz.core.channels import MOTION_SENSORS
from jointz.core.clock import VirtualClock
from jointz.core.errors import DataError
from jointz.core.gait_phases import TIMING_POINTS
from jointz.core.protocols.pulse_models import PulseSpec
from jointz.rig.devices.interface import Stretch
from jointz.rig.sim.direct_walk import QUICK_GRID, WalkPlan, walk_directly
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import (
    PRESETS,
    GoniometerSettings,
    JointSettings,
    ReflexSettings,
    preset,
)
from jointz.rig.sim.rig import SimulatedRig, simulated_rig
from jointz.rig.sim.walking.layout import Gait
from jointz.rig.sim.walking.plant_build import Grid

PERIOD_S = 0.002
EXACT = {"joint_moment": 1e-9} | dict.fromkeys(  # N*m; rad, rad/s, A
    ("angle", "motor_angle", "motor_velocity", "current", "contact", *MOTION_SENSORS), 1e-12
)
FEW = WalkPlan(per_point=1, gap_strides=(1, 2), warm_up_strides=2, tail_strides=2)
RAMPED = PulseSpec(
    amplitude_nm=7.0,
    duration_s=0.25,
    ramp_up_s=0.075,
    hold_s=0.1,
    ramp_down_s=0.075,
    direction="both",
)
SETTINGS = {
    **PRESETS,
    "bad footswitch": replace(
        preset("hard"), footswitch=replace(preset("hard").footswitch, missed=0.2, false=0.2)
    ),
    "tissue and reflex": replace(
        preset("nominal"),
        joint=JointSettings(reflex=ReflexSettings(), softening_rad=0.3, voluntary_sd_nm=1.0),
        goniometer=GoniometerSettings(tissue_range_hz=(20.0, 40.0), drift_sd_rad=0.02),
    ),
}


def phase_of_stride(rig, number, time_s):
    """Return the phase in cycles by the stride's polynomial, and how fast it goes."""
    motion = rig.motion("perturbed", 0)
    for _ in range(number):
        motion.next()
    row = motion.next().row
    rising = Polynomial([0, row[Gait.LINEAR], 0, *row[Gait.CUBIC : Gait.QUINTIC + 1]])
    u = (time_s - row[Gait.START_S]) * row[Gait.RATE_HZ]
    return rising(u), rising.deriv()(u) * row[Gait.RATE_HZ]


def stride_of(rig, time_s):
    motion = rig.motion("perturbed", 0)
    number = 0
    while motion.next().end_s <= time_s:
        number += 1
    return number


def through_devices(rig, walk, *, worn=True, condition="perturbed"):
    """Drive the rig's devices with the command of a walk, sample by sample."""
    clock = VirtualClock()
    devices = rig.open(condition, worn=worn, segment=0, clock=clock)
    for device in devices.all():
        device.configure()
        device.activate()
    found = []
    for k in range(walk.time_s.size):
        clock.wait_until_ns(k * 2_000_000)
        row = {"angle": devices.angle.read()[0].value, "contact": devices.contact.read()[0].value}
        row["joint_moment"] = devices.torque.read()[0].value
        if devices.actuator is not None:
            motor = devices.actuator.read()[0]
            row |= {
                "motor_angle": motor.angle,
                "motor_velocity": motor.velocity,
                "current": motor.current,
            }
            row |= {
                name: device.read()[0].value
                for name, device in devices.named().items()
                if name in MOTION_SENSORS
            }
            devices.actuator.command_torque(walk.channels["command"][k])
        found.append(row)
    return {name: np.array([row[name] for row in found]) for name in found[0]}


class TestAgainstTheDevices:
    @pytest.mark.parametrize("name", SETTINGS)
    def test_signals_are_those_of_the_devices_for_the_same_command(self, name):
        rig = SimulatedRig(draw_person(3, seed=11), SETTINGS[name])
        walk = walk_directly(rig, "perturbed", plan=replace(FEW, pulse=RAMPED))
        expected = through_devices(rig, walk)
        assert set(walk.channels) == {*expected, "command"}
        for channel, values in expected.items():
            np.testing.assert_allclose(walk.channels[channel], values, rtol=0, atol=EXACT[channel])

    def test_a_walk_without_the_exoskeleton_is_that_of_the_sensors(self):
        rig = simulated_rig(3, seed=11)
        plan = WalkPlan(per_point=0, warm_up_strides=10)
        walk = walk_directly(rig, "NWC", worn=False, plan=plan)
        assert set(walk.channels) == {"angle", "joint_moment", "contact"}
        assert walk.pulses.empty
        expected = through_devices(rig, walk, worn=False, condition="NWC")
        for channel, values in expected.items():
            np.testing.assert_allclose(walk.channels[channel], values, rtol=0, atol=EXACT[channel])

    def test_half_the_steps_of_the_physics_move_no_angle_by_1e_5_rad(self):
        for name in PRESETS:
            fine, quick = (
                walk_directly(
                    SimulatedRig(draw_person(2, seed=1), preset(name), grid=grid),
                    "perturbed",
                    plan=FEW,
                )
                for grid in (Grid(500.0, substeps=40), QUICK_GRID)
            )
            # A reflex is late by whole steps, and people of personal presets by any time.
            atol = 1e-5 if preset(name).personal is None else 1e-3
            np.testing.assert_allclose(
                quick.channels["angle"], fine.channels["angle"], rtol=0, atol=atol
            )


class TestPulses:
    def test_they_fire_at_the_first_sample_at_or_after_their_timing_point(self):
        rig = simulated_rig(4, preset="hard")
        walk = walk_directly(rig, "perturbed", plan=replace(FEW, per_point=2))
        for pulse in walk.pulses.to_dict("records"):
            number = stride_of(rig, pulse["onset_s"])
            phase, per_s = phase_of_stride(rig, number, pulse["onset_s"])
            late_s = (phase - TIMING_POINTS[pulse["timing_point"]] / 100.0) / per_s
            assert -1e-9 <= late_s < PERIOD_S * (1 + 1e-3)
            samples = pulse["onset_s"] / PERIOD_S
            assert samples == pytest.approx(round(samples), abs=1e-6)

    def test_every_timing_point_has_its_count_in_rounds_that_hold_each_once(self):
        walk = walk_directly(simulated_rig(4), "perturbed", plan=replace(FEW, per_point=3))
        points = walk.pulses["timing_point"].tolist()
        assert [sorted(points[i : i + 6]) for i in (0, 6, 12)] == 3 * [sorted(TIMING_POINTS)]
        assert walk.pulses["pulse"].tolist() == list(range(1, 19))
        assert walk.pulses["completed"].all()

    def test_counts_may_be_unequal_and_timing_points_anywhere_in_the_cycle(self):
        plan = replace(
            FEW,
            per_point={"ICO": 3, "TSW": 1},
            timing_points={"ICO": 1.0, "TSW": 93.5, "MST": 21.5},
            gap_strides=(2, 3),
        )
        rig = simulated_rig(4)
        walk = walk_directly(rig, "perturbed", plan=plan)
        assert walk.pulses["timing_point"].value_counts().to_dict() == {"ICO": 3, "TSW": 1}
        truth = rig.truth(
            "perturbed", worn=True, stretches=(Stretch(0, 0.0, walk.end_s),), pulses=walk.pulses
        )
        for row in truth["pulses"]:
            planned = plan.timing_points[row["timing_point"]]
            assert 0.0 <= row["onset_gait_pct"] - planned < 100.0 * PERIOD_S / 0.9

    def test_directions_and_sizes_take_turns_at_every_timing_point(self):
        both = RAMPED.model_copy(update={"direction": "both"})
        plan = replace(FEW, per_point=4, pulse=both, amplitudes_nm=(8.0, 17.0))
        walk = walk_directly(simulated_rig(4), "perturbed", plan=plan)
        for _, rows in walk.pulses.groupby("timing_point"):
            assert rows["amplitude_nm"].tolist() == [8.0, -8.0, 17.0, -17.0]
        down = plan.pulse.model_copy(update={"direction": "negative"})
        single = replace(plan, pulse=down, amplitudes_nm=())
        assert [single.torque_nm(count) for count in range(2)] == [-7.0, -7.0]

    def test_gaps_lie_in_their_range_and_strides_lead_in_and_out(self):
        plan = replace(FEW, per_point=4, gap_strides=(2, 4), warm_up_strides=5, tail_strides=3)
        rig = simulated_rig(4)
        walk = walk_directly(rig, "perturbed", plan=plan)
        numbers = [stride_of(rig, onset) for onset in walk.pulses["onset_s"]]
        assert numbers[0] == 5
        assert set(np.diff(numbers).tolist()) == {2, 3, 4}
        motion = rig.motion("perturbed", 0)
        starts = [motion.next().start_s for _ in range(numbers[-1] + 4)]
        assert starts[-1] - 2 * PERIOD_S < walk.end_s < starts[-1]

    def test_the_command_is_the_trapezoid_and_nothing_between_pulses(self):
        plan = replace(FEW, per_point=2, pulse=RAMPED)
        walk = walk_directly(simulated_rig(4), "perturbed", plan=plan)
        expected = np.zeros_like(walk.time_s)
        for pulse in walk.pulses.to_dict("records"):
            corners = pulse["onset_s"] + np.array([0.0, 0.075, 0.175, 0.25])
            shape = np.interp(walk.time_s, corners, [0.0, 1.0, 1.0, 0.0])
            expected += pulse["amplitude_nm"] * shape
        np.testing.assert_allclose(walk.channels["command"], expected, rtol=0, atol=1e-9)
        held = walk_directly(simulated_rig(4), "perturbed", plan=FEW).channels["command"]
        assert set(held.tolist()) == {0.0, 17.0}
        assert np.count_nonzero(held) == 6 * 125


class TestWhatCannotBe:
    @pytest.mark.parametrize(
        ("change", "message"),
        [
            ({"per_point": {"XYZ": 3}}, "expected per_point for LRE, .*, got XYZ"),
            ({"per_point": -1}, "expected per_point >= 0, got -1"),
            ({"timing_points": {"LRE": 100.0}}, r"timing_points in 0\.\.100 %"),
            ({"amplitudes_nm": (17.0, -17.0)}, "amplitudes_nm > 0"),
            ({"gap_strides": (4, 3)}, r"gap_strides from low to high, 1 or more, got \(4, 3\)"),
            ({"warm_up_strides": 0}, "warm_up_strides and tail_strides, got 0 and 2"),
            ({"per_point": -1, "gap_strides": (0, 0)}, "per_point >= 0.*gap_strides"),
        ],
    )
    def test_a_plan_that_cannot_be_walked_is_refused(self, change, message):
        with pytest.raises(DataError, match=message):
            replace(FEW, **change)

    def test_pulses_without_an_exoskeleton_are_refused(self):
        with pytest.raises(DataError, match="no pulse without an exoskeleton"):
            walk_directly(simulated_rig(0), "NWC", worn=False, plan=FEW)

    def test_pulses_that_overlap_or_outlast_the_walk_are_refused(self):
        long = PulseSpec(amplitude_nm=5.0, duration_s=3.0, hold_s=3.0)
        with pytest.raises(DataError, match=r"pulse 1.*gap_strides"):
            walk_directly(simulated_rig(0), "perturbed", plan=replace(FEW, pulse=long))
        last = replace(FEW, timing_points={"TSW": 93.5}, tail_strides=1)
        with pytest.raises(DataError, match="pulse 1"):
            walk_directly(simulated_rig(0), "perturbed", plan=last)

    def test_misbehaviour_of_devices_that_are_not_there_is_refused(self):
        rig = simulated_rig(0)
        rig.inject.order("angle", "freeze", from_s=1.0)
        with pytest.raises(DataError, match=r"no orders in rig\.inject"):
            walk_directly(rig, "perturbed", plan=FEW)
