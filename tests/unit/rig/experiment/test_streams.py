"""What the devices measured: all samples of a tick, and how old the stalest device is."""

from math import inf

import pytest

from jointz.rig.devices.interface import ActuatorSample, Devices, SensorSample
from jointz.rig.experiment.streams import NO_ACTUATOR_SAMPLE, Streams

PERIOD = 2_000_000


class Fake:
    """A device whose queue a test fills; only its read matters here."""

    def __init__(self):
        self.queue = []

    def read(self):
        taken, self.queue = self.queue, []
        return taken


class Bench:
    def __init__(self, *, worn=True):
        self.actuator, self.angle, self.contact = Fake(), Fake(), Fake()
        self.streams = Streams(
            Devices(
                angle=self.angle, contact=self.contact, actuator=self.actuator if worn else None
            )
        )
        self.tick = -1

    def read(self, *names, samples=1):
        """Read a tick in which the named devices have samples; return the age."""
        self.tick += 1
        slot_ns = self.tick * PERIOD
        for name in names:
            for part in range(samples):
                at = slot_ns + part
                sample = (
                    ActuatorSample(at, at, 0.1 * self.tick, 0.0, 0.0, 48.0, 30.0, 0)
                    if name == "actuator"
                    else SensorSample(at, at, 0.1 * self.tick + part)
                )
                getattr(self, name).queue.append(sample)
        return self.streams.read(slot_ns)


ALL = ("actuator", "angle", "contact")


def test_all_samples_of_the_tick_are_there_oldest_first():
    bench = Bench()
    assert bench.read(*ALL, samples=3) == 0.0
    for name in ALL:
        times = [sample.device_time_ns for sample in getattr(bench.streams, name)]
        assert times == [0, 1, 2]
    assert bench.streams.newest_actuator.device_time_ns == 2
    assert bench.streams.newest_angle.value == 2.0


@pytest.mark.parametrize("missing", ALL)
def test_age_is_infinite_until_every_device_gave_a_sample(missing):
    bench = Bench()
    others = [name for name in ALL if name != missing]
    assert bench.read(*others) == inf
    assert bench.read(*others) == inf
    assert bench.read(*ALL) == 0.0
    assert bench.streams.actuator[-1].device_time_ns == 2 * PERIOD


def test_age_is_that_of_the_stalest_of_several():
    bench = Bench()
    bench.read(*ALL)
    bench.read("actuator", "angle")
    bench.read("actuator")
    assert bench.read("actuator") == pytest.approx(0.006)
    assert bench.read("actuator", "contact") == pytest.approx(0.006)  # of the goniometer


def test_the_age_of_a_device_that_nobody_acts_on_does_not_count():
    bench, moment = Bench(), Fake()
    devices = Devices(
        angle=bench.angle, contact=bench.contact, actuator=bench.actuator, torque=moment
    )
    bench.streams = Streams(devices, dispensable=("torque",))
    assert bench.read(*ALL) == 0.0
    assert bench.streams.torque == []
    moment.queue.append(SensorSample(3, 3, -40.0))
    assert bench.read(*ALL) == 0.0
    assert bench.streams.torque == [(3, 3, -40.0)]
    assert bench.read("actuator", "angle") == pytest.approx(0.002)
    assert bench.streams.newest_contact.value == pytest.approx(0.1)


def test_a_tick_has_a_record_for_every_sample_also_of_a_device_that_nobody_acts_on():
    bench, encoder = Bench(), Fake()
    devices = Devices(angle=bench.angle, contact=bench.contact, joint_encoder=encoder)
    bench.streams = Streams(devices, dispensable=("joint_encoder",))
    encoder.queue = [SensorSample(at, at, 0.1) for at in range(3)]
    bench.read("angle", "contact", samples=2)
    assert bench.streams.parts == len(bench.streams.joint_encoder) == 3
    bench.read("angle", "contact", samples=2)
    assert bench.streams.parts == 2


def test_without_the_device_its_age_does_not_count():
    bench = Bench(worn=False)
    assert bench.read("angle", "contact") == 0.0
    assert bench.streams.actuator == []
    assert bench.streams.newest_actuator == NO_ACTUATOR_SAMPLE
    assert bench.read("angle") == pytest.approx(0.002)
