"""Paths of files and folders relative to another folder."""

import os
from pathlib import Path


def seen_from(place: Path, folder: Path) -> str:
    """Return where a file or folder is as seen from a folder; from the root where no way leads."""
    try:
        return Path(os.path.relpath(place.resolve(), folder.resolve())).as_posix()
    except ValueError:  # on another drive
        return place.resolve().as_posix()
