"""Coverage of means over people: ``python -m benchmarks.population`` from the repository's root.

Studies of ten are drawn again and again from a pool of simulated people; wherever a mean is given,
its 95 % interval is held against the mean of the preset's whole population. What is analysed is
kept in ``.accuracy-cache``; the table stands in ``docs/population.md``.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from benchmarks.accuracy.people import cell_truth, rig_of, settings_of, simulate
from benchmarks.accuracy.rows import PARAMETERS, all_rows
from benchmarks.accuracy.runs import ESTIMATION, code_hash
from scipy.special import ndtr, ndtri

from jointz.core.gait_phases import TIMING_POINTS
from jointz.identify.participant import analyze_participant
from jointz.results.estimates import CellEstimate
from jointz.stats.population import population_means
from jointz.tasks.engine import Task, done_in_turn
from jointz.tasks.open_engine import open_engine

_ROOT = Path(__file__).parents[1]
ROWS = {"nominal": "nominal-lag-unknown", "anthropometric": "anthropometric"}
_METHOD = "rigid"
#: People whose bodies are drawn to know the mean of the population.
_POPULATION = 20_000
_Z = 1.96
#: Points that are looked at together: six timing points of K, B and J.
_POINTS = 18

Entry = dict[str, Any]


def entry_of(row_name: str, number: int, seed: int) -> Entry:
    """Simulate and analyse one person; return estimates and truth, ready for JSON."""
    row = all_rows()[row_name]
    simulated = simulate(row, number, seed)
    person = simulated.rig.person
    settings = settings_of(row, simulated.rig, [_METHOD])
    cells = analyze_participant(person.id, simulated.recordings, settings).cells[_METHOD]
    return {
        "number": number,
        "truth": cell_truth(simulated.truth),
        "cells": [replace(cell, response=None).to_dict() for cell in cells],
    }


def pool_of(row_name: str, people: int, seed: int, *, workers: int, cache: Path) -> list[Entry]:
    """Return everybody of a pool; who is in the cache is not analysed again."""
    path = cache / f"population-{row_name}-{seed}-{code_hash(ESTIMATION)[:16]}.jsonl"
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = path.read_text().splitlines() if path.is_file() else []
    entries = {entry["number"]: entry for entry in map(json.loads, lines)}
    tasks = [
        Task(f"{row_name} {number}", partial(entry_of, row_name, number, seed))
        for number in range(people)
        if number not in entries
    ]
    with open_engine(workers=workers, tasks=len(tasks), needs=__name__) as engine:
        for done in done_in_turn(engine, tasks):
            entry = done.result()
            entries[entry["number"]] = entry
            with path.open("a") as file:
                file.write(json.dumps(entry) + "\n")
    return [entries[number] for number in range(people)]


def population_truth(row_name: str, entries: Sequence[Entry], seed: int) -> np.ndarray:
    """Return the mean of the population's true K and B, and the geometric one of J, (6, 3).

    The truth of those in the pool is regressed on what they were drawn with, and taken at the
    mean of many more drawn people.
    """
    row = all_rows()[row_name]
    true = np.array(
        [[[e["truth"][p][name] for name in PARAMETERS] for p in TIMING_POINTS] for e in entries]
    )
    true[..., 2] = np.log(true[..., 2])
    drawn = np.array([_features(row, number, seed) for number in range(_POPULATION)])
    means = np.empty(true.shape[1:])
    for point in range(true.shape[1]):
        for k in range(true.shape[2]):
            chosen = drawn[:, [*_SHARED, 4 + point, 10 + point]]
            design = np.column_stack([np.ones(len(chosen)), chosen])
            slopes = np.linalg.lstsq(design[: len(entries)], true[:, point, k], rcond=None)[0]
            means[point, k] = (design @ slopes).mean()
    means[:, 2] = np.exp(means[:, 2])
    return means


#: Places of what a person has once, before K and B of the points.
_SHARED = (0, 1, 2, 3)


def _features(row: Any, number: int, seed: int) -> list[float]:
    person = rig_of(row, number, seed).person
    mass, height = person.mass_kg, person.height_m
    return [
        np.log(mass),
        np.log(height),
        mass * height,
        np.log(person.inertia),
        *(mass * person.stiffness_per_mass[p] for p in TIMING_POINTS),
        *(mass * person.damping_per_mass[p] for p in TIMING_POINTS),
    ]


def studies(
    entries: Sequence[Entry], truth: np.ndarray, *, draws: int, size: int, seed: int
) -> pd.DataFrame:
    """Draw studies and hold their means against the truth: one row a mean."""
    rng = np.random.default_rng(seed)
    cells = [[CellEstimate.from_dict(cell) for cell in entry["cells"]] for entry in entries]
    points = list(TIMING_POINTS)
    rows = []
    for draw in range(draws):
        chosen = rng.choice(len(cells), size=size, replace=False)
        for mean in population_means([cell for i in chosen for cell in cells[i]]):
            if mean.parameter not in PARAMETERS:
                continue
            true = truth[points.index(mean.timing_point), PARAMETERS.index(mean.parameter)]
            given = mean.status == "ok"
            rows.append(
                {
                    "draw": draw,
                    "parameter": mean.parameter,
                    "timing_point": mean.timing_point,
                    "given": given,
                    "held": given and mean.ci_low <= true <= mean.ci_high,
                    "half_width_pct": 50.0 * (mean.ci_high - mean.ci_low) / true if given else None,
                    "bias_pct": 100.0 * (mean.value / true - 1.0) if given else None,
                }
            )
    return pd.DataFrame(rows)


def table(rows: pd.DataFrame, *, people: int, size: int) -> pd.DataFrame:
    """Return share given, coverage with its Monte-Carlo band, half-width and bias, by cell."""
    found = []
    for (parameter, point), group in rows.groupby(["parameter", "timing_point"], sort=False):
        found.append(_summary(parameter, point, group, people=people, size=size))
    for parameter, group in rows.groupby("parameter", sort=False):
        found.append(_summary(parameter, "all", group, people=people, size=size))
    found.append(_summary("all", "all", rows, people=people, size=size))
    return pd.DataFrame(found)


def _summary(parameter: str, point: str, rows: pd.DataFrame, *, people: int, size: int) -> Entry:
    given = rows[rows["given"]]
    low, high = _band(max(len(given), 1), people=people, size=size)
    return {
        "parameter": parameter,
        "timing_point": point,
        "given": len(given) / len(rows),
        "coverage": given["held"].mean() if len(given) else None,
        "band_low": low,
        "band_high": high,
        "half_width_pct": given["half_width_pct"].median(),
        "bias_pct": given["bias_pct"].mean(),
    }


def _band(n: int, *, people: int, size: int) -> tuple[float, float]:
    """Return where the coverage of n studies at a rate of 0.95 lies, at all points at once.

    Studies of one pool share its people: where the mean of the pool is off by chance, by
    sd/sqrt(people), the coverage of all of them falls.
    """
    z = float(ndtri(1.0 - 0.025 / _POINTS))  # Bonferroni
    off = z * np.sqrt(size / people)
    lowest = float(ndtr(_Z - off) - ndtr(-_Z - off))
    reach = z * np.sqrt(0.95 * 0.05 / n)
    return max(lowest - reach, 0.0), min(0.95 + reach, 1.0)


def main() -> None:
    """Print the two tables, and write them as CSV."""
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add("--people", type=int, default=400, help="of every pool")
    add("--draws", type=int, default=200, help="studies drawn from each")
    add("--size", type=int, default=10, help="people of a study")
    add("--seed", type=int, default=20260, help="of the population and of the draws")
    add("--workers", type=int, default=2, help="processes")
    add("--cache", type=Path, default=_ROOT / ".accuracy-cache", help="people analysed")
    asked = parser.parse_args()
    for preset, row_name in ROWS.items():
        entries = pool_of(
            row_name, asked.people, asked.seed, workers=asked.workers, cache=asked.cache
        )
        truth = population_truth(row_name, entries, asked.seed)
        rows = studies(entries, truth, draws=asked.draws, size=asked.size, seed=asked.seed)
        shown = table(rows, people=asked.people, size=asked.size)
        print(f"{preset}: {asked.draws} studies of {asked.size} of {asked.people} people")
        print(shown.round(3).to_string(index=False))
        out = _ROOT / "docs" / "tables" / f"population-{preset}.csv"
        out.parent.mkdir(exist_ok=True)
        shown.round(4).to_csv(out, index=False)


if __name__ == "__main__":
    main()
