"""Alignment of the streams of a log, each on the clock of its device, to the times of one of them.

Clocks of devices have other zeros and rates than the host's: 50 parts in a million are 85 ms in
half an hour. The offset between the clocks is taken from the samples that came fastest, since
nothing arrives before it was measured.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from jointz.core.session_log import NO_SAMPLE

#: A stream is not filled over a hole of more than this many of its own sample periods.
_HOLE_PERIODS = 1.5
#: The fastest sample of every block of so long tells the way; a line goes through three or more.
_BLOCK_NS = 10_000_000_000
_FEWEST_BLOCKS = 3
#: Fitted times of samples taken in step may differ by so much.
_ROUNDING_NS = 1000.0
_NEVER = np.iinfo(np.int64).min


@dataclass(frozen=True, slots=True)
class ClockFit:
    """A device's clock against the host's."""

    start_ns: int  # ns: device time of the first sample
    way_ns: int  # ns: host time minus device time at the first sample
    drift: float  # relative excess of the host's clock rate; 0 for a short record
    residual_ms: float  # ms: largest distance of a block's fastest sample from the line

    def place(self, device_ns: np.ndarray, master: "ClockFit") -> np.ndarray:
        """Return device times by another device's clock, since its start, ns."""
        # Whole numbers, as long as they are large: a float holds 2**53 ns, a hundred days.
        later = (self.start_ns + self.way_ns) - (master.start_ns + master.way_ns)
        since = (device_ns - self.start_ns).astype(float)
        return np.asarray((later + since * (1.0 + self.drift)) / (1.0 + master.drift))


class LogStreams:
    """The streams of a log's devices: which samples are new, and how the clocks ran.

    Each clock is examined once: a log of an hour has millions of records.
    """

    def __init__(self, records: np.ndarray) -> None:
        self.records = records
        self._fresh: dict[str, np.ndarray] = {}
        self._fits: dict[str, ClockFit] = {}

    def fresh(self, clock: str) -> np.ndarray:
        """Return which records hold a sample of a device that is newer than all before it.

        A sample whose clock stands still or jumps back cannot be placed in time.
        """
        if clock not in self._fresh:
            times = self.records[clock]
            sampled = times != NO_SAMPLE
            newest = np.maximum.accumulate(np.where(sampled, times, _NEVER))
            before = np.concatenate([[_NEVER], newest[:-1]])
            self._fresh[clock] = np.asarray(sampled & (times > before))
        return self._fresh[clock]

    def values(self, field: str, clock: str) -> np.ndarray:
        """Return a field at the new samples of a device."""
        return np.asarray(self.records[field][self.fresh(clock)])

    def fit(self, clock: str) -> ClockFit:
        """Return a device's clock fitted to the host's."""
        if clock not in self._fits:
            times = self.values(clock, clock)
            self._fits[clock] = _fit_clock(times, self.values("host_time_ns", clock) - times)
        return self._fits[clock]

    def onto(self, field: str, *, clock: str, master: str, interpolated: bool = True) -> np.ndarray:
        """Return a field of a device at the times of the master's samples.

        Devices sampled in step share their times and are taken as they are. Others
        are placed by the host's clock (:meth:`fit`) and interpolated.
        """
        time_ns, device_ns = self.values(master, master), self.values(clock, clock)
        values = self.values(field, clock).astype(float)
        if np.array_equal(device_ns, time_ns):
            return np.asarray(values)
        if device_ns.size < 2 or time_ns.size == 0:
            return np.full(time_ns.size, np.nan)
        masters = self.fit(master)
        place = (time_ns - masters.start_ns).astype(float)
        device_place = self.fit(clock).place(device_ns, masters)
        after = np.searchsorted(device_place, place, side="right").clip(1, device_place.size - 1)
        hole = np.diff(device_place) > _HOLE_PERIODS * np.median(np.diff(device_place))
        inside = (place > device_place[after - 1]) & (place < device_place[after])
        first, last = device_place[0] - _ROUNDING_NS, device_place[-1] + _ROUNDING_NS
        outside = (place < first) | (place > last)
        if interpolated:
            placed = np.interp(place, device_place, values)
        else:
            placed = values[after - (place < device_place[after])]
        return np.asarray(np.where((hole[after - 1] & inside) | outside, np.nan, placed))

    def clock_notes(self, clocks: Mapping[str, str]) -> dict[str, dict[str, float]]:
        """Return, for the history of a recording, how each device's clock ran."""
        notes = {}
        for device, clock in clocks.items():
            new = self.fresh(clock)
            if not new.any():
                continue
            fit = self.fit(clock)
            notes[device] = {
                "drift_ppm": round(fit.drift * 1e6, 3),
                "residual_ms": round(fit.residual_ms, 3),
                "repeated_samples": int((self.records[clock] != NO_SAMPLE).sum() - new.sum()),
            }
        return notes


def _fit_clock(times: np.ndarray, way: np.ndarray) -> ClockFit:
    """Fit a clock to the host's; ``way`` is host time minus device time."""
    first = int(times[0])
    block = (times - first) // _BLOCK_NS
    starts = np.flatnonzero(np.diff(block, prepend=-1)).tolist()
    fastest = np.array([a + int(np.argmin(way[a:b])) for a, b in pairwise([*starts, way.size])])
    least = int(way.min())
    if fastest.size < _FEWEST_BLOCKS:
        return ClockFit(first, least, 0.0, 0.0)
    since = (times[fastest] - first).astype(float)
    later = (way[fastest] - least).astype(float)
    drift, at_start = np.polyfit(since, later, 1) if np.ptp(later) else (0.0, 0.0)
    residual = later - (at_start + drift * since)
    return ClockFit(
        first, least + round(at_start), float(drift), float(np.abs(residual).max()) * 1e-6
    )
