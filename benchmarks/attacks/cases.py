"""The cases: what is planted in each, and how it is planted."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

ANGLE, TORQUE, ENCODER = "knee_angle_deg", "torque_nm", "encoder_deg"
SHANK, THIGH = "shank_gyro_deg_s", "thigh_gyro_deg_s"


@dataclass(frozen=True)
class Case:
    """A study with one error, or none."""

    name: str
    factors: Mapping[str, float] = field(default_factory=dict)  # of columns
    missing: tuple[str, float, bool] | None = None  # column, share, in runs
    goniometer_only: bool = False
    table: bool = False  # pulse table instead of the command
    device_inertia: float | None = None  # as stated; default: as calibrated
    uncalibrated: tuple[str, ...] = ()  # entries of the calibration that are left out
    method: str = "recommended"
    walk: Mapping[str, Any] = field(default_factory=dict)  # arguments of `people.walk`


def cases() -> dict[str, Case]:
    """Return all cases by name, in the order of the table."""
    found = [Case("clean"), Case("clean_goniometer", goniometer_only=True)]
    # The goniometer is on soft skin (18 to 40 Hz); is it that, or the calibrated lag?
    on_bone = {"skin_hz": 150.0}
    found += [
        Case("clean_goniometer_no_lag", goniometer_only=True, uncalibrated=("angle_lag_s",)),
        Case("clean_goniometer_on_bone", goniometer_only=True, walk=on_bone),
        Case("clean_table", table=True),
    ]
    # Stride times 1.5, 1.25 and 1.0 s of people whose own is 1.15 s on average
    for speed, stride, excursion in ((0.6, 1.5, 0.8), (0.9, 1.25, 0.9), (1.4, 1.0, 1.05)):
        settings = {"stride": round(stride / 1.15, 3), "excursion": excursion}
        found.append(Case(f"speed_{speed}", walk=settings))
    for table in (False, True):
        for factor in (0.6, 0.8, 1.25, 1.6, 2.5):
            name = f"torque_{'table' if table else 'command'}_x{factor}"
            found.append(Case(name, {TORQUE: factor}, table=table))
    found += [Case(f"angle_x{f}", {ANGLE: f}) for f in (0.4, 0.6, 0.8, 1.25, 1.6, 2.5)]
    found += [
        Case("angle_alone_x0.6", {ANGLE: 0.6}, goniometer_only=True),
        Case("encoder_x1.3", {ENCODER: 1.3}),
        Case("shank_x1.3", {SHANK: 1.3}),
        Case("angle_encoder_x0.7", {ANGLE: 0.7, ENCODER: 0.7}),
    ]
    for name, column in (("angle", ANGLE), ("torque", TORQUE)):
        for pct in (0.3, 1, 3):
            found.append(Case(f"{name}_missing_{pct}", missing=(column, pct / 100, False)))
        found.append(Case(f"{name}_missing_runs", missing=(column, 0.1, True)))
    found += [Case(f"pulses_{n}", walk={"per_point": n}) for n in (2, 5)]
    for inertia in (0.05, 0.1):
        found += [
            Case(f"device_inertia_{inertia}", device_inertia=inertia),
            Case(
                f"device_inertia_{inertia}_dissertation",
                device_inertia=inertia,
                method="dissertation",
            ),
        ]
    # What the method gives without the error
    found.append(Case("clean_dissertation", method="dissertation"))
    return {case.name: case for case in found}


def plant(case: Case, recording: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Return a recording with the case's error."""
    recording = recording.copy()
    for column, factor in case.factors.items():
        recording[column] = (factor * recording[column]).round(4)
    if case.missing:
        column, share, in_runs = case.missing
        recording.loc[_holes(len(recording), share, rng, in_runs=in_runs), column] = np.nan
    return recording


def _holes(n: int, share: float, rng: np.random.Generator, *, in_runs: bool) -> np.ndarray:
    """Return which samples are missing: scattered ones, or runs of two to eight."""
    if not in_runs:
        return rng.random(n) < share
    starts = np.flatnonzero(rng.random(n) < share / 5 * (1 + share / 2))
    holes = np.zeros(n, dtype=bool)
    for start, length in zip(starts, rng.integers(2, 9, len(starts)), strict=True):
        holes[start : start + length] = True
    return holes
