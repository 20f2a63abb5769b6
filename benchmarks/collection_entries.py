"""Entries of fictional labs, made of numbers: for the benchmark and the tests of collections.

Nobody measured anything here: values are drawn around those of the dissertation's tables.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jointz.collections.entry_reader import written_entry
from jointz.core.channels import PARAMETER_UNITS
from jointz.core.gait_phases import TIMING_POINTS
from jointz.io.formats.columns import file_sha256
from jointz.results.estimates import COVARIANCE_COLUMNS, ESTIMATE_COLUMNS, REACH_95

#: Medians of fictional joints, SI: stiffness, damping, inertia.
JOINTS: Mapping[str, tuple[str, float, float, float]] = {
    "knee": ("flexion", 75.0, 2.9, 0.16),
    "ankle": ("dorsiflexion", 90.0, 2.0, 0.03),
    "hip": ("flexion", 110.0, 4.0, 1.4),
    "elbow": ("flexion", 9.0, 0.6, 0.07),
    "wrist": ("flexion", 1.8, 0.03, 0.004),
}
PARAMETERS = ("stiffness", "damping", "inertia")
#: Relative standard deviation of an estimate, and correlation of K with B, K with J, B with J.
_SD = np.array([0.12, 0.10, 0.08])
_CORRELATION = np.array([[1.0, 0.2, -0.5], [0.2, 1.0, 0.1], [-0.5, 0.1, 1.0]])

Change = Callable[[dict[str, Any], dict[str, pd.DataFrame]], None]


def write_entry(
    folder: Path,
    *,
    seed: int,
    people: int = 12,
    joint: str = "knee",
    activity: str = "walking",
    change: Change | None = None,
) -> None:
    """Write an entry without problems, or one that ``change`` spoils before it is hashed.

    Parameters
    ----------
    folder : pathlib.Path
        Its folder, whose name is the study's id.
    seed : int
        Another one makes other people.
    people : int
        How many.
    joint, activity : str
        Of the study.
    change : callable, optional
        Given the content of ``entry.toml`` and the tables (file -> table), alters them.
    """
    rng = np.random.default_rng(seed)
    spec = _spec(folder.name, rng, people=people, joint=joint, activity=activity)
    tables = _tables(rng, spec)
    if change is not None:
        change(spec, tables)
    folder.mkdir(parents=True)
    for file, table in tables.items():
        table.to_csv(folder / file, index=False, float_format="%.10g")
    spec.setdefault("hashes", {file: file_sha256(folder / file) for file in tables})
    (folder / "entry.toml").write_text(written_entry(spec), encoding="utf-8")


def _spec(
    name: str, rng: np.random.Generator, *, people: int, joint: str, activity: str
) -> dict[str, Any]:
    in_gait = activity in ("walking", "running")
    speed = round(float(rng.uniform(0.6, 1.8)) * (2.0 if activity == "running" else 1.0), 2)
    gait = {"walking_speed_m_s": speed, "slope_deg": 0.0, "surface": "treadmill"}
    condition = {"name": f"{activity} {speed:g}", "activity": activity,
                 "estimates": "estimates.csv", "covariance": "covariance.csv"}  # fmt: skip
    return {
        "jointz_entry": 1,
        "study": name,
        "version": "1.0",
        "title": f"The {joint} of {people} fictional people",
        "values": "estimates",
        "licence": "CC-BY-4.0",
        "cite": f"Fictional lab {name}: simulated values, nobody was measured.",
        "protocol": "doi:10.0000/fictional",
        "exclusions": [{"kind": "pulse", "n": 7, "reason": "overlapping_pulse"}],
        "contributors": [{"name": "A. Fictional"}],
        "ethics": {"approval": "Fictional committee, number 0", "consent": "public"},
        "device": {"name": "fictional perturbator", "torque": "joint_torque_sensor"},
        "joint": {"name": joint, "side": "right", "positive": JOINTS[joint][0]},
        "calibration": {"torque_gain": {"value": 1.0, "sd": 0.02}},
        "units": {
            n: PARAMETER_UNITS[n] for n in (*PARAMETERS, "stiffness_per_mass", "damping_per_mass")
        },
        "method": {"name": "rigid", "settings": {"window_s": 0.1}},
        "software": {"name": "jointz", "version": "0.1.0"},
        "participants": [_person(rng, k) for k in range(people)],
        "conditions": [condition | (gait if in_gait else {})],
        "raw_data": {"where": "nowhere: they are simulated"},
    }


def _person(rng: np.random.Generator, k: int) -> dict[str, Any]:
    return {
        "id": f"S{k + 1:03d}",
        "age_band": ("20-29", "30-39", "60-69")[int(rng.integers(3))],
        "sex": ("female", "male")[int(rng.integers(2))],
        "mass_kg": round(float(rng.normal(73.0, 9.0)), 1),
        "height_m": round(float(rng.normal(1.72, 0.09)), 2),
    }


def _tables(rng: np.random.Generator, spec: Mapping[str, Any]) -> dict[str, pd.DataFrame]:
    masses = {person["id"]: person["mass_kg"] for person in spec["participants"]}
    in_gait = spec["conditions"][0]["activity"] in ("walking", "running")
    places = dict(TIMING_POINTS) if in_gait else {"rest": np.nan}
    cells = [(person, point) for person in masses for point in places]
    medians = np.array(JOINTS[spec["joint"]["name"]][1:])
    truth = medians * np.exp(rng.normal(0.0, 0.35, (len(cells), 3)))
    sd = truth * _SD
    values = truth + sd * (rng.normal(size=truth.shape) @ np.linalg.cholesky(_CORRELATION).T)
    frame = pd.DataFrame(cells, columns=["participant", "timing_point"]).assign(session="", side="")
    frame["onset_gait_pct"] = [places[point] + rng.normal(0, 0.3) for _, point in cells]
    mass = frame["participant"].map(masses).to_numpy()
    parts = [_rows(frame, name, values[:, k], sd[:, k]) for k, name in enumerate(PARAMETERS)]
    parts += [_rows(frame, f"{name}_per_mass", values[:, k] / mass, sd[:, k] / mass)
              for k, name in enumerate(PARAMETERS[:2])]  # fmt: skip
    covariances = sd[:, :, None] * sd[:, None, :] * _CORRELATION
    return {
        "estimates.csv": pd.concat(parts, ignore_index=True).reindex(
            columns=list(ESTIMATE_COLUMNS)
        ),
        "covariance.csv": _covariances(frame, covariances),
    }


def _rows(frame: pd.DataFrame, name: str, values: np.ndarray, sd: np.ndarray) -> pd.DataFrame:
    return frame.assign(
        parameter=name, value=values, unit=PARAMETER_UNITS[name],
        ci_low=values - REACH_95 * sd, ci_high=values + REACH_95 * sd, ci_level=0.95,
        vaf_pct=99.0, n_used=50, n_excluded=1, method="rigid", status="ok",
    )  # fmt: skip


def _covariances(frame: pd.DataFrame, covariances: np.ndarray) -> pd.DataFrame:
    cells = frame[["participant", "timing_point", "session", "side"]]
    columns = list(COVARIANCE_COLUMNS[3:6])
    parts = [
        cells.assign(parameter=name, **dict(zip(columns, covariances[:, k].T, strict=True)))
        for k, name in enumerate(PARAMETERS)
    ]
    return pd.concat(parts, ignore_index=True)[list(COVARIANCE_COLUMNS)]
