"""Channels that were sampled by another clock than the torque: error of their lag, and notes."""

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from jointz.core.recording import history_of
from jointz.core.study import Calibrated, CalibrationSpec
from jointz.gait.timestamps import rate_hz

#: Sd of a uniform error within one period: when in it a frame was taken is not known.
_SD_OF_PERIOD = 1.0 / np.sqrt(12.0)
#: Levels, which hold until their next sample.
_LEVELS = ("contact", "command", "trigger")


def sampled_hz(recording: xr.Dataset) -> dict[str, float]:
    """Return the rates of the channels that were interpolated to the torque's clock."""
    steps = [step for step in history_of(recording) if step.get("step") == "joined"]
    return {name: step["sampled_hz"] for step in steps for name in step.get("channels", ())}


def with_clock_errors(known: CalibrationSpec, recording: xr.Dataset) -> CalibrationSpec:
    """Return the calibration with the share that another clock has in the sds of its lags."""
    wider = {}
    for channel, rate in sampled_hz(recording).items():
        lag = getattr(known, f"{channel}_lag_s", None)
        if isinstance(lag, Calibrated):
            sd = float(np.hypot(lag.sd, _SD_OF_PERIOD / rate))
            wider[f"{channel}_lag_s"] = Calibrated(value=lag.value, sd=sd)
    return known.model_copy(update=wider) if wider else known


def clock_notes(recordings: Sequence[tuple[str, xr.Dataset]]) -> Iterator[str]:
    """Yield a note about each file with channels of another clock."""
    for file, recording in recordings:
        names: dict[float, list[str]] = {}
        for name, rate in sampled_hz(recording).items():
            names.setdefault(rate, []).append(name)
        own = rate_hz(recording["time"].to_numpy())
        for rate, channels in names.items():
            levels = [name for name in channels if name in _LEVELS]
            if levels:
                yield (
                    f"{file}: {', '.join(levels)} sampled at {rate:.4g} Hz by another clock: its "
                    f"edges are up to {1e3 / rate:.2g} ms late."
                )
            if signals := [name for name in channels if name not in _LEVELS]:
                yield (
                    f"{file}: {', '.join(signals)} sampled at {rate:.4g} Hz by another clock, "
                    f"interpolated to the {own:.4g} Hz of the torque; a calibrated lag has "
                    f"{1e3 * _SD_OF_PERIOD / rate:.2g} ms more sd for it."
                )
