"""Provenance of results: versions and time."""

import platform
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

_PACKAGES = ("numpy", "scipy", "pandas", "xarray", "numba", "h5netcdf", "matplotlib")


def software() -> dict[str, Any]:
    """Return the versions of jointz, Python and the packages a number depends on."""
    return {
        "jointz": version_of("jointz"),
        "python": platform.python_version(),
        "packages": {name: version_of(name) for name in _PACKAGES},
    }


@cache  # reading what is installed takes as long as many a fit
def own_version() -> str:
    """Return the version of jointz, cached for results made in large numbers."""
    return version_of("jointz")


def now() -> str:
    """Return the time in UTC, to the second, in ISO 8601."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def version_of(package: str) -> str:
    """Return the version of an installed package."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
