"""A channel of a stream of Lab Streaming Layer as a sensor: ``pip install "jointz[lsl]"``.

Tried with liblsl between two programs of one computer, never with an amplifier or a data logger,
and never over a network.

Timing of its samples: the sender stamps them with its clock, and LSL measures the offset of that
clock from the one of this computer, every few seconds, to some 0.2 ms over a cable. The stamps here
are corrected by that offset, so that a sender whose clock drifts stays aligned; they are only as
good as the sender's own stamps, which leave out the delay of its hardware. Wireless networks
deliver in bursts: use a cable. Samples that arrive 0.1 s later than the fastest did are left out,
so that the safety gate sees a stale sensor.
"""

import contextlib
import importlib
from collections.abc import Callable
from math import isfinite
from typing import Any

from jointz.core.clock import Clock
from jointz.core.errors import DeviceError, NotConnectedError, install_advice
from jointz.rig.devices.config import LslSpec
from jointz.rig.devices.driver_base import ACTIVE, INACTIVE, UNCONFIGURED, DriverBase, channel_unit
from jointz.rig.devices.drivers import Driver
from jointz.rig.devices.interface import SensorDescription, SensorSample

#: liblsl discards samples that are not fetched within this time.
_BUFFER_S = 2  # of markers: 200
_CHUNK = 256
_MOST_CHUNKS = 32
#: Without a sample for so long a sender is gone: one that crashed says nothing.
_SILENCE_NS = 1_000_000_000
_RATE_TOLERANCE = 0.01
#: Samples that arrive so much later than the fastest were delayed on their way: they are stale.
_LATE_NS = 100_000_000
#: Stamps of a sender that counts samples run away from the host's clock by less than this.
_DRIFT = 1e-3
#: What pylsl raises; its own errors are RuntimeErrors.
LIBRARY_ERRORS = (RuntimeError, OSError)


class LslSensor(DriverBase):
    """One channel of a stream as a sensor of an experiment; see the module for its timing."""

    def __init__(self, spec: LslSpec, channel: str, *, clock: Clock) -> None:
        super().__init__(f"LSL stream {spec.stream}")
        self._spec = spec
        self._channel = channel
        self._now_ns = clock.now_ns
        self._inlet: Any = None
        self._newest_ns = self._received_ns = 0
        self._fastest: tuple[float, int] | None = None  # lag (ns) of the least late, when
        self.dropped = 0
        self.offset_s = 0.0

    def describe(self) -> SensorDescription:
        """Return the description of the sensor, in any state."""
        spec = self._spec
        unit, kind = channel_unit(self._channel, spec.kind)
        return SensorDescription(
            name=f"{self._name}, channel {spec.index}",
            model="Lab Streaming Layer (never tried with an amplifier or over a network)",
            serial=spec.source_id,
            channel=self._channel,
            unit=unit,
            sample_rate_hz=spec.sample_rate_hz,
            kind=kind,
        )

    def configure(self) -> None:
        """Find the stream and connect, which takes a second; afterwards ``INACTIVE``."""
        self._require(UNCONFIGURED)
        spec = self._spec
        inlet = open_inlet(
            self._name,
            ("source_id", spec.source_id) if spec.source_id else ("name", spec.stream),
            timeout_s=spec.timeout_s,
            check=self._check,
        )
        self.offset_s = inlet.time_correction(0.0)
        self._inlet = inlet
        self._state = INACTIVE

    def activate(self) -> None:
        """Begin to sample; afterwards ``ACTIVE``."""
        self._require(INACTIVE)
        try:
            self._inlet.flush()
        except LIBRARY_ERRORS as exc:
            raise _gone(self._name, exc) from exc
        self._received_ns = self._now_ns()
        self._fastest = None
        self._state = ACTIVE

    def _release(self) -> None:
        inlet, self._inlet = self._inlet, None
        if inlet is not None:
            with contextlib.suppress(*LIBRARY_ERRORS):
                inlet.close_stream()

    def read(self) -> list[SensorSample]:
        """Return all samples that arrived since the last read, oldest first."""
        self._require(ACTIVE)
        received: list[tuple[float, float]] = []
        index = self._spec.index
        try:
            for _ in range(_MOST_CHUNKS):
                values, stamps = self._inlet.pull_chunk(timeout=0.0, max_samples=_CHUNK)
                received += [(stamp, row[index]) for stamp, row in zip(stamps, values, strict=True)]
                if len(stamps) < _CHUNK:
                    break
            if received:
                self.offset_s = self._inlet.time_correction(0.0)
        except LIBRARY_ERRORS as exc:
            raise _gone(self._name, exc) from exc
        return self._samples(received)

    def _samples(self, received: list[tuple[float, float]]) -> list[SensorSample]:
        host_ns = self._now_ns()
        if self._is_late([stamp for stamp, _ in received if isfinite(stamp)], host_ns):
            self.dropped += len(received)
            received = []
        if received:
            self._received_ns = host_ns
        elif host_ns - self._received_ns > _SILENCE_NS:
            raise NotConnectedError(
                self._name,
                "sent nothing for a second, or all of it came late. Check its sender and the "
                "network.",
            )
        spec, offset_s = self._spec, self.offset_s
        samples = []
        for stamp, value in received:
            time_ns = round((stamp + offset_s) * 1e9) if isfinite(stamp) else 0
            if time_ns <= self._newest_ns:
                self.dropped += 1
                continue
            self._newest_ns = time_ns
            samples.append(SensorSample(time_ns, host_ns, spec.gain * (value - spec.offset)))
        return samples

    def _is_late(self, stamps: list[float], host_ns: int) -> bool:
        """Return whether the newest sample was delayed on its way, against the fastest so far.

        The clocks of host and stream need not have one zero; their difference may drift.
        """
        if not stamps:
            return False
        lag_ns = host_ns - (max(stamps) + self.offset_s) * 1e9
        fastest_ns, seen_ns = self._fastest or (lag_ns, host_ns)
        fastest_ns = min(lag_ns, fastest_ns + _DRIFT * (host_ns - seen_ns))
        self._fastest = fastest_ns, host_ns
        return lag_ns - fastest_ns > _LATE_NS

    def _check(self, info: Any) -> None:
        spec = self._spec
        if spec.index >= info.channel_count():
            raise DeviceError(
                self._name,
                f"index: expected less than its {info.channel_count()} channels, got {spec.index}.",
            )
        if info.channel_format() == load_pylsl(self._name).cf_string:
            raise DeviceError(self._name, "expected numbers, it sends text (a marker stream?).")
        rate_hz = info.nominal_srate()
        if abs(rate_hz - spec.sample_rate_hz) > _RATE_TOLERANCE * spec.sample_rate_hz:
            raise DeviceError(
                self._name,
                f"sample_rate_hz: expected {spec.sample_rate_hz:g} Hz, it states {rate_hz:g} Hz.",
            )


def open_inlet(
    name: str, stream: tuple[str, str], *, timeout_s: float, check: Callable[[Any], None]
) -> Any:
    """Find a stream and connect to it, its clock measured; return the inlet of pylsl."""
    library = load_pylsl(name)
    key, wanted = stream
    try:
        streams = library.resolve_byprop(key, wanted, 1, timeout_s)
        if not streams:
            raise NotConnectedError(
                name,
                f"no stream whose {key} is {wanted!r} within {timeout_s:g} s. Start its sender, "
                "and let multicast through the firewall (UDP 16571).",
            )
        if len(streams) > 1:
            ids = ", ".join(repr(one.source_id()) for one in streams)
            raise DeviceError(name, f"{len(streams)} streams answer. Give source_id: one of {ids}.")
        check(streams[0])
        # A stream that liblsl recovers by itself would leave a gap without an error.
        inlet = library.StreamInlet(streams[0], max_buflen=_BUFFER_S, recover=False)
        inlet.open_stream(timeout_s)
        inlet.time_correction(timeout_s)  # the first takes a second, all others no time
    except LIBRARY_ERRORS as exc:
        raise _gone(name, exc) from exc
    return inlet


def _gone(name: str, exc: Exception) -> NotConnectedError:
    return NotConnectedError(name, f"does not answer ({exc}). Check its sender and the network.")


def load_pylsl(name: str) -> Any:
    """Return the module pylsl."""
    try:
        return importlib.import_module("pylsl")
    except (ImportError, *LIBRARY_ERRORS) as exc:  # without liblsl pylsl raises a RuntimeError
        raise DeviceError(name, f"pylsl is not installed ({exc}). {install_advice('lsl')}") from exc


DRIVER = Driver(LslSpec, LslSensor, package="pylsl")
