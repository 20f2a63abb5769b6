"""The pilot of chapter III (3.2.4, 3.3.4) on two simulated people, by its own method."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Any

import pandas as pd

from jointz.analysis.analyze import analyze
from jointz.core.gait_phases import TIMING_POINTS
from jointz.core.protocols.protocol import Protocol
from jointz.io.study_reader import open_study
from jointz.reference import chapter3
from jointz.reproduction.chapter4.walking import (
    COLUMNS,
    PARAMETERS,
    estimated,
    rows_of,
    true_values,
)
from jointz.reproduction.reproduction_tables import Compared, ComparedTable
from jointz.session.run import run
from jointz.tasks.progress import RunProgress

_NAMES = {"stiffness_per_mass": "stiffness", "damping_per_mass": "damping", "inertia": "inertia"}
_SOURCES = ("pilot", "recommended", "truth")
#: The pilot's method makes no resamples; of the one beside it nothing is shown.
_FEWEST_RESAMPLES = 2


@dataclass(frozen=True, slots=True, eq=False)
class PilotStudy:
    """A simulated pilot."""

    people: tuple[str, ...]  # ids
    # as ``WalkedStudy`` has them, of the sources ``pilot``, ``recommended`` and ``truth``
    estimates: pd.DataFrame

    def mean(self, source: str, parameter: str, column: str = "value") -> dict[str, float]:
        """Return the mean over people by timing point.

        A timing point that lacks a person's value has no mean: half a pilot is no average.
        """
        rows = rows_of(self.estimates, source, parameter)
        by_point = rows.groupby("timing_point")[column].agg(["mean", "count"])
        whole = by_point.loc[by_point["count"] == len(self.people), "mean"]
        return {point: float(whole[point]) for point in TIMING_POINTS if point in whole}


def pilot_study(
    folder: Path,
    seed: int,
    preset: str,
    *,
    run_progress: RunProgress | None = None,
    protocol: str | Protocol = "walking-pilot",
) -> PilotStudy:
    """Run the pilot on simulated people and analyse it by its own and the recommended method."""
    made = run(
        protocol,
        out=folder / "pilot",
        seed=seed,
        preset=preset,
        workers=os.cpu_count() or 1,
        progress=run_progress,
    )
    study = open_study(made.study)
    masses = {person.id: person.mass_kg for person in study.spec.participants}
    rows = true_values(study.root, masses)
    for method in ("pilot", "recommended"):
        analysis = analyze(study, method=method, resamples=_FEWEST_RESAMPLES, seed=seed)
        rows += estimated(method, analysis.cells)
    return PilotStudy(tuple(masses), pd.DataFrame(rows, columns=list(COLUMNS)))


def pilot_results(found: PilotStudy) -> tuple[ComparedTable, dict[str, Any]]:
    """Return the numbers of 3.3.4 beside ours, and what figure 3.7 draws."""
    rows = [row for name in PARAMETERS for row in _range_rows(found, name)]
    table = ComparedTable(
        "pilot",
        "Pilot with two people (3.3.4)",
        "Largest and smallest of the six averages over two people, and the VAF. The dissertation's "
        "method is here the pilot's: one bounded fit to the average response, without bootstrap. "
        "Its two people are S2 and S3 of chapter IV; the simulated two are nobody's copy. The "
        "truth is the largest and the smallest true average; the largest of six estimates is "
        "larger than that of six true values by noise alone. No interval: two people say next to "
        "nothing of others.",
        (*rows, *_vaf_rows(found)),
    )
    return table, _curves(found)


def _range_rows(found: PilotStudy, name: str) -> list[Compared]:
    means = {source: found.mean(source, name) for source in _SOURCES}
    rows = []
    for word, pick, printed in zip(
        ("largest", "smallest"), (max, min), chapter3.PILOT_RANGES[name], strict=True
    ):
        ours = {source: pick(m.values(), default=None) for source, m in means.items()}
        rows.append(
            Compared(
                f"{word} average {_NAMES[name]}",
                PARAMETERS[name],
                printed=printed.value,
                dissertation=ours["pilot"],
                recommended=ours["recommended"],
                truth=ours["truth"],
                note="; ".join(filter(None, (printed.note, _refused(found, name)))),
            )
        )
    return rows


def _refused(found: PilotStudy, name: str) -> str:
    """Say whose recommended estimates were refused, so that an average is missing."""
    rows = rows_of(found.estimates, "recommended", name)
    people = sorted(set(rows.loc[rows["value"].isna(), "participant"]))
    return f"recommended: undecided in {', '.join(people)}" if people else ""


def _vaf_rows(found: PilotStudy) -> list[Compared]:
    vaf = {source: _mean_vaf(found, source) for source in ("pilot", "recommended")}
    rows = [
        _vaf_row(f"VAF of person {number}", chapter3.PILOT_VAF[number], vaf, person)
        for number, person in zip(("1", "2"), found.people, strict=False)
    ]
    whole = {s: {"mean": fmean(m.values())} if m else {} for s, m in vaf.items()}
    return [*rows, _vaf_row("VAF of both", chapter3.PILOT_VAF["mean"], whole, "mean")]


def _mean_vaf(found: PilotStudy, source: str) -> dict[str, float]:
    """Return every person's mean VAF over timing points; a person without any is left out."""
    rows = rows_of(found.estimates, source, "inertia").dropna(subset=["vaf_pct"])
    return {str(who): float(v) for who, v in rows.groupby("participant")["vaf_pct"].mean().items()}


def _vaf_row(
    quantity: str, printed: Any, vaf: Mapping[str, Mapping[str, float]], key: str
) -> Compared:
    return Compared(
        quantity,
        "%",
        printed=printed.value,
        dissertation=vaf["pilot"].get(key),
        recommended=vaf["recommended"].get(key),
        note=printed.note,
    )


def _curves(found: PilotStudy) -> dict[str, Any]:
    return {
        "onset_pct": dict(TIMING_POINTS),
        "people": list(found.people),
        "printed_range": {
            name: [printed.value for printed in chapter3.PILOT_RANGES[name]] for name in PARAMETERS
        },
        "parameters": {
            name: {
                source: {
                    "people": [_of_person(found, source, name, person) for person in found.people],
                    "mean": found.mean(source, name),
                }
                for source in _SOURCES
            }
            for name in PARAMETERS
        },
    }


def _of_person(found: PilotStudy, source: str, name: str, person: str) -> dict[str, Any]:
    """Return timing point -> value, low, high, None where there is none."""
    rows = rows_of(found.estimates, source, name)
    rows = rows[rows["participant"] == person]
    return {
        str(row["timing_point"]): [
            None if pd.isna(row[column]) else float(row[column])
            for column in ("value", "ci_low", "ci_high")
        ]
        for row in rows.to_dict("records")
    }
