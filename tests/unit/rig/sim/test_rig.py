"""The simulated devices: their lifecycle, their time, what goes wrong on order."""

from dataclasses import replace

import numpy as np
import pytest

from jointz.core.clock import VirtualClock
from jointz.core.errors import DataError, DeviceError
from jointz.rig.devices.interface import Lifecycle
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import preset
from jointz.rig.sim.rig import SimulatedRig, simulated_rig
from jointz.rig.sim.walking.injection import Injection
from jointz.rig.sim.walking.plant_build import Grid, build_plant

PERIOD_NS = 2_000_000


def opened(rig=None, *, condition="perturbed", segment=0, start_ns=0):
    rig = rig or simulated_rig(0)
    clock = VirtualClock(start_ns)
    devices = rig.open(condition, worn=condition != "NWC", segment=segment, clock=clock)
    for device in devices.all():
        device.configure()
    for device in devices.all():
        device.activate()
    return rig, clock, devices


def pulse(k):
    return 17.0 if 200 <= k % 700 < 325 else 0.0


def run(rig=None, *, n=1500, every=1, command=pulse, start_ns=0, **kwargs):
    """Return the samples of actuator, goniometer and footswitch, read every so many periods."""
    rig, clock, devices = opened(rig, start_ns=start_ns, **kwargs)
    taken = [], [], []
    first = start_ns // PERIOD_NS
    for k in range(0, n, every):
        clock.wait_until_ns((first + k) * PERIOD_NS)
        if devices.actuator:
            taken[0].extend(devices.actuator.read())
        taken[1].extend(devices.angle.read())
        taken[2].extend(devices.contact.read())
        if devices.actuator:
            devices.actuator.command_torque(command(k))
    return taken


def without_host(samples):
    return [(s[0], *s[2:]) for s in samples]


class TestTime:
    def test_late_reads_give_the_same_samples(self):
        # Commands every fifth period only: whoever reads less often must not command more often.
        def seldom(k):
            return pulse(k - k % 5)

        often = run(command=seldom)
        late = run(every=5, command=seldom)
        for one, two in zip(often, late, strict=True):
            n = len(two)
            assert n == 1496
            assert without_host(one)[:n] == without_host(two)

    def test_samples_do_not_depend_on_what_the_clock_shows(self):
        start_ns = 987_654_321 * PERIOD_NS + 1_234
        for one, two in zip(run(), run(start_ns=start_ns), strict=True):
            assert without_host(one) == without_host(two)

    def test_a_command_acts_from_the_sample_before_it(self):
        def responses(commanded_at_ns):
            _, clock, devices = opened(simulated_rig(0, preset="clean"))
            devices.actuator.read()
            clock.wait_until_ns(commanded_at_ns)
            devices.actuator.read()
            devices.actuator.command_torque(10.0)
            clock.wait_until_ns(10 * PERIOD_NS)
            return [s.current for s in devices.actuator.read()]

        at_sample, between = responses(2 * PERIOD_NS), responses(2 * PERIOD_NS + 999_999)
        assert at_sample == between
        # 6 ms of delay after sample 2, then a first order of 12 ms.
        assert at_sample[:3] == [0.0] * 3
        assert at_sample[3] == pytest.approx(10.0 / 0.99 * -np.expm1(-2.0 / 12.0))


class TestDeterminism:
    def test_people_seeds_conditions_and_stretches_differ(self):
        angles = [
            run(rig, n=40, condition=condition, segment=segment)[1][-1].value
            for rig, condition, segment in (
                (simulated_rig(0), "perturbed", 0),
                (simulated_rig(1), "perturbed", 0),
                (simulated_rig(0, seed=2), "perturbed", 0),
                (simulated_rig(0), "unperturbed", 0),
                (simulated_rig(0), "perturbed", 1),
            )
        ]
        assert len(set(angles)) == 5


class TestSafetyOfTheDevice:
    def test_a_hang_ends_in_zero_current_by_the_command_timeout(self):
        _, clock, devices = opened(simulated_rig(0, preset="clean"))
        devices.actuator.read()
        devices.actuator.command_torque(17.0)
        timeout_s = devices.actuator.describe().command_timeout_s
        clock.wait_until_ns(1_000_000_000)
        current = np.array([s.current for s in devices.actuator.read()])
        time = np.arange(1, current.size + 1) / 500.0
        on = time <= timeout_s + 0.006
        assert current.size == 500
        assert current[on].max() == pytest.approx(17.0 / 0.99, rel=0.05)
        assert (np.diff(current[~on]) < 0).all()
        assert current[time > timeout_s + 0.006 + 0.15].max() < 1e-4

    def test_current_saturates(self):
        _, clock, devices = opened(simulated_rig(0, preset="clean"))
        for k in range(100):
            clock.wait_until_ns(k * PERIOD_NS)
            samples = devices.actuator.read()
            devices.actuator.command_torque(-500.0)
        assert samples[-1].current == pytest.approx(-30.0, rel=1e-3)

    def test_a_hot_winding_sends_the_actuator_into_fault_with_zero_current(self):
        one = preset("clean")
        hot = replace(one, actuator=replace(one.actuator, thermal_s=0.1, heating_c_a2=1.0))
        _, clock, devices = opened(SimulatedRig(draw_person(0, seed=1), hot))
        for k in range(200):
            clock.wait_until_ns(k * PERIOD_NS)
            samples = devices.actuator.read()
            if samples[-1].faults:
                break
            devices.actuator.command_torque(17.0)
        assert samples[-1].temperature_c > 110.0
        names = devices.actuator.describe().fault_names
        assert names[samples[-1].faults] == "over_temperature"
        assert devices.actuator.state is Lifecycle.FAULT
        with pytest.raises(DeviceError, match=r"cannot be commanded: it is fault"):
            devices.actuator.command_torque(1.0)
        clock.wait_until_ns(400 * PERIOD_NS)
        assert abs(devices.actuator.read()[-1].current) < 1e-3
        devices.actuator.stop()
        assert devices.actuator.state is Lifecycle.FAULT


class TestLifecycle:
    @pytest.mark.parametrize("torque", [float("nan"), float("inf")])
    def test_a_torque_that_is_not_finite_is_refused(self, torque):
        _, _, devices = opened()
        with pytest.raises(DeviceError, match="expected a finite torque"):
            devices.actuator.command_torque(torque)

    def test_at_another_speed_the_same_person_walks_in_other_strides(self):
        usual, slow = simulated_rig(0), simulated_rig(0, speed_m_s=0.6)
        one, other = (
            [motion.next().duration_s for _ in range(20)]
            for motion in (rig.motion("EWP", 0) for rig in (usual, slow))
        )
        np.testing.assert_allclose(other, np.sqrt(2.0) * np.array(one), rtol=1e-12)
        assert run(simulated_rig(0, speed_m_s=1.2), n=50) == run(simulated_rig(0), n=50)

    def test_without_the_exoskeleton_there_is_no_actuator_and_the_knee_is_on_its_path(self):
        rig = simulated_rig(0, preset="clean")
        _, angle, _ = run(rig, n=600, condition="NWC")
        motion = rig.motion("NWC", 0)
        stride = [motion.next() for _ in range(2)][1]
        peak = max(s.value for s in angle)
        assert rig.open("NWC", worn=False, segment=0, clock=VirtualClock()).actuator is None
        assert np.degrees(peak) == pytest.approx(62.0, abs=0.5)
        assert stride.duration_s == pytest.approx(rig.person.stride_time_s)


class TestMeasurement:
    def test_goniometer_noise_is_as_large_as_the_preset_says(self):
        one = preset("nominal")
        quiet = replace(
            one, goniometer=replace(one.goniometer, white_sd_rad=0.0, coloured_sd_rad=0.0)
        )
        person = draw_person(0, seed=1)
        noisy, clean = (
            np.array([s.value for s in run(SimulatedRig(person, p), n=20000)[1]])
            for p in (one, quiet)
        )
        noise = np.degrees(noisy - clean)
        # 40 s hold 20000 white samples and about 200 independent coloured ones.
        assert np.diff(noise).std() == pytest.approx(0.3 * np.sqrt(2), rel=0.02)
        assert noise.std() == pytest.approx(np.hypot(0.3, 0.15), rel=0.05)

    def test_contact_follows_heel_strikes(self):
        rig = simulated_rig(0, preset="clean")
        contact = np.array([s.value for s in run(rig, n=5000)[2]])
        motion = rig.motion("perturbed", 0)
        starts = np.array([motion.next().start_s for _ in range(10)][1:])
        rises = (np.flatnonzero(np.diff(contact) > 0) + 1) / 500.0
        assert rises.size == 9
        assert ((rises - starts >= 0) & (rises - starts < 0.002)).all()

    def test_a_lab_knows_gains_with_their_sd_and_no_lag(self):
        known = simulated_rig(0, preset="hard").calibration
        assert (known.torque_gain.value, known.torque_gain.sd) == (1.0, 0.02)
        assert (known.angle_gain.value, known.angle_gain.sd) == (1.0, 0.03)
        assert known.angle_lag_s is None
        assert simulated_rig(0, preset="clean").calibration.model_fields_set == set()
        assert simulated_rig(3).notes()["preset"] == "nominal"


class TestInternalMoment:
    @pytest.mark.parametrize("worn", [True, False])
    def test_inverse_dynamics_is_a_sensor_of_the_joint_moment_also_without_exoskeleton(self, worn):
        rig = simulated_rig(0)
        sensor = rig.open("EWP", worn=worn, segment=0, clock=VirtualClock()).torque
        description = sensor.describe()
        assert (description.channel, description.unit) == ("joint_moment", "N*m")
        assert description.sample_rate_hz == 500.0

    def test_its_samples_are_those_of_the_other_sensors_in_time_and_can_go_missing(self):
        rig = simulated_rig(0)
        rig.inject.order("torque", "silence", from_s=0.1, until_s=0.2)
        _, clock, devices = opened(rig)
        devices.torque.read()  # the first look starts the time of all
        clock.wait_until_ns(199 * PERIOD_NS)
        moment, angle = devices.torque.read(), devices.angle.read()
        times = [sample.device_time_ns for sample in angle[1:]]
        assert [s.device_time_ns for s in moment] == [t for t in times if not 1e8 <= t < 2e8]
        assert 1.0 < np.abs([s.value for s in moment]).max() < 100.0


class TestMisbehaviour:
    @pytest.mark.parametrize(("device", "place"), [("actuator", 0), ("angle", 1), ("contact", 2)])
    def test_silence_is_no_samples_for_its_time(self, device, place):
        rig = simulated_rig(0)
        rig.inject.order(device, "silence", from_s=0.1, until_s=0.2)
        samples = run(rig, n=200)
        assert [len(s) for s in samples] == [150 if i == place else 200 for i in range(3)]
        assert without_host(samples[place]) == [
            s for s in without_host(run(n=200)[place]) if not 1e8 <= s[0] < 2e8
        ]

    def test_nan_heat_and_double_contacts_are_shown(self):
        rig = simulated_rig(0, preset="clean")
        rig.inject.order("angle", "nan", from_s=0.1)
        rig.inject.order("actuator", "nan", from_s=0.2)
        rig.inject.order("actuator", "heat", from_s=0.1, value=50.0)
        rig.inject.order("contact", "double")
        actuator, angle, contact = run(rig, n=5000)
        assert np.isnan(angle[50].value)
        assert not np.isnan(angle[49].value)
        assert np.isnan(actuator[100].angle)
        assert actuator[50].temperature_c - actuator[49].temperature_c == pytest.approx(50.0, abs=1)
        rises = np.sum(np.diff([s.value for s in contact]) > 0)
        assert rises == 2 * 9

    def test_a_fault_ends_the_current_and_the_active_life(self):
        rig = simulated_rig(0)
        _, clock, devices = opened(rig)
        devices.actuator.read()
        devices.actuator.command_torque(17.0)
        rig.inject.order("actuator", "fault", from_s=0.02, value=2)
        clock.wait_until_ns(20 * PERIOD_NS)
        assert [s.faults for s in devices.actuator.read()] == [0] * 9 + [2] * 11
        assert devices.actuator.state is Lifecycle.FAULT
        clock.wait_until_ns(150 * PERIOD_NS)
        assert abs(devices.actuator.read()[-1].current) < 0.02

    def test_unknown_orders_are_refused(self):
        with pytest.raises(ValueError, match="got 'angle', 'melt'"):
            Injection().order("angle", "melt")


class TestGrid:
    def test_grids_and_delays_that_cannot_be_are_refused(self):
        with pytest.raises(DataError, match="expected sample_rate_hz > 0"):
            Grid(0.0)
        slow = replace(
            preset("clean"),
            goniometer=replace(preset("clean").goniometer, delay_s=1.0, lag_range_s=(1.0, 1.0)),
        )
        with pytest.raises(DataError, match="a delay is too long"):
            build_plant(draw_person(0, seed=1), slow, grid=Grid(), worn=True)
