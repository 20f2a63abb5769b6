"""Encoder and gyroscopes against the motion that a walk had, and against theory written here."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import lsim

from jointz.core.clock import VirtualClock
from jointz.core.errors import DataError
from jointz.rig.sim.direct_walk import WalkPlan, walk_directly
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import preset
from jointz.rig.sim.rig import SimulatedRig, simulated_rig
from jointz.rig.sim.sensors.sensor_settings import EncoderSettings, GyroscopeSettings
from jointz.rig.sim.walking.impedance_curves import thigh_share

PLAN = WalkPlan(per_point=1, gap_strides=(1, 2), warm_up_strides=2, tail_strides=2)
ENCODER = EncoderSettings(step_rad=0.0, lag_range_s=(0.0, 0.0), gain_error_sd=0.0, white_sd_rad=0.0)
GYROSCOPES = GyroscopeSettings(
    lag_range_s=(0.0, 0.0),
    gain_error_sd=0.0,
    white_sd_rad_s=0.0,
    bias_sd_rad_s=0.0,
    mount_range_hz=None,
)


def walk_of(*, encoder=ENCODER, gyroscopes=GYROSCOPES, body=True, **more):
    clean = preset("clean")
    settings = replace(
        clean,
        body=preset("realistic").body if body else None,
        encoder=encoder,
        gyroscopes=gyroscopes,
    )
    rig = SimulatedRig(draw_person(2, seed=1), settings)
    walk = walk_directly(rig, "perturbed", **{"plan": PLAN, **more})
    return walk.time_s, walk.channels


class TestTrueMotion:
    def test_joint_velocity_is_shank_less_thigh(self):
        _, channels = walk_of(body=False)
        difference = channels["shank_velocity"] - channels["thigh_velocity"]
        np.testing.assert_allclose(difference, channels["motor_velocity"], rtol=0, atol=1e-9)
        np.testing.assert_allclose(channels["joint_encoder"], channels["angle"], rtol=0, atol=1e-9)

    def test_the_encoder_is_on_the_device_side_of_the_strap(self):
        _, channels = walk_of()
        device, joint = channels["joint_encoder"], channels["angle"]
        np.testing.assert_allclose(device, channels["motor_angle"], rtol=0, atol=1e-9)
        assert np.abs(device - joint).max() > 0.01

    def test_a_pulse_turns_the_thigh_back_by_its_share_of_the_knees_deviation(self):
        time, pulsed = walk_of()
        _, level = walk_of(plan=WalkPlan(per_point=0, warm_up_strides=60))
        n = time.size
        change = {name: pulsed[name] - level[name][:n] for name in pulsed if name != "contact"}
        rate = CubicSpline(time, change["thigh_velocity"])
        turned = np.array([rate.integrate(0.0, t) for t in time[::50]])
        x = change["angle"][::50]
        rig = SimulatedRig(
            draw_person(2, seed=1), replace(preset("clean"), body=preset("realistic").body)
        )
        motion = rig.motion("perturbed", 0)
        strides = [motion.next() for _ in range(60)]
        starts = np.array([s.start_s for s in strides])
        which = np.searchsorted(starts, time[::50], side="right") - 1
        phase = np.array(
            [
                float(strides[k].cycles(np.array([at_s]))[0])
                for k, at_s in zip(which, time[::50], strict=True)
            ]
        )
        share = thigh_share(rig.person, rig.preset, phase % 1.0)
        assert np.abs(x).max() > 0.05
        np.testing.assert_allclose(turned, -share * x, rtol=0, atol=2e-4)


class TestErrors:
    def test_a_lag_is_a_pure_delay(self):
        for name in ("joint_encoder", "shank_velocity", "thigh_velocity"):
            lag_s = 0.0033
            time, true = walk_of()
            _, late = walk_of(
                encoder=replace(ENCODER, lag_range_s=(lag_s, lag_s)),
                gyroscopes=replace(GYROSCOPES, lag_range_s=(lag_s, lag_s)),
            )
            expected = CubicSpline(time, true[name])(time - lag_s)
            scale = np.ptp(true[name])
            np.testing.assert_allclose(late[name][5:], expected[5:], rtol=0, atol=2e-4 * scale)

    def test_a_mount_is_a_spring_and_damper_between_bone_and_sensor(self):
        time, true = walk_of()
        mounted = replace(GYROSCOPES, mount_range_hz=(30.0, 30.0), mount_damping_range=(0.4, 0.4))
        _, shown = walk_of(gyroscopes=mounted)
        omega = 2.0 * pi * 30.0
        fine = np.arange(0.0, time[-1], 1e-4)
        bone = CubicSpline(time, true["shank_velocity"])(fine)
        system = ([0.8 * omega, omega**2], [1.0, 0.8 * omega, omega**2])
        sensor = lsim(system, bone, fine)[1]
        # The filter begins at zero; by half a second it has forgotten that.
        expected = CubicSpline(fine, sensor)(time[250:-1])
        np.testing.assert_allclose(shown["shank_velocity"][250:-1], expected, rtol=0, atol=0.01)
        assert np.abs(shown["shank_velocity"] - true["shank_velocity"]).max() > 0.1

    def test_gain_resolution_noise_and_bias(self):
        _, true = walk_of()
        _, coarse = walk_of(encoder=replace(ENCODER, step_rad=0.01))
        steps = coarse["joint_encoder"] / 0.01
        np.testing.assert_allclose(steps, np.round(steps), rtol=0, atol=1e-9)
        assert np.abs(coarse["joint_encoder"] - true["joint_encoder"]).max() <= 0.005 + 1e-12
        noisy = replace(GYROSCOPES, white_sd_rad_s=0.01)
        error = walk_of(gyroscopes=noisy)[1]["thigh_velocity"] - true["thigh_velocity"]
        assert error.std() == pytest.approx(0.01, rel=0.1)
        drifting = replace(GYROSCOPES, bias_sd_rad_s=0.01)
        error = walk_of(gyroscopes=drifting)[1]["thigh_velocity"] - true["thigh_velocity"]
        assert 0.0 < np.abs(np.diff(error)).max() < 1e-3

    def test_ground_truth_has_gain_lag_and_mount(self):
        rig = simulated_rig(4, preset="realistic")
        walk = walk_directly(rig, "perturbed", plan=replace(PLAN, per_point=0))
        truth = rig.truth("perturbed", worn=True, stretches=[], pulses=walk.pulses)
        shank = truth["instruments"]["shank_velocity"]
        assert 20.0 <= shank["mount_hz"] <= 60.0
        assert 0.2 <= shank["mount_damping"] <= 0.6
        assert 0.0 <= shank["lag_s"] <= 0.005
        assert shank["lag_s"] == truth["instruments"]["thigh_velocity"]["lag_s"]
        assert truth["instruments"]["joint_encoder"]["gain"] != 1.0


class TestChoice:
    @pytest.mark.parametrize("name", ["nominal", "realistic"])
    def test_sensors_change_no_other_signal(self, name):
        alone, all_ = (
            walk_directly(simulated_rig(1, preset=name, sensors=sensors), "perturbed", plan=PLAN)
            for sensors in (["goniometer"], ["goniometer", "encoder", "gyroscopes"])
        )
        assert set(all_.channels) - set(alone.channels) == {
            "joint_encoder",
            "shank_velocity",
            "thigh_velocity",
        }
        for channel, values in alone.channels.items():
            np.testing.assert_array_equal(all_.channels[channel], values)

    def test_default_is_what_the_preset_has(self):
        def added(name):
            walk = walk_directly(simulated_rig(1, preset=name), "perturbed", plan=PLAN)
            return "joint_encoder" in walk.channels, "shank_velocity" in walk.channels

        assert added("realistic") == (True, True)
        assert added("anthropometric") == (False, False)

    @pytest.mark.parametrize("sensors", [[], ["encoder"], ["goniometer", "camera"]])
    def test_the_goniometer_is_never_left_out_and_names_are_known(self, sensors):
        with pytest.raises(DataError, match="sensors: expected goniometer"):
            simulated_rig(0, sensors=sensors)


class TestKnowledge:
    def test_lags_are_known_to_half_a_millisecond_where_synchronised(self):
        errors, plan = [], WalkPlan(per_point=0, warm_up_strides=1)
        pulses = walk_directly(simulated_rig(0, preset="realistic"), "perturbed", plan=plan).pulses
        for number in range(40):
            rig = simulated_rig(number, preset="realistic")
            known = rig.calibration
            truth = rig.truth("perturbed", worn=True, stretches=[], pulses=pulses)
            for name in ("joint_encoder", "shank_velocity", "thigh_velocity"):
                lag, gain = getattr(known, f"{name}_lag_s"), getattr(known, f"{name}_gain")
                true = truth["instruments"][name]
                assert (lag.sd, gain.sd) == (0.0005, 0.01)
                errors.append(
                    [(lag.value - true["lag_s"]) / lag.sd, (gain.value - true["gain"]) / gain.sd]
                )
            assert known.angle_lag_s is None
        np.testing.assert_allclose(np.std(errors, axis=0), 1.0, rtol=0.25)

    def test_unsynchronised_lags_are_unknown(self):
        settings = replace(
            preset("nominal"), gyroscopes=replace(GYROSCOPES, synchronised_sd_s=None)
        )
        known = SimulatedRig(draw_person(0, seed=1), settings).calibration
        assert known.shank_velocity_lag_s is None


class TestDevices:
    def test_gyroscopes_tell_times_of_their_own_clock(self):
        rig = simulated_rig(1, preset="realistic")
        clock = VirtualClock()
        devices = rig.open("perturbed", worn=True, segment=0, clock=clock)
        for device in devices.all():
            device.configure()
            device.activate()
        devices.angle.read()  # the first look begins the walk
        clock.wait_until_ns(10_000_000_000)
        shank = [sample.device_time_ns for sample in devices.shank_velocity.read()]
        angle = [sample.device_time_ns for sample in devices.angle.read()]
        encoder = [sample.device_time_ns for sample in devices.joint_encoder.read()]
        assert encoder[1:] == angle
        assert shank[0] > angle[0]
        assert 0 < abs((shank[-1] - shank[1]) - (angle[-1] - angle[0])) < 10e9 * 60e-6

    def test_without_the_exoskeleton_there_is_no_encoder(self):
        rig = simulated_rig(1, preset="realistic")
        devices = rig.open("no_device", worn=False, segment=0, clock=VirtualClock())
        assert devices.joint_encoder is None
        assert devices.thigh_velocity is not None
