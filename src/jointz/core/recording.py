"""Recording in memory: an ``xarray.Dataset``, validated once.

Schema
------
dimension : ``time``
coordinate ``time`` : (n,) float64, s, finite, strictly increasing.
data variables : (n,) float64 each, SI, ``attrs["units"]`` one of
    :data:`jointz.core.channels.CHANNEL_UNITS`; a channel of the user's own
    keeps its name and the SI unit it was converted to. NaN is a missing sample.
attributes : ``participant``, ``condition``, ``file``, ``session``, ``trial``,
    ``side``, ``joint``, ``positive``, ``contact_kind``, ``trigger_threshold``
    (text, ``""`` where unknown), ``first_row`` (row of the file that the first sample came from),
    ``sha256`` of the file and ``history`` (JSON list, one entry a step).
"""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from jointz.core.channels import CHANNEL_UNITS
from jointz.core.errors import DataError

_TEXT_ATTRIBUTES = (
    "participant",
    "condition",
    "file",
    "session",
    "trial",
    "side",
    "joint",
    "positive",
    "contact_kind",
    "trigger_threshold",
    "sha256",
)


def build_recording(
    time: np.ndarray,
    channels: Mapping[str, np.ndarray],
    *,
    units: Mapping[str, str] | None = None,
    first_row: int = 1,
    history: tuple[dict[str, Any], ...] = (),
    **attributes: str,
) -> xr.Dataset:
    """Build a validated recording from arrays in SI units.

    Parameters
    ----------
    time : (n,) float, s
        Time stamps.
    channels : mapping of str to (n,) float
        Channel name -> samples, SI.
    units : mapping of str to str, optional
        SI unit of each channel; known channels have a default.
    first_row : int
        Row of the source file that holds the first sample, for messages.
    history : tuple of dict
        What was done to the data so far.
    **attributes : str
        ``participant``, ``condition``, ``file``, ``session``, ``trial``,
        ``side``, ``joint``, ``positive``, ``contact_kind``, ``trigger_threshold``, ``sha256``.

    Returns
    -------
    xarray.Dataset
        The recording; see the module's schema.

    Raises
    ------
    DataError
        When the arrays do not make a recording; all problems in one message.

    Examples
    --------
    >>> rec = build_recording(np.arange(3) * 0.001, {"angle": np.zeros(3)})
    >>> rec["angle"].attrs["units"]
    'rad'
    """
    units = dict(units or {})
    data = {
        name: (
            "time",
            np.asarray(values, dtype=float),
            {"units": units.get(name, CHANNEL_UNITS.get(name, ("1",))[0])},
        )
        for name, values in channels.items()
    }
    attrs: dict[str, Any] = dict.fromkeys(_TEXT_ATTRIBUTES, "")
    attrs.update(attributes)
    attrs["first_row"] = first_row
    attrs["history"] = json.dumps(list(history))
    coords = {"time": ("time", np.asarray(time, dtype=float), {"units": "s"})}
    try:
        recording = xr.Dataset(data, coords=coords, attrs=attrs)
    except ValueError as exc:
        shapes = {"time": np.shape(time)} | {name: np.shape(v) for name, v in channels.items()}
        raise DataError(
            f"{attributes.get('file') or 'recording'}: expected one sample of every channel per "
            f"time stamp, got the shapes {shapes}. Give every channel as long as time.",
        ) from exc
    return validate_recording(recording)


def validate_recording(recording: xr.Dataset) -> xr.Dataset:
    """Check a recording against the schema and return it unchanged."""
    where = str(recording.attrs.get("file") or "recording")
    problems = _time_problems(recording) + _channel_problems(recording)
    if problems:
        raise DataError(f"{where}: " + " ".join(problems), path=where)
    return recording


def history_of(recording: xr.Dataset) -> list[dict[str, Any]]:
    """Return the processing history of a recording."""
    entries: list[dict[str, Any]] = json.loads(recording.attrs.get("history", "[]"))
    return entries


def deflection(recording: xr.Dataset) -> np.ndarray:
    """Return the deflection of a bench, (n,) rad: angle minus that of the far side, if recorded.

    That is the channel ``position`` in rad; in another unit it is one of the user's own.
    """
    angle = recording["angle"].to_numpy()
    if "position" not in recording or recording["position"].attrs.get("units") != "rad":
        return angle
    return np.asarray(angle - recording["position"].to_numpy())


def damage_of(recording: xr.Dataset) -> np.ndarray:
    """Return the damaged stretches (n, 2), s, that the recording's history lists as left out."""
    holes = [hole for step in history_of(recording) for hole in step.get("damaged_s", ())]
    try:
        return np.array(holes, dtype=float).reshape(-1, 2)
    except (ValueError, TypeError) as exc:
        where = str(recording.attrs.get("file"))
        raise DataError(
            f"{where}: its history is damaged: expected begin and end of each stretch that was "
            f"left out under damaged_s, got {holes}. Make the recording again.",
            path=where,
        ) from exc


def damage_near(damage_s: np.ndarray, begin_s: float, end_s: float) -> str:
    """Return the first damaged stretch that overlaps a time range, in words; "" for none."""
    near = damage_s[(damage_s[:, 0] <= end_s) & (damage_s[:, 1] >= begin_s)]
    return f"damaged from {near[0, 0]:.3f} to {near[0, 1]:.3f} s" if near.size else ""


def with_history(recording: xr.Dataset, step: str, **arguments: Any) -> xr.Dataset:
    """Return the recording with one more entry in its history."""
    entries = [*history_of(recording), {"step": step, **arguments}]
    return recording.assign_attrs(history=json.dumps(entries))


def _time_problems(recording: xr.Dataset) -> list[str]:
    if "time" not in recording.coords:
        return ["it has no coordinate 'time'."]
    if recording["time"].dims != ("time",) or recording["time"].dtype.kind != "f":
        kind = f"{recording['time'].dtype} over {recording['time'].dims}"
        return [f"its coordinate 'time' holds {kind}, expected float64 seconds over ('time',)."]
    time = recording["time"].to_numpy()
    first_row = int(recording.attrs.get("first_row", 1))
    if time.size < 2:
        return [f"it has {time.size} sample(s); at least two are needed."]
    if not np.isfinite(time).all():
        row = first_row + int(np.flatnonzero(~np.isfinite(time))[0])
        return [f"row {row}: the time stamp is not a number. Repair or remove the row."]
    bad = np.flatnonzero(time[1:] <= time[:-1])
    if bad.size == 0:
        return []
    at = int(bad[0])
    word = "repeats" if time[at + 1] == time[at] else "goes back"
    return [
        f"row {first_row + at + 1}: time {word} ({time[at + 1]:.6g} s after {time[at]:.6g} s; "
        f"{bad.size} such row(s)). Time must increase; sort the file, or separate trials with "
        "[channels.trial]. If stamps repeat for lack of digits, give sample_rate_hz for time."
    ]


def _channel_problems(recording: xr.Dataset) -> list[str]:
    problems = []
    for name, variable in recording.data_vars.items():
        allowed = CHANNEL_UNITS.get(str(name))
        unit = variable.attrs.get("units")
        if variable.dims != ("time",):
            problems.append(f"channel '{name}' has dimensions {variable.dims}, expected ('time',).")
        if variable.dtype.kind != "f":
            problems.append(f"channel '{name}' holds {variable.dtype}, expected float64.")
        if allowed and unit not in allowed:
            problems.append(f"channel '{name}' must be in {' or '.join(allowed)}, got {unit!r}.")
    return problems
