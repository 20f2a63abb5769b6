"""Entries of a collection as files: ``entry.toml`` and the tables that it names."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import pandas as pd
from pydantic import ValidationError

from jointz.collections.catalog_columns import CATALOG_COLUMNS, PRINTED_COLUMNS
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
    "estimates": tuple(name for name in ESTIMATE_COLUMNS if name in CATALOG_COLUMNS),
    "printed": PRINTED_COLUMNS,
    "covariance": COVARIANCE_COLUMNS,
}


@dataclass(frozen=True, slots=True)
class EntryFolder:
    """An entry and its folder."""

    root: Path  # its folder
    spec: Entry  # content of ``entry.toml``
    sha256: str  # hash of ``entry.toml``

    @property
    def name(self) -> str:
        """The folder's name."""
        return self.root.name

    def path(self, file: str) -> Path:
        """Return the path of a file of the entry."""
        parts = PurePosixPath(file)
        if parts.is_absolute() or ".." in parts.parts or "\\" in file:
            raise DataError(
                f"{file}: expected a file inside the folder of the entry. Copy it there.", path=file
            )
        path = self.root / parts
        try:
            exists = path.is_file()
        except OSError as exc:
            raise DataError(
                f"{file}: cannot be read ({exc.strerror}). Allow reading it.", path=file
            ) from exc
        if not exists:
            raise DataError(f"{file}: does not exist. Put it beside {ENTRY_FILE}.", path=file)
        if not path.resolve().is_relative_to(self.root.resolve()):
            raise DataError(
                f"{file}: links to a file outside the folder of the entry. Copy it there.",
                path=file,
            )
        return path


@dataclass(frozen=True, slots=True)
class ConditionTables:
    """The values of one condition of an entry, as in its files."""

    condition: Condition
    rows: pd.DataFrame  # in the columns of ``estimates.csv``, or those of printed values
    covariance: pd.DataFrame | None  # None if the entry has none
    sha256: Mapping[str, str]  # file -> hash of its bytes
    first_row: int = 2  # row number of the first value in its file


def entry_folders(collection: Path) -> tuple[Path, ...]:
    """List the folders of a collection, one an entry."""
    try:
        folders = sorted(p for p in collection.iterdir() if p.is_dir() and p.name[0] not in "._")
    except OSError as exc:
        raise DataError(
            f"{collection}: cannot be read as a folder ({exc.strerror}). Name the folder of a "
            "collection, which holds a folder for each study."
        ) from exc
    if not folders:
        raise DataError(
            f"{collection}: expected a folder for each study, with {ENTRY_FILE} and its estimates; "
            "found none. Make one of results: jointz collect entry RESULTS."
        )
    return tuple(folders)


def read_entry(folder: Path) -> EntryFolder:
    """Read an ``entry.toml``, without the files that it names."""
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
    """Read the values of a condition, with their covariance if there is one."""
    values, sha256, first_row = read_values(entry.path(condition.estimates), entry.spec.kind)
    hashes = {condition.estimates: sha256}
    covariance = None
    if condition.covariance is not None:
        covariance, sha256, _ = read_values(entry.path(condition.covariance), "covariance")
        hashes[condition.covariance] = sha256
    return ConditionTables(condition, values, covariance, hashes, first_row)


def columns_of(entry: EntryFolder, file: str) -> tuple[str, ...]:
    """List the columns of a table of an entry."""
    return tuple(list_columns(entry.path(file), FilesSpec()) or ())


def read_values(path: Path, kind: str) -> tuple[pd.DataFrame, str, int]:
    """Read a table of values; return its rows, its hash and the number of its first row."""
    # Tables of other programs and of older versions have neither session nor side.
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
    """Return the text of an ``entry.toml``; missing keys stand as comments in their tables."""
    questions: dict[str, list[str]] = {}
    for key, question in (missing or {}).items():
        table, _, name = key.rpartition(".")
        questions.setdefault(table, []).append(f"# {name} =   # {question}")
    plain = {key: value for key, value in content.items() if not _tables(value)}
    lines = [f"{key} = {_value(value)}" for key, value in plain.items() if value is not None]
    lines += questions.get("", [])
    for key, value in content.items():
        header = f"[{key}]" if isinstance(value, Mapping) else f"[[{key}]]"
        for entries in _tables(value):
            statements = [
                f"{written_key(k)} = {_value(v)}" for k, v in entries.items() if v not in (None, "")
            ]
            lines += ["", header, *statements, *questions.get(key, [])]
    for key in sorted(questions.keys() - content.keys() - {""}):
        lines += ["", f"[{key}]", *questions[key]]
    return "\n".join(lines) + "\n"


def _tables(value: Any) -> list[Mapping[str, Any]]:
    """Return a value as tables of TOML; an empty list if it is none."""
    if isinstance(value, Mapping):
        return [value]
    is_list = isinstance(value, list | tuple) and value and isinstance(value[0], Mapping)
    return list(value) if is_list else []


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        inner = (f"{written_key(str(k))} = {_value(v)}" for k, v in value.items() if v is not None)
        return "{ " + ", ".join(inner) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, int | float) else written_text(str(value))
