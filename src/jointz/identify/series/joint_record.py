"""The border of every command that takes one time series: checked once, trusted after."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr

from jointz.core.codes import Failure
from jointz.core.errors import DataError, EstimationError
from jointz.gait import timestamps

#: Parts of a record whose sampling rates are compared, and the largest ratio allowed.
_PARTS = 8
_LARGEST_RATE_RATIO = 1.5

Samples = xr.Dataset | Mapping[str, npt.ArrayLike] | pd.DataFrame


@dataclass(frozen=True, slots=True)
class JointRecord:
    """Checked samples on a uniform grid, SI, as given."""

    channels: dict[str, np.ndarray]  # by canonical name
    rate_hz: float  # sampling rate
    time: np.ndarray
    sha256: str = ""  # hash of the file, where known


def check_choice(name: str, value: str, choices: tuple[str, ...]) -> None:
    """Raise ValueError when a setting is not one of its choices."""
    if value not in choices:
        raise ValueError(f"{name}: expected one of {', '.join(choices)}; got {value!r}")


def gather_record(
    recording: Samples | None,
    given: Mapping[str, npt.ArrayLike | None],
    *,
    rate_hz: float | None,
    where: str,
    required: tuple[str, ...] = ("angle", "torque"),
) -> JointRecord:
    """Read channels out of whatever was given and put them on a uniform grid."""
    arrays = {name: values for name, values in given.items() if values is not None}
    first_row, sha256 = 1, ""
    if recording is not None:
        if arrays:
            raise ValueError(
                f"give either a recording or arrays; got a recording and {', '.join(arrays)}"
            )
        arrays = {name: recording[name] for name in given if name in recording}
        if isinstance(recording, xr.Dataset):
            first_row = int(recording.attrs.get("first_row", 1))
            sha256 = str(recording.attrs.get("sha256", ""))
    channels = {name: np.asarray(values, dtype=float) for name, values in arrays.items()}
    _check_channels(channels, first_row, where=where, required=required)
    time = channels.pop("time", None)
    if time is not None and rate_hz is not None:
        raise DataError(f"{where}: expected time stamps or rate_hz, got both. Drop rate_hz.")
    if time is None:
        if rate_hz is None or not 0.0 < rate_hz < np.inf:
            raise DataError(
                f"{where}: expected time stamps or rate_hz > 0, got no time and rate_hz "
                f"{rate_hz}. Give time= or rate_hz=."
            )
        n = channels[required[0]].size
        return JointRecord(channels, float(rate_hz), np.arange(n) / rate_hz, sha256)
    _check_time(time, first_row)
    names = list(channels)
    uniform, values = timestamps.resample_stretch(time, np.stack([channels[n] for n in names]))
    rate = (uniform.size - 1) / float(uniform[-1] - uniform[0])
    return JointRecord(dict(zip(names, values, strict=True)), rate, uniform, sha256)


def sign_warnings(kbj: npt.ArrayLike) -> list[str]:
    """Say what negative values of stiffness, damping and inertia may come of."""
    values = np.asarray(kbj, dtype=float)
    if np.all(values < 0.0):
        return [
            "stiffness, damping and inertia are negative: the torque is counted on the other body. "
            "Turn torque_acts_on (--torque-acts-on device, or joint if it was device), or check "
            "the sign of the angle"
        ]
    names = ("stiffness", "damping", "inertia")
    return [
        f"{name} is negative" + (": gravity or body weight may act so" * (name == "stiffness"))
        for name, value in zip(names, values, strict=True)
        if value < 0.0
    ]


def _check_channels(
    channels: Mapping[str, np.ndarray], first_row: int, *, where: str, required: tuple[str, ...]
) -> None:
    problems = [
        f"no channel '{name}'; give it as a column or as {name}=."
        for name in required
        if name not in channels
    ]
    lengths = {name: values.shape for name, values in channels.items()}
    if len(set(lengths.values())) > 1 or any(len(shape) != 1 for shape in lengths.values()):
        problems.append(
            f"channels must be one-dimensional and equally long, got {lengths}; channels sampled "
            "at different rates must be resampled to one first."
        )
    if any(values.size < 2 for values in channels.values()):
        problems.append(f"at least two samples are needed, got {lengths}.")
    for name, values in channels.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            problems.append(
                f"channel '{name}' has {bad.size} sample(s) without a number, the first in row "
                f"{first_row + int(bad[0])}; cut the record there or fill them yourself."
            )
    if problems:
        raise DataError(f"{where}: " + " ".join(problems))


def _check_time(time: np.ndarray, first_row: int) -> None:
    backwards = np.flatnonzero(np.diff(time) <= 0)
    if backwards.size:
        row = first_row + int(backwards[0]) + 1
        raise DataError(f"row {row}: time does not increase. Sort the record.", row=row)
    _check_one_rate(time)
    gaps = timestamps.find_gaps(time)
    if len(gaps):
        start, end = (float(edge) for edge in gaps[0])
        row = first_row + int(np.searchsorted(time, start))
        raise DataError(
            f"row {row}: a gap of {end - start:.4g} s after {start:.6g} s ({len(gaps)} gap(s) in "
            "all); expected one record without gaps. Give the longest stretch between gaps.",
            channel="time",
            row=row,
        )


def _check_one_rate(time: np.ndarray) -> None:
    """Refuse a record that changes its sampling rate: two records put together."""
    if time.size < 2 * _PARTS:
        return
    steps = np.array([np.median(part) for part in np.array_split(np.diff(time), _PARTS)])
    if steps.max() > _LARGEST_RATE_RATIO * steps.min():
        raise DataError(
            f"time: the sampling rate changes inside the record, from {1.0 / steps.max():.4g} to "
            f"{1.0 / steps.min():.4g} Hz; expected one rate. Cut the record where it changes.",
            channel="time",
        )


def refuse_constant(record: JointRecord) -> None:
    """Refuse a record whose angle or torque never changes."""
    for name, code in (("angle", Failure.CONSTANT_ANGLE), ("torque", Failure.CONSTANT_TORQUE)):
        values = record.channels[name]
        if np.ptp(values) <= 1e-12 * np.abs(values).max():
            raise EstimationError(
                code.value,
                f"the {name} is constant ({values[0]:.6g}): nothing to identify. Check the column.",
            )
