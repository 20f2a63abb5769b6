"""Read a ``device.toml``; :mod:`jointz.devices.config` checks its content."""

import os
from pathlib import Path
from typing import Any

from jointz.core.errors import DataError, DeviceFileError
from jointz.io.toml_problems import parse_toml


def read_device_file(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return what a ``device.toml`` holds, not checked yet."""
    where = os.fspath(path)
    if not os.path.isfile(where):  # unlike Path.is_file it holds for names no system takes
        raise DataError(
            f"{where}: no such file. Name the file that says which devices there are and how they "
            "are connected.",
            path=where,
        )
    try:
        content = Path(where).read_bytes()
    except OSError as exc:
        raise DataError(f"{where}: cannot be read ({exc.strerror}).", path=where) from exc
    return parse_toml(where, content, error=DeviceFileError)
