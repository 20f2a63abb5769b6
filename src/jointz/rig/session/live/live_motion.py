"""Traces, heel strikes, pulse onsets and loop timing of a stretch, from its log."""

from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np

from jointz.core.session_log import LAYOUTS, Flag

#: Length (s) and rate of the traces that a page can show.
WINDOW_S = 30.0
_SHOWN_HZ = 100.0
#: Columns of the traces after the time; NaN where a layout or a condition has none.
TRACES = ("angle", "command", "sent_torque", "applied_torque", "phase_pct", "pulse")
#: Over how long the loop's work is told, and for how long a flag stays lit, s.
_LOOP_S, _FLAG_S = 10.0, 1.0
_DUTY_S = 10.0
_LIT = (Flag.CLAMPED, Flag.FADING, Flag.CUT, Flag.TRIPPED, Flag.OVERRUN)


@dataclass(slots=True)
class StartedPulse:
    """A pulse that has begun in a stretch."""

    number: int  # number in the plan
    at_s: float  # time since the stretch began
    stride: int  # accepted strides before it; 0 on a bench
    onset_pct: float | None = None  # onset in % of its stride; None until the stride ends


class Motion:
    """A stretch by its log, record by record."""

    def __init__(self, header: dict[str, Any]) -> None:
        self._step = max(1, round(header["control_hz"] / _SHOWN_HZ))
        self._period_ns = round(1e9 / header["control_hz"])
        layout = LAYOUTS[header.get("layout", "walking")]
        self._walks = any(field.name == "stride" for field in layout.fields)
        self._first_ns = -1
        self._last_slot = self._last_bucket = -1
        self._pulse = 0
        self._recent: deque[np.ndarray] = deque()
        self.rows = np.empty((0, 1 + len(TRACES)))
        self.count = 0
        self.strikes_s: deque[float] = deque(maxlen=200)
        self.strides = 0
        self.pulses: list[StartedPulse] = []
        self._open: list[StartedPulse] = []  # those whose stride is not over
        self.ticks = self.missed_slots = 0
        self.last_ns = 0

    def take(self, records: np.ndarray) -> None:
        """Process records."""
        ticks = records[records["part"] == 0]
        if not ticks.size:
            return
        if self._first_ns < 0:
            self._first_ns = int(ticks["host_time_ns"][0])
        time_s = (ticks["host_time_ns"] - self._first_ns) * 1e-9
        slot = ticks["slot"].astype(np.int64)
        before = self._last_slot if self._last_slot >= 0 else int(slot[0]) - 1
        self.missed_slots += int(slot[-1]) - before - ticks.size
        self.ticks += ticks.size
        self.last_ns = int(ticks["host_time_ns"][-1])
        self._keep_rows(ticks, slot, time_s)
        self._keep_pulses(ticks, time_s)
        if self._walks:
            self._keep_strides(ticks["stride"].astype(np.int64), time_s)
        self._last_slot = int(slot[-1])
        self._keep_recent(ticks)

    def loop(self) -> dict[str, float]:
        """Return the timing of the loop over the last seconds, us, and the slots missed in all."""
        summary: dict[str, float] = {"ticks": self.ticks, "missed_slots": self.missed_slots}
        if not self._recent:
            return summary
        late = np.concatenate([p["host_time_ns"] for p in self._recent]) % self._period_ns / 1e3
        busy = np.concatenate([p["busy_us"] for p in self._recent])
        return summary | {
            "busy_p99_us": float(np.percentile(busy, 99.0)),
            "busy_max_us": float(busy.max()),
            "late_p99_us": float(np.percentile(late, 99.0)),
            "late_max_us": float(late.max()),
            "period_us": self._period_ns / 1e3,
        }

    def device(self) -> dict[str, float | None]:
        """Return newest values of the actuator, and peaks of the last seconds."""
        if not self._recent:
            return {}
        recent = np.concatenate(self._recent)
        summary = {name: _newest(recent[name]) for name in ("temperature_c", "voltage", "angle")}
        peaks = {
            "sent_torque": np.abs(recent["sent_torque"]),
            "current": np.abs(recent["current"]),
            "velocity": np.abs(recent["motor_velocity"]),
        }
        summary |= {f"peak_{name}": _largest(values) for name, values in peaks.items()}
        newest = recent[recent["host_time_ns"] > self.last_ns - _DUTY_S * 1e9]
        # Shams have a number and no torque, a controller has torque and no number.
        pulse_on = (newest["command"] != 0.0) & (newest["pulse"] > 0)
        # Of the whole window, as the safety gate has it, from the first tick on.
        summary["pulse_duty"] = float(pulse_on.sum() * self._period_ns / (_DUTY_S * 1e9))
        return summary

    @property
    def torque_is_off(self) -> bool:
        """Whether the last tick sent no torque."""
        return bool(self._recent) and float(self._recent[-1]["sent_torque"][-1]) == 0.0

    def flags(self) -> list[str]:
        """Return the names of the flags that were up in the last second."""
        return [flag.name.lower() for flag in _LIT if flag.name and self._union("flags") & flag]

    def faults(self) -> int:
        """Return the fault bits of the actuator of the last second."""
        return self._union("faults")

    def _union(self, field: str) -> int:
        since = self.last_ns - int(_FLAG_S * 1e9)
        bits = 0
        for part in self._recent:
            if part["host_time_ns"][-1] > since:
                late = part[field][part["host_time_ns"] > since]
                bits |= int(np.bitwise_or.reduce(late))
        return bits

    def _keep_rows(self, ticks: np.ndarray, slot: np.ndarray, time_s: np.ndarray) -> None:
        bucket = slot // self._step
        before = np.concatenate([[self._last_bucket], bucket[:-1]])
        kept = bucket != before
        self._last_bucket = int(bucket[-1])
        names = ticks.dtype.names or ()
        source = {"applied_torque": "measured_torque"} if "measured_torque" in names else {}
        columns = [time_s[kept]]
        for name in TRACES:
            field = source.get(name, name)
            whole = ticks[field] if field in names else np.full(ticks.size, np.nan)
            columns.append(whole[kept])
        rows = np.column_stack(columns).astype(float)
        self.count += rows.shape[0]
        self.rows = np.concatenate([self.rows, rows])[-round(WINDOW_S * _SHOWN_HZ) :]

    def _keep_strides(self, stride: np.ndarray, time_s: np.ndarray) -> None:
        before = np.concatenate([[self.strides], stride[:-1]])
        for k in np.flatnonzero(stride != before):
            if stride[k] > before[k]:
                self._strike(float(time_s[k]))
            elif self.strikes_s:  # the last turned out to be none
                self.strikes_s.pop()
        self.strides = int(stride[-1])

    def _strike(self, at_s: float) -> None:
        """Record a strike that ends an accepted stride, and the pulses in that stride."""
        start_s = self.strikes_s[-1] if self.strikes_s else at_s
        self.strikes_s.append(at_s)
        for pulse in self._open:
            if start_s <= pulse.at_s < at_s:
                pulse.onset_pct = 100.0 * (pulse.at_s - start_s) / (at_s - start_s)
        self._open = [pulse for pulse in self._open if pulse.at_s >= at_s]

    def _keep_pulses(self, ticks: np.ndarray, time_s: np.ndarray) -> None:
        number = ticks["pulse"].astype(np.int64)
        before = np.concatenate([[self._pulse], number[:-1]])
        for k in np.flatnonzero((number != before) & (number > 0)):
            stride = int(ticks["stride"][k]) if self._walks else 0
            pulse = StartedPulse(int(number[k]), float(time_s[k]), stride)
            self.pulses.append(pulse)
            self._open.append(pulse)
        self._pulse = int(number[-1])

    def _keep_recent(self, ticks: np.ndarray) -> None:
        self._recent.append(ticks)
        since = self.last_ns - int(_LOOP_S * 1e9)
        while self._recent[0]["host_time_ns"][-1] < since:
            self._recent.popleft()


def _newest(values: np.ndarray) -> float | None:
    finite = values[np.isfinite(values)]
    return float(finite[-1]) if finite.size else None


def _largest(values: np.ndarray) -> float | None:
    finite = values[np.isfinite(values)]
    return float(finite.max()) if finite.size else None
