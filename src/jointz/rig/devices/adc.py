"""Goniometer and footswitch on an ADS1115: ``pip install "jointz[adc]"`` (smbus2).

**Never tried on hardware.** It was run against smbus2 on a stand-in for the kernel's I2C bus,
with the registers of the data sheet (SBAS444).

Timing of its samples:

- The chip converts at most 860 times a second, by an oscillator of its own that is good to 10 %,
  and over I2C it tells nobody when a conversion was ready. It is read by a thread at the stated
  rate, at most nine tenths of its own, so that no conversion is read twice; some are skipped.
- Each value is an average over the conversion and waits until it is read: it is old by one
  conversion (:attr:`Ads1115Sensor.lag_s`), more or less by up to half of one, evenly spread
  (:attr:`Ads1115Sensor.lag_sd_s`): 1.2 ms and 0.34 ms at 860 a second. State both as
  ``angle_lag_s``, or measure the lag. A stamp says when the value was read.
- A thread of Python waits its turn: samples come 0.1 ms late, and sometimes some ms; the stamps
  say so. One reading takes 0.1 ms of the bus at 400 kHz, 0.5 ms at 100 kHz: set 400 kHz.

A jitter of 0.3 ms is small beside that of a footswitch. For the angle of a perturbed joint a
converter with a clock that is counted along (an encoder, an EtherCAT or USB data logger) is
the better choice.
"""

import contextlib
from collections import deque
from math import nan, sqrt
from typing import Any

from jointz.core.clock import Clock
from jointz.core.errors import DeviceError, NotConnectedError
from jointz.rig.devices.config import ADS1115_FULL_SCALES_V, ADS1115_RATES, Ads1115Spec
from jointz.rig.devices.driver_base import (
    ACTIVE,
    INACTIVE,
    UNCONFIGURED,
    DriverBase,
    channel_unit,
    drained,
    load_library,
)
from jointz.rig.devices.drivers import Driver
from jointz.rig.devices.interface import SensorDescription, SensorSample
from jointz.rig.devices.repeating import Repeat, Repeating, RepeatingThread

_CONVERSION, _CONFIG = 0x00, 0x01
_INPUTS = ("0-1", "0-3", "1-3", "2-3", "0", "1", "2", "3")
#: Comparator off; continuous conversion is a 0.
_NO_COMPARATOR = 0b11
#: The highest bit says whether a conversion is going on, not what was written.
_WRITTEN = 0x7FFF
_LOWEST, _HIGHEST = -32_768, 32_767
_READ_OF_RATE = 0.9
#: Failures in a row for so long, or no reading at all, mean that the chip is gone.
_LOST_S, _SILENCE_NS = 0.02, 1_000_000_000
_KEPT_S = 2.0
#: Its settings are checked so often: a chip that lost its supply still answers.
_CHECK_S = 0.25


class Ads1115Sensor(DriverBase):
    """One input of an ADS1115 as a sensor of an experiment; see the module for its timing.

    At the end of the range an angle is NaN: the true value may lie beyond it.
    """

    def __init__(
        self,
        spec: Ads1115Spec,
        channel: str,
        *,
        clock: Clock,
        repeat: Repeat = RepeatingThread,
    ) -> None:
        super().__init__(f"ADS1115 at {spec.address:#x} on I2C bus {spec.bus}")
        self._spec = spec
        self._channel = channel
        self._now_ns = clock.now_ns
        self._repeat = repeat
        self._per_count = spec.full_scale_v / 32_768.0
        wanted_hz = spec.sample_rate_hz / _READ_OF_RATE
        self._rate_hz = next(rate for rate in ADS1115_RATES if rate >= wanted_hz - 1.0)
        self._most_failures = max(3, round(_LOST_S * spec.sample_rate_hz))
        self._bus: Any = None
        self._sampling: Repeating | None = None
        self._queue: deque[SensorSample] = deque(maxlen=round(_KEPT_S * spec.sample_rate_hz) + 1)
        self._failures = 0
        self._failure = ""
        self._sampled_ns = 0
        self._until_check = self._between_checks = max(1, round(_CHECK_S * spec.sample_rate_hz))
        self._closed = False
        self.dropped = 0

    @property
    def lag_s(self) -> float:
        """Mean age of a value when it is stamped, s."""
        return 1.0 / self._rate_hz

    @property
    def lag_sd_s(self) -> float:
        """Standard deviation of the age of a value when it is stamped, s."""
        return 1.0 / (self._rate_hz * sqrt(12.0))

    def describe(self) -> SensorDescription:
        """Return the description of the sensor, in any state."""
        unit, kind = channel_unit(self._channel, self._spec.kind)
        return SensorDescription(
            name=f"{self._name}, input {self._spec.input}",
            model="ADS1115 through smbus2 (driver never tried on hardware)",
            serial=self._spec.serial,
            channel=self._channel,
            unit=unit,
            sample_rate_hz=self._spec.sample_rate_hz,
            kind=kind,
        )

    def configure(self) -> None:
        """Connect and set the chip up; afterwards ``INACTIVE``."""
        self._require(UNCONFIGURED)
        library = load_library("smbus2", device=self._name, extra="adc")
        config = self._config()
        try:
            self._bus = library.SMBus(self._spec.bus)
            self._bus.write_i2c_block_data(
                self._spec.address, _CONFIG, list(config.to_bytes(2, "big"))
            )
            register = self._register(_CONFIG)
        except OSError as exc:
            self._release()
            raise NotConnectedError(
                self._name,
                f"does not answer ({exc}). Check the wiring and the address (i2cdetect -y "
                f"{self._spec.bus}), that I2C is switched on and the user is in the group i2c.",
            ) from exc
        if (register ^ config) & _WRITTEN:
            self._release()
            raise DeviceError(
                self._name,
                f"expected {config:#06x} in its register, found {register:#06x}: no ADS1115, or "
                "another program sets it too.",
            )
        self._state = INACTIVE

    def activate(self) -> None:
        """Begin to sample; afterwards ``ACTIVE``."""
        self._require(INACTIVE)
        self._queue.clear()
        self._failures = 0
        self._sampled_ns = self._now_ns()
        self._state = ACTIVE
        self._sampling = self._repeat(self._take, 1.0 / self._spec.sample_rate_hz)

    def stop(self) -> None:
        """Sample no more; never raises, never blocks."""
        if self._sampling is not None:
            self._sampling.cancel()
            self._sampling = None
        super().stop()

    def read(self) -> list[SensorSample]:
        """Return all samples queued since the last read, oldest first."""
        self._require(ACTIVE)
        if self._failures >= self._most_failures:
            raise NotConnectedError(
                self._name, f"stopped to answer ({self._failure}). Check the wiring."
            )
        samples = drained(self._queue)
        if not samples and self._now_ns() - self._sampled_ns > _SILENCE_NS:
            raise NotConnectedError(
                self._name, "gave no sample for a second: the bus hangs. Check the wiring."
            )
        return samples

    # --- in the sampling thread ----------------------------------------------------------------

    def _take(self) -> None:
        """Read the newest conversion and queue it."""
        if self._state is not ACTIVE:
            return
        try:
            self._check_settings()
            before_ns = self._now_ns()
            raw = self._register(_CONVERSION)
        except (OSError, AttributeError, TypeError) as exc:  # the last two: closed meanwhile
            self._failures += 1
            self.dropped += 1
            self._failure = str(exc)
            return
        now_ns = self._now_ns()
        self._failures = 0
        self._sampled_ns = now_ns
        self.dropped += len(self._queue) == self._queue.maxlen
        counts = raw - 65_536 if raw > _HIGHEST else raw
        self._queue.append(SensorSample((before_ns + now_ns) // 2, now_ns, self._value(counts)))

    def _check_settings(self) -> None:
        """Check every ``_CHECK_S`` that the chip still has its settings."""
        self._until_check -= 1
        if self._until_check > 0:
            return
        self._until_check = 1
        if (self._register(_CONFIG) ^ self._config()) & _WRITTEN:
            raise OSError("it lost its settings: its supply was interrupted")
        self._until_check = self._between_checks

    def _value(self, counts: int) -> float:
        spec = self._spec
        volts = counts * self._per_count
        is_contact = self._channel == "contact"
        if is_contact and spec.kind == "contact":
            # Hysteresis: between the two thresholds a contact keeps its state.
            self._closed = volts >= (spec.release_v if self._closed else spec.threshold_v)
            return float(self._closed)
        if not is_contact and counts in (_LOWEST, _HIGHEST):
            return nan
        return spec.gain_per_v * (volts - spec.offset_v)

    # --- the chip ------------------------------------------------------------------------------

    def _config(self) -> int:
        spec = self._spec
        return (
            _INPUTS.index(spec.input) << 12
            | ADS1115_FULL_SCALES_V.index(spec.full_scale_v) << 9
            | ADS1115_RATES.index(self._rate_hz) << 5
            | _NO_COMPARATOR
        )

    def _register(self, pointer: int) -> int:
        high, low = self._bus.read_i2c_block_data(self._spec.address, pointer, 2)
        return int(high) << 8 | int(low)

    def _release(self) -> None:
        bus, self._bus = self._bus, None
        if bus is not None:
            with contextlib.suppress(OSError):
                bus.close()


DRIVER = Driver(Ads1115Spec, Ads1115Sensor, package="smbus2")
