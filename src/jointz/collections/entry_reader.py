"""Read the entries of a collection: ``entry.toml`` and the tables that it names."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import pandas as pd
from pydantic import ValidationError

from jointz.collections.catalog_columns import PRINTED_COLUMNS
from jointz.collections.entry_model import ENTRY_FILE, Condition, Entry
from jointz.core.errors import DataError, EntryError
from jointz.core.study import FilesSpec
from jointz.io.formats.columns import file_sha256
from jointz.io.formats.registry import list_columns, read_table
from jointz.io.toml_problems import all_problems, parse_toml
from jointz.io.toml_text import written_key, written_text
from jointz.results.estimates import COVARIANCE_COLUMNS, ESTIMATE_COLUMNS

_LABELS = (
    "statistic", "participant", "timing_point", "parameter", "unit", "method", "status", "source",
    "note", "session", "side",
)  # fmt: skip
_UNIT = ("session", "side")
_TABLES = {
    "estimates": ESTIMATE_COLUMNS,
    "printed": PRINTED_COLUMNS,
    "covariance": COVARIANCE_COLUMNS,
}


@dataclass(frozen=True, slots=True)
class EntryFolder:
    """An entry that was read."""

    root: Path  # its folder
    spec: Entry  # what ``entry.toml`` says
    sha256: str  # hash of ``entry.toml``

    @property
    def name(self) -> str:
        """The folder's name."""
        return self.root.name

    def path(self, file: str) -> Path:
        """Return where a file of the entry is."""
        parts = PurePosixPath(file)
        if parts.is_absolute() or ".." in parts.parts or "\\" in file:
            raise DataError(
                f"{file}: expected a file inside the folder of the entry. Copy it there.", path=file
            )
        found = self.root / parts
        try:
            there = found.is_file()
        except OSError as exc:
            raise DataError(
                f"{file}: cannot be read ({exc.strerror}). Let it be read.", path=file
            ) from exc
        if not there:
            raise DataError(f"{file}: is not there. Put it beside {ENTRY_FILE}.", path=file)
        if not found.resolve().is_relative_to(self.root.resolve()):
            raise DataError(
                f"{file}: links to a file outside the folder of the entry. Copy it there.",
                path=file,
            )
        return found


@dataclass(frozen=True, slots=True)
class ConditionTables:
    """The values of one condition of an entry, as they stand in its files."""

    condition: Condition
    rows: pd.DataFrame  # in the columns of ``estimates.csv``, or those of printed values
    covariance: pd.DataFrame | None  # none where the entry has none
    sha256: Mapping[str, str]  # file -> hash of its bytes
    first_row: int = 2  # row of the file of values that holds the first of them


def entry_folders(collection: Path) -> tuple[Path, ...]:
    """List the folders of a collection that hold an entry, or should."""
    try:
        found = sorted(p for p in collection.iterdir() if p.is_dir() and p.name[0] not in "._")
    except OSError as exc:
        raise DataError(
            f"{collection}: cannot be read as a folder ({exc.strerror}). Name the folder of a "
            f"collection, with a folder for each study in it."
        ) from exc
    if not found:
        raise DataError(
            f"{collection}: expected a folder for each study, with {ENTRY_FILE} and its estimates; "
            "found none. jointz collect entry RESULTS makes one of results."
        )
    return tuple(found)


def read_entry(folder: Path) -> EntryFolder:
    """Read an ``entry.toml``; the files that it names are not opened."""
    file = folder / ENTRY_FILE
    try:
        text = file.read_bytes()
        sha256 = file_sha256(file)
    except OSError as exc:
        raise EntryError(str(file), [f"{ENTRY_FILE}: cannot be read ({exc.strerror})."]) from exc
    raw = parse_toml(str(file), text, error=EntryError)
    try:
        spec = Entry.model_validate(raw)
    except ValidationError as exc:
        raise EntryError(str(file), all_problems(exc, Entry, raw)) from exc
    return EntryFolder(folder, spec, sha256)


def read_condition(entry: EntryFolder, condition: Condition) -> ConditionTables:
    """Read the values of a condition, with their covariance where there is one."""
    values, sha256, first_row = _table(entry, condition.estimates, entry.spec.kind)
    hashes = {condition.estimates: sha256}
    covariance = None
    if condition.covariance is not None:
        covariance, sha256, _ = _table(entry, condition.covariance, "covariance")
        hashes[condition.covariance] = sha256
    return ConditionTables(condition, values, covariance, hashes, first_row)


def columns_of(entry: EntryFolder, file: str) -> tuple[str, ...]:
    """List the columns of a table of an entry."""
    return tuple(list_columns(entry.path(file), FilesSpec()) or ())


def _table(entry: EntryFolder, file: str, kind: str) -> tuple[pd.DataFrame, str, int]:
    return read_values(entry.path(file), kind)


def read_values(path: Path, kind: str) -> tuple[pd.DataFrame, str, int]:
    """Read a table of values."""
    # Tables of other programs, and older ones, have neither session nor side.
    stated = list_columns(path, FilesSpec()) or _TABLES[kind]
    columns = [n for n in _TABLES[kind] if n in stated or n not in _UNIT]
    table = read_table(
        path,
        numeric=[name for name in columns if name not in _LABELS],
        labels=[name for name in columns if name in _LABELS],
        files=FilesSpec(),
        as_written=True,
    )
    frame = pd.DataFrame({name: table.columns[name] for name in columns})
    frame = frame.assign(**{name: "" for name in _UNIT if name not in columns})
    return frame, table.sha256, table.first_row


def written_entry(content: Mapping[str, Any], missing: Mapping[str, str] | None = None) -> str:
    """Return the text of an ``entry.toml``."""
    open_questions = dict(missing or {})
    lines = [f"{k} = {_value(v)}" for k, v in content.items() if _is_plain(v) and v is not None]
    lines += _asked(open_questions, "")
    for key, value in content.items():
        if isinstance(value, Mapping):
            lines += ["", f"[{key}]", *_statements(value), *_asked(open_questions, key)]
        elif not _is_plain(value):
            for one in value:
                lines += ["", f"[[{key}]]", *_statements(one), *_asked(open_questions, key)]
    tables = {key.rpartition(".")[0] for key in open_questions} - set(content) - {""}
    for table in sorted(tables):
        lines += ["", f"[{table}]", *_asked(open_questions, table)]
    return "\n".join(lines) + "\n"


def _is_plain(value: Any) -> bool:
    tables = isinstance(value, list | tuple) and bool(value) and isinstance(value[0], Mapping)
    return not isinstance(value, Mapping) and not tables


def _asked(questions: Mapping[str, str], table: str) -> list[str]:
    of_table = {key: told for key, told in questions.items() if key.rpartition(".")[0] == table}
    return [f"# {key.rpartition('.')[2]} =   # {told}" for key, told in of_table.items()]


def _statements(table: Mapping[str, Any]) -> list[str]:
    return [f"{written_key(k)} = {_value(v)}" for k, v in table.items() if v not in (None, "")]


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        inner = (f"{written_key(str(k))} = {_value(v)}" for k, v in value.items() if v is not None)
        return "{ " + ", ".join(inner) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, int | float) else written_text(str(value))
