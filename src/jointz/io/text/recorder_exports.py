"""Text exports of recorders: tables below lines that state their names, units and rates."""

import csv
import io
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, groupby, pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from jointz.core.acquisition import Acquisition, Signal, SignalGroup
from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.formats.columns import file_error
from jointz.io.text.column_names import READING, padded, unique_names, unit_in_name
from jointz.io.text.delimited import MISSING_TEXT, decompressed_text
from jointz.io.text.text_bytes import (
    is_compressed,
    likely_encoding,
    open_text_bytes,
    reading_errors,
)

_FIRST_LINES = 40
#: A line of samples: its first cell that is not empty is a number, or a time of day.
_SAMPLE = re.compile(r"[\s,;]*[-+]?[.,]?\d[\d.,:]*(?:E[-+]?\d+)?\s*(?:[,;\t]|$)", re.IGNORECASE)
_TIME = re.compile(r"X ?\[s\](?:\.\d+)?|X_Value")  # a column of time, s
_COMMA = re.compile(r"\d,\d")
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6}


class _Head(NamedTuple):
    """Names, units and clock of a table; a column without a name is dropped."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    delimiter: str = "\t"
    group: str = ""
    rate_hz: float | None = None  # holds where no column has the time
    start_s: float = 0.0


#: Lines above a table, and the lines of its samples.
_Block = tuple[list[str], list[str]]
_Tables = Iterator[tuple[_Head, list[str]]]
#: Group, number of samples, rate, time of the first sample, and the bytes of stamps instead.
_Clock = tuple[str, int, float | None, float, bytes]


def recorder_of(path: Path, files: FilesSpec) -> str:
    """Return whose export a text file is; "" if none is known or its layout is stated."""
    if files.skip_rows or files.delimiter or not files.header or is_compressed(path):
        return ""
    try:
        lines = decompressed_text(path, _FIRST_LINES, files.encoding or likely_encoding(path))
    except DataError:
        return ""
    first = "\n".join(lines)
    return next((name for name, (mark, _) in _RECORDERS.items() if mark.search(first)), "")


def read_export(path: Path, files: FilesSpec, recorder: str) -> Acquisition:
    """Return the signals of an export, a group for each clock."""
    with (
        reading_errors(path),
        open_text_bytes(path, files.encoding or likely_encoding(path)) as stream,
    ):
        lines = stream.read().decode("utf-8-sig").splitlines()
    parts = [(k, list(part)) for k, part in groupby(lines, lambda a: bool(_SAMPLE.match(a)))]
    blocks = [(head, body) for (is_body, head), (_, body) in pairwise(parts) if not is_body]
    try:
        clocks = _by_clock(_RECORDERS[recorder][1](blocks))
    except (ValueError, LookupError, RuntimeError, ArithmeticError) as exc:
        raise file_error(
            path,
            f"begins as an export of {recorder} and cannot be read as one ({exc}). Give its layout "
            "(--skip-rows, --delimiter), or copy or export it again.",
        ) from exc
    names = unique_names([clock[0] or "clock" for clock in clocks]) if len(clocks) > 1 else [""]
    groups = tuple(map(_group, names, clocks, clocks.values()))
    note = f"an export of {recorder}: names, units and rates are those it states"
    return Acquisition(groups, (), {f"{READING}recorder": note})


def _by_clock(tables: _Tables) -> dict[_Clock, list[Signal]]:
    whole: dict[_Head, list[str]] = {}
    for head, body in tables:  # segments below the same head go on
        whole.setdefault(head, []).extend(body)
    clocks: dict[_Clock, list[Signal]] = {}
    for clock, signals in chain.from_iterable(map(_signals, whole, whole.values())):
        clocks.setdefault(clock, []).extend(signals)
    if not clocks:
        raise ValueError("no samples")
    return clocks


def _group(name: str, clock: _Clock, signals: Sequence[Signal]) -> SignalGroup:
    names = unique_names([signal.name for signal in signals])
    own = tuple(replace(signal, name=n) for signal, n in zip(signals, names, strict=True))
    *_, rate_hz, start_s, stamps = clock
    if stamps:
        return SignalGroup(name, own, time_s=np.frombuffer(stamps))
    return SignalGroup(name, own, rate_hz, start_s)


def _signals(head: _Head, body: Sequence[str]) -> Iterator[tuple[_Clock, list[Signal]]]:
    """Yield the signals behind each column of time, or all of them by the stated rate."""
    columns = _numbers(head, body)
    clocks = [k for k, name in enumerate(head.names) if _TIME.fullmatch(name)]
    for first, last in pairwise([*(clocks or [-1]), len(head.names)]):
        time_s = columns.get(first, np.arange(len(body)))
        rows = np.flatnonzero(np.isfinite(time_s))
        steps = np.diff(time_s[rows])
        stamped = bool((steps != 1.0).any())  # else X counts the samples
        rows = rows if rows.size else np.arange(len(body))
        for at in np.split(rows, np.flatnonzero(steps <= 0.0) + 1):
            stamps = time_s[at].tobytes() if stamped else b""
            own = [k for k in columns if first < k < last]
            signals = [Signal(head.names[k], columns[k][at], head.units[k]) for k in own]
            yield (head.group, at.size, head.rate_hz, head.start_s, stamps), signals


def _numbers(head: _Head, body: Sequence[str]) -> dict[int, np.ndarray]:
    """Return the samples of each column that has a name."""
    named = [k for k, name in enumerate(head.names) if name]
    if body[-1].count(head.delimiter) < named[-1]:
        raise ValueError("the last row is cut off")
    frame = pd.read_csv(
        io.StringIO("\n".join(body)), sep=head.delimiter, header=None, index_col=False,
        decimal="," if head.delimiter != "," and _COMMA.search("\n".join(body[:100])) else ".",
        names=range(len(head.names) + 1), na_values=MISSING_TEXT,
        dtype=dict.fromkeys(named, np.float64), skipinitialspace=head.delimiter != "\t",
    )  # fmt: skip
    return {k: frame[k].to_numpy() for k in named}


def _cells(line: str, delimiter: str = "\t") -> list[str]:
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]


# --- one function a recorder ------------------------------------------------------------------


def _labview(blocks: Sequence[_Block]) -> _Tables:
    delimiter = next(line[9] for line in blocks[0][0] if line.startswith("Separator"))
    stated: dict[str, list[str]] = {}
    for head, body in blocks:
        *above, names = (_cells(line, delimiter) for line in head)
        stated |= {row[0]: row[1:] for row in above if row}
        step_s = float(stated["Delta_X"][0].replace(",", "."))
        units = iter(stated.get("Y_Unit_Label", ()))
        own = tuple("s" if name == "X_Value" else next(units, "") for name in names)
        kept = tuple("" if name == "Comment" else name for name in names)
        # One second between samples is LabVIEW's default, which nobody stated.
        yield _Head(kept, own, delimiter, rate_hz=None if step_s in (0, 1) else 1.0 / step_s), body


def _labchart(blocks: Sequence[_Block]) -> _Tables:
    for head, body in blocks:
        stated = {row[0]: row[1:] for row in map(_cells, head) if row}
        number, unit = stated["Interval="][0].replace(",", ".").split()
        names = [name for name in stated["ChannelTitle="] if name]
        ranges = [text.rpartition(" ")[2] for text in stated.get("Range=", ())]
        units = padded(stated.get("UnitName=", ranges), len(names))
        filled = [cell for cell in _cells(body[0]) if cell and not cell.startswith("#")]  # comment
        before = ["X_Value", ""][: len(filled) - len(names)]  # a date may follow the time
        rate_hz = 1.0 / (float(number) * _SECONDS[unit])
        yield _Head((*before, *names), (*before, *units), rate_hz=rate_hz), body


def _spike2(blocks: Sequence[_Block]) -> _Tables:
    rates: dict[str, list[float]] = {}
    rows: list[list[str]] = []
    for head, body in blocks:
        rows += [_cells(line) for line in head if line.strip()]
        # A row of the summary: number, kind, title, unit, rates of a channel.
        rates |= {row[0]: [*map(float, row[4:])] for row in rows if len(row) > 5}
        if rows[-1][0] == "START":
            at = max(k for k, row in enumerate(rows) if row[0] == "CHANNEL")
            (_, number), _kind, _comment, (title, *_), (unit, *_) = rows[at : at + 5]
            _, start_s, step_s = rows[-1]
            rate_hz = 1.0 / float(step_s)  # of few digits
            rate_hz = min((*rates[number], rate_hz), key=lambda hz: abs(hz - rate_hz))
            yield _Head((title,), (unit,), "\t", "", rate_hz, float(start_s)), body
            rows = []


def _nexus(blocks: Sequence[_Block]) -> _Tables:
    for ((*_, section), (rate, *_)), (head, body) in zip(blocks[::2], blocks[1::2], strict=True):
        over, names, units = (_cells(line, ",") for line in head[:3])
        device, full = "", []
        for above, name in zip(padded(over, len(names)), names, strict=True):
            device = above or device
            full.append(f"{device}.{name}" if device and name else "")
        own = tuple(padded(units, len(names)))
        yield _Head(tuple(full), own, ",", section.strip(' ",'), float(rate.strip(" ,"))), body


def _emgworks(blocks: Sequence[_Block]) -> _Tables:
    for head, body in blocks:
        delimiter = next(sign for sign in "\t;," if sign in head[-1])
        names = tuple(_cells(head[-1], delimiter))
        yield _Head(names, tuple(map(unit_in_name, names)), delimiter), body


#: Recorder -> mark in the first lines of its export, and what takes it apart.
_RECORDERS: Mapping[str, tuple[re.Pattern[str], Callable[[Sequence[_Block]], _Tables]]] = {
    "LabVIEW": (re.compile(r"\ALabVIEW Measurement"), _labview),
    "LabChart": (re.compile(r"\AInterval=\t"), _labchart),
    "Spike2": (re.compile(r'\A"INFORMATION"[\s\S]*^"SUMMARY"', re.MULTILINE), _spike2),
    "Vicon Nexus": (re.compile(r"^Frame,Sub Frame,", re.MULTILINE), _nexus),
    "Delsys EMGworks": (re.compile(r'^"?X ?\[s\]"?[,;\t]', re.MULTILINE), _emgworks),
}
