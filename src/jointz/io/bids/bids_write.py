"""Writer of one recording's files in a Motion-BIDS folder."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.errors import DataError
from jointz.io.bids.bids_read import CLOCK_CHANNEL, CLOCK_START, EVENT_COUNT, OWN, SAMPLE_COUNT
from jointz.io.bids.bids_tables import NOTHING

_TYPES = ("ACCEL", "ANGACCEL", "GYRO", "JNTANG", "LATENCY", "MAGN", "MISC", "ORNT", "POS", "VEL")
_COLUMNS = (
    *("name", "component", "type", "tracked_point", "units", "placement", "reference_frame"),
    *("description", "positive_direction"),
)
_POSITIVE = "positive_direction"
_CHANNELS_JSON = {
    _POSITIVE: {
        "LongName": "Positive direction",
        "Description": "Direction of the joint in which the channel counts positive.",
    },
    "description": {"Description": "What the channel holds."},
    "reference_frame": {
        "Description": "Not used: angles and torques are about the joint's own axis."
    },
}
_EVENTS_JSON: Mapping[str, dict[str, Any]] = {
    "trial_type": {
        "Description": "What happened.",
        "Levels": {"pulse": "A perturbation of the joint by the device."},
    },
    "amplitude": {
        "Description": "Amplitude of the pulse, signed in the study's direction.",
    },
    "timing_point": {"Description": "Point of the gait cycle at which the pulse was due."},
}


@dataclass(frozen=True, slots=True, eq=False)
class MotionChannel:
    """One channel of a recording."""

    name: str
    values: np.ndarray  # SI, (n,); NaN if missing
    kind: str  # type in BIDS, such as ``JNTANG``
    unit: str  # SI unit in the spelling of jointz
    tracked_point: str  # joint with side, or ``device``
    description: str  # meaning, for people
    positive: str = ""  # positive direction; "" for none


@dataclass(frozen=True, slots=True, eq=False)
class MotionRecording:
    """A recording as Motion-BIDS has it."""

    # entity -> label, in the order of BIDS: ``sub``, ``ses``, ``task``, ``tracksys``, ``acq``,
    # ``run``
    entities: Mapping[str, str]
    time_s: np.ndarray  # time stamps, (n,), increasing
    nominal_hz: float  # sampling rate, used if the time stamps are not uniform
    channels: tuple[MotionChannel, ...]
    sidecar: Mapping[str, Any] = field(default_factory=dict)  # further keys of its sidecar in BIDS
    # further keys, unknown to BIDS: joint, side, condition, directions
    told: Mapping[str, Any] = field(default_factory=dict)
    # ``onset_s`` in the time of ``time_s``, ``duration_s``, ``amplitude``, ``timing_point`` of each
    # pulse
    events: Sequence[Mapping[str, Any]] = ()
    # unit of the pulses' amplitudes: ``N*m``, or ``rad`` for steps of the angle
    amplitude_unit: str = "N*m"

    @property
    def stem(self) -> str:
        """Its name without suffix and ending."""
        return "_".join(f"{name}-{label}" for name, label in self.entities.items())

    @property
    def folder(self) -> str:
        """The folder it belongs to."""
        parts = [f"{n}-{self.entities[n]}" for n in ("sub", "ses") if n in self.entities]
        return "/".join([*parts, "motion"])


def write_motion(recording: MotionRecording, root: Path) -> list[str]:
    """Write samples, sidecar, channels and events of a recording."""
    rate, start = even_clock(recording.time_s)
    channels = recording.channels
    if rate is None:
        taken = {channel.name for channel in channels}
        channels = (*_clock_channels(recording.time_s, taken), *channels)
    _check_finite(recording.stem, channels)
    about = {
        "Description": "About the recording: what Motion-BIDS has no keys for.",
        CLOCK_START: start,
        SAMPLE_COUNT: recording.time_s.size,
        EVENT_COUNT: len(recording.events),
        **({} if rate is not None else {CLOCK_CHANNEL: "time"}),
        **recording.told,
    }
    files = {
        "motion.tsv": _samples(channels),
        "motion.json": json_text(_sidecar(recording, channels, rate=rate)),
        "channels.tsv": _table(_COLUMNS, [_channel_row(c) for c in channels]),
        "channels.json": json_text({**_CHANNELS_JSON, OWN: about}),
    }
    if recording.events:
        columns = ("onset", "duration", "trial_type", "amplitude", "timing_point")
        rows = [_event_row(e, float(recording.time_s[0])) for e in recording.events]
        files["events.tsv"] = _table(columns, sorted(rows, key=lambda row: float(row[0])))
        amplitude = {**_EVENTS_JSON["amplitude"], "Units": _bids_unit(recording.amplitude_unit)}
        files["events.json"] = json_text({**_EVENTS_JSON, "amplitude": amplitude})
    folder = root / recording.folder
    folder.mkdir(parents=True, exist_ok=True)
    names = []
    for ending, text in files.items():
        name = f"{recording.folder}/{recording.stem}_{ending}"
        (root / name).write_text(text, encoding="utf-8", newline="\n")
        names.append(name)
    return names


def even_clock(time_s: np.ndarray) -> tuple[float | None, float]:
    """Return the rate and the start that give time stamps back bit for bit; None: none does."""
    start = float(time_s[0])
    mean = (time_s.size - 1) / float(time_s[-1] - start)
    steps = np.arange(time_s.size)
    for digits in (3, 6, 9, 12, 17):
        rate = float(f"{mean:.{digits}g}")
        if np.array_equal(start + steps / rate, time_s):
            return rate, start
    return None, start


def _clock_channels(time_s: np.ndarray, taken: set[str]) -> tuple[MotionChannel, ...]:
    """Return latencies to the microsecond, as BIDS wants them, and the exact clock beside them."""
    latency = np.round(time_s - time_s[0], 6)
    about = "Time since the first sample, rounded to a microsecond."
    exact = "The recording's own clock, to the last digit."
    return (
        MotionChannel(_free_name("latency", taken), latency, "LATENCY", "s", NOTHING, about),
        MotionChannel("time", time_s, "MISC", "s", NOTHING, exact),
    )


def _free_name(name: str, taken: set[str]) -> str:
    """Return a name that no channel of the study has."""
    numbered = (f"{name}_{k}" for k in range(2, len(taken) + 3))
    return next(n for n in chain([name], numbered) if n not in taken)


def _check_finite(stem: str, channels: Sequence[MotionChannel]) -> None:
    for channel in channels:
        endless = np.flatnonzero(np.isinf(channel.values))
        if endless.size:
            raise DataError(
                f"{stem}: channel '{channel.name}', sample {int(endless[0]) + 1}: expected a "
                "number or a missing sample, found infinity, which BIDS cannot hold. Correct the "
                "recording.",
                channel=channel.name,
            )


def _samples(channels: Sequence[MotionChannel]) -> str:
    columns = [[_cell(v) for v in channel.values.tolist()] for channel in channels]
    for k, channel in enumerate(channels):
        if channel.kind == "LATENCY":
            columns[k] = [f"{v:.6f}" for v in channel.values.tolist()]
    return "".join("\t".join(row) + "\n" for row in zip(*columns, strict=True))


def _cell(value: float) -> str:
    return NOTHING if value != value else repr(value)


def _sidecar(
    recording: MotionRecording,
    channels: Sequence[MotionChannel],
    *,
    rate: float | None,
) -> dict[str, Any]:
    time = recording.time_s
    seconds = float(time[-1] - time[0])
    content: dict[str, Any] = {"TaskName": recording.entities["task"]}
    content["SamplingFrequency"] = recording.nominal_hz if rate is None else rate
    content["SamplingFrequencyEffective"] = (time.size - 1) / seconds
    content["RecordingDuration"] = time.size * seconds / (time.size - 1)
    content["RecordingType"] = "continuous"
    content["MotionChannelCount"] = len(channels)
    content |= {f"{kind}ChannelCount": sum(c.kind == kind for c in channels) for kind in _TYPES}
    points = {c.tracked_point for c in channels} - {NOTHING}
    content["TrackedPointsCount"] = len(points)
    content["MissingValues"] = NOTHING
    return content | dict(recording.sidecar)


def _channel_row(channel: MotionChannel) -> list[str]:
    cells = [channel.name, NOTHING, channel.kind, channel.tracked_point]
    cells += [_bids_unit(channel.unit), NOTHING, NOTHING, channel.description]
    return [*(cell or NOTHING for cell in cells), channel.positive or NOTHING]


def _bids_unit(unit: str) -> str:
    return unit.replace("*", ".")


def _event_row(event: Mapping[str, Any], start_s: float) -> list[str]:
    onset = repr(float(event["onset_s"]) - start_s)
    length, size = float(event["duration_s"]), float(event["amplitude"])
    return [onset, _cell(length), "pulse", _cell(size), str(event["timing_point"]) or NOTHING]


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [columns, *rows]
    return "".join("\t".join(" ".join(cell.split()) for cell in line) + "\n" for line in lines)


def json_text(content: Mapping[str, Any]) -> str:
    """Return a table as JSON for people: indented, with letters of any language as they are."""
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"
