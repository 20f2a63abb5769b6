"""Paths of files and folders relative to another folder, and short names of several."""

import os
from collections.abc import Sequence
from pathlib import Path


def seen_from(place: Path, folder: Path) -> str:
    """Return where a file or folder is as seen from a folder; from the root where no way leads."""
    try:
        return Path(os.path.relpath(place.resolve(), folder.resolve())).as_posix()
    except ValueError:  # on another drive
        return place.resolve().as_posix()


def distinct_names(paths: Sequence[Path], *, taken: str = "") -> list[str]:
    """Name paths by their shortest distinct ends, none of which is ``taken``."""
    parts = [path.resolve().parts for path in paths]
    names: list[str] = []
    for length in range(1, max(map(len, parts), default=0) + 1):
        names = ["/".join(part[-length:]) for part in parts]
        if len(set(names)) == len(names) and taken not in names:
            break
    return names
