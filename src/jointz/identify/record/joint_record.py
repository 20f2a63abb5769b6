"""Records of one time series, and requests to identify a joint from one; checked once."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, Self, get_args

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr

from jointz.core import provenance
from jointz.core.channels import RECORD_UNITS
from jointz.core.errors import DataError, EstimationError, UnitError
from jointz.core.units import conversion
from jointz.gait import timestamps
from jointz.identify.preparation.instrument_checks import looks_like_degrees
from jointz.results.impedance_limits import LARGEST_IMPEDANCE, unit_question

#: Parts of a record whose sampling rates are compared, and the largest ratio allowed.
_PARTS = 8
_LARGEST_RATE_RATIO = 1.5
_LARGE_ANGLE_RAD = 0.2

JOINT = "identify_joint"
OPPOSITE_SIGN = (
    "stiffness, damping and inertia are negative: the torque is counted on the other body. Turn "
    "torque_acts_on (device, or joint if it was device), or check the sign of the angle"
)
PARAMETERS = ("stiffness", "damping", "inertia")
Samples = xr.Dataset | Mapping[str, npt.ArrayLike] | pd.DataFrame
Input = Literal["torque", "angle"]
TorqueSide = Literal["joint", "device"]


@dataclass(frozen=True, slots=True)
class JointRecord:
    """Checked samples on a uniform grid, SI, as given."""

    channels: dict[str, np.ndarray]  # canonical name -> samples, SI
    rate_hz: float  # sampling rate
    time: np.ndarray  # s
    sha256: str = ""  # hash of the file, where known

    @property
    def seconds(self) -> float:
        """Length of the record."""
        return self.time.size / self.rate_hz

    def origin(self) -> dict[str, str]:
        """Return the hash of the file and the version of jointz, for the settings of a result."""
        return {"sha256": self.sha256, "jointz": provenance.software()["jointz"]}


@dataclass(frozen=True, slots=True)
class JointRequest:
    """Record of a joint, and the settings that every model of it takes."""

    record: JointRecord  # as recorded
    input: Input  # perturbed signal
    torque_acts_on: TorqueSide
    cutoff_hz: float | None  # None: chosen by the model
    ci_level: float

    @classmethod
    def of(
        cls,
        recording: Samples | None = None,
        arrays: Mapping[str, npt.ArrayLike | None] | None = None,
        *,
        rate_hz: float | None = None,
        units: Mapping[str, str] | None = None,
        input: Input = "torque",
        torque_acts_on: TorqueSide = "joint",
        cutoff_hz: float | None = None,
        ci_level: float = 0.95,
    ) -> Self:
        """Check settings and samples."""
        check_choice("input", input, get_args(Input))
        check_choice("torque_acts_on", torque_acts_on, get_args(TorqueSide))
        check_level(JOINT, ci_level)
        arrays = dict.fromkeys(("angle", "torque", "command", "time")) | dict(arrays or {})
        record = gather_record(recording, arrays, rate_hz=rate_hz, where=JOINT, units=units)
        return cls(record, input, torque_acts_on, cutoff_hz, ci_level)

    @property
    def output(self) -> Input:
        """The signal that answers the perturbed one."""
        return "angle" if self.input == "torque" else "torque"

    def settings(self, **chosen: Any) -> dict[str, Any]:
        """Return the settings of a result: those of its model, then those that all models have."""
        common = {"torque_acts_on": self.torque_acts_on, "ci_level": self.ci_level}
        return chosen | common | self.record.origin()


def check_choice(name: str, value: str, choices: tuple[str, ...]) -> None:
    """Raise ValueError when a setting is not one of its choices."""
    if value not in choices:
        raise ValueError(f"{name}: expected one of {', '.join(choices)}; got {value!r}")


def check_level(where: str, ci_level: float) -> None:
    """Refuse a level of intervals outside of 0 to 1."""
    if not 0.0 < ci_level < 1.0:
        raise DataError(f"{where}: ci_level: expected 0 < ci_level < 1, got {ci_level}. Use 0.95.")


def gather_record(
    recording: Samples | None,
    arrays: Mapping[str, npt.ArrayLike | None],
    *,
    rate_hz: float | None,
    where: str,
    required: tuple[str, ...] = ("angle", "torque"),
    units: Mapping[str, str] | None = None,
) -> JointRecord:
    """Check the channels of a recording, or the arrays, and put them in SI on a uniform grid."""
    present = {name: values for name, values in arrays.items() if values is not None}
    first_row, sha256 = 1, ""
    if recording is not None:
        if present:
            raise ValueError(
                f"give either a recording or arrays; got a recording and {', '.join(present)}"
            )
        present = {name: recording[name] for name in arrays if name in recording}
        if isinstance(recording, xr.Dataset):
            first_row = int(recording.attrs.get("first_row", 1))
            sha256 = str(recording.attrs.get("sha256", ""))
    samples = {name: _samples(values, name, where) for name, values in present.items()}
    channels = _in_si(samples, _stated_units(present), units or {}, where)
    _check_channels(channels, first_row, where=where, required=required)
    time = channels.pop("time", None)
    if time is not None and rate_hz is not None:
        raise DataError(f"{where}: expected time stamps or rate_hz, got both. Drop rate_hz.")
    if time is not None:
        _check_time(time, first_row)
        time, rows = timestamps.resample_stretch(time, np.stack(list(channels.values())))
        rate = (time.size - 1) / float(time[-1] - time[0])
        channels = dict(zip(channels, rows, strict=True))
    elif rate_hz is not None and 0.0 < rate_hz < np.inf:
        time, rate = np.arange(channels[required[0]].size) / rate_hz, float(rate_hz)
    else:
        raise DataError(
            f"{where}: expected time stamps or rate_hz > 0, got no time and rate_hz "
            f"{rate_hz}. Give time= or rate_hz=."
        )
    _refuse_degrees(channels, rate, where)
    return JointRecord(channels, rate, time, sha256)


def _samples(values: npt.ArrayLike, name: str, where: str) -> np.ndarray:
    """Return values as floats, (n,); masked ones are NaN, a row or a column is a vector."""
    array: np.ma.MaskedArray[Any, Any] = np.ma.asarray(values)
    if array.dtype.kind not in "buif":
        raise DataError(
            f"{where}: channel '{name}': expected real numbers, got {array.dtype}. Give times in "
            "s, and other channels in SI or with units=.",
            channel=name,
        )
    filled = np.ma.filled(array.astype(float), np.nan)
    is_vector = filled.ndim == 2 and 1 in filled.shape  # as MATLAB has them
    return np.asarray(filled.ravel() if is_vector else filled)


def _stated_units(channels: Mapping[str, Any]) -> dict[str, str]:
    """Return the unit that each channel of a dataset states."""
    stated = {n: str(getattr(v, "attrs", {}).get("units", "")) for n, v in channels.items()}
    return {name: unit for name, unit in stated.items() if unit}


def _in_si(
    channels: Mapping[str, np.ndarray],
    stated: Mapping[str, str],
    units: Mapping[str, str],
    where: str,
) -> dict[str, np.ndarray]:
    """Return channels in SI, by the unit given or that of a dataset."""
    if not isinstance(units, Mapping):
        raise UnitError(f"{where}: units: expected channel -> unit, got {units!r}.")
    problems = [f"'{name}' is not a channel given." for name in units if name not in channels]
    converted = dict(channels)
    for name, unit in ((n, units.get(n, stated.get(n))) for n in channels):
        if unit is None or name not in RECORD_UNITS:
            continue
        try:
            factor, offset = conversion(unit, RECORD_UNITS[name])
            if name in stated and conversion(stated[name], RECORD_UNITS[name])[0] != factor:
                problems.append(f"'{name}' is given in {unit}, the recording says {stated[name]}.")
        except UnitError as exc:
            problems.append(f"'{name}': {exc}")
        else:
            converted[name] = factor * channels[name] + offset
    if problems:
        raise UnitError(f"{where}: units: {' '.join(problems)}")
    return converted


def value_warnings(kbj: npt.ArrayLike) -> list[str]:
    """Return warnings of negative and of enormous K, B and J, with their likely cause."""
    values = np.asarray(kbj, dtype=float)
    if np.all(values < 0.0):
        return [OPPOSITE_SIGN]
    enormous = np.any(np.abs(values) > LARGEST_IMPEDANCE)
    units = [unit_question(dict(zip(PARAMETERS, values, strict=True)))] if enormous else []
    return units + [
        f"{name} is negative" + (": gravity or body weight may act so" * (name == "stiffness"))
        for name, value in zip(PARAMETERS, values, strict=True)
        if value < 0.0
    ]


def angle_warnings(angle: np.ndarray, *, assumption: str = "one stiffness") -> list[str]:
    """Return a warning where the angle moves further than one linear joint holds."""
    largest = float(np.abs(angle).max())
    if largest <= _LARGE_ANGLE_RAD:
        return []
    return [
        f"the angle moves {largest:.2f} rad from its mean, above {_LARGE_ANGLE_RAD} rad: "
        f"{assumption} may not hold over such a range"
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


def _refuse_degrees(channels: Mapping[str, np.ndarray], rate_hz: float, where: str) -> None:
    angle = channels.get("angle")
    if angle is not None and looks_like_degrees(angle, rate_hz):
        raise DataError(
            f"{where}: channel 'angle' turns further or faster than any joint, as degrees do that "
            'are taken for rad; state its unit: units={"angle": "deg"}, COLUMN:deg in a command.',
            channel="angle",
        )


def _check_time(time: np.ndarray, first_row: int) -> None:
    backwards = np.flatnonzero(np.diff(time) <= 0)
    if backwards.size:
        row = first_row + int(backwards[0]) + 1
        problem = "goes back. Sort the record."
        if (np.diff(time) >= 0).all():
            problem = f"repeats in {backwards.size} rows. Give an even rate: rate_hz (--rate HZ)."
        raise DataError(f"row {row}: time does not increase, it {problem}", row=row)
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


def refuse_constant(record: JointRecord, names: tuple[str, ...] = ("angle", "torque")) -> None:
    """Refuse a record with a constant channel."""
    for name in names:
        values = record.channels[name]
        if np.ptp(values) <= 1e-12 * np.abs(values).max():
            raise EstimationError(
                f"constant_{name}",
                f"the {name} is constant ({values[0]:.6g}): nothing to identify. Check the column.",
            )
