"""Text tables in and out: csv, tsv and txt, plain or gzip."""

import csv
import gzip
import io
from collections.abc import Sequence
from pathlib import Path

from jointz.core.acquisition import Acquisition, Signal, SignalGroup
from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.formats.columns import RawTable, TableRequest, file_error
from jointz.io.formats.group_format import GroupFormat
from jointz.io.formats.losses import (
    first_group,
    has_text,
    is_plain,
    listed,
    lost_descriptions,
    lost_events,
    lost_groups,
    lost_metadata,
    lost_signals,
)
from jointz.io.text.column_names import (
    READING,
    clock_column,
    name_with_unit,
    unique_names,
    unit_in_name,
    with_clock,
)
from jointz.io.text.delimited import (
    MISSING_TEXT,
    decompressed_text,
    default_delimiter,
    is_number,
    list_delimited,
    read_delimited,
)
from jointz.io.text.recorder_exports import read_export, recorder_of
from jointz.io.text.text_layout import DELIMITERS, split_cells
from jointz.io.text.vendor_logs import with_vendor_units

_PEEKED_ROWS = 200


class TextFormat(GroupFormat):
    """Reads every column, as numbers where it holds numbers; writes one group."""

    name = "text table"

    def read(self, path: Path, files: FilesSpec) -> Acquisition:
        """Return all columns under their own names; of a recorder's export, its tables."""
        if recorder := recorder_of(path, files):
            return read_export(path, files, recorder)
        files, notes = _with_delimiter(path, files)
        names: list[str | int] = list(list_delimited(path, files))
        if not files.header:
            names = list(range(1, len(names) + 1))
        texts = _text_columns(path, files, names)
        tables: list[RawTable] = []
        while len(texts) < len(names) and not tables:
            numbers = [name for name in names if name not in texts]
            try:
                tables.append(read_delimited(path, TableRequest(tuple(numbers), files=files)))
            except DataError as exc:
                texts.add(_text_after_all(path, files, numbers, exc))
        if not tables:
            raise _no_numbers(path, files, names)
        if texts:
            labels = [name for name in names if name in texts]
            notes[f"{READING}text"] = f"read as text: {listed(map(repr, labels))}"
            tables.append(_read_texts(path, labels, files))
        columns = {name: values for table in tables for name, values in table.columns.items()}
        signals, vendor = with_vendor_units(
            [Signal(n, columns[n], unit_in_name(n)) for n in map(str, names)]
        )
        group, clock_notes = with_clock("", signals, row=tables[0].first_row)
        if vendor:
            notes[f"{READING}log"] = f"taken for a log of {vendor}: units by its documentation"
        return Acquisition((group,), (), {**notes, **clock_notes})

    def read_columns(self, path: Path, request: TableRequest) -> RawTable:
        """Return the requested columns, by name, or by number where there is no header."""
        if recorder_of(path, request.files):
            return super().read_columns(path, request)
        return read_delimited(path, request)

    def list_columns(self, path: Path, files: FilesSpec) -> list[str]:
        """Return the names in the header, or numbers from 1 where there is none."""
        exported = recorder_of(path, files)
        return super().list_columns(path, files) if exported else list_delimited(path, files)

    def losses(self, content: Acquisition) -> list[str]:
        """Name what a text table cannot hold: other groups, events, metadata, some texts."""
        group = first_group(content)
        lost = lost_groups(content) + lost_events(content) + lost_metadata(content)
        lost += lost_descriptions(group)
        lost += lost_signals(
            group,
            "text with line ends, or blanks at an end",
            lambda s: has_text(s, lambda t: is_plain(t) and t == t.strip() and _one_line(t) == t),
        )
        lost += lost_signals(
            group,
            "text apart from numbers where half of it or more looks like one",
            _reads_as_numbers,
        )
        lost += [] if _has_numbers(group) else ["It cannot hold text alone, without a number."]
        odd = [s.name for s in group.signals if _plain_name(name_with_unit(s)) != name_with_unit(s)]
        if odd:
            lost.append(f"It cannot hold the name {', '.join(map(repr, odd))} as it is.")
        return lost

    def encode(self, content: Acquisition, path: Path) -> bytes:
        """Return the first group, its clock as the first column; NaN is written ``NaN``."""
        group = first_group(content)
        if not group.n_samples or not _has_numbers(group):
            raise file_error(
                path, "expected numbers to write, found none. Choose another group or format."
            )
        data = _written(content, group, path).encode("utf-8", errors="replace")
        # The same bytes for the same content: no time of writing.
        return gzip.compress(data, mtime=0) if path.name.lower().endswith(".gz") else data


def _with_delimiter(path: Path, files: FilesSpec) -> tuple[FilesSpec, dict[str, str]]:
    """Find a delimiter that is not given: what header and first row are both split by."""
    if files.delimiter is not None:
        return files, {}
    lines = decompressed_text(path, files.skip_rows + files.header + 1, files.encoding)
    lines = lines[files.skip_rows :]
    if not lines or _width(lines, default_delimiter(path)) > 1:
        return files, {}
    delimiter = next((d for d in DELIMITERS if _width(lines, d) > 1 and d != files.decimal), None)
    if delimiter is None:
        return files, {}
    note = f"columns stand apart by {DELIMITERS[delimiter]}"
    return files.model_copy(update={"delimiter": delimiter}), {f"{READING}delimiter": note}


def _width(lines: list[str], delimiter: str) -> int:
    """Return into how many cells all lines are split, 1 where they differ."""
    widths = {len(split_cells(line, delimiter)) for line in lines}
    return widths.pop() if len(widths) == 1 else 1


def _text_columns(path: Path, files: FilesSpec, names: list[str | int]) -> set[str | int]:
    """Return the columns whose first rows hold more text than numbers."""
    head = files.skip_rows + files.header
    lines = decompressed_text(path, head + _PEEKED_ROWS, files.encoding)[head:]
    delimiter = files.delimiter or default_delimiter(path)
    try:
        rows = list(csv.reader(lines, delimiter=delimiter, skipinitialspace=True))
    except csv.Error:
        return set()
    cells = {name: [row[k] for row in rows if k < len(row)] for k, name in enumerate(names)}
    return {name for name, found in cells.items() if _is_text(found)}


def _is_text(cells: list[str]) -> bool:
    filled = [cell.strip() for cell in cells if cell.strip() not in MISSING_TEXT]
    numbers = sum(map(_is_number, filled))
    return 2 * numbers < len(filled)


def _is_number(cell: str) -> bool:  # the other decimal sign is told as an error
    return is_number(cell) or is_number(cell, ",")


def _text_after_all(
    path: Path, files: FilesSpec, numbers: list[str | int], trouble: DataError
) -> str | int:
    """Return the column that the trouble is about, where it holds more text than numbers."""
    named = next((n for n in numbers if str(n) == trouble.channel), None)
    if named is None or trouble.row is None:
        raise trouble
    column = _read_texts(path, [named], files).columns[str(named)]
    if not _is_text(list(column)):
        raise trouble
    return named


def _read_texts(path: Path, names: Sequence[str | int], files: FilesSpec) -> RawTable:
    return read_delimited(path, TableRequest((), tuple(names), files, as_written=True))


def _no_numbers(path: Path, files: FilesSpec, names: list[str | int]) -> DataError:
    shown = listed(repr(str(name)[:40]) for name in names)
    return file_error(
        path,
        f"no column holds numbers; found {len(names)} column(s) of text, {shown}, under row "
        f"{files.skip_rows + files.header}. Give the file's layout (--delimiter, --decimal, "
        "--skip-rows, --no-header), or another file; jointz inspect finds it out.",
    )


def _has_numbers(group: SignalGroup) -> bool:
    """Whether a table of a group has a column of numbers."""
    return group.times_s() is not None or any(not s.is_text for s in group.signals)


def _reads_as_numbers(signal: Signal) -> bool:
    return signal.is_text and not _is_text([str(text) for text in signal.values])


def _one_line(text: str) -> str:
    return "".join(text.splitlines())


def _plain_name(name: str) -> str:
    """Return a name that a header can hold: one line, no blanks at its ends, no number."""
    odd = not is_plain(name) or name != name.strip() or _one_line(name) != name
    plain = " ".join(name.replace("\0", "").split()) if odd else name
    return f"column {plain}" if _is_number(plain) or not plain else plain


def _written(content: Acquisition, group: SignalGroup, path: Path) -> str:
    signals = [signal for signal in group.signals if not _reads_as_numbers(signal)]
    names = unique_names([_plain_name(name_with_unit(s)) for s in signals])
    columns = [_cells(signal) for signal in signals]
    time = group.times_s()
    if time is not None:
        names.insert(0, clock_column(group, content.metadata))
        columns.insert(0, [repr(value) for value in time.tolist()])
    buffer = io.StringIO(newline="")
    writer = csv.writer(buffer, delimiter=default_delimiter(path), lineterminator="\n")
    writer.writerow(names)
    writer.writerows(zip(*columns, strict=True))
    return buffer.getvalue()


def _cells(signal: Signal) -> list[str]:
    if signal.is_text:
        return [_one_line(str(text)).strip() for text in signal.values]
    return ["NaN" if value != value else repr(value) for value in signal.values.tolist()]
