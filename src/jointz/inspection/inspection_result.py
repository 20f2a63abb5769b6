"""Result of an inspection: channels, clocks, gaps, and a study to start from."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from jointz.results.base import Result
from jointz.results.figure_style import Axes, axes_or_new, in_figure_style

_BLOCKS = "▁▂▃▄▅▆▇█"
_NOTHING = "·"
#: Smaller differences of steps are due to rounding.
_LEAST_JITTER_MS = 1e-6
_LONGEST_LIST = 3
_COLUMNS = (
    *("group", "column", "channel", "guess", "unit", "unit_is", "n", "n_missing"),
    *("low", "high", "notes"),
)


@dataclass(frozen=True, slots=True)
class SeenChannel:
    """One column of a file."""

    # group of signals that were sampled together, named as in the file; "" for the only one
    group: str
    column: str  # name in a study, or number if the file has no names
    title: str = ""  # name in the file, if ``column`` is a number
    channel: str = ""  # the assigned channel of a study, "" for none
    guess: str = ""  # reason for the assignment
    unit: str = ""  # stated by the file or guessed, "" for neither
    unit_is: str = ""  # ``stated``, ``guessed`` or ""
    n: int = 0  # number of samples
    n_missing: int = 0  # number of samples without a number; for text, of empty ones
    low: float | None = None  # smallest number, in the unit of the file
    high: float | None = None  # largest number, in the unit of the file
    levels: tuple[str, ...] = ()  # different values of a text, or of few different numbers
    # remarks for the user: constant, saturated, impossibly large
    notes: tuple[str, ...] = ()
    # means of equal parts of the column, in the unit of the file; None without a number
    outline: tuple[float | None, ...] = ()

    @property
    def name(self) -> str:
        """Name for people: the name in the file, with its number if that is the key."""
        own = f"column {self.column} '{self.title}'" if self.title else self.column
        return f"{self.group}/{own}" if self.group else own

    def thumbnail(self) -> str:
        """Return the course as a line of small blocks, with dots where numbers are missing."""
        last = len(_BLOCKS) - 1
        return "".join(
            _NOTHING if height is None else _BLOCKS[round(height * last)]
            for height in self.heights()
        )

    def heights(self) -> tuple[float | None, ...]:
        """Return the course scaled to 0 (lowest mean) to 1 (highest mean)."""
        means = [value for value in self.outline if value is not None]
        if not means:
            return self.outline
        largest = max(map(abs, means)) or 1.0  # the span of huge numbers has no room in a float
        low, high = min(means) / largest, max(means) / largest
        span = (high - low) or 1.0
        return tuple(None if v is None else (v / largest - low) / span for v in self.outline)


@dataclass(frozen=True, slots=True)
class SeenClock:
    """The clock of signals that were sampled together."""

    group: str  # "" for the only group
    # name of the column of time stamps; ``rate`` if the file states a rate; "" without a clock
    source: str
    n: int  # number of samples
    rate_hz: float | None = None  # stated rate, or rate of the stamps
    start_s: float | None = None  # first stamp
    end_s: float | None = None  # last stamp
    uniform: bool = False  # whether the stamps are equally spaced, without gaps
    jitter_ms: float | None = None  # standard deviation of the time steps, without gaps
    # s: last stamp before and first stamp after each gap
    gaps: tuple[tuple[float, float], ...] = ()
    # index of each sample at which time starts again, as of a new trial
    restarts: tuple[int, ...] = ()
    n_back: int = 0  # number of missing, repeated or unordered stamps, without restarts

    def text(self) -> str:
        """Return a description of the clock."""
        if self.rate_hz is None:
            return f"{self.n} samples without a clock"
        jitter_ms = self.jitter_ms or 0.0
        regular = self.uniform or jitter_ms < _LEAST_JITTER_MS
        even = "evenly" if regular else f"with {jitter_ms:.3g} ms of jitter"
        parts = [f"{self.n} samples, {self.rate_hz:.6g} Hz {even}"]
        if self.start_s is not None and self.end_s is not None:
            parts.append(f"{self.start_s:.6g} to {self.end_s:.6g} s")
        parts.append(self._gap_text())
        if self.restarts:
            parts.append(f"time begins again {len(self.restarts)} time(s)")
        if self.n_back:
            parts.append(f"{self.n_back} stamp(s) missing, repeated or out of order")
        return ", ".join(parts)

    def _gap_text(self) -> str:
        if not self.gaps:
            return "no gaps"
        longest = sorted(self.gaps, key=lambda g: g[0] - g[1])[:_LONGEST_LIST]
        shown = "; ".join(f"{1e3 * (b - a):.0f} ms at {a:.6g} s" for a, b in longest)
        return f"{len(self.gaps)} gap(s), the longest {shown}"


@dataclass(frozen=True, slots=True)
class Answer:
    """A possible answer to a question, and what speaks for it."""

    value: str | float | None  # as in the study file; None for leaving the key out
    why: str


@dataclass(frozen=True, slots=True)
class Question:
    """Question about a proposed study, with its possible answers."""

    about: str  # key of the study file
    text: str
    answers: tuple[Answer, ...] = ()
    drafted: bool = True  # whether the proposed study has the first answer; else it is open

    def in_a_line(self) -> str:
        """Return the question and its answers on one line."""
        answers = (
            f"{'(leave out)' if a.value is None else a.value}{f' ({a.why})' if a.why else ''}"
            for a in self.answers
        )
        return " ".join([self.text, "; ".join(answers)]).strip()

    def lines(self) -> list[str]:
        """Return the question and its answers, a line each."""
        marks = ["* " if self.drafted else "  ", *["  "] * len(self.answers)]
        values = ["(leave out)" if a.value is None else a.value for a in self.answers]
        lines = [
            f"    {mark}{value}: {a.why}" if a.why else f"    {mark}{value}"
            for mark, value, a in zip(marks, values, self.answers, strict=False)
        ]
        return [f"  ? {self.text}  [{self.about}]", *lines]


@dataclass(frozen=True, slots=True)
class SeenRecording:
    """A recording that was found, and what its name and samples say of it."""

    file: str
    participant: str
    condition: str  # "" where a column holds the conditions
    part: str = ""  # of the file
    session: str = ""
    side: str = ""
    perturbations: str = ""  # its pulse table
    n: int = 0  # number of samples
    rate_hz: float | None = None

    def text(self) -> str:
        """Return a line about the recording."""
        words = [self.participant, self.condition, self.session, self.side]
        rate = f", {self.rate_hz:.6g} Hz" if self.rate_hz else ""
        table = f", pulses in {self.perturbations}" if self.perturbations else ""
        part = f" ({self.part})" if self.part else ""
        label = " ".join(filter(None, words))
        return f"  {self.file}{part}: {label}: {self.n} samples{rate}{table}"


@dataclass(frozen=True, slots=True, repr=False)
class Inspection(Result):
    """Content of a file or folder, the assigned channels, and a ``study.toml`` to edit."""

    SCHEMA: ClassVar[str] = "jointz.Inspection/1"

    file: str  # name of the file
    # keys of ``[files]`` of a study for a text file; empty for other formats
    layout: Mapping[str, Any] = field(default_factory=dict)
    channels: tuple[SeenChannel, ...] = ()  # columns of the file
    clocks: tuple[SeenClock, ...] = ()  # one for each group of signals
    n_events: int = 0  # number of events in the file
    notes: tuple[str, ...] = ()  # remarks for the user
    obstacles: tuple[str, ...] = ()  # reasons why this file alone cannot be analysed
    advice: tuple[str, ...] = ()  # commands that can use the file
    toml: str = ""  # a ``study.toml`` with its guesses marked
    questions: tuple[Question, ...] = ()  # what the files do not say and a person must
    recordings: tuple[SeenRecording, ...] = ()  # what the study is proposed for

    @property
    def n_guesses(self) -> int:
        """Number of marked guesses in the study."""
        return self.toml.count("# guess:")

    def channel(self, name: str) -> SeenChannel | None:
        """Return the column of a channel of a study, None if there is none."""
        return next((c for c in self.channels if c.channel == name), None)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a column of the file."""
        rows = [
            {name: getattr(c, name) for name in _COLUMNS if name != "notes"}
            | {"notes": " ".join(c.notes)}
            for c in self.channels
        ]
        return pd.DataFrame(rows, columns=list(_COLUMNS)).astype({"low": float, "high": float})

    def summary(self) -> str:
        """Return clocks, a line with a thumbnail for each column, notes and obstacles."""
        lines = [f"{self.file}: {len(self.channels)} column(s)"]
        if self.layout:
            stated = (f"{k} {value!r}" for k, value in self.layout.items() if value is not None)
            lines.append(f"  layout: {', '.join(stated)}")
        lines += [
            f"  {clock.group + ': ' if clock.group else ''}{clock.text()}" for clock in self.clocks
        ]
        if self.n_events:
            lines.append(f"  {self.n_events} event(s)")
        width = max((len(c.name) for c in self.channels), default=0)
        lines += [line for c in self.channels for line in _channel_text(c, width)]
        lines += [f"  Note: {note}" for note in self.notes]
        lines += [f"  Cannot be analysed as it is: {reason}" for reason in self.obstacles]
        lines += [f"  {advice}" for advice in self.advice]
        if len(self.recordings) > 1:
            lines += ["", f"{len(self.recordings)} recordings (the columns above are the first's):"]
            lines += [recording.text() for recording in self.recordings]
        if self.questions:
            lines += [
                "",
                f"To decide ({len(self.questions)}): the proposed study has the answers with a *, "
                'and "?" where none has one.',
            ]
            lines += [line for question in self.questions for line in question.lines()]
        return "\n".join(lines)

    @in_figure_style
    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the course of every column, each on its own scale."""
        drawn = [c for c in self.channels if any(v is not None for v in c.outline)]
        axes = axes_or_new(ax, (7.0, max(2.0, 0.45 * len(drawn) + 0.8)))
        for k, channel in enumerate(reversed(drawn)):
            course = np.array([np.nan if v is None else v for v in channel.heights()])
            where = (np.arange(course.size) + 0.5) / course.size
            axes.plot(where, k + 0.8 * course, linewidth=1.2)
        labels = [f"{c.name} {f'({c.unit})' if c.unit else ''}".strip() for c in reversed(drawn)]
        axes.set_yticks(np.arange(len(drawn)) + 0.4, labels, fontsize="small")
        axes.set_xlabel("share of the file")
        axes.set_ylabel("columns, each on its own scale")
        axes.set_title(self.file, fontsize="medium")
        return axes


def _channel_text(channel: SeenChannel, width: int) -> list[str]:
    mark = "?" if channel.unit_is == "guessed" else ""
    if channel.low is not None and channel.high is not None:
        found = f"{channel.low:.6g} to {channel.high:.6g} {channel.unit}{mark}".strip()
    else:
        found = _level_text(channel.levels) if channel.levels else "no numbers"
    if channel.n_missing:
        found += f", {channel.n_missing} missing"
    assignment = f" -> {channel.channel} ({channel.guess})" if channel.channel else ""
    head = f"  {channel.name:<{width}}  {channel.thumbnail()}  {found}{assignment}"
    return [head, *(f"  {'':<{width}}    {note}" for note in channel.notes)]


def _level_text(levels: tuple[str, ...]) -> str:
    more = ", ..." if len(levels) > _LONGEST_LIST else ""
    return f"text: {', '.join(levels[:_LONGEST_LIST])}{more}"
