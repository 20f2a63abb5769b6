"""The main job with nothing to bring: run a simulated study, analyse it, show the truth."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jointz.analysis.analyze import analyze
from jointz.analysis.results_folder import write_results
from jointz.core.protocols.protocol import Protocol
from jointz.io.new_folder import new_folder, write_marker
from jointz.io.protocols import load_protocol
from jointz.io.study_reader import open_study
from jointz.results.run_report import RunReport
from jointz.results.study_analysis import StudyAnalysis
from jointz.session.run import TRUTH_FILE, run
from jointz.tasks.open_engine import open_engine
from jointz.tasks.progress import Progress, RunProgress

MARKER = ".jointz-demo"
_QUICK_PEOPLE, _QUICK_PULSES = 2, 10


@dataclass(frozen=True, slots=True)
class Demo:
    """Results of the demonstration."""

    report: Path  # page to open
    analysis: StudyAnalysis  # the analysis of the simulated study
    run: RunReport  # report of the simulated experiment
    truth: pd.DataFrame  # truth against estimate, one row a participant, timing point and parameter

    def accuracy(self) -> pd.DataFrame:
        """Return RMS error (%) and coverage of the intervals by parameter."""
        return pd.DataFrame(
            [
                {
                    "parameter": name,
                    "rms_error_pct": float(np.sqrt((rows["error_pct"] ** 2).mean())),
                    "coverage": float(rows["covered"].mean()),
                    "n": len(rows),
                }
                for name, rows in self.truth.groupby("parameter", sort=False)
            ]
        )


def run_demo(
    out: Path,
    *,
    quick: bool = False,
    seed: int = 1,
    run_progress: RunProgress | None = None,
    progress: Progress | None = None,
) -> Demo:
    """Run the walking protocol on simulated people, analyse it, report beside the truth."""
    with new_folder(out, marker=MARKER, overwrite=True) as folder:
        study_run = run(
            _protocol(quick=quick),
            out=folder / "study",
            preset="nominal",
            seed=seed,
            workers=os.cpu_count() or 1,
            progress=run_progress,
        )
        study = open_study(study_run.study)
        people = len(study.spec.participants)
        with open_engine(tasks=people, needs="jointz.analysis.participant_jobs") as engine:
            analysis = analyze(study, seed=seed, engine=engine, progress=progress)
            truth = truth_table(analysis, study_run.study)
            truth.to_csv(folder / "truth.csv", index=False, float_format="%.10g")
            write_results(
                analysis, folder / "results", truth=truth, run=study_run.report, engine=engine
            )
        write_marker(folder, MARKER, {"made_by": "jointz demo"})
    return Demo(out / "results" / "report.html", analysis, study_run.report, truth)


def truth_table(analysis: StudyAnalysis, study: Path) -> pd.DataFrame:
    """Set every estimate beside the truth it should have found.

    Parameters
    ----------
    analysis : StudyAnalysis
        Of a simulated study.
    study : pathlib.Path
        Its folder, with ``ground_truth.json``.

    Returns
    -------
    pandas.DataFrame
        ``participant, timing_point, parameter, truth, estimate, ci_low, ci_high,
        error_pct, covered``; estimates that do not stand are left out.
    """
    written = json.loads((study / TRUTH_FILE).read_text(encoding="utf-8"))
    rows = []
    for cell in analysis.cells:
        truth = _truth_of(written["participants"][cell.participant], cell.timing_point)
        for name, true_value in truth.items():
            estimate = cell.parameter(name)
            if estimate is None or estimate.value is None or not estimate.available:
                continue
            low, high = estimate.ci_low or 0.0, estimate.ci_high or 0.0
            rows.append(
                {
                    "participant": cell.participant,
                    "timing_point": cell.timing_point,
                    "parameter": name,
                    "truth": true_value,
                    "estimate": estimate.value,
                    "ci_low": low,
                    "ci_high": high,
                    "error_pct": 100.0 * (estimate.value / true_value - 1.0),
                    "covered": low <= true_value <= high,
                }
            )
    return pd.DataFrame(rows)


def _truth_of(conditions: Mapping[str, Any], timing_point: str) -> dict[str, float]:
    """Return the means over the windows of the pulses at a timing point."""
    for condition in conditions.values():
        means = condition.get("timing_points", {}).get(timing_point)
        if means:
            return {name: float(means[name]) for name in ("stiffness", "damping", "inertia")}
    return {}


def _protocol(*, quick: bool) -> Protocol:
    protocol = load_protocol("walking")
    if not quick:
        return protocol
    conditions = []
    for condition in protocol.conditions:
        plan = condition.perturbations
        if plan is not None:
            shortened = plan.model_copy(update={"count_per_point": _QUICK_PULSES})
            condition = condition.model_copy(update={"perturbations": shortened})
        conditions.append(condition)
    return protocol.model_copy(
        update={"conditions": tuple(conditions), "participants": _QUICK_PEOPLE}
    )
