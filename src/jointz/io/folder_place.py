"""Rename a finished folder to its final name without removing anything that appeared there."""

import errno
import os
import secrets
import shutil
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import NoReturn

from jointz.core.errors import OutputError

_FIRST_COPY = 2


@dataclass(frozen=True, slots=True)
class FolderState:
    """Content of a path at one moment: nothing, or one folder with its files.

    Two states are equal if the same folder has the same files, none of which was written between.
    """

    identity: tuple[int, int] | None = None  # device and inode; None where nothing is
    files: frozenset[tuple[str, int, int]] = frozenset()  # path in the folder, bytes, mtime_ns

    @classmethod
    def of(cls, path: Path) -> "FolderState":
        """Return the state of a path."""
        try:
            own = path.lstat()
        except FileNotFoundError:
            return cls()
        identity = own.st_dev, own.st_ino
        try:
            files = [p for p in path.rglob("*") if p.is_symlink() or not p.is_dir()]
            found = [(p.relative_to(path).as_posix(), p.lstat()) for p in files]
        except FileNotFoundError:  # renamed or removed while it was listed
            return cls(identity)
        return cls(identity, frozenset((name, s.st_size, s.st_mtime_ns) for name, s in found))


def check_name(path: Path) -> None:
    """Refuse a name that is not UTF-8, because results and messages contain it as text."""
    try:
        str(path).encode("utf-8")
    except UnicodeEncodeError:
        shown = str(path).encode("utf-8", "backslashreplace").decode("utf-8")
        raise OutputError(
            f"{shown}: expected a name in UTF-8, found other bytes. Name another folder."
        ) from None


def take_place(finished: Path, out: Path, before: FolderState) -> None:
    """Rename a finished folder to ``out``; replace only what was there before.

    If ``out`` is something else by now, it is kept, and the finished folder is renamed to the
    first free name beside it, such as ``results-2``, which OutputError names.
    """
    if before.identity is None:
        _rename_to_free(finished, out)
    else:
        _replace(finished, out, before)


def beside(out: Path, what: str) -> Path:
    """Return a new name for a hidden folder beside another."""
    return out.with_name(f".{out.name}.{what}-{secrets.token_hex(8)}")


def _rename_to_free(finished: Path, out: Path) -> None:
    """Rename to a name that must be free; an empty folder counts as free."""
    try:
        _rename(finished, out)
    except OSError:
        if not os.path.lexists(out):
            raise
        _keep_both(finished, out)


def _rename(folder: Path, name: Path) -> None:
    """Rename a folder; the system refuses, in one step, if the name is in use.

    Linux and macOS replace an empty folder only, Windows nothing.
    """
    if os.name == "nt":
        with suppress(OSError):  # not there, or not empty
            name.rmdir()
    folder.rename(name)


def _replace(finished: Path, out: Path, before: FolderState) -> None:
    """Replace the folder that was there before; keep it if anything else is there by now."""
    if FolderState.of(out) != before:
        _rename_to_free(finished, out)
        return
    old = beside(out, "replaced")
    try:
        out.rename(old)
    except OSError:  # another process replaces it, or has a file of it open
        _keep_both(finished, out)
    try:
        _check_unchanged(old, before)
        _rename(finished, out)
    except BaseException as exc:
        _put_back(old, out)
        if isinstance(exc, OSError) and os.path.lexists(out) and FolderState.of(out) != before:
            _keep_both(finished, out, old, before)
        raise
    _remove(old)


def _check_unchanged(old: Path, before: FolderState) -> None:
    """Raise if a folder changed between the first check and its renaming."""
    if FolderState.of(old) != before:
        raise FileExistsError(errno.EEXIST, "changed meanwhile", str(old))


def _put_back(old: Path, out: Path) -> None:
    """Give a folder its name back, unless the name is in use."""
    if not os.path.lexists(out):
        with suppress(OSError):
            old.rename(out)


def _remove(old: Path) -> None:
    if old.is_symlink():
        old.unlink()
    else:
        shutil.rmtree(old, ignore_errors=True)


def _keep_both(
    finished: Path, out: Path, old: Path | None = None, before: FolderState | None = None
) -> NoReturn:
    """Rename the finished folder to a free name beside ``out``, and say so."""
    kept = _rename_beside(finished, out)
    if old and FolderState.of(old) == before:  # the one that was to be replaced
        _remove(old)
    moved = f" The folder that was there before is {old}." if old and os.path.lexists(old) else ""
    raise OutputError(
        f"{out}: appeared or was changed while the new folder was written, and is kept.{moved} "
        f"The new folder is complete: {kept}. Rename it, or remove the one that you do not need."
    )


def _rename_beside(finished: Path, out: Path) -> Path:
    """Rename to the first free name beside ``out``, and return it."""
    for number in count(_FIRST_COPY):
        name = out.with_name(f"{out.name}-{number}")
        if os.path.lexists(name):
            continue
        try:
            _rename(finished, name)
        except OSError:
            if os.path.lexists(name):  # another process was first
                continue
            raise
        return name
    raise AssertionError  # count() does not end
