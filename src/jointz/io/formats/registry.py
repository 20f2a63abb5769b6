"""Registry of file formats: reads columns for a study and whole files, and writes files.

A format registers by an entry point of the group ``jointz.formats``: its name is the suffix, its
value a class that implements :class:`Format`. It is loaded when a file of its suffix is used.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Protocol, cast

from jointz.core.acquisition import Acquisition
from jointz.core.entry_points import registered
from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.core.whole_file import whole_file
from jointz.io.formats.columns import RawTable, TableRequest, damaged, file_error

GROUP = "jointz.formats"
_TEXT = "jointz.io.text.text_format:TextFormat"
_OPENSIM = "jointz.io.formats.opensim:OpenSimFormat"
#: Suffix -> class of the formats of jointz; pyproject.toml registers the same.
BUILT_IN: Mapping[str, str] = {
    **dict.fromkeys((".csv", ".csv.gz", ".tsv", ".tsv.gz", ".txt", ".txt.gz"), _TEXT),
    **dict.fromkeys((".mot", ".sto"), _OPENSIM),
    ".c3d": "jointz.io.c3d.c3d_format:C3dFormat",
    ".mat": "jointz.io.formats.matlab_format:MatlabFormat",
    ".nc": "jointz.io.formats.netcdf_format:NetcdfFormat",
    ".parquet": "jointz.io.formats.parquet_format:ParquetFormat",
    ".xdf": "jointz.io.xdf.xdf_format:XdfFormat",
    ".xlsx": "jointz.io.text.workbook:WorkbookFormat",
}


class Format(Protocol):
    """A file format; :class:`jointz.io.formats.group_format.GroupFormat` does most of it."""

    name: str

    def read(self, path: Path, files: FilesSpec) -> Acquisition:
        """Return all that a file holds, nothing interpolated, nothing converted."""

    def read_columns(self, path: Path, request: TableRequest) -> RawTable:
        """Return the requested columns."""

    def list_columns(self, path: Path, files: FilesSpec) -> list[str] | None:
        """Return the names of the columns, None where that means reading the file."""

    def losses(self, content: Acquisition) -> list[str]:
        """Return what of a content the format cannot hold, a sentence each."""

    def encode(self, content: Acquisition, path: Path) -> bytes:
        """Return the bytes of a file that holds what the format can hold of a content."""


def read_table(
    path: Path,
    *,
    numeric: Sequence[str | int],
    labels: Sequence[str | int] = (),
    files: FilesSpec,
    as_written: bool = False,
    from_zero: bool = False,
) -> RawTable:
    """Read columns of a file; the file is never modified."""
    reader = _format_of_file(path)
    request = TableRequest(tuple(numeric), tuple(labels), files, as_written, from_zero)
    both = {str(c) for c in numeric} & {str(c) for c in labels}
    if both:
        raise file_error(
            path,
            f"column '{min(both)}' is asked for both as numbers and as labels. Use it for one of "
            "them.",
        )
    try:
        table = reader.read_columns(path, request)
    except OSError as exc:
        raise damaged(path, exc) from exc
    lengths = {name: len(values) for name, values in table.columns.items()}
    if len(set(lengths.values())) > 1:
        raise file_error(
            path,
            f"columns differ in length: {lengths}. Choose columns that were sampled together.",
        )
    return table


def list_columns(path: Path, files: FilesSpec) -> list[str] | None:
    """List the columns of a file without reading its samples."""
    reader = _format_of_file(path)
    try:
        return reader.list_columns(path, files)
    except OSError as exc:
        raise damaged(path, exc) from exc


def read_acquisition(path: Path, files: FilesSpec | None = None) -> Acquisition:
    """Read all that a file holds; the file is never modified.

    Parameters
    ----------
    path : pathlib.Path
        The file; its suffix says what it is.
    files : FilesSpec, optional
        How text files are laid out.

    Raises
    ------
    DataError
        When the file is missing, unknown or damaged.
    """
    reader = _format_of_file(path)
    try:
        return reader.read(path, files or FilesSpec())
    except OSError as exc:
        raise damaged(path, exc) from exc


def write_acquisition(content: Acquisition, path: Path, *, lossy: bool = False) -> list[str]:
    """Write a content in the format of the file's suffix, whole or not at all."""
    kind = format_of(path)
    lost = kind.losses(content)
    if lost and not lossy:
        raise file_error(
            path,
            f"{kind.name} cannot hold all of it: {' '.join(lost)} Choose another format, or say "
            "that this may be left out (--lossy).",
        )
    data = kind.encode(content, path)
    with whole_file(path, "Make room or name another place.") as partial:
        partial.write_bytes(data)
    return lost


def format_of(path: Path) -> Format:
    """Return the format of a file's suffix; the longest suffix that fits wins."""
    name = path.name.lower()
    known = _formats()
    fitting = [suffix for suffix in known if name.endswith(suffix)]
    if not fitting:
        raise file_error(
            path,
            "no format for this kind of file; expected one of "
            f"{', '.join(sorted(known))}. Convert the file, or correct its suffix.",
        )
    return _loaded(known[max(fitting, key=len)])


def _format_of_file(path: Path) -> Format:
    kind = format_of(path)
    if not path.is_file():
        raise DataError(
            f"{path}: no such file. Correct the name or bring the file.", path=str(path)
        )
    return kind


@cache
def _formats() -> Mapping[str, EntryPoint]:
    """Return the formats by suffix; those of other packages cannot replace those of jointz."""
    return registered(GROUP, BUILT_IN)


@cache
def _loaded(entry: EntryPoint) -> Format:
    return cast("Format", entry.load()())
