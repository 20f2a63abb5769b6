"""Unpredictability of strides, recorded and simulated: ``python -m benchmarks.unpredictability``.

How far the knee angle some time after a phase is from its prediction, in degrees. The phase is
counted from the last peak of swing flexion by the last stride time, as a device does it. Two
predictors, both fitted to other strides: the best linear one from the angle at 0 to 300 ms before
the phase, and the mean stride moved to the level and slope of the angle at the phase.

Recorded angles are taken as published, with whatever noise and filter they have. Simulated angles
are those of the joint, without the noise of the goniometer, which comes on top of them.
"""

import csv
import os
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import find_peaks

from jointz.core.gait_phases import TIMING_POINTS
from jointz.rig.sim.people import draw_person, personal_preset
from jointz.rig.sim.presets import PRESETS, GaitSettings
from jointz.rig.sim.walking.gait_motion import GaitMotion, draw_shift
from jointz.rig.sim.walking.path import path

OUTPUT = Path(__file__).parents[1] / "docs" / "tables" / "unpredictability.csv"
HORIZONS_S = (0.05, 0.10, 0.15)
_BEFORE_S = np.arange(0.0, 0.301, 0.02)
_PEAK_PCT = 72.2  # of swing flexion
_SAMPLE_S = 0.01
_LARGEST_STEP_S = 0.025
_LARGEST_JUMP_DEG = 10.0  # between two samples: a knee turns by 4 or 5 degrees in 10 ms
_BLOCKS = 10
_RIDGES = 10.0 ** np.arange(-3.0, 3.1, 0.5)  # degrees^2 per stride
_SEED = 1
_PEOPLE, _STRIDES = 20, 45  # simulated


@dataclass(frozen=True, slots=True)
class Walk:
    """Knee angle of one leg in one recording."""

    source: str
    person: str
    time_s: np.ndarray
    angle_deg: np.ndarray


def unpredictability(walk: Walk) -> dict[str, float]:
    """Return strides, and the SD of what is not predicted: median over the timing points."""
    onsets = _onsets(walk)
    points = [_windows(walk, at) for at in onsets.values()]
    result: dict[str, float] = {"strides": min(len(before) for before, _ in points)}
    linear = [
        [[_linear_sd(b, after[:, i], ridge) for b, after in points] for i in range(len(HORIZONS_S))]
        for ridge in _RIDGES
    ]
    medians = np.median(linear, axis=2)
    best = medians[medians.sum(axis=1).argmin()]
    for i, horizon in enumerate(HORIZONS_S):
        matched = [_matched_sd(before, after[:, i], horizon) for before, after in points]
        result[f"linear_{1000 * horizon:.0f}ms_deg"] = float(best[i])
        result[f"matched_{1000 * horizon:.0f}ms_deg"] = float(np.median(matched))
    return result


def _onsets(walk: Walk) -> dict[str, np.ndarray]:
    """Return the times of the timing points, from the last peak and the last stride time."""
    distance = round(0.6 / _SAMPLE_S)
    found = find_peaks(walk.angle_deg, prominence=25.0, distance=distance)[0]
    found = found[(found > 0) & (found < walk.time_s.size - 1)]
    # Between the samples by the parabola through three of them.
    below, top, above = (walk.angle_deg[found + i] for i in (-1, 0, 1))
    shift = 0.5 * (below - above) / (below - 2.0 * top + above)
    peaks = walk.time_s[found] + _SAMPLE_S * shift
    lasted = np.diff(peaks)
    usual = np.abs(lasted / np.median(lasted) - 1.0) < 0.3
    after = {name: ((pct - _PEAK_PCT) % 100.0) / 100.0 for name, pct in TIMING_POINTS.items()}
    return {name: (peaks[1:] + share * lasted)[usual] for name, share in after.items()}


def _windows(walk: Walk, onsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the angle before and after onsets, (n, 16) and (n, 3), where nothing is missing."""
    time, angle = walk.time_s, walk.angle_deg
    broken = (np.diff(time) > _LARGEST_STEP_S) | (np.abs(np.diff(angle)) > _LARGEST_JUMP_DEG)
    count = np.concatenate([[0], np.cumsum(broken)])
    first = np.searchsorted(time, onsets - _BEFORE_S[-1], side="right") - 1
    last = np.searchsorted(time, onsets + HORIZONS_S[-1])
    inside = (first >= 0) & (last < time.size)
    kept = onsets[inside][count[first[inside]] == count[last[inside]]]
    before = np.interp(kept[:, None] - _BEFORE_S, time, angle)
    return before, np.interp(kept[:, None] + np.array(HORIZONS_S), time, angle)


def _folds(n: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the strides to fit to and those to predict: neighbours are left out together."""
    edges = np.linspace(0, n, _BLOCKS + 1).round().astype(int)
    for low, high in pairwise(edges.tolist()):
        out = np.zeros(n, dtype=bool)
        out[low:high] = True
        yield ~out, out


def _linear_sd(before: np.ndarray, after: np.ndarray, ridge: float) -> float:
    residual = np.empty(after.size)
    for fit, out in _folds(after.size):
        centre, level = before[fit].mean(axis=0), after[fit].mean()
        angles = before[fit] - centre
        normal = angles.T @ angles + ridge * fit.sum() * np.eye(angles.shape[1])
        weights = np.linalg.solve(normal, angles.T @ (after[fit] - level))
        residual[out] = after[out] - level - (before[out] - centre) @ weights
    return float(residual.std())


def _matched_sd(before: np.ndarray, after: np.ndarray, horizon: float) -> float:
    slope = (before[:, 0] - before[:, 1]) / (_BEFORE_S[1] - _BEFORE_S[0])
    moved = after - before[:, 0] - horizon * slope
    residual = np.empty(after.size)
    for fit, out in _folds(after.size):
        residual[out] = moved[out] - moved[fit].mean()
    return float(residual.std())


def recorded_walks(folder: Path) -> Iterator[Walk]:
    """Yield the recorded walks that are there."""
    table = pd.read_csv(folder / "moore2015_walk" / "UnpertPre_data.csv")
    for side in ("Left", "Right"):
        angle = np.degrees(table[f"{side}KneeFlexionAngle"].to_numpy())
        yield Walk("moore2015_walk, 0.8 m/s", f"1, {side.lower()}", table["time"].to_numpy(), angle)
    # Only on the left is one of the three undocumented axes the flexion of the knee.
    for walk, speed in (("4", "4 km/h"), ("5", "5 km/h"), ("mix", "changing speed")):
        table = pd.read_csv(folder / "tum_walk" / f"walk_{walk}_Angles_left.txt.gz", sep="\t")
        time = pd.to_timedelta(table["Time"]).dt.total_seconds().to_numpy()
        walking = (time > time[0] + 8.0) & (time < time[-1] - 5.0)
        angle = table["Knee_x"].to_numpy()[walking]
        yield Walk(f"tum_walk, {speed}", "2, left", time[walking], angle)


def simulated_walk(gait: GaitSettings, number: int, *, source: str) -> Walk:
    """Return the unperturbed knee of a simulated person."""
    person = draw_person(number, seed=_SEED)
    rng = person.stream("unpredictability")
    motion = GaitMotion(
        gait, stride_time_s=person.stride_time_s, shift=draw_shift(gait, rng), rng=rng
    )
    strides = [motion.next() for _ in range(_STRIDES + 3)]
    times = [np.arange(0.0, s.duration_s, _SAMPLE_S) + s.start_s for s in strides]
    at = np.arange(times[0][0], times[-1][-1], _SAMPLE_S)
    starts = np.array([s.start_s for s in strides])
    which = np.searchsorted(starts, at, side="right") - 1
    angle = [path(strides[i].row, float(t))[0] for i, t in zip(which, at, strict=True)]
    return Walk(source, str(number), at, np.degrees(angle))


def simulated_rows(name: str) -> Iterator[dict[str, object]]:
    """Yield the median over people of a preset, and the range that holds 80 % of them."""
    people = [draw_person(number, seed=_SEED) for number in range(_PEOPLE)]
    values = pd.DataFrame(
        [
            unpredictability(
                simulated_walk(personal_preset(p, PRESETS[name]).gait, p.number, source=name)
            )
            for p in people
        ]
    )
    for label, quantile in (("median", 0.5), ("10 % of people", 0.1), ("90 % of people", 0.9)):
        person = f"{_PEOPLE} people, {label}"
        yield {"source": name, "person": person, **values.quantile(quantile)}


def main() -> None:
    """Write the table."""
    folder = Path(os.environ.get("JOINTZ_DATA", "../shared/data"))
    rows: list[dict[str, object]] = [
        {"source": walk.source, "person": walk.person, **unpredictability(walk)}
        for walk in recorded_walks(folder)
    ]
    for name in PRESETS:
        if name != "clean":  # every stride is the same
            rows += simulated_rows(name)
    with OUTPUT.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.2f}" if k.endswith("_deg") else v for k, v in row.items()})
    print(pd.DataFrame(rows).round(2).to_string())


if __name__ == "__main__":
    main()
