"""The demo: simulated people walk two protocols; their estimates are compared with the truth."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from jointz.analysis.analyze import analyze
from jointz.analysis.results_folder import write_results
from jointz.core.errors import DataError
from jointz.core.gait_phases import ALL_POINTS
from jointz.core.method_names import BAYESIAN
from jointz.core.protocols.protocol import Protocol
from jointz.io.new_folder import new_folder, write_marker
from jointz.io.protocols import load_protocol
from jointz.io.study_reader import open_study
from jointz.results.study_analysis import StudyAnalysis
from jointz.rig.session.run import TRUTH_FILE, run
from jointz.rig.sim.direct_walk import WALKING_PULSE, WalkPlan
from jointz.rig.sim.own_truth import cell_truth, own_truth
from jointz.rig.sim.people import Person
from jointz.rig.sim.presets import preset
from jointz.tasks.engine import Engine, Serial
from jointz.tasks.open_engine import open_engine
from jointz.tasks.progress import Progress, RunProgress
from jointz.tasks.shared_memory import shared_out

MARKER = ".jointz-demo"
_PRESET = "realistic"
#: People; pulses a timing point, a multiple of the eight doublets (shape, size, sign); strides
#: from pulse to pulse.
_WHOLE, _QUICK = (4, 16, (3, 7)), (2, 8, (3, 4))
_PARAMETERS = ("stiffness", "damping", "inertia")
#: Pulses a timing point of the walks that tell how far pulses of every shape move the joint.
_TRUTH_PULSES = 8


class TruthRow(NamedTuple):
    """An available estimate beside the truth, in SI."""

    participant: str
    timing_point: str
    parameter: str
    truth: float
    estimate: float
    ci_low: float
    ci_high: float
    error_pct: float  # of the estimate, % of the truth
    covered: bool  # whether the interval contains the truth


@dataclass(frozen=True, slots=True)
class DemoProtocol:
    """A built-in protocol of the demo, and the sensors of the knee's motion."""

    name: str
    title: str  # in tables
    folder_prefix: str
    sensors: tuple[str, ...]
    plan: WalkPlan  # its pulses


@dataclass(frozen=True, slots=True)
class DemoExperiment:
    """A protocol that simulated people walked, analysed."""

    protocol: DemoProtocol
    analysis: StudyAnalysis
    truth: pd.DataFrame  # made by truth_table

    def accuracy(self) -> pd.DataFrame:
        """Return decided values, their RMS error (%) and coverage of intervals, by parameter.

        Error and coverage are None where nothing is decided.
        """
        cells = {(c.participant, c.timing_point) for c in self.analysis.cells}
        n_cells = sum(point != ALL_POINTS for _, point in cells)
        rows = [
            {"protocol": self.protocol.name, "parameter": name, "n_cells": n_cells}
            | _scores(self.truth[self.truth["parameter"] == name])
            for name in _PARAMETERS
        ]
        return pd.DataFrame(rows, dtype=object)


def _scores(decided: pd.DataFrame) -> dict[str, float | None]:
    if decided.empty:
        return {"n_decided": 0, "rms_error_pct": None, "coverage": None}
    return {
        "n_decided": len(decided),
        "rms_error_pct": float(np.sqrt((decided["error_pct"] ** 2).mean())),
        "coverage": float(decided["covered"].mean()),
    }


@dataclass(frozen=True, slots=True)
class Demo:
    """Results of the demonstration."""

    report: Path  # page to open, of the doublets
    doublets: DemoExperiment
    dissertation: DemoExperiment

    def accuracy(self) -> pd.DataFrame:
        """Return ``accuracy`` of both protocols, one row a protocol and parameter."""
        return accuracy_of((self.doublets, self.dissertation))

    def lesson(self) -> str:
        """Return in a sentence what the two protocols decide."""
        table = self.accuracy()
        k_and_b = table[table["parameter"].isin(["stiffness", "damping"])]
        counts = k_and_b.groupby("protocol")[["n_decided", "n_cells"]].sum()
        held, doublets = (
            "{n_decided} of {n_cells}".format(**counts.loc[one.protocol.name])
            for one in (self.dissertation, self.doublets)
        )
        return (
            f"The same people, as many pulses: with one held torque {held} K and B are available, "
            f"with doublets of two shapes and sizes and three sensors {doublets}."
        )


def accuracy_of(experiments: tuple[DemoExperiment, ...]) -> pd.DataFrame:
    """Return the accuracy of several experiments in one table."""
    return pd.concat([one.accuracy() for one in experiments], ignore_index=True)


def run_demo(
    out: Path,
    *,
    quick: bool = False,
    seed: int = 1,
    run_progress: RunProgress | None = None,
    progress: Progress | None = None,
) -> Demo:
    """Run both protocols on the same simulated people, analyse them, report beside the truth."""
    people, pulses, gaps = _QUICK if quick else _WHOLE
    protocols = demo_protocols()
    with new_folder(out, marker=MARKER, overwrite=True) as folder:
        runs = [
            run(
                _shortened(load_protocol(protocol.name), people, pulses, gap_strides=gaps),
                out=folder / f"{protocol.folder_prefix}study",
                preset=_PRESET,
                sensors=protocol.sensors,
                seed=seed,
                workers=os.cpu_count() or 1,
                progress=run_progress,
            )
            for protocol in protocols
        ]
        with open_engine(tasks=2 * people, needs="jointz.analysis.participant_jobs") as engine:
            experiments = []
            for protocol, study_run in zip(protocols, runs, strict=True):
                study = open_study(study_run.study)
                analysis = analyze(study, seed=seed, engine=engine, progress=progress)
                truth = truth_table(analysis, study_run.study, plan=protocol.plan, engine=engine)
                experiments.append(DemoExperiment(protocol, analysis, truth))
            doublets, dissertation = experiments
            _write(folder, (doublets, dissertation), engine)
        write_marker(folder, MARKER, {"made_by": "jointz demo"})
    return Demo(out / "results" / "report.html", doublets, dissertation)


def demo_protocols() -> tuple[DemoProtocol, DemoProtocol]:
    """Return the protocol that decides K and B, and the dissertation's."""
    pulses = load_protocol("walking_doublets").pulses
    return (
        DemoProtocol(
            "walking_doublets",
            "doublets, three sensors",
            "",
            ("goniometer", "encoder", "gyroscopes"),
            WalkPlan(per_point=_TRUTH_PULSES, pulses=pulses),
        ),
        DemoProtocol(
            "walking",
            "one torque held, goniometer",
            "dissertation-",
            ("goniometer",),
            WalkPlan(per_point=_TRUTH_PULSES, pulse=WALKING_PULSE),
        ),
    )


def _write(folder: Path, experiments: tuple[DemoExperiment, ...], engine: Engine) -> None:
    """Write the truth and the results of all experiments."""
    truth = [one.truth.assign(protocol=one.protocol.name) for one in experiments]
    pd.concat(truth).to_csv(folder / "truth.csv", index=False, float_format="%.10g")
    titles = {one.protocol.name: one.protocol.title for one in experiments}
    accuracy = accuracy_of(experiments)
    accuracy["protocol"] = accuracy["protocol"].map(titles)
    for one in experiments:
        results = folder / f"{one.protocol.folder_prefix}results"
        write_results(one.analysis, results, truth=one.truth, accuracy=accuracy, engine=engine)


def truth_table(
    analysis: StudyAnalysis,
    study: Path,
    *,
    plan: WalkPlan | None = None,
    engine: Engine | None = None,
) -> pd.DataFrame:
    """Return every available estimate beside its truth.

    Parameters
    ----------
    analysis : StudyAnalysis
        Of a simulated study.
    study : pathlib.Path
        Its folder, with ``ground_truth.json``.
    plan : WalkPlan, optional
        Pulses of the study, for estimates by ``bayesian`` of a strap: their stiffness is that
        along the bone's own motion, which is simulated again; a few pulses of every shape are
        enough.
    engine : Engine, optional
        Engine that simulates several people at once.

    Returns
    -------
    pandas.DataFrame
        ``participant, timing_point, parameter, truth, estimate, ci_low, ci_high,
        error_pct, covered``; unavailable estimates are left out.

    Raises
    ------
    DataError
        If estimates are by ``bayesian`` of a strap and there is no plan.
    """
    written = json.loads((study / TRUTH_FILE).read_text(encoding="utf-8"))
    truths = _truths(written, analysis, plan, engine or Serial())
    rows = []
    for cell in analysis.cells:
        truth = truths[cell.participant].get(cell.timing_point, {})
        for name in _PARAMETERS:
            estimate = cell.parameter(name)
            value = None if estimate is None or not estimate.available else estimate.value
            if estimate is None or value is None or name not in truth:
                continue
            low, high = estimate.ci_low or 0.0, estimate.ci_high or 0.0
            error_pct = 100.0 * (value / truth[name] - 1.0)
            interval = low, high, error_pct, low <= truth[name] <= high
            rows.append(
                TruthRow(cell.participant, cell.timing_point, name, truth[name], value, *interval)
            )
    return pd.DataFrame(rows, columns=TruthRow._fields)


def _truths(
    written: Mapping[str, Any], analysis: StudyAnalysis, plan: WalkPlan | None, engine: Engine
) -> dict[str, dict[str, dict[str, float]]]:
    """Return participant -> timing point -> parameter -> truth, of what the method estimates."""
    walks = {name: _pulsed(conditions) for name, conditions in written["participants"].items()}
    is_strap = analysis.settings.get("coupling") == "strap"
    if not is_strap or not any(cell.method == BAYESIAN for cell in analysis.cells):
        return {name: cell_truth(dict(walk)) for name, walk in walks.items()}
    if plan is None:
        raise DataError(
            "plan: missing; the stiffness under a strap is that along the motion which the "
            "pulses caused. Give the study's pulses, as plan=WalkPlan(...)."
        )
    calls = [partial(_truth_of_strap, walk, written["preset"], plan) for walk in walks.values()]
    return {name: result() for name, result in zip(walks, shared_out(engine, calls), strict=True)}


def _pulsed(conditions: Mapping[str, Any]) -> dict[str, Any]:
    """Return the ground truth of the condition with pulses."""
    return next(dict(c) for c in conditions.values() if c["pulses"])


def _truth_of_strap(
    recorded: Mapping[str, Any], preset_name: str, plan: WalkPlan
) -> dict[str, dict[str, float]]:
    known = {name: value for name, value in recorded["person"].items() if name != "sex"}
    person, window_s = Person(**known), float(recorded["window_s"])
    return own_truth(person, preset(preset_name), plan, window_s, recorded=recorded)


def _shortened(
    protocol: Protocol, people: int, pulses: int, *, gap_strides: tuple[int, int]
) -> Protocol:
    """Return a protocol of fewer people and of fewer pulses a timing point."""
    conditions = []
    for condition in protocol.conditions:
        plan = condition.perturbations
        if plan is not None:
            fewer = {"count_per_point": pulses, "gap_strides": gap_strides}
            condition = condition.model_copy(
                update={"perturbations": plan.model_copy(update=fewer)}
            )
        conditions.append(condition)
    return protocol.model_copy(update={"conditions": tuple(conditions), "participants": people})
