"""Timing of the loop, from the ticks of a log."""

from typing import Any

import numpy as np

from jointz.core.session_log import Flag

_QUANTILES = {"p50": 50.0, "p99": 99.0, "p99_9": 99.9, "max": 100.0}


def timing_report(records: np.ndarray, period_ns: int) -> dict[str, Any]:
    """Summarise lateness, period error and work of the ticks."""
    ticks = records[records["part"] == 0]
    if ticks.size < 2:
        return {"ticks": int(ticks.size), "missed_slots": 0, "clamped_ticks": 0}
    slot = ticks["slot"].astype(np.int64)
    host_ns = ticks["host_time_ns"]
    steps = np.diff(slot)
    period_error_ns = np.abs(np.diff(host_ns) - steps * period_ns)
    return {
        "ticks": int(ticks.size),
        "missed_slots": int((steps - 1).sum()),
        "clamped_ticks": int(np.count_nonzero(_clamped(ticks))),
        "mean_rate_hz": float((ticks.size - 1) * 1e9 / (host_ns[-1] - host_ns[0])),
        "lateness_us": _quantiles((host_ns % period_ns) / 1e3),
        "period_error_us": _quantiles(period_error_ns / 1e3),
        "busy_us": _quantiles(ticks["busy_us"][1:]),
    }


def _clamped(ticks: np.ndarray) -> np.ndarray:
    """Return which ticks sent less than was requested; before the first samples nothing is."""
    asked = ticks["requested_torque"]  # no number before the actuator's first sample
    differs = np.isfinite(asked) & (asked != ticks["sent_torque"])
    return np.asarray(differs & ((ticks["flags"] & Flag.CLAMPED) != 0))


def _quantiles(values: np.ndarray) -> dict[str, float]:
    return {name: float(np.percentile(values, q)) for name, q in _QUANTILES.items()}
