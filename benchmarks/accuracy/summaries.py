"""A row's figures: written as JSON and CSV, held against what is asked for."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from benchmarks.accuracy.ranks import ranks_of
from benchmarks.accuracy.rows import PARAMETERS, Row, Target
from benchmarks.accuracy.runs import TRUTH, Cache
from benchmarks.accuracy.scores import ALL, Score, cells_of, scores_of

from jointz import __version__

SCHEMA = "jointz.accuracy/1"

Summary = dict[str, Any]


def summarise(
    row: Row, methods: Sequence[str], *, participants: int, seed: int, store: Cache
) -> Summary:
    """Score a row from what is in the cache.

    Parameters
    ----------
    row : Row
        Which row.
    methods : sequence of str
        Methods.
    participants, seed : int
        How many, and seed of the population.
    store : Cache
        Where their results are.
    """
    truths = store.load(row, seed, TRUTH)
    results = [
        entry
        for method in methods
        for number, entry in sorted(store.load(row, seed, method).items())
        if number < participants
    ]
    cells = cells_of(truths.values(), results)
    numbers = sorted(number for number in truths if number < participants)
    return {
        "schema": SCHEMA,
        "version": __version__,
        "row": row.name,
        "title": row.title,
        "participants": len(numbers),
        "seed": seed,
        "pulses_per_point": row.per_point,
        "target": asdict(row.target) if row.target else None,
        "bound_pct": _bounds([truths[number] for number in numbers]),
        "misfit": _median([truths[number]["misfit"] for number in numbers]),
        "seconds": {m: _median([r["seconds"] for r in _by(results, m)]) for m in methods},
        "errors": {m: sum(bool(r["error"]) for r in _by(results, m)) for m in methods},
        "scores": [s.to_dict() for s in scores_of(cells)],
        "ranks": [r.to_dict() for r in ranks_of(cells)],
    }


def write_summary(summary: Summary, folder: Path) -> None:
    """Write a row's figures as JSON, and its scores as CSV.

    Parameters
    ----------
    summary : dict
        Of :func:`summarise`.
    folder : Path
        Where.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{summary['row']}.json").write_text(json.dumps(summary, indent=1) + "\n")
    table = pd.json_normalize(summary["scores"])
    table.to_csv(folder / f"{summary['row']}.csv", index=False, float_format="%.5g")


def read_summaries(folder: Path, order: Sequence[str]) -> list[Summary]:
    """Read all rows of a folder.

    Parameters
    ----------
    folder : Path
        Where they were written.
    order : sequence of str
        Names of rows; others are left out.
    """
    paths = [folder / f"{name}.json" for name in order]
    return [json.loads(path.read_text()) for path in paths if path.is_file()]


def verdicts(summary: Summary, method: str) -> list[tuple[str, bool]]:
    """Hold a method against what is asked for in a row.

    Parameters
    ----------
    summary : dict
        Of :func:`summarise`.
    method : str
        Which method.

    Returns
    -------
    list of (str, bool)
        What was asked for and found, and whether it is met.
    """
    if summary["target"] is None:
        return []
    target = Target(**summary["target"])
    scores = [Score.from_dict(s) for s in summary["scores"]]
    mine = {s.parameter: s for s in scores if s.method == method and s.timing_point == ALL}
    if not mine:
        return []
    if target.may_decline and all(s.rmse is None for s in mine.values()):
        return [("undecided, which is allowed", True)]
    return [
        *_errors_verdicts(target, mine),
        *[_coverage_verdict(target, s) for s in mine.values()],
        *_undecided_verdicts(target, mine),
    ]


def _errors_verdicts(target: Target, mine: Mapping[str, Score]) -> list[tuple[str, bool]]:
    found = []
    if target.rmse_pct:
        for name, most in zip(PARAMETERS, target.rmse_pct, strict=True):
            rmse = mine[name].rmse_pct if name in mine else None
            text = f"RMSE of {name} {_number(rmse)} % (at most {most:g})"
            found.append((text, rmse is not None and rmse <= most))
    if target.ratio:
        for name, s in mine.items():
            text = f"{name} {_number(s.ratio)} x the bound (at most {target.ratio:g})"
            found.append((text, s.ratio is not None and s.ratio <= target.ratio))
    if target.inertia_pct and "inertia" in mine:
        rmse = mine["inertia"].rmse_pct
        text = f"RMSE of inertia {_number(rmse)} % (at most {target.inertia_pct:g})"
        found.append((text, rmse is not None and rmse <= target.inertia_pct))
    return found


def _coverage_verdict(target: Target, s: Score) -> tuple[str, bool]:
    c = s.coverage
    if c.rate is None:
        return f"coverage of {s.parameter}: no decided cell", False
    if target.least_coverage is not None:
        text = f"coverage of {s.parameter} {c.rate:.3f} (at least {target.least_coverage:.2f})"
        return text, c.rate >= target.least_coverage
    return f"coverage of {s.parameter} {c.rate:.3f} (band {c.low:.3f}-{c.high:.3f})", c.met


def _undecided_verdicts(target: Target, mine: Mapping[str, Score]) -> list[tuple[str, bool]]:
    if target.most_undecided is None:
        return []
    worst = max(s.undecided_pct + s.failed_pct for s in mine.values())
    most = 100.0 * target.most_undecided
    return [(f"{worst:.1f} % undecided (at most {most:.0f})", worst <= most)]


def _bounds(truths: Sequence[Mapping[str, Any]]) -> dict[str, float | None]:
    """Return the root mean square of the relative bound over all cells, %."""
    result: dict[str, float | None] = {}
    for name in PARAMETERS:
        shares = [
            entry["bound"][point][name] / values[name]
            for entry in truths
            for point, values in entry["truth"].items()
            if values[name]
        ]
        result[name] = 100.0 * float(np.sqrt(np.mean(np.square(shares)))) if shares else None
    return result


def _by(results: Sequence[Mapping[str, Any]], method: str) -> list[Mapping[str, Any]]:
    return [result for result in results if result["method"] == method]


def _median(values: Sequence[float]) -> float | None:
    return float(np.median(values)) if values else None


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"
