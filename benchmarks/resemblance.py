"""Estimates of the dissertation's method in simulated people, beside the printed ones.

``python -m benchmarks.resemblance`` from the root of the repository writes
``docs/tables/resemblance.csv``. Protocol and method are the dissertation's: 17 N*m held for
250 ms, a window of 100 ms, a goniometer, the mean unperturbed stride as baseline, bounded least
squares. A stopped run continues.
"""

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from benchmarks.accuracy.people import settings_of, simulate
from benchmarks.accuracy.rows import Row
from benchmarks.accuracy.runs import ESTIMATION, code_hash
from benchmarks.kept import Entry, add_options, by_person

from jointz.core.gait_phases import TIMING_POINTS
from jointz.identify.participant import analyze_participant
from jointz.results.estimates import CellEstimate
from jointz.rig.sim.presets import preset

PRESETS = ("nominal", "anthropometric", "hard", "realistic")
_METHOD = "dissertation"
#: Values of the first method are withheld where their intervals are wide; the others are kept.
_METHODS = ("least_squares", _METHOD)
_ROOT = Path(__file__).parents[1]
_TABLE = _ROOT / "docs" / "tables" / "resemblance.csv"
#: A value below this counts as at the bound of 0, simulated or printed: N*m/rad/kg,
#: N*m*s/rad/kg, kg*m^2.
_AT_BOUND = {"stiffness_per_mass": 1e-3, "damping_per_mass": 1e-3, "inertia": 1e-3}
_NAMES = {"stiffness_per_mass": "K per kg", "damping_per_mass": "B per kg", "inertia": "J"}

#: Means over subjects: last columns of tables 4.1, 4.2, 4.3 and 4.4 of the dissertation.
_PRINTED: Mapping[str, tuple[float, ...]] = {
    "stiffness_per_mass": (2.13, 0.62, 1.15, 1.16, 0.31, 0.38),
    "damping_per_mass": (0.039, 0.042, 0.053, 0.030, 0.038, 0.029),
    "inertia": (0.027, 0.036, 0.024, 0.040, 0.033, 0.023),
    "vaf_pct": (87.84, 94.92, 96.92, 87.77, 86.26, 90.02),
}
#: Section 4.3.2 and table 4.4: mean, least and largest VAF.
_PRINTED_VAF = (90.62, 45.20, 99.83)
#: Cells of tables 4.1, 4.2 and 4.3 below the limits above, of 60.
_PRINTED_AT_BOUND = {"stiffness_per_mass": 4, "damping_per_mass": 4, "inertia": 2}
_PRINTED_CELLS = 60


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the presets, write the table, and return the exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Of the command line by default.
    """
    asked = _parser().parse_args(arguments)
    columns = {"printed": printed_figures()}
    for name in asked.presets:
        entries = by_person(
            partial(cells_of_person, name, asked.seed),
            range(asked.people),
            asked.kept / name / f"{_METHOD}-{asked.seed}-{code_hash(ESTIMATION)[:16]}.jsonl",
            workers=asked.workers,
        )
        cells = pd.DataFrame([cell for entry in entries for cell in entry["cells"]])
        columns[name] = figures_of(cells)
    table = table_of(columns)
    asked.table.parent.mkdir(parents=True, exist_ok=True)
    table.to_csv(asked.table, index=False, float_format="%.4g")
    print(table.to_string(index=False, float_format="%.3g"))
    return 0


def cells_of_person(name: str, seed: int, number: int) -> Entry:
    """Return the cells of one simulated person by the dissertation's method, ready for JSON.

    Parameters
    ----------
    name : str
        Preset.
    seed, number : int
        Of the population; person.
    """
    row = Row(f"resemblance-{name}", name, preset(name))
    simulated = simulate(row, number, seed)
    settings = settings_of(row, simulated.rig, _METHODS)
    person = simulated.rig.person
    cells = analyze_participant(person.id, simulated.recordings, settings).cells[_METHOD]
    return {"number": number, "cells": [_cell(cell) for cell in cells]}


def _cell(cell: CellEstimate) -> Entry:
    values = {name: (p.value if (p := cell.parameter(name)) else None) for name in _AT_BOUND}
    response = cell.response
    end_rad = None if response is None else abs(float(np.asarray(response.angle)[-1]))
    return {
        "timing_point": cell.timing_point,
        **values,
        "vaf_pct": cell.vaf_pct,
        "response_deg": None if end_rad is None else float(np.degrees(end_rad)),
    }


def figures_of(cells: pd.DataFrame) -> dict[tuple[str, str], float]:
    """Return figures by quantity and timing point (``all``: over all of them).

    Parameters
    ----------
    cells : pandas.DataFrame
        A line a cell: ``timing_point``, K and B per kg, J, ``vaf_pct``, ``response_deg``; empty
        where the method failed.
    """
    numbers = cells.set_index("timing_point").astype(float)
    vaf = numbers["vaf_pct"]
    figures = {
        ("VAF mean", "all"): vaf.mean(),
        ("VAF least", "all"): vaf.min(),
        ("VAF largest", "all"): vaf.max(),
    }
    for title, name in (*_quantities(), ("response at the end of the window", "response_deg")):
        for point, mean in numbers[name].groupby(level=0, sort=False).mean().items():
            figures[title, str(point)] = float(mean)
        figures.setdefault((f"{title} mean", "all"), float(numbers[name].mean()))
    for name, limit in _AT_BOUND.items():
        given = numbers[name].dropna()
        figures[f"{_NAMES[name]} at 0", "all"] = 100.0 * float((given < limit).mean())
    figures["failed", "all"] = 100.0 * float(numbers["inertia"].isna().mean())
    return {key: float(value) for key, value in figures.items()}


def printed_figures() -> dict[tuple[str, str], float]:
    """Return the dissertation's figures as :func:`figures_of` gives those of a preset."""
    names = ("VAF mean", "VAF least", "VAF largest")
    figures = {(n, "all"): v for n, v in zip(names, _PRINTED_VAF, strict=True)}
    for title, name in _quantities():
        figures |= {(title, p): v for p, v in zip(TIMING_POINTS, _PRINTED[name], strict=True)}
        figures.setdefault((f"{title} mean", "all"), float(np.mean(_PRINTED[name])))
    for name, count in _PRINTED_AT_BOUND.items():
        figures[f"{_NAMES[name]} at 0", "all"] = 100.0 * count / _PRINTED_CELLS
    return figures


def _quantities() -> Iterator[tuple[str, str]]:
    for name, title in _NAMES.items():
        yield title, name
    yield "VAF", "vaf_pct"


_UNITS = {
    "K per kg": "N*m/rad/kg",
    "B per kg": "N*m*s/rad/kg",
    "J": "kg*m^2",
    "response at the end of the window": "deg",
}


def table_of(columns: Mapping[str, Mapping[tuple[str, str], float]]) -> pd.DataFrame:
    """Return a line a quantity and timing point, a column a source.

    Parameters
    ----------
    columns : mapping
        Source -> figures of :func:`figures_of`.
    """
    points = ("all", *TIMING_POINTS)
    quantities = dict.fromkeys(title for figures in columns.values() for title, _ in figures)
    rows: list[dict[str, Any]] = []
    for title in quantities:
        for point in points:
            values = {source: figures.get((title, point)) for source, figures in columns.items()}
            if any(value is not None for value in values.values()):
                unit = _UNITS.get(title.removesuffix(" mean"), "%")
                rows.append({"quantity": title, "unit": unit, "timing_point": point, **values})
    return pd.DataFrame(rows)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.resemblance", description=__doc__)
    parser.add_argument("--presets", nargs="+", default=list(PRESETS), help="presets to simulate")
    kept = _ROOT / ".accuracy-cache" / "resemblance"
    add_options(parser, people=10, kept=kept, table=_TABLE)
    return parser


if __name__ == "__main__":
    sys.exit(main())
