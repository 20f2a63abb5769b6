"""Pulse tables: onsets of the pulses of one recording, or of several, as a lab writes them."""

import io
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from jointz.core.errors import DataError, UnitError
from jointz.core.study import PulseColumn, RecordingSpec, Study, StudySpec, name_problem
from jointz.core.units import conversion, si_unit_of
from jointz.io.column_units import SAMPLE, same_unit
from jointz.io.formats.columns import LARGEST_SAMPLE, file_error
from jointz.io.formats.registry import (
    TEXT_SUFFIXES,
    list_columns,
    read_acquisition,
    read_table,
)
from jointz.io.study_files import PART, named_as_written
from jointz.io.text.clock_times import CLOCK_TEXT, seconds_of_clock
from jointz.io.text.column_names import known_unit_in_name, written_unit
from jointz.io.text.delimited import MISSING_TEXT, is_number
from jointz.io.text.text_bytes import likely_encoding, not_decoded, stated_encoding
from jointz.io.text.text_layout import DELIMITERS, split_cells

#: What a column holds -> names that say so without [perturbations.columns].
NAMES: Mapping[str, tuple[str, ...]] = {
    "onset": ("onset_s", "onset_ms", "onset_sample"),
    "duration": ("duration_s", "duration_ms", "duration_samples"),
    "amplitude": ("amplitude_nm",),
    **{name: (name,) for name in ("timing_point", "recording", "participant", "session", "side")},
}
_NUMBERS = {"onset": "s", "duration": "s", "amplitude": "N*m"}
_MOST_LINES_ABOVE = 50
_LINE_ENDS = re.compile(r"\r\n|\r|\n")
_THOUSANDS, _FEWEST_THOUSANDS = re.compile(r"\d{1,3}[.,]\d{3}"), 3

#: Times of the samples of a recording, s.
Times = Callable[[], np.ndarray]


@dataclass(frozen=True, slots=True, eq=False)
class _Table:
    path: Path
    cells: pd.DataFrame  # what was found for each meaning; the index is the row of the file, from 1
    columns: Mapping[str, PulseColumn]  # meaning -> its column


def read_pulses(study: Study, entry: RecordingSpec, times: Times | None = None) -> pd.DataFrame:
    """Return the pulses of a recording; onsets in samples stay NaN without ``times``."""
    file = entry.perturbations or ""
    with named_as_written(study.root, file) as path:
        table = _own_rows(_read(path, study.spec, entry), study.spec, entry)
        pulses = pd.DataFrame(index=table.cells.index)
        for name, si_unit in _NUMBERS.items():
            column = f"{name}_{'nm' if si_unit == 'N*m' else si_unit}"
            pulses[column] = _numbers(table, name, study.spec, times)
        named = "timing_point" in table.cells
        pulses["timing_point"] = table.cells["timing_point"].to_numpy() if named else ""
        for row, name in zip(table.cells.index, pulses["timing_point"], strict=True):
            if not is_number(str(name)) and (problem := name_problem(str(name))):
                where = table.columns["timing_point"].column
                message = f"{name!r} {problem}. Rename it."
                raise file_error(path, message, row=int(row), channel=str(where))
    return pulses.reset_index(drop=True)


def _read(path: Path, spec: StudySpec, entry: RecordingSpec) -> _Table:
    if path.name.lower().endswith(TEXT_SUFFIXES):
        return _read_text(path, spec, entry)
    names = list_columns(path, spec.files)
    if names is None and (stated := spec.perturbations.columns):  # not listed without reading all
        names = [name for meaning in stated for name in _wanted(spec, entry)[str(meaning)]]
    elif names is None:
        names = [s.name for group in read_acquisition(path).groups for s in group.signals]
    columns = _find(path, names, spec, entry)
    numeric = [c.column for name, c in columns.items() if name in _NUMBERS]
    labels = [c.column for name, c in columns.items() if name not in _NUMBERS]
    table = read_table(path, numeric=numeric, labels=labels, files=spec.files)
    for meaning in [m for m in columns if m in _NUMBERS]:
        name, given = columns[meaning].column, columns[meaning].unit
        unit = _agreed(path, meaning, name, given, table.units.get(name))
        columns[meaning] = PulseColumn(column=name, unit=unit)
    cells = {name: table.columns[str(c.column)] for name, c in columns.items()}
    frame = pd.DataFrame(cells)
    frame.index += table.first_row
    return _Table(path, frame[frame.notna().any(axis=1)], columns)


def _read_text(path: Path, spec: StudySpec, entry: RecordingSpec) -> _Table:
    if path.name.lower().endswith(".gz"):
        raise file_error(path, "a pulse table must not be compressed. Unpack it.")
    try:
        encoding = spec.files.encoding or likely_encoding(path)
        text = path.read_bytes().decode(stated_encoding(path, encoding))
    except UnicodeDecodeError as exc:
        raise not_decoded(path, exc) from exc
    except OSError as exc:
        raise file_error(path, f"not a readable pulse table ({exc}).") from exc
    text = text.removeprefix("\ufeff")
    above, delimiter, names = _header(text, _wanted(spec, entry)["onset"])
    if twice := next((name for name in names if name and names.count(name) > 1), ""):
        message = f"the name '{twice}' stands over several columns. Rename or remove one."
        raise file_error(path, message, row=above + 1)
    columns = _find(path, names, spec, entry)
    try:
        frame = pd.read_csv(
            io.StringIO(text),
            sep=delimiter,
            skiprows=above,
            dtype=str,
            keep_default_na=False,
            skip_blank_lines=False,  # they count as rows
        )
    except ValueError as exc:  # all that pandas has to say about a file is among them
        message = f"not a readable pulse table ({str(exc).strip()}). Correct it."
        raise file_error(path, message) from exc
    if not isinstance(frame.index, pd.RangeIndex):  # what pandas makes of rows too long
        message = f"expected {len(names)} values as in the header, found more. Correct the rows."
        raise file_error(path, message, row=above + 2)
    frame.index += above + 2
    frame.columns = pd.Index(names)
    cells = {m: frame[str(c.column)].fillna("").str.strip() for m, c in columns.items()}
    table = pd.DataFrame(cells)
    return _Table(path, table[(table != "").any(axis=1)], columns)


def _header(text: str, onset: tuple[str, ...]) -> tuple[int, str, list[str]]:
    """Return the lines above the header, the delimiter and the names: the onset is among them."""
    lines = _LINE_ENDS.split(text)  # those that pandas knows
    for above, line in enumerate(lines[:_MOST_LINES_ABOVE]):
        for delimiter in DELIMITERS:
            names = split_cells(line, delimiter)
            if set(names) & set(onset):
                return above, delimiter, list(names)
    return 0, ",", list(split_cells(lines[0], ","))


def _wanted(spec: StudySpec, entry: RecordingSpec) -> dict[str, tuple[str, ...]]:
    """Return the names that a column of each meaning may have."""
    wanted = dict(NAMES)
    for meaning, column in (spec.perturbations.columns or {}).items():
        wanted[meaning] = (column.column.replace(PART, entry.part or PART),)
    return wanted


def _find(
    path: Path, names: list[str], spec: StudySpec, entry: RecordingSpec
) -> dict[str, PulseColumn]:
    """Find the column of each meaning; a struct or a sheet may stand before a usual name."""
    stated = {str(name): c for name, c in (spec.perturbations.columns or {}).items()}
    ends = [re.split(r"[./]", name)[-1] for name in names]
    last = {end: name for end, name in zip(ends, names, strict=True) if ends.count(end) == 1}
    found: dict[str, PulseColumn] = {}
    for meaning, wanted in _wanted(spec, entry).items():
        known = dict.fromkeys(names, "") if meaning in stated else {**last, **{n: n for n in names}}
        name = next((known[w] or w for w in wanted if w in known), None)
        if name is not None:
            unit = stated[meaning].unit if meaning in stated else None
            found[meaning] = PulseColumn(column=name, unit=_agreed(path, meaning, name, unit))
    missing = [*(m for m in stated if m not in found), *([] if "onset" in found else ["onset"])]
    text = path.name.lower().endswith(TEXT_SUFFIXES)
    unknown = [n for n in names if n and n not in {c.column for c in found.values()}]
    if missing or (unknown and text and not stated):
        usual = ", ".join(own for kinds in NAMES.values() for own in kinds)
        lacks = f"has no column for {', '.join(dict.fromkeys(missing))}" if missing else (
            f"has columns that jointz does not know: {', '.join(unknown)}"
        )  # fmt: skip
        raise file_error(
            path,
            f"the pulse table {lacks}. It has {', '.join(names) or 'none'}; a pulse table has the "
            f"columns {usual} (an onset is required). Name its columns under "
            "[perturbations.columns], and others are left out.",
        )
    return found


def _agreed(
    path: Path, meaning: str, name: str, given: str | None, stated: str | None = None
) -> str | None:
    """Return the unit of a column; what has no unit of its own may have any."""
    stated, si_unit = stated or unit_in(name), _NUMBERS.get(meaning)
    return given or stated if si_unit is None else agreed_unit(path, name, given, stated, si_unit)


def agreed_unit(
    path: Path, name: str, given: str | None, stated: str | None, si_unit: str
) -> str | None:
    """Return the unit of a column; refuse one that the file, or the column's name, contradicts."""
    if given is None or stated is None or given == stated:
        return given or stated
    if not same_unit(stated, given, si_unit):  # one of them may count samples
        both = f"its name or unit says {stated!r}, its name or study.toml says {given!r}"
        raise file_error(path, f"{both}. Correct one of them.", channel=name)
    return given


def unit_in(name: str) -> str | None:
    """Return the unit that a column's name states in brackets or at its end."""
    in_samples = re.search(r"([\[(]samples?[\])]|_samples?)\s*$", name.casefold())
    end = written_unit(name)
    end = end if si_unit_of(end)[0] in _NUMBERS.values() else ""  # else no unit of a pulse
    return SAMPLE if in_samples else known_unit_in_name(name) or end or None


def _own_rows(table: _Table, spec: StudySpec, entry: RecordingSpec) -> _Table:
    """Return the rows of one recording, where columns say which recording a row belongs to."""
    sharing = [r for r in spec.recordings if r.perturbations == entry.perturbations]
    own = _rows_of(table, spec, entry)
    if not own.any() and len(own):
        known = {m: sorted(set(table.cells[m])) for m in _keys(table, entry)}
        raise file_error(
            table.path,
            f"no row belongs to {entry.label} (participant '{entry.participant}'); found "
            + "; ".join(f"{name}: {', '.join(values)}" for name, values in known.items())
            + ". Correct the table or the recording.",
        )
    for name in ("session", "side"):
        if name in table.cells and getattr(entry, name) is None:
            values = sorted(set(table.cells[name][own]))
            if len(values) > 1:
                raise file_error(
                    table.path,
                    f"has rows of {name} {', '.join(values)}, and {entry.label} does not say which "
                    f"is its own. Give {name} of the recording.",
                    channel=str(table.columns[name].column),
                )
    of_any = np.any([_rows_of(table, spec, r) for r in sharing], axis=0)
    if "participant" in table.cells:  # rows of people whom the study leaves out
        people = {p.id for p in spec.participants}
        of_any |= ~table.cells["participant"].isin(people).to_numpy()
    if not of_any.all():
        row = int(table.cells.index[~of_any][0])
        message = "belongs to no recording of the study. Correct the row or remove it."
        raise file_error(table.path, message, row=row)
    return _Table(table.path, table.cells[own], table.columns)


def _keys(table: _Table, entry: RecordingSpec) -> Iterator[str]:
    """Yield the columns that say which recording a row belongs to."""
    stated = {"recording": True, "participant": True}
    stated |= {"session": entry.session is not None, "side": entry.side is not None}
    yield from (name for name, used in stated.items() if used and name in table.cells)


def _names_of(entry: RecordingSpec) -> set[str]:
    """Return what a table may call a recording; of a file with parts, the part."""
    if entry.part is not None:
        return {entry.label, entry.part}
    base = entry.file.rpartition("/")[2]
    return {entry.file, base, base.removesuffix(".gz").rpartition(".")[0] or base}


def _rows_of(table: _Table, spec: StudySpec, entry: RecordingSpec) -> np.ndarray:
    rows = np.ones(len(table.cells), dtype=bool)
    others = [_names_of(r) for r in spec.recordings if r.label != entry.label]
    own = {name for name in _names_of(entry) if not any(name in names for names in others)}
    meant = {
        "recording": own,
        "participant": {entry.participant},
        "session": {entry.session or ""},
        "side": {entry.side or "", (entry.side or "")[:1]},
    }
    for name in _keys(table, entry):
        values = table.cells[name]
        rows &= (values.str.casefold() if name == "side" else values).isin(meant[name]).to_numpy()
    return rows


def _numbers(table: _Table, name: str, spec: StudySpec, times: Times | None) -> np.ndarray:
    """Return a column of numbers in SI."""
    if name not in table.cells:
        return np.full(len(table.cells), np.nan)
    values = _parsed(table, name)
    unit, si_unit = table.columns[name].unit or _NUMBERS[name], _NUMBERS[name]
    if unit == SAMPLE:
        return _times_of(table, name, values, spec, times)
    try:
        factor, offset = conversion(unit, si_unit)
    except UnitError as exc:
        raise file_error(table.path, str(exc), channel=str(table.columns[name].column)) from exc
    return np.asarray(factor * values + offset)


def _parsed(table: _Table, name: str) -> np.ndarray:
    """Return numbers with points or with commas, but not with both; only an onset must be there."""
    cells, column = table.cells[name], str(table.columns[name].column)
    if cells.dtype.kind == "f":
        if name == "onset" and cells.isna().any():
            row = int(cells.index[cells.isna()][0])
            raise file_error(table.path, "an onset is empty. Correct it.", row=row, channel=column)
        return cells.to_numpy(dtype=float)
    if table.columns[name].unit == CLOCK_TEXT:
        return _times_of_day(table, name)
    filled = ~cells.isin(MISSING_TEXT).to_numpy()
    written = "".join(cells[filled])
    decimal = "," if "," in written and "." not in written else "."
    good = np.array([is_number(cell, decimal) for cell in cells], dtype=bool) | ~filled
    points = cells.str.replace(",", ".") if decimal == "," else cells
    values = pd.to_numeric(points.where(good & filled, "nan"), errors="coerce").to_numpy(float)
    unit = table.columns[name].unit
    unclear = unit in ("ms", SAMPLE) and filled.sum() >= _FEWEST_THOUSANDS
    if unclear and all(_THOUSANDS.fullmatch(cell) for cell in cells[filled]):
        message = f"'{cells[filled].iloc[0]}' may be thousands, or have three decimals."
        todo = "Write it without a sign for thousands."
        raise file_error(table.path, f"{message} {todo}", channel=column)
    bad = ~good | (np.abs(values) > LARGEST_SAMPLE) | (~filled & (name == "onset"))
    if bad.any():
        row = int(cells.index[bad][0])
        message = f"expected a number, found '{cells.loc[row]}'. Correct the cell."
        raise file_error(table.path, message, row=row, channel=column)
    return values


def _times_of_day(table: _Table, name: str) -> np.ndarray:
    seconds = seconds_of_clock(table.cells[name])
    if np.isnan(seconds).any():
        row = int(table.cells.index[np.isnan(seconds)][0])
        message = f"expected a time of day, found '{table.cells[name].loc[row]}'. Correct the cell."
        raise file_error(table.path, message, row=row, channel=table.columns[name].column)
    return seconds


def _times_of(
    table: _Table, name: str, samples: np.ndarray, spec: StudySpec, times: Times | None
) -> np.ndarray:
    """Return the times of samples, or the duration of as many."""
    column = str(table.columns[name].column)
    if name == "onset" and spec.perturbations.first_sample is None:
        raise _no_first_sample(table.path, column)
    if times is None:
        return np.full(samples.size, np.nan)
    if name == "duration":
        return np.asarray(samples * float(np.median(np.diff(times()))))
    rows = table.cells.index.to_numpy()
    return times_of_samples(table.path, column, samples, spec, times(), rows=rows)


def times_of_samples(
    path: Path,
    column: str,
    samples: np.ndarray,
    spec: StudySpec,
    time_s: np.ndarray,
    *,
    rows: np.ndarray | None = None,
) -> np.ndarray:
    """Return the times of counted samples, s; ``rows`` are those of the table."""
    first = spec.perturbations.first_sample
    if first is None:
        raise _no_first_sample(path, column)
    index = samples - float(first)
    beyond = ~((index >= 0) & (index <= time_s.size - 1))
    if beyond.any():
        row = None if rows is None else int(rows[beyond][0])
        message = f"there is no sample {samples[beyond][0]:g} in {time_s.size} samples. Correct it."
        raise file_error(path, message, row=row, channel=column)
    return np.asarray(np.interp(index, np.arange(time_s.size), time_s))


def _no_first_sample(path: Path, column: str) -> DataError:
    return file_error(
        path,
        "counts samples. Give [perturbations] first_sample: the number of the recording's first "
        "sample, 1 in MATLAB and 0 in Python or C.",
        channel=column,
    )
