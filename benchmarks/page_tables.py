"""Tables of all benchmarks as files, which the page links to."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
from benchmarks.figures import Figure
from benchmarks.page import (
    Part,
    efficiency_in,
    entries,
    figures_of,
    scale_entries,
    short_test,
    shown,
)

#: Parts that ``benchmarks.scale`` measures.
_SCALED = ("growth", "engines", "fits")


def write_tables(parts: Sequence[Part], folder: Path, *, quick: bool) -> None:
    """Write the tables that the page links to.

    Parameters
    ----------
    parts : sequence of mapping
        What each part measured.
    folder : pathlib.Path
        Where.
    quick : bool
        Whether little work was done, so that nothing is judged.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for name, rows in tables_of(parts, quick=quick).items():
        pd.DataFrame(rows).to_csv(folder / name, index=False)


def tables_of(parts: Sequence[Part], *, quick: bool) -> dict[str, list[dict[str, Any]]]:
    """Return the rows of every table, by the name of its file; numbers as the page shows them.

    Parameters
    ----------
    parts : sequence of mapping
        What each part measured.
    quick : bool
        Whether little work was done, so that nothing is judged.
    """
    return {
        "benchmarks-figures.csv": [
            _figure_row(replace(row, asked=None) if quick else row) for row in figures_of(parts)
        ],
        "benchmarks-scale.csv": [
            _scale_row(name, one, scale_entries(parts, name))
            for name in _SCALED
            for one in scale_entries(parts, name)
        ],
        "benchmarks-timings.csv": [_timing_row(one) for one in entries(parts, "timings")],
        "benchmarks-runs.csv": [_run_row(part) for part in parts if part["found"]],
    }


def _figure_row(row: Figure) -> dict[str, Any]:
    return {
        "quantity": row.what,
        "note": row.note,
        "unit": row.unit,
        "jointz": _digits(row.ours),
        "peer": row.peer.name if row.peer else "",
        "peer_version": row.peer.version if row.peer else "",
        "peer_value": _digits(row.theirs),
        "ratio": _digits(row.ratio),
        "ratio_is": row.ratio_is.replace("ours", "jointz"),
        "target": f"{row.asked.sense} {_digits(row.asked.value)}" if row.asked else "",
        "met": "" if row.met is None else row.met,
    }


def _scale_row(
    name: str, one: Mapping[str, Any], others: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    return {
        "part": name,
        "of": "fits" if name == "fits" else "people",
        "count": one["count"],
        "engine": one["engine"],
        "workers": one["workers"],
        "time_s": _digits(one["wall_s"]),
        "work_s_each": _digits(one["busy_s"] / one["count"]),
        "efficiency": _digits(efficiency_in(one, others)),
        "waiting_pct": _digits(100.0 * one["idle_share"]),
        "client_mb": _digits(one["client_mb"]),
        "largest_worker_mb": _digits(one["worker_mb"]),
        "digest": one["digest"],
    }


def _timing_row(one: Mapping[str, Any]) -> dict[str, Any]:
    times = {f"{name}_ms": _digits(1e3 * one[f"{name}_s"]) for name in ("median", "min", "iqr")}
    return {"test": short_test(one["test"]), **times, "rounds": one["rounds"]}


def _run_row(part: Part) -> dict[str, Any]:
    versions = part["found"]["versions"]
    return {
        "part": part["part"],
        "date": part["date"][:10],
        "commit": part["commit"],
        "minutes": f"{part['seconds'] / 60:.1f}",
        "python": versions["python"],
        "jointz": versions["jointz"],
        **versions["packages"],
    }


def _digits(value: float | None) -> str:
    return "" if value is None else shown(value).replace(",", "")
