"""Profile files (JSON): what is written can be read again to the last bit, and nothing else."""

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jointz.control.impedance_profile import (
    ARRAYS,
    GRID_PCT,
    INTERVALS,
    LAW,
    PROFILE_UNITS,
    ImpedanceProfile,
)
from jointz.core.errors import DataError
from jointz.core.whole_file import refuse_existing, whole_file
from jointz.io.small_files import read_json

_POSITIVE = ("stiffness", "stiffness_low", "damping", "damping_low")
_LARGEST_BYTES = 5_000_000
_AGAIN = "Make the file again: jointz control profile."


def profile_text(profile: ImpedanceProfile) -> str:
    """Return a profile as JSON with its law, its units and its SHA-256."""
    content = {**profile.to_dict(), "law": LAW, "units": dict(PROFILE_UNITS)}
    return json.dumps({**content, "sha256": _sha256(content)}, indent=1, allow_nan=False) + "\n"


def write_profile(profile: ImpedanceProfile, file: str | os.PathLike[str]) -> Path:
    """Write a profile file.

    Parameters
    ----------
    profile : ImpedanceProfile
        The profile.
    file : path
        The file to write (JSON).

    Returns
    -------
    pathlib.Path
        The file.

    Raises
    ------
    OutputError
        When it exists.
    WriteError
        When it cannot be written.
    """
    path = Path(file)
    refuse_existing(path)
    with whole_file(path) as partial:
        partial.write_text(profile_text(profile), encoding="utf-8")
    return path


def read_profile(file: str | os.PathLike[str]) -> ImpedanceProfile:
    """Read a profile file.

    Parameters
    ----------
    file : path
        A file of ``jointz control profile``.

    Returns
    -------
    ImpedanceProfile
        The profile.

    Raises
    ------
    DataError
        When it is no profile, or was changed after jointz wrote it.
    """
    todo = "Give a profile of jointz control profile."
    return profile_of(read_json(file, todo, largest=_LARGEST_BYTES), os.fspath(file))


def profile_of(content: Mapping[str, Any], where: str) -> ImpedanceProfile:
    """Return the profile that a file holds; raise DataError if it is none or was edited."""
    hashed = {key: value for key, value in content.items() if key != "sha256"}
    if (schema := hashed.get("schema")) != ImpedanceProfile.SCHEMA:
        raise DataError(
            f"{where}: expected schema {ImpedanceProfile.SCHEMA}, got {schema!r}. {_AGAIN}"
        )
    if content.get("sha256") != _sha256(hashed):
        raise DataError(
            f"{where}: was changed after jointz wrote it: its SHA-256 does not fit. A controller "
            f"must not follow numbers of unknown origin. {_AGAIN}"
        )
    law, units = hashed.pop("law", None), hashed.pop("units", None)
    try:
        profile = ImpedanceProfile.from_dict(hashed)
    except (ValueError, OverflowError) as exc:  # pydantic's among them
        raise DataError(f"{where}: {exc}. {_AGAIN}") from exc
    problems = list(_problems(profile))
    if (law, units) != (LAW, dict(PROFILE_UNITS)):
        problems.append("law or units are not those of this version")
    if problems:
        raise DataError(f"{where}: {'; '.join(problems)}. {_AGAIN}")
    return profile


def _problems(profile: ImpedanceProfile) -> list[str]:
    n = GRID_PCT.size
    problems = [
        f"{name}: expected {n} numbers" for name in ARRAYS if getattr(profile, name).shape != (n,)
    ]
    problems += [
        f"{name}: expected finite numbers"
        for name, value in profile.to_dict().items()
        if not _is_finite(value)
    ]
    return problems or list(_contradictions(profile))


def _is_finite(value: Any) -> bool:
    """Return whether JSON can hold a value."""
    try:
        json.dumps(value, allow_nan=False)
    except ValueError:
        return False
    return True


def _contradictions(profile: ImpedanceProfile) -> Iterator[str]:
    """Yield what cannot be in a profile whose arrays are whole."""
    if not np.array_equal(profile.gait_pct, GRID_PCT):
        yield "gait_pct: expected 0 to 99 %"
    for name in _POSITIVE:
        if (getattr(profile, name) <= 0.0).any():
            yield f"{name}: expected > 0"
    for name in INTERVALS:
        low, value, high = (getattr(profile, f"{name}{end}") for end in ("_low", "", "_high"))
        if (low > value).any() or (value > high).any():
            yield f"{name}: expected low <= value <= high"
    along = profile.torque(profile.gait_pct, profile.angle, profile.velocity)
    if not np.allclose(along, profile.moment, atol=1e-6):
        yield "equilibrium: does not give the moment along the mean stride"


def _sha256(content: Mapping[str, Any]) -> str:
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()
