"""Channels that were sampled by another clock than the torque: error of their lag, and notes."""

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from jointz.core.channels import LEVEL_CHANNELS
from jointz.core.recording import history_of
from jointz.core.study import Calibrated, CalibrationSpec
from jointz.gait.timestamps import rate_hz

#: Sd of a uniform error within one period: two clocks are aligned to a period of the faster one.
_SD_OF_PERIOD = 1.0 / np.sqrt(12.0)


def sampled_hz(recording: xr.Dataset) -> dict[str, float]:
    """Return the rates of the channels that were interpolated to the torque's clock."""
    steps = [step for step in history_of(recording) if step.get("step") == "joined"]
    return {name: step["sampled_hz"] for step in steps for name in step.get("channels", ())}


def with_clock_errors(known: CalibrationSpec, recording: xr.Dataset) -> CalibrationSpec:
    """Return the calibration with the share that another clock has in the sds of its lags."""
    wider, torque_hz = {}, rate_hz(recording["time"].to_numpy())
    for channel, rate in sampled_hz(recording).items():
        lag = getattr(known, f"{channel}_lag_s", None)
        if isinstance(lag, Calibrated):
            sd = float(np.hypot(lag.sd, _SD_OF_PERIOD / max(rate, torque_hz)))
            wider[f"{channel}_lag_s"] = Calibrated(value=lag.value, sd=sd)
    return known.model_copy(update=wider) if wider else known


def clock_notes(recordings: Sequence[xr.Dataset]) -> Iterator[str]:
    """Yield a note about the channels of each clock beside the torque's."""
    for recording in recordings:
        torque_hz = rate_hz(recording["time"].to_numpy())
        channels = sampled_hz(recording)
        for rate in dict.fromkeys(channels.values()):
            names = [name for name, other in channels.items() if other == rate]
            if levels := ", ".join(name for name in names if name in LEVEL_CHANNELS):
                yield (
                    f"{levels}: sampled at {rate:.4g} Hz by another clock: edges are up to "
                    f"{1e3 / rate:.2g} ms late."
                )
            if signals := ", ".join(name for name in names if name not in LEVEL_CHANNELS):
                yield (
                    f"{signals}: sampled at {rate:.4g} Hz by another clock and interpolated to the "
                    f"{torque_hz:.4g} Hz of the torque; the sd of a calibrated lag includes "
                    f"{1e3 * _SD_OF_PERIOD / max(rate, torque_hz):.2g} ms for it."
                )
