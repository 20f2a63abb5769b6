"""Plans beside what then came out: ``python -m benchmarks.planning``.

Thirty realistic people, three shapes of pulse, two sets of sensors, six timing points. What is
predicted knows the person's mass, height and four minutes of unperturbed walking; what is obtained
is the analysis of 50 pulses a timing point. Writes ``docs/tables/planning.csv``.
"""

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from benchmarks.accuracy.runs import ESTIMATION, code_hash
from benchmarks.kept import Entry, add_options, by_person
from benchmarks.planning.obtained import PLANNED, obtained
from benchmarks.planning.predicted import predicted
from benchmarks.realistic.rows import PARAMETERS

from jointz.core.gait_phases import TIMING_POINTS
from jointz.results.estimates import relative_half_width

_ROOT = Path(__file__).parents[2]
_BAND = (0.8, 1.25)
_NARROW, _SHARE = 0.25, 0.8


def main(arguments: Sequence[str] | None = None) -> int:
    """Run rows, write cells, and return the exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Of the command line by default.
    """
    parser = argparse.ArgumentParser(prog="python -m benchmarks.planning", description=__doc__)
    parser.add_argument("--rows", default=",".join(PLANNED), help="names, separated by commas")
    kept = _ROOT / ".accuracy-cache" / "planning"
    add_options(parser, people=30, kept=kept, table=_ROOT / "docs" / "tables" / "planning.csv")
    asked = parser.parse_args(arguments)
    names, people = asked.rows.split(","), range(asked.people)
    tell = partial(print, file=sys.stderr)
    stamp = f"{asked.seed}-{code_hash(ESTIMATION)[:16]}.jsonl"
    rows = []
    for name in names:
        found = [
            by_person(
                partial(work, name, asked.seed),
                people,
                asked.kept / f"{name}-{work.__name__}" / stamp,
                workers=asked.workers,
                tell=tell,
            )
            for work in (predicted, obtained)
        ]
        rows += compared(name, *found)
    table = pd.DataFrame(rows)
    table.to_csv(asked.table, index=False, float_format="%.4g")
    print(summary(table))
    return 0


def compared(name: str, plans: Sequence[Entry], results: Sequence[Entry]) -> list[Entry]:
    """Return a row for each parameter and timing point.

    Parameters
    ----------
    name : str
        Row.
    plans, results : sequence of Entry
        Of the same people.
    """
    points = list(TIMING_POINTS)
    sd = np.median([p["sd"] for p in plans], axis=0)
    typical = np.array([p["half_width"] for p in plans])
    decided = np.array([p["decided"] for p in plans])
    narrow = (typical <= _NARROW) & decided
    drawn = np.array([leg for p in plans for leg in p["drawn"]])
    reached = np.array([_posterior_sds(r, points) for r in results])
    rows = []
    for i, parameter in enumerate(PARAMETERS):
        cells = [c for r in results for c in r["cells"] if c["parameter"] == parameter]
        for k, point in enumerate(points):
            own = [c for c in cells if c["timing_point"] == point]
            half = np.array([_half_width(c) for c in own])
            wide = np.array([relative_half_width(s) for s in reached[:, i, k]])
            assured = float(np.quantile(drawn[:, i, k], _SHARE))
            rows.append({
                "row": name,
                "parameter": parameter,
                "timing_point": point,
                "people": len(own),
                "predicted_sd": float(sd[i, k]),
                "obtained_sd": float(np.nanmedian(reached[:, i, k])),
                "ratio": float(sd[i, k] / np.nanmedian(reached[:, i, k])),
                "predicted_narrow": float(narrow[:, i, k].mean()),
                "drawn_narrow": float((drawn[:, i, k] <= _NARROW).mean()),
                "obtained_narrow": float((half <= _NARROW).mean()),
                "predicted_decided": float(decided[:, i, k].mean()),
                "obtained_decided": float(np.mean([c["status"] == "ok" for c in own])),
                "assured": assured,
                "within_assured": float((wide <= assured).mean()),
            })  # fmt: skip
    return rows


def _posterior_sds(result: Entry, points: Sequence[str]) -> np.ndarray:
    """Return the sds of the logarithms of K, B and J, (parameter, point); NaN without."""
    found = np.full((len(PARAMETERS), len(points)), np.nan)
    for posterior in result["posteriors"]:
        sds = np.sqrt(np.diag(np.array(posterior["covariance"])))
        keys = zip(posterior["parameters"], posterior["timing_points"], sds, strict=True)
        for parameter, point, sd in keys:
            if parameter in PARAMETERS and point in points:
                found[PARAMETERS.index(parameter), points.index(point)] = sd
    return found


def _half_width(cell: Entry) -> float:
    """Return the relative half-width of a decided value, infinite for others."""
    if cell["value"] is None:
        return np.inf
    return (cell["high"] - cell["low"]) / (2.0 * abs(cell["value"]))  # type: ignore[no-any-return]


def summary(table: pd.DataFrame) -> str:
    """Return what is asked of plans, in words.

    Parameters
    ----------
    table : DataFrame
        Of :func:`compared`.
    """
    kb = table[table["parameter"].isin(PARAMETERS[:2])]
    inside = kb["ratio"].between(*_BAND)
    lines = [f"ratio of K and B within {_BAND}: {inside.mean():.3f} of {len(kb)} cells"]
    for (row, parameter), own in table.groupby(["row", "parameter"], sort=False):
        mean = own.mean(numeric_only=True)
        lines.append(
            f"{row:20} {parameter:10} ratio {own['ratio'].min():.2f}-{own['ratio'].max():.2f}; "
            f"<= 25 %: predicted {mean['predicted_narrow']:.2f} (drawn {mean['drawn_narrow']:.2f})"
            f", obtained {mean['obtained_narrow']:.2f}; decided: {mean['predicted_decided']:.2f}, "
            f"{mean['obtained_decided']:.2f}; within the assured {mean['within_assured']:.2f}"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
