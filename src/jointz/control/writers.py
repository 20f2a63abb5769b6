"""Files that other software reads: C, MATLAB, CSV and the Open-Source Leg's state machine."""

import hashlib
import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jointz.control.impedance_profile import INTERVALS, LAW, PROFILE_UNITS, ImpedanceProfile
from jointz.control.state_machine import StateMachineFit, fit_state_machine
from jointz.core.errors import DataError
from jointz.core.whole_file import refuse_existing, whole_file


def export_profile(profile: ImpedanceProfile, file: str | os.PathLike[str]) -> Path:
    """Write a profile for other software, by the suffix of the file.

    Parameters
    ----------
    profile : ImpedanceProfile
        The profile.
    file : path
        ``.h``: C; ``.mat``: MATLAB and Octave; ``.csv``: a table; ``.py``: constants of the
        Open-Source Leg's four states, which are fitted and lose what they cannot hold.

    Returns
    -------
    pathlib.Path
        The file.

    Raises
    ------
    DataError
        For another suffix, or a joint or direction that the state machine is not for.
    OutputError
        When the file exists.
    """
    path = Path(file)
    write = _WRITERS.get(path.suffix.lower())
    if write is None:
        raise DataError(f"{path}: expected a suffix out of {', '.join(_WRITERS)}.")
    refuse_existing(path)
    with whole_file(path) as partial:
        write(profile, partial, path.stem)
    return path


def _write_csv(profile: ImpedanceProfile, file: Path, _: str) -> None:
    # Python's shortest decimals: every reader gets the same double back.
    file.write_text(profile.to_frame().to_csv(index=False, lineterminator="\n"), encoding="utf-8")


def _write_matlab(profile: ImpedanceProfile, file: Path, _: str) -> None:
    from scipy.io import savemat

    table = profile.to_frame()
    content: dict[str, Any] = {str(name): table[name].to_numpy()[:, None] for name in table}
    content |= {name: getattr(profile, name) for name in _ABOUT}
    content |= {"law": LAW, "units": dict(PROFILE_UNITS)}
    with file.open("wb") as stream:
        savemat(stream, {"profile": content})


_ABOUT = ("subject", "joint", "positive", "side", "mass_kg", "stride_s", "displacement")
_C_BODY = """
static inline double {name}_between(const double *values, int node, double share)
{{
    return values[node] + share * (values[(node + 1) % {NAME}_NODES] - values[node]);
}}
/* Torque on the joint, N*m. gait_pct: phase, %; angle: rad; velocity: rad/s. */
static inline double {name}_torque(double gait_pct, double angle, double velocity)
{{
    double place = gait_pct / 100.0;
    place = (place - floor(place)) * {NAME}_NODES;
    if (!(place >= 0.0)) return 0.0; /* the phase is no number */
    int node = (int)place;
    if (node >= {NAME}_NODES) node = {NAME}_NODES - 1;
    const double share = place - node;
    return {name}_between({name}_stiffness, node, share)
        * ({name}_between({name}_equilibrium, node, share) - angle)
        - {name}_between({name}_damping, node, share) * velocity;
}}
"""


def _write_c(profile: ImpedanceProfile, file: Path, stem: str) -> None:
    name = re.sub(r"\W", "_", stem, flags=re.ASCII)
    name = name if re.match(r"[A-Za-z]", name) else f"knee_{name}"
    if name == "math":
        raise DataError("math.h: the C library has a file of that name. Name another file.")
    lines = [
        f"/* {text} */"
        for text in (*_about(profile), LAW, "Made from a profile: change that, not this.")
    ]
    # Two files whose names differ in other characters than letters must not hide each other.
    guard = f"{name.upper()}_{hashlib.sha256(stem.encode()).hexdigest()[:8].upper()}_H"
    lines += [f"#ifndef {guard}", f"#define {guard}", "#include <math.h>"]
    lines.append(f"#define {name.upper()}_NODES {profile.gait_pct.size}")
    for quantity in INTERVALS:
        numbers = ", ".join(repr(value) for value in getattr(profile, quantity).tolist())
        lines.append(f"/* {PROFILE_UNITS[quantity]} */")
        lines.append(
            f"static const double {name}_{quantity}[{name.upper()}_NODES] = {{{numbers}}};"
        )
    body = _C_BODY.format(name=name, NAME=name.upper())
    file.write_text("\n".join(lines) + body + "#endif\n", encoding="utf-8")


def _write_osl(profile: ImpedanceProfile, file: Path, _: str) -> None:
    if (profile.joint, profile.positive) != ("knee", "flexion"):
        raise DataError("the Open-Source Leg's states are for a knee with flexion positive.")
    fit = fit_state_machine(profile)
    lines = [f"# {text}" for text in (*_about(profile), *fit_text(fit))]
    for state in fit.states:
        lines.append(f"# {state.begin_pct:g} to {state.end_pct:g} % of the gait cycle")
        degrees = float(np.degrees(state.equilibrium))
        values = ("K", state.stiffness), ("B", state.damping), ("THETA", degrees)
        lines += [f"KNEE_{key}_{state.name} = {value!r}" for key, value in values]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def fit_text(fit: StateMachineFit) -> tuple[str, ...]:
    """Return sentences on how well four states hold a profile."""
    return (
        f"Four states of constant impedance: RMS error {fit.rms_nm:.2f} N*m along the mean stride, "
        f"{fit.rms_deviated_nm:.2f} N*m with deviations from it.",
        "K in N*m/rad, B in N*m*s/rad, THETA in degrees of flexion. The rules that change the "
        "state (load, ankle, knee angle) stay those of the leg's own controller.",
    )


def _about(profile: ImpedanceProfile) -> tuple[str, ...]:
    """Return lines for the head of a file; a name cannot end a comment."""
    texts = profile.summary().splitlines()
    return tuple(re.sub(r"[^\x20-\x7e]|\*/|/\*", " ", text).strip() for text in texts)


_WRITERS: Mapping[str, Callable[[ImpedanceProfile, Path, str], None]] = {
    ".h": _write_c,
    ".mat": _write_matlab,
    ".csv": _write_csv,
    ".py": _write_osl,
}
