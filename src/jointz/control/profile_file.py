"""Profile files (JSON): what is written can be read again to the last bit, and nothing else."""

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jointz.control.impedance_profile import GRID_PCT, LAW, PROFILE_UNITS, ImpedanceProfile
from jointz.core.errors import DataError
from jointz.core.whole_file import refuse_existing, whole_file

_INTERVALS = ("stiffness", "damping", "equilibrium")
_ARRAYS = (
    *("gait_pct", "angle", "angle_sd", "moment", "moment_sd"),
    *(f"{name}{end}" for name in _INTERVALS for end in ("", "_low", "_high")),
)
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
    path = Path(file)
    try:
        content = _content(path)
    except (OSError, ValueError, OverflowError, RecursionError) as exc:
        raise DataError(
            f"{path}: expected a profile of jointz control profile, cannot be read ({exc}).",
            path=str(path),
        ) from exc
    return profile_of(content, str(path))


def _content(path: Path) -> dict[str, Any]:
    if path.stat().st_size > _LARGEST_BYTES:
        raise ValueError(f"larger than {_LARGEST_BYTES} bytes")
    content = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(content, dict):
        raise ValueError("no JSON object")  # noqa: TRY004 - a file's content, no argument
    return content


def profile_of(content: Mapping[str, Any], where: str) -> ImpedanceProfile:
    """Return the profile that a file holds; raise DataError if it is none or was edited."""
    own = {key: value for key, value in content.items() if key != "sha256"}
    if own.get("schema") != ImpedanceProfile.SCHEMA:
        raise DataError(
            f"{where}: expected schema {ImpedanceProfile.SCHEMA}, got {own.get('schema')!r}. "
            f"{_AGAIN}"
        )
    if content.get("sha256") != _sha256(own):
        raise DataError(
            f"{where}: was changed after jointz wrote it: its SHA-256 does not fit. A controller "
            f"must not follow numbers of unknown origin. {_AGAIN}"
        )
    law, units = own.pop("law", None), own.pop("units", None)
    try:
        profile = ImpedanceProfile.from_dict(own)
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
    arrays: dict[str, np.ndarray] = {name: getattr(profile, name) for name in _ARRAYS}
    problems = [
        f"{name}: expected {n} finite numbers"
        for name, values in arrays.items()
        if values.shape != (n,) or not np.isfinite(values).all()
    ]
    numbers = [getattr(profile, name) for name in ("energy_j", "damping_loss_j", "ci_level")]
    if not np.isfinite([*numbers, profile.energy_low_j, profile.energy_high_j]).all():
        problems.append("energy and ci_level: expected finite numbers")
    if not (0.0 < profile.mass_kg < np.inf and 0.0 < profile.stride_s < np.inf):
        problems.append("mass_kg and stride_s: expected > 0")
    k = profile.covariance.shape
    if len(k) != 2 or k[0] != k[1] or not np.isfinite(profile.covariance).all():
        problems.append("covariance: expected a square of finite numbers")
    return problems or list(_contradictions(profile))


def _contradictions(profile: ImpedanceProfile) -> Iterator[str]:
    """Yield what cannot be in a profile whose arrays are whole."""
    if not np.array_equal(profile.gait_pct, GRID_PCT):
        yield "gait_pct: expected 0 to 99 %"
    for name in _POSITIVE:
        if (getattr(profile, name) <= 0.0).any():
            yield f"{name}: expected > 0"
    for name in _INTERVALS:
        low, value, high = (getattr(profile, f"{name}{end}") for end in ("_low", "", "_high"))
        if (low > value).any() or (value > high).any():
            yield f"{name}: expected low <= value <= high"
    along = profile.torque(profile.gait_pct, profile.angle, profile.velocity)
    if not np.allclose(along, profile.moment, atol=1e-6):
        yield "equilibrium: does not give the moment along the mean stride"


def _sha256(content: Mapping[str, Any]) -> str:
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()
