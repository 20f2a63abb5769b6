"""The rows: which pulses and sensors; and one person of a row, walked and analysed."""

import re
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType

from benchmarks.kept import Entry

import jointz
from jointz.analysis.page.uncertainty_section import uncertainty_section
from jointz.core.protocols.pulse_models import DoubletPulse
from jointz.report.wording import parameter_name
from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan
from jointz.rig.sim.own_truth import own_truth
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import Preset, preset

PRESET = "realistic"
PARAMETERS = ("stiffness", "damping", "inertia")
METHOD = "strapped"
#: Bootstrap resamples, of the method that the report compares with only.
_RESAMPLES = 10
_SIZES_NM = (12.0, 17.0)
_SHORT_S, _LONG_S = (0.039, 0.021), (0.091, 0.049)
_PER_POINT = 50
_TIMING_POINTS = re.compile(r"^perturbations\.timing_points = ", re.MULTILINE)
#: Of remedies: that nothing was found.
_NOTHING = "no single measurement"


@dataclass(frozen=True, slots=True)
class RealisticRow:
    """What is measured of the people, and over which window it is analysed.

    Parameters
    ----------
    name, title : str
        As asked for on the command line; as printed.
    plan : WalkPlan
        Pulses.
    window_s : float, s
        Window of the analysis.
    sensors : bool
        Whether encoder and gyroscopes are there beside the goniometer.
    """

    name: str
    title: str
    plan: WalkPlan
    window_s: float
    sensors: bool = False


def _doublet(name: str, durations_s: tuple[float, float]) -> DoubletPulse:
    return DoubletPulse(
        name=name,
        kind="doublet",
        amplitudes_nm=_SIZES_NM,
        durations_s=durations_s,
        direction="both",
    )


_DOUBLETS = WalkPlan(
    per_point=_PER_POINT, pulses=(_doublet("short", _SHORT_S), _doublet("long", _LONG_S))
)

ROWS: Mapping[str, RealisticRow] = MappingProxyType(
    {
        row.name: row
        for row in (
            RealisticRow(
                "a", "goniometer, hold of 250 ms, 17 N*m", WalkPlan(per_point=_PER_POINT), 0.1
            ),
            RealisticRow("b", "goniometer, two doublets of 12 and 17 N*m", _DOUBLETS, 0.15),
            RealisticRow(
                "c",
                "goniometer, encoder and gyroscopes, two doublets of 12 and 17 N*m",
                _DOUBLETS,
                0.15,
                sensors=True,
            ),
        )
    }
)


def preset_of(row: RealisticRow) -> Preset:
    """Return the people's preset with the row's sensors.

    Parameters
    ----------
    row : RealisticRow
        Which row.
    """
    whole = preset(PRESET)
    return whole if row.sensors else replace(whole, encoder=None, gyroscopes=None)


def person_of_row(name: str, seed: int, number: int) -> Entry:
    """Let one person walk and be analysed; return cells beside their truth, ready for JSON.

    Parameters
    ----------
    name : str
        Row.
    seed, number : int
        Of the population; person, the same in all rows.
    """
    row, person = ROWS[name], draw_person(number, seed=seed)
    settings = preset_of(row)
    truth = own_truth(person, settings, row.plan, row.window_s)
    with TemporaryDirectory(prefix="realistic_") as scratch:
        study = simulate_study(
            Path(scratch) / "study", preset=settings, participants=[person], plan=row.plan
        )
        set_window(study, row.window_s)
        analyze = jointz.analyze  # imports it, which is not part of the analysis
        start = time.process_time()
        analysis = analyze(study, method=METHOD, resamples=_RESAMPLES, progress=False)
        cpu_s = time.process_time() - start
    section = uncertainty_section(analysis) or {"undecided": []}
    reports = {
        (r["name"], r["parameter"]): (str(r["why"]), str(r["remedy"])) for r in section["undecided"]
    }
    cells = [c for cell in analysis.cells for c in cells_of(cell, truth, reports)]
    return {"number": number, "cpu_s": cpu_s, "cells": cells}


def set_window(study: Path, window_s: float) -> None:
    """Write the window of the analysis into the study file of a simulated study."""
    file = study / "study.toml"
    line = f"perturbations.window_s = {window_s:g}\n"
    text, count = _TIMING_POINTS.subn(lambda found: line + found.group(), file.read_text())
    if count != 1:
        raise ValueError(f"{file}: expected one line of timing points, found {count}.")
    file.write_text(text)


def cells_of(
    cell: CellEstimate,
    truth: Mapping[str, Mapping[str, float]],
    reports: Mapping[tuple[str, str], tuple[str, str]],
) -> Iterator[Entry]:
    """Yield K, B and J of a timing point, also those that the method did not give."""
    for name in PARAMETERS:
        found = cell.parameter(name) or ParameterEstimate(name, None, None, None, "failed:missing")
        why, remedy = reports.get((cell.timing_point, parameter_name(name)), ("", ""))
        yield {
            "timing_point": cell.timing_point,
            "parameter": name,
            "value": found.value,
            "low": found.ci_low,
            "high": found.ci_high,
            "status": found.status,
            "truth": truth[cell.timing_point][name],
            "displacement_deg": truth[cell.timing_point]["displacement_deg"],
            "why": why,
            # A withheld value has no limits; its reason names what to check, no measurement.
            "remedy": "" if found.ci_low is None or remedy.startswith(_NOTHING) else remedy,
        }
