"""Content of a file of any format: groups of signals, each with its own clock, and events.

A study's recording (:mod:`jointz.core.recording`) has one clock and SI units; a file of a
laboratory has what its maker put there: markers at 100 Hz, analog channels at 1000 Hz, units as
they were typed. An acquisition says what stands there, and changes nothing.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class Signal:
    """One column of samples, as it stands in the file."""

    name: str  # as in the file; unique in its group
    values: np.ndarray  # float64, NaN if missing; or str objects, "" if missing
    unit: str = ""  # as in the file; "" if not stated
    description: str = ""  # as in the file; "" if not stated
    # name of the column in a study, if it differs from ``name``; set by the reader of a file, no
    # part of the content
    column: str = ""

    def __post_init__(self) -> None:
        """Check shape and kind."""
        if self.values.ndim != 1 or self.values.dtype.kind not in ("f", "O"):
            message = f"signal '{self.name}': expected one column of float64 or of str objects"
            raise ValueError(message)

    @property
    def is_text(self) -> bool:
        """Whether the samples are text."""
        return self.values.dtype.kind == "O"


@dataclass(frozen=True, slots=True, eq=False)
class SignalGroup:
    """Signals that were sampled together."""

    name: str  # unique in its acquisition, such as ``points`` or ``analogs``; "" for the only group
    signals: tuple[Signal, ...]  # all of the same length
    # rate of a uniform clock; None with time stamps or without a clock
    rate_hz: float | None = None
    start_s: float = 0.0  # time of the first sample on a uniform clock
    time_s: np.ndarray | None = None  # time stamps, (n,); None without
    time_column: str = ""  # name of the clock's column in a study; "" if unknown or none
    # whether the file states the unit of its time stamps; seconds are assumed otherwise
    time_unit_stated: bool = True

    def __post_init__(self) -> None:
        """Check that lengths and names go together."""
        lengths = {len(signal.values) for signal in self.signals}
        if self.time_s is not None:
            lengths.add(len(self.time_s))
        if len(lengths) > 1:
            raise ValueError(f"group '{self.name}': signals of different length: {lengths}")
        names = [signal.name for signal in self.signals]
        if len(set(names)) < len(names):
            repeated = sorted({name for name in names if names.count(name) > 1})
            raise ValueError(f"group '{self.name}': more than one signal named {repeated}")
        if self.rate_hz is not None and self.time_s is not None:
            raise ValueError(f"group '{self.name}': a rate and time stamps; expected one of them")

    @property
    def n_samples(self) -> int:
        """Samples of each signal."""
        if self.time_s is not None:
            return len(self.time_s)
        return len(self.signals[0].values) if self.signals else 0

    def times_s(self) -> np.ndarray | None:
        """Return the time of every sample, None where the file has no clock."""
        if self.time_s is not None or self.rate_hz is None:
            return self.time_s
        return self.start_s + np.arange(self.n_samples) / self.rate_hz


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened at a time."""

    time_s: float  # on the clock of the file
    label: str
    duration_s: float = 0.0  # 0 for a moment, NaN if unknown


@dataclass(frozen=True, slots=True, eq=False)
class Acquisition:
    """The content of a file."""

    groups: tuple[SignalGroup, ...]  # in the order of the file
    events: tuple[Event, ...] = ()  # in order of time
    # dotted name -> text: ``subject.name``, ``device.serial``
    metadata: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check that the groups' names differ."""
        names = [group.name for group in self.groups]
        if len(set(names)) < len(names):
            raise ValueError(f"more than one group of one name: {names}")
