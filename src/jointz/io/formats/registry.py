"""Registry of file formats, and functions that read or write a file in its format.

A format registers by an entry point of the group ``jointz.formats``: its name is the suffix, its
value a class that implements :class:`Format`. It is loaded when a file of its suffix is used.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Protocol, TypeGuard, cast

from jointz.core.acquisition import Acquisition
from jointz.core.entry_points import registered
from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.core.whole_file import whole_file
from jointz.io.file_kinds import missing_file, special_kind
from jointz.io.formats.columns import RawTable, TableRequest, damage_errors, file_error

GROUP = "jointz.formats"
#: Endings of text tables.
TEXT_SUFFIXES = (
    *(".csv", ".csv.gz", ".tsv", ".tsv.gz", ".txt", ".txt.gz"),
    *(".dat", ".asc", ".lvm", ".prn"),
)
#: Endings of files that know the clock of their samples.
CLOCK_SUFFIXES = (".c3d", ".mot", ".sto", ".xdf")
#: Remedy where a format is only read.
WRITE_INSTEAD = (
    "Write .csv, .tsv, .txt or .nc instead; a study becomes a BIDS folder with --to bids."
)
_TEXT = "jointz.io.text.text_format:TextFormat"
_OPENSIM = "jointz.io.formats.opensim:OpenSimFormat"
#: Suffix -> class of the formats of jointz; pyproject.toml registers the same.
BUILT_IN: Mapping[str, str] = {
    **dict.fromkeys(TEXT_SUFFIXES, _TEXT),
    **dict.fromkeys((".mot", ".sto"), _OPENSIM),
    ".c3d": "jointz.io.c3d.c3d_format:C3dFormat",
    ".mat": "jointz.io.formats.matlab_format:MatlabFormat",
    ".nc": "jointz.io.formats.netcdf_format:NetcdfFormat",
    ".parquet": "jointz.io.formats.parquet_format:ParquetFormat",
    ".xdf": "jointz.io.xdf.xdf_format:XdfFormat",
    ".xlsx": "jointz.io.text.workbook:WorkbookFormat",
}


class Format(Protocol):
    """A file format.

    To add a format, derive from :class:`jointz.io.formats.group_format.GroupFormat`: it needs
    ``name`` and ``read`` only. One that is written, too, is a :class:`WrittenFormat`.
    """

    name: str  # as messages call the format, such as "text table"

    def read(self, path: Path, files: FilesSpec) -> Acquisition:
        """Return the whole content of a file, neither interpolated nor converted."""

    def read_columns(self, path: Path, request: TableRequest) -> RawTable:
        """Return the requested columns."""

    def list_columns(self, path: Path, files: FilesSpec) -> list[str] | None:
        """Return the column names; None if only reading the samples would show them."""


class WrittenFormat(Format, Protocol):
    """A file format that is written, too."""

    def losses(self, content: Acquisition) -> list[str]:
        """Return what writing would lose, one sentence per loss."""

    def encode(self, content: Acquisition, path: Path) -> bytes:
        """Return the bytes of the file, without what :meth:`losses` lists."""


def read_table(
    path: Path,
    *,
    numeric: Sequence[str | int],
    labels: Sequence[str | int] = (),
    files: FilesSpec,
    as_written: bool = False,
    from_zero: bool = False,
    several_clocks: bool = False,
) -> RawTable:
    """Read columns of a file; the other arguments are the fields of :class:`TableRequest`."""
    file_format = _format_of_existing(path)
    request = TableRequest(
        tuple(numeric), tuple(labels), files, as_written, from_zero, several_clocks
    )
    both = {str(c) for c in numeric} & {str(c) for c in labels}
    if both:
        raise file_error(
            path,
            f"column '{min(both)}' is asked for both as numbers and as labels. Use it for one of "
            "them.",
        )
    with damage_errors(path, OSError):
        table = file_format.read_columns(path, request)
    lengths = {name: len(values) for name, values in table.columns.items()}
    without_clock = {n for name, n in lengths.items() if name not in table.clocks}
    if len(without_clock) > 1:
        raise file_error(
            path,
            f"columns differ in length: {lengths}. Choose columns that were sampled together.",
        )
    return table


def list_columns(path: Path, files: FilesSpec) -> list[str] | None:
    """List the columns of a file without reading its samples."""
    file_format = _format_of_existing(path)
    with damage_errors(path, OSError):
        return file_format.list_columns(path, files)


def read_acquisition(path: Path, files: FilesSpec | None = None) -> Acquisition:
    """Read the whole content of a file.

    Parameters
    ----------
    path : pathlib.Path
        The file; its suffix selects the format.
    files : FilesSpec, optional
        How text files are laid out.

    Raises
    ------
    DataError
        If the file is missing or damaged, or no format has its suffix.
    """
    file_format = _format_of_existing(path)
    with damage_errors(path, OSError):
        return file_format.read(path, files or FilesSpec())


def write_acquisition(content: Acquisition, path: Path, *, lossy: bool = False) -> list[str]:
    """Write a file in the format of its suffix, whole or not at all; return what was lost.

    Losses are refused unless ``lossy`` allows them.
    """
    file_format = format_to_write(path)
    losses = file_format.losses(content)
    if losses and not lossy:
        raise file_error(
            path,
            f"{file_format.name} cannot hold all of it: {' '.join(losses)} Choose another format, "
            "or allow the losses (--lossy).",
        )
    data = file_format.encode(content, path)
    with whole_file(path, "Make room or name another place.") as partial:
        partial.write_bytes(data)
    return losses


def format_of(path: Path) -> Format:
    """Return the format of a file by its suffix; of several that match, the longest counts."""
    suffix = _suffix_of(path)
    if suffix is None:
        raise _no_format(path, _formats(), "Save it as csv where it was written, or rename it.")
    return _load_format(_formats()[suffix])


def has_format(path: Path) -> bool:
    """Return whether a format reads files of this suffix."""
    return _suffix_of(path) is not None


def format_to_write(path: Path) -> WrittenFormat:
    """Return the format of a file to be written; one that is only read is refused."""
    if _suffix_of(path) is None:
        raise _no_format(path, filter(_is_written, _formats()), "Choose one of these suffixes.")
    file_format = format_of(path)
    if not _can_write(file_format):
        raise file_error(path, f"{file_format.name} is read only. {WRITE_INSTEAD}")
    return file_format


def _suffix_of(path: Path) -> str | None:
    """Return the longest suffix of a format that a file's name ends with."""
    name = path.name.lower()
    return max((suffix for suffix in _formats() if name.endswith(suffix)), key=len, default=None)


def _no_format(path: Path, suffixes: Iterable[str], todo: str) -> DataError:
    known = ", ".join(sorted(suffixes))
    return file_error(path, f"no format for this kind of file; expected one of {known}. {todo}")


def _can_write(file_format: Format) -> TypeGuard[WrittenFormat]:
    return hasattr(file_format, "encode")


def _is_written(suffix: str) -> bool:
    """Whether files of a suffix can be written; not by a package that cannot be loaded."""
    try:
        return _can_write(_load_format(_formats()[suffix]))
    except (ImportError, AttributeError):
        return False


def _format_of_existing(path: Path) -> Format:
    """Return the format of a file to be read, after checking that the file exists."""
    problem = missing_file(path, "Correct the path or copy the file there.")
    if special_kind(path):  # a pipe has no suffix that could be wrong
        raise DataError(problem, path=str(path))
    file_format = format_of(path)
    if not path.is_file():
        raise DataError(problem, path=str(path))
    return file_format


@cache
def _formats() -> Mapping[str, EntryPoint]:
    """Return the formats by suffix; those of other packages cannot replace those of jointz."""
    return registered(GROUP, BUILT_IN)


@cache
def _load_format(entry: EntryPoint) -> Format:
    return cast("Format", entry.load()())
