"""Sensors of opensourceleg 3.5 as devices of an experiment: encoder, ADC, load cell, IMU.

Install the library with ``pip install "jointz[osl]"``. **None of it was ever tried on
hardware.** Units, as the library's code has them: ``position`` of an encoder in rad (AS5048B:
-pi to pi, so put its jump outside the joint's range, or use ``abs_ang``), ``data`` of
``ADS131M0x`` in mV, ``fx`` and ``mx`` of a load cell in N and N*m, ``gyro_x`` and ``acc_x`` of an
IMU in rad/s and m/s^2 (those of ``LordMicrostrainIMU`` are named ``vel_x``; its ``gyro_x`` is
always 0). No sensor tells the time of its measurement: samples carry the host's time after
``update`` returned.
"""

from collections import deque
from typing import Any

from jointz.core.clock import Clock
from jointz.core.errors import DeviceError, NotConnectedError
from jointz.rig.devices.driver_base import ACTIVE, INACTIVE, UNCONFIGURED, DriverBase, drained
from jointz.rig.devices.interface import SensorDescription, SensorSample
from jointz.rig.devices.opensourceleg_polling import (
    NEVER_TRIED,
    QUEUE_LENGTH,
    PolledDevice,
    PollingOf,
    PollingThread,
)
from jointz.rig.devices.opensourceleg_setup import Reading

#: A library whose update does not return raises nothing; without a sample for so long it is gone.
_SILENCE_NS = 1_000_000_000


class OpenSourceLegSource:
    """A sensor of opensourceleg with a thread of its own, for one or more channels.

    The first channel that is configured starts it, the last that is closed stops it.
    """

    def __init__(
        self,
        sensor: Any,
        *,
        clock: Clock,
        sample_rate_hz: float,
        polling: PollingOf = PollingThread,
    ) -> None:
        # ADS131M0x of 3.5.0 never calls the constructor that would give it a tag.
        name = str(getattr(sensor, "tag", type(sensor).__name__))
        if getattr(sensor, "is_offline", False):
            raise DeviceError(name, "is offline: what it says is made up. Leave offline=True away.")
        self.device = PolledDevice(
            sensor, name=name, sample_rate_hz=sample_rate_hz, clock=clock, polling=polling
        )
        self._open: list[OpenSourceLegSensor] = []

    def join(self, sensor: "OpenSourceLegSensor") -> None:
        """Start the library's sensor for the first channel."""
        self.device.check()
        if not self._open:
            self.device.begin(lambda: None, self._poll)
        self._open = [*self._open, sensor]  # a new list: the thread may be in the old one

    def leave(self, sensor: "OpenSourceLegSensor") -> None:
        """Stop the library's sensor after the last channel; never raises."""
        self._open = [one for one in self._open if one is not sensor]
        if not self._open:
            self.device.end()

    def _poll(self, due: bool) -> None:  # noqa: FBT001 - a Poll
        if due:
            self.device.library.update()
            now_ns = self.device.clock.now_ns()
            for sensor in self._open:
                sensor.take(now_ns)


class OpenSourceLegSensor(DriverBase):
    """One channel of a sensor of opensourceleg as our sensor; never tried on hardware."""

    def __init__(self, source: OpenSourceLegSource, reading: Reading) -> None:
        super().__init__(f"{source.device.name} {reading.channel}")
        self._source, self._device, self._reading = source, source.device, reading
        self._queue: deque[SensorSample] = deque(maxlen=QUEUE_LENGTH)
        self._sampled_ns = 0

    def describe(self) -> SensorDescription:
        """Return the description of the sensor; it says that nobody tried it on hardware."""
        return SensorDescription(
            name=self._name,
            model=f"opensourceleg {type(self._device.library).__name__}; {NEVER_TRIED}",
            serial="not read",
            channel=self._reading.channel,
            unit=self._reading.unit,
            sample_rate_hz=self._device.sample_rate_hz,
            kind=self._reading.kind,
        )

    def configure(self) -> None:
        """Start the library's sensor; afterwards ``INACTIVE``."""
        self._require(UNCONFIGURED)
        self._source.join(self)
        self._state = INACTIVE

    def activate(self) -> None:
        """Begin to queue samples; afterwards ``ACTIVE``."""
        self._require(INACTIVE)
        self._device.check()
        self._queue.clear()
        self._sampled_ns = self._device.clock.now_ns()
        self._state = ACTIVE

    def read(self) -> list[SensorSample]:
        """Return all samples queued since the last read, oldest first."""
        self._require(ACTIVE)
        self._device.check()
        samples, now_ns = drained(self._queue), self._device.clock.now_ns()
        if samples:
            self._sampled_ns = now_ns
        elif now_ns - self._sampled_ns > _SILENCE_NS:
            raise NotConnectedError(
                self._name, "gave no sample for a second: its update hangs. Check the wiring."
            )
        return samples

    def _release(self) -> None:
        self._source.leave(self)

    def take(self, now_ns: int) -> None:
        """Queue what the library's sensor says, while ``ACTIVE``; called by the source."""
        if self._state is ACTIVE:
            value = self._reading.of(self._device.library)
            self._queue.append(SensorSample(now_ns, now_ns, value))
