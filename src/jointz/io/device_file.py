"""Read a ``device.toml``; :mod:`jointz.devices.config` checks its content."""

import os
from typing import Any

from jointz.core.errors import DeviceFileError
from jointz.io.toml_problems import file_content, parse_toml


def read_device_file(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return what a ``device.toml`` holds, not checked yet."""
    where = os.fspath(path)
    absent = (
        f"{where}: no such file. Name the file that says which devices there are and how they are "
        "connected."
    )
    return parse_toml(where, file_content(where, absent=absent), error=DeviceFileError)
