"""Output folders: filled beside their place, renamed when whole, never over what others made."""

import json
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from jointz.core.errors import DataError, OutputError, WriteError
from jointz.core.stop_signals import signals_held
from jointz.io.folder_place import FolderState, beside, check_name, take_place
from jointz.io.small_files import read_json

#: File that shows that jointz made a folder, and so may replace it.
MARKER = "provenance.json"
#: Key of the marker with the SHA-256 of every other file of a results folder, by name.
CHECKSUMS = "sha256"
#: Contents of a folder by its marker (``made_by``); one kind never replaces another.
ANALYSIS, COMPARISON, POOL = "analysis", "comparison", "pool"
#: File that shows the kind of a folder whose marker is older and does not name it.
_KIND_FILES = ((ANALYSIS, "estimates.csv"), (COMPARISON, "comparison.json"))


def check_free(
    out: Path, *, marker: str, overwrite: bool, made_by: str | None = None
) -> FolderState:
    """Raise unless a folder can be made or replaced here; return what is there."""
    check_name(out)
    if out.name in ("", ".."):  # a folder beside it is filled first and then takes its name
        raise OutputError(
            f"{out}: is no name for a new folder. Give the name itself, such as results or "
            "../results."
        )
    with _write_errors(out):
        before = FolderState.of(out)  # first: what changes during the checks is seen at the end
        if before.identity is None or (out.is_dir() and not any(out.iterdir())):
            return before
    if out.is_symlink() and not out.exists():
        raise OutputError(f"{out}: is a link to nothing. Remove it, or name another folder.")
    if not out.is_dir():
        raise OutputError(f"{out}: is a file. Name a folder that does not exist yet.")
    if not overwrite:
        raise OutputError(
            f"{out}: exists and is kept. Name another folder, or replace it: --overwrite, "
            "overwrite=True."
        )
    listed = _listed_files(out / marker)
    if listed is None:
        raise OutputError(
            f"{out}: contains no {marker} of jointz, so jointz did not make it and will not "
            "replace it. Name another folder."
        )
    if made_by is not None:
        _check_kind(out, out / marker, made_by)
    foreign = sorted(files_in(out) - listed - {marker})
    if foreign:
        raise OutputError(
            f"{out}: contains files that jointz did not write ({', '.join(foreign[:3])}"
            f"{', ...' if len(foreign) > 3 else ''}) and will not replace it. Move them, or name "
            "another folder."
        )
    return before


def write_marker(folder: Path, marker: str, content: Mapping[str, object]) -> None:
    """Write the marker of a folder last; it lists all other files."""
    write_json(folder / marker, {**content, "files": sorted(files_in(folder) - {marker})})


def files_in(folder: Path) -> set[str]:
    """Return the files of a folder and of those in it, relative to it."""
    return {p.relative_to(folder).as_posix() for p in folder.rglob("*") if not p.is_dir()}


def _listed_files(marker: Path) -> set[str] | None:
    """Return the files that a marker lists, None if jointz did not write it."""
    try:
        listed = read_json(marker, "")["files"]
        return set(map(str, listed))
    except (ValueError, KeyError, TypeError):
        return None


def _kind(marker: Path) -> str:
    """Return the kind of a folder, empty if its marker does not show it."""
    content = read_json(marker, "Name another folder.")
    if "made_by" in content:
        return str(content["made_by"])
    return next((kind for kind, name in _KIND_FILES if name in content["files"]), "")


def _check_kind(out: Path, marker: Path, made_by: str) -> None:
    """Refuse to replace a folder of another kind."""
    if (kind := _kind(marker)) != made_by:
        raise OutputError(
            f"{out}: jointz made it as {kind or 'something else'}, not as {made_by or 'this'}. It "
            "is kept, as overwriting replaces the same kind only. Name another folder."
        )


@contextmanager
def new_folder(
    out: Path,
    *,
    marker: str,
    overwrite: bool,
    made_by: str | None = None,
    before: FolderState | None = None,
) -> Iterator[Path]:
    """Yield a folder to fill, which takes its name only if there was no error.

    It replaces nothing but what was there at the beginning, or at an earlier :func:`check_free`
    that returned ``before``.
    """
    if before is None:
        before = check_free(out, marker=marker, overwrite=overwrite, made_by=made_by)
    with _write_errors(out), _parents(out), _partial_folder(out) as partial:
        yield partial
        with suppress(FileNotFoundError, DataError):  # replaced by another: take_place sees it
            if (out / marker).exists() and FolderState.of(out) == before:
                _check_kind(out, out / marker, _kind(partial / marker))
        with signals_held():
            take_place(partial, out, before)


@contextmanager
def _write_errors(out: Path) -> Iterator[None]:
    """Raise errors of the file system as WriteError."""
    try:
        yield
    except OSError as exc:
        todo = "Make room or ask for permission, or name another folder."
        raise WriteError(str(out), exc, todo) from exc


@contextmanager
def _parents(out: Path) -> Iterator[None]:
    """Create the folders above ``out``, and remove them again after an exception."""
    missing = [parent for parent in out.parents if not parent.exists()]
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        for parent in missing:
            with suppress(OSError):  # no longer empty, or never created
                parent.rmdir()
        raise


@contextmanager
def _partial_folder(out: Path) -> Iterator[Path]:
    """Yield a new folder beside ``out`` that is removed after an exception."""
    partial = beside(out, "partial")
    try:  # before the folder exists, as an interrupt may come at any time
        partial.mkdir()
        yield partial
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise


def write_json(file: Path, content: object, indent: int | None = 2) -> None:
    """Write an object as strict JSON."""
    file.write_text(json.dumps(content, indent=indent, allow_nan=False) + "\n", encoding="utf-8")
