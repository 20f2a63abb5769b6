"""Whole files of any format in and out: one door, formats behind it by suffix.

:mod:`jointz.io.column_readers` gives a study the columns that it names. This gives all that a file
holds (:mod:`jointz.core.acquisition`), for looking at it and for writing it in another format.
"""

from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Protocol, TypeVar

from jointz.core.acquisition import Acquisition
from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.column_readers import damaged

#: Suffix -> module that registers the format when it is loaded.
_HOMES: Mapping[str, str] = {
    ".c3d": "jointz.io.c3d.c3d_format",
    ".xdf": "jointz.io.xdf.xdf_format",
    ".mot": "jointz.io.formats.opensim",
    ".sto": "jointz.io.formats.opensim",
    ".xlsx": "jointz.io.text.workbook",
    **dict.fromkeys(
        (".csv", ".csv.gz", ".tsv", ".tsv.gz", ".txt", ".txt.gz"), "jointz.io.text.text_format"
    ),
    ".parquet": "jointz.io.formats.parquet_format",
    ".nc": "jointz.io.formats.netcdf_format",
    ".mat": "jointz.io.formats.matlab_format",
}


class Format(Protocol):
    """What a file format has to offer."""

    name: str

    def read(self, path: Path, files: FilesSpec) -> Acquisition:
        """Return all that a file holds, nothing interpolated, nothing converted."""

    def losses(self, content: Acquisition) -> list[str]:
        """Return what of a content the format cannot hold, a sentence each; empty: all is held."""

    def write(self, content: Acquisition, path: Path) -> None:
        """Write what the format can hold; the file is there whole or not at all."""


_F = TypeVar("_F", bound=Format)

_FORMATS: dict[str, Format] = {}


def register_format(*suffixes: str) -> Callable[[type[_F]], type[_F]]:
    """Register a format class for files with these suffixes."""

    def register(kind: type[_F]) -> type[_F]:
        _FORMATS.update(dict.fromkeys(suffixes, kind()))
        return kind

    return register


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
    kind = format_of(path)
    if not path.is_file():
        raise DataError(
            f"{path}: no such file. Correct the name or bring the file.", path=str(path)
        )
    try:
        return kind.read(path, files or FilesSpec())
    except OSError as exc:
        raise damaged(path, exc) from exc


def write_acquisition(content: Acquisition, path: Path, *, lossy: bool = False) -> list[str]:
    """Write a content in the format that the file's suffix says."""
    kind = format_of(path)
    lost = kind.losses(content)
    if lost and not lossy:
        raise DataError(
            f"{path.name}: {kind.name} cannot hold all of it: {' '.join(lost)} Choose another "
            "format, or say that this may be left out (--lossy).",
            path=str(path),
        )
    kind.write(content, path)
    return lost


def format_of(path: Path) -> Format:
    """Return the format that a file's suffix says."""
    name = path.name.lower()
    known = sorted({*_HOMES, *_FORMATS})
    fitting = [suffix for suffix in known if name.endswith(suffix)]
    if not fitting:
        raise DataError(
            f"{path.name}: no format for this kind of file; expected one of {', '.join(known)}. "
            "Correct its suffix.",
            path=str(path),
        )
    suffix = max(fitting, key=len)
    if suffix not in _FORMATS:
        import_module(_HOMES[suffix])
    return _FORMATS[suffix]
