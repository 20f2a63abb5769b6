"""OpenSim's motion and storage files, .mot and .sto: a header and a table with ``time``.

The header says ``inDegrees``, or "Angles are in degrees.", once for the whole file, and it holds
for rotational coordinates only: translations in the same table are in m, forces in N. So a unit of
angle is stated for a column that is, by the name OpenSim gives it, a rotational coordinate or its
speed; every other column has no unit, and its description says so. A header that says both degrees
and radians states both units.
"""

import json
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jointz.core.acquisition import Acquisition, Signal, SignalGroup
from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.formats.columns import file_error
from jointz.io.formats.group_format import GroupFormat
from jointz.io.formats.losses import NOTE
from jointz.io.text.column_names import EITHER, READING

#: The words by which OpenSim names rotational coordinates. ``add`` and ``flex`` stand behind the
#: joint there; at the beginning of a name they are muscles: ``add_long_r``.
_ROTATION = re.compile(
    r"(?:(?:^|_)(?:angle|flexion|extension|adduction|abduction|rotation|rot|tilt|list|bending"
    r"|pro_sup|dev|inversion|eversion|beta)|_(?:add|flex))(?:_|$)"
)
_NO_COORDINATE = re.compile(
    r"moment|force|torque|reserve|activation|power|work|_[tpv][xyz](?:_|$)|acc"
)
_YES, _NO = ("yes", "y", "true", "1"), ("no", "n", "false", "0")
_SENTENCE = re.compile(r"(?im)(?:^|\.)\s*angles are in (deg|rad)(?:rees|ians)\s*(?:\.|$)")
#: What OpenSim's analysis of kinematics calls its files of what is no coordinate.
_RATES_BY_NAME = {"speeds": "/s", "accelerations": "/s^2"}
_DIGITS = re.compile(r"[+-]?\d*(?:\.(?P<decimals>\d*))?(?:[eE][+-]?(?P<exponent>\d+))?")
_LONGEST_COUNT = 15
_COUNTS = {"nrows": "rows", "datarows": "rows", "ncolumns": "columns", "datacolumns": "columns"}
#: Key of a line in which earlier versions of jointz kept what the table has no place for.
_EARLIER = "jointz"
_LEFT_OUT = "names, descriptions, events and metadata of the line 'jointz=' are left out"
_UNSTATED = NOTE + "OpenSim's header states a unit for rotational coordinates only"
_UNSAID = NOTE + "the header has no inDegrees, so that the unit of a rotational coordinate is open"
_CONTRADICTORY = NOTE + "inDegrees and the sentence in the header contradict each other"
_DECIMAL = "If the file has decimal commas, give --decimal , ([files] decimal in study.toml)."
_LONGEST_HEADER = 1000
_PIECES = re.compile(r"(?:vec|quaternion|spatialvec|unitvec|rotation)\d*", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class _Header:
    metadata: dict[str, str]  # key -> value
    counts: dict[str, int]  # ``rows`` or ``columns`` -> number stated by the header
    units: list[str] | None  # unit of each column but time, where an earlier version stated them
    n_lines: int  # number of lines of the header, ``endheader`` included


class OpenSimFormat(GroupFormat):
    """Reads .mot and .sto."""

    name = "OpenSim .mot/.sto"

    def read(self, path: Path, files: FilesSpec) -> Acquisition:
        """Return the table; time stamps are its clock, the header its metadata."""
        lines = _lines(path)
        header = _header(path, lines)
        names, samples, notes = _table(path, lines, header, files.decimal)
        columns = {name: samples[:, k] for k, name in enumerate(names) if k > 0}
        units = [_unit_of(name, header.metadata) for name in columns]
        if header.units is not None:
            same = len(header.units) == len(columns)
            units = [(unit, "") for unit in header.units] if same else [("", "")] * len(columns)
        signals = tuple(
            Signal(name, values, *unit)
            for (name, values), unit in zip(columns.items(), units, strict=True)
        )
        group = SignalGroup("", signals, time_s=samples[:, 0])
        return Acquisition((group,), (), header.metadata | notes)


def _lines(path: Path) -> list[str]:
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as exc:
        raise _bad(path, f"expected text, found the byte {exc.object[exc.start]:#04x}.") from exc
    return text.replace("\r\n", "\n").split("\n")


def _header(path: Path, lines: list[str]) -> _Header:
    plain = (line.strip().lower() for line in lines[:_LONGEST_HEADER])
    end = next((k for k, line in enumerate(plain) if line == "endheader"), None)
    if end is None:
        raise _bad(path, "expected a header that ends with 'endheader', found none.")
    metadata: dict[str, str] = {}
    counts: dict[str, int] = {}
    units: list[str] | None = None
    comments = []
    for row, line in enumerate(lines[:end], start=1):
        key, value = _key_and_value(line)
        count = _COUNTS.get(key.lower())
        if count:
            counts[count] = _count(path, row, key, value)
        elif key == _EARLIER:
            units = _units_of_jointz(value)
            metadata[f"{READING}jointz"] = _LEFT_OUT
        elif key:
            metadata[key] = value
        elif row == 1:
            metadata["name"] = value
        elif value:
            comments.append(value)
    if comments:
        metadata["comment"] = "\n".join(comments)
    return _Header(metadata, counts, units, end + 1)


def _units_of_jointz(line: str) -> list[str]:
    try:
        return [str(unit) for _, unit, *_ in json.loads(line)["signals"]]
    except (ValueError, TypeError, KeyError, RecursionError):
        return []


def _key_and_value(line: str) -> tuple[str, str]:
    """Take a line of the header apart; the older files write ``datarows 100``."""
    key, sign, value = line.partition("=")
    if sign and " " not in key.strip():
        return key.strip(), value.strip()
    first, _, rest = line.strip().partition(" ")
    if first.lower() in (*_COUNTS, "name", "range"):
        return first, rest.strip()
    return "", line.strip()


def _count(path: Path, row: int, key: str, value: str) -> int:
    if not value.isdecimal() or len(value) > _LONGEST_COUNT:
        raise _bad(path, f"expected a whole number for {key}, found '{value[:40]}'.", row)
    return int(value)


def _table(
    path: Path, lines: list[str], header: _Header, decimal: str
) -> tuple[list[str], np.ndarray, dict[str, str]]:
    """Return names, samples, (n, columns), and notes; the first column is time."""
    at = header.n_lines
    while at < len(lines) and not lines[at].strip():
        at += 1
    if at == len(lines):
        raise _bad(path, "expected the names of the columns after 'endheader', found nothing.")
    separator = "\t" if "\t" in lines[at] else None
    labels = _cells(lines[at], separator)
    body = lines[at + 1 :]
    while body and not body[-1].strip():
        body.pop()
    rows = [_cells(line, separator) for line in body]
    _check_counts(path, header, len(labels), len(rows))
    for k, cells in enumerate(rows):
        if len(cells) != len(labels):
            message = f"expected {len(labels)} values, found {len(cells)}."
            raise _bad(path, message, at + 2 + k)
    pieces = _PIECES.match(header.metadata.get("DataType", ""))
    if pieces is None and decimal == ",":
        rows = [[cell.replace(",", ".") for cell in cells] for cells in rows]
    if pieces is not None and rows:
        labels, rows = _taken_apart(path, labels, rows, at + 2)
    _check_labels(path, labels, at + 1)
    notes = {}
    if lines[-1].strip():  # the last line has no end
        notes = _check_end(path, [row[-1] for row in rows], at + 1 + len(rows))
    return labels, _numbers(path, labels, rows, at + 2), notes


def _check_end(path: Path, cells: list[str], row: int) -> dict[str, str]:
    """Refuse a last number that is shorter than all above it, or say that it may be cut off."""
    last, above = _n_digits(cells[-1]), [d for cell in cells[:-1] if (d := _n_digits(cell))]
    least = tuple(map(min, zip(*above, strict=True)))
    shorter = last and least and (last[0] < least[0] or last[1] < least[1])
    if shorter:
        raise _bad(
            path,
            f"the last line has no end, and its last number, '{cells[-1]}', may be cut off.",
            row,
            todo="Copy the file again, or end that line where it is whole.",
        )
    return {
        f"{READING}end": f"The last line has no end; its last number, {cells[-1]}, may be cut off."
    }


def _n_digits(cell: str) -> tuple[int, int] | None:
    """Return how many decimals and digits of an exponent a number has, None for a word."""
    match = _DIGITS.fullmatch(cell)
    if match is None:
        return None
    return len(match["decimals"] or ""), len(match["exponent"] or "")


def _cells(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return line.split()
    return [cell.strip() for cell in line.rstrip("\t \r").split(separator)]


def _check_counts(path: Path, header: _Header, n_columns: int, n_rows: int) -> None:
    for what, found in (("columns", n_columns), ("rows", n_rows)):
        stated = header.counts.get(what, found)
        if stated != found:
            raise _bad(
                path,
                f"the header says {stated} {what}, the table has {found}; it is cut off, or was "
                "edited.",
                header.n_lines + 1 + n_rows if what == "rows" else header.n_lines + 1,
            )
    if not n_rows:
        raise _bad(path, "expected samples under the names of the columns, found none.")


def _check_labels(path: Path, labels: list[str], row: int) -> None:
    if labels[0].lower() != "time":
        raise _bad(path, f"expected 'time' as the first column, found '{labels[0]}'.", row)
    twice = sorted(name for name, count in Counter(labels).items() if count > 1)
    if twice:
        raise _bad(path, f"the name '{twice[0]}' stands over two columns.", row, todo="Rename one.")


def _taken_apart(
    path: Path, labels: list[str], rows: list[list[str]], first: int
) -> tuple[list[str], list[list[str]]]:
    """Make a column of each element of vectors, which stand as ``1,2,3`` in one cell."""
    sizes = [cell.count(",") + 1 for cell in rows[0]]
    for k, cells in enumerate(rows):
        if [cell.count(",") + 1 for cell in cells] != sizes:
            raise _bad(path, "its vectors have other lengths than those of the first.", first + k)
    names = [
        f"{label}.{i + 1}" if size > 1 else label
        for label, size in zip(labels, sizes, strict=True)
        for i in range(size)
    ]
    return names, [[piece for cell in cells for piece in cell.split(",")] for cells in rows]


def _numbers(path: Path, labels: list[str], rows: list[list[str]], first: int) -> np.ndarray:
    try:
        samples = np.array([[_number(cell) for cell in cells] for cells in rows])
    except ValueError as exc:
        raise _first_bad_cell(path, labels, rows, first) from exc
    time = samples[:, 0]
    wrong = ~np.isfinite(time)
    wrong[1:] |= ~(time[1:] > time[:-1])
    if wrong.any():
        at = int(np.flatnonzero(wrong)[0])
        message, todo = f"expected time to increase, found {time[at]:.9g} s.", "Sort the rows."
        if at and rows[at][0] == rows[at - 1][0]:
            message = f"the time {rows[at][0]} s of the row above repeats at the digits printed."
            todo = f"Remove this row; if the header counts rows, write {len(time) - 1} there. "
            todo += "If many repeat at an even rate, write row number / rate as time."
        raise _bad(path, message, first + at, todo=todo)
    return samples


def _number(cell: str) -> float:
    return float(cell.replace("_", "x"))  # Python takes 1_0 for 10


def _first_bad_cell(path: Path, labels: list[str], rows: list[list[str]], first: int) -> DataError:
    for k, cells in enumerate(rows):
        for label, cell in zip(labels, cells, strict=True):
            try:
                _number(cell)
            except ValueError:
                message = f"expected a number for '{label}', found '{cell}'."
                commas = {"todo": _DECIMAL} if re.fullmatch(r"[+-]?\d*,\d+.*", cell) else {}
                return _bad(path, message, first + k, **commas)
    return _bad(path, "it holds what is no number.")


def _unit_of(name: str, header: Mapping[str, str]) -> tuple[str, str]:
    """Return unit and description of a column, as far as the header states one."""
    degrees = header.get("inDegrees", "").lower()
    *_, coordinate = name.removesuffix("/value").removesuffix("/speed").split("/")
    words = coordinate.removesuffix("_u").lower()
    if not _ROTATION.search(words) or _NO_COORDINATE.search(words):
        return "", _UNSTATED
    per_second = _RATES_BY_NAME.get(header.get("name", "").lower(), "")
    if name.endswith(("/speed", "_u")):
        per_second = "/s"
    units = {"deg": degrees in _YES, "rad": degrees in _NO}
    units |= {unit.lower(): True for unit in _SENTENCE.findall(header.get("comment", ""))}
    stated = [f"{unit}{per_second}" for unit, says_so in units.items() if says_so]
    return EITHER.join(stated), ("" if len(stated) == 1 else _CONTRADICTORY if stated else _UNSAID)


def _bad(
    path: Path, message: str, row: int | None = None, *, todo: str = "Correct or export it again."
) -> DataError:
    return file_error(path, f"{message} {todo}", row=row)
