"""The walk behind all files, and the truth of one file."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
DEG = np.pi / 180.0


@dataclass(frozen=True, slots=True)
class Walk:
    """Signals of a right knee in SI units, flexion positive, torque acting on the joint."""

    time: Array
    angle: Array
    torque: Array
    command: Array
    contact: Array

    def at(self, rate_hz: float, start_s: float = 0.0, length_s: float | None = None) -> "Walk":
        """Return the walk at another rate, from `start_s` after its begin."""
        duration = self.time[-1] - self.time[0] - start_s if length_s is None else length_s
        n = round(duration * rate_hz)
        time = self.time[0] + start_s + np.arange(n) / rate_hz
        held = np.clip(np.searchsorted(self.time, time + 1e-9, side="right") - 1, 0, None)
        return Walk(
            time,
            np.interp(time, self.time, self.angle),
            np.interp(time, self.time, self.torque),
            self.command[held],
            self.contact[held],
        )

    def rows(self, kept: NDArray[np.bool_]) -> "Walk":
        """Return the samples that are kept."""
        values = (self.time, self.angle, self.torque, self.command, self.contact)
        return Walk(*(v[kept] for v in values))

    @property
    def clock(self) -> Array:
        """Time since the first sample, s."""
        clock: Array = self.time - self.time[0]
        return clock


@dataclass(frozen=True, slots=True)
class Part:
    """Channels of one stretch of a file, and how finely the file rounds each; all in SI units."""

    values: dict[str, Array]  # NaN: the file has no value here
    step: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Truth:
    """What a careful person would read from a file.

    Attributes
    ----------
    parts
        Stretches of the file; each stretch that was read must equal one of them.
    open
        Words of the thing that is open in the file; ``a&b``: both in one sentence; ``@key``: a
        question about this key of the study file.
    answerable
        False if no answer could be right without knowledge from outside the file.
    hopeless
        True if only a question is right.
    all_parts
        True if every part must be read.
    onsets_s
        Onsets of pulses of a file that has a table of them.
    """

    parts: tuple[Part, ...]
    participant: str = ""
    condition: str = "perturbed"
    open: tuple[str, ...] = ()
    answerable: bool = True
    hopeless: bool = False
    all_parts: bool = False
    onsets_s: tuple[float, ...] = ()


Writer = Callable[[Walk, Path, np.random.Generator], Truth]


@dataclass(frozen=True, slots=True)
class AwkwardFile:
    """A file by name, what is awkward in it, and the function that writes it."""

    name: str
    awkward: str
    write: Writer


def part(walk: Walk, *, omit: tuple[str, ...] = (), **step: float) -> Part:
    """Return the truth of a walk: all channels but `omit`; `step` in SI units."""
    names = ("time", "angle", "torque", "command", "contact")
    values = {name: getattr(walk, name) for name in names if name not in omit}
    return Part(values, {"angle": 0.01 * DEG, "torque": 0.001, "command": 0.001} | step)


People = dict[tuple[int, str], Walk]  # by participant and condition


@dataclass(frozen=True, slots=True)
class FileTruth:
    """What a careful person would read from one recording of a folder.

    Attributes
    ----------
    truth
        Channels, participant, condition and onsets.
    side, session
        Empty: the folder does not say.
    no_onsets
        True if onsets of pulses cannot be known.
    """

    truth: Truth
    side: str = ""
    session: str = ""
    no_onsets: bool = False


@dataclass(frozen=True, slots=True)
class FolderTruth:
    """The recordings of a folder by file name; for the rest see `Truth`."""

    recordings: dict[str, FileTruth]
    open: tuple[str, ...] = ()
    answerable: bool = True
    hopeless: bool = False


FolderWriter = Callable[[People, Path, np.random.Generator], FolderTruth]


@dataclass(frozen=True, slots=True)
class AwkwardFolder:
    """A folder by name, what is awkward in it, and the function that writes its files."""

    name: str
    awkward: str
    write: FolderWriter
