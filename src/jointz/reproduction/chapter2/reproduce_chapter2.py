"""Chapter II again: every table and figure of the series-elastic exoskeleton's bench."""

import tempfile
from functools import partial
from typing import Any

from jointz.io.protocols import load_protocol
from jointz.reproduction.audit_claims import audit_claims
from jointz.reproduction.chapter2 import chapter2_claims, chapter2_loads
from jointz.reproduction.chapter2 import chapter2_numbers as chapter2
from jointz.reproduction.chapter2.mechanisms import (
    Mechanism,
    mechanism_errors,
    mechanism_table,
    mechanisms,
)
from jointz.reproduction.reproduction_result import Reproduction
from jointz.reproduction.reproduction_tasks import (
    in_processes,
    provenance,
    run_study,
    study_truth,
)
from jointz.tasks.engine import Task
from jointz.tasks.progress import Progress


def reproduce_chapter2(seed: int, preset: str, tell: Progress) -> Reproduction:
    """Run the protocols of chapter II on the simulated bench and set the numbers beside."""
    loads = [load.name for load in load_protocol("sea-mass-spring").loads]
    with tempfile.TemporaryDirectory() as folder:
        tasks: list[Task[Any]] = [
            *(Task(load, partial(_load, folder, load, seed, preset)) for load in loads),
            Task("bandwidth", partial(_bandwidth, folder, seed, preset)),
            Task("intrinsic impedance", partial(_intrinsic, folder, seed, preset)),
            *(Task(m.name, partial(_mechanism, m, seed)) for m in mechanisms()),
        ]
        done = dict(in_processes(tasks, tell))
    found = {load: done[load] for load in loads}
    pairs = [pair for study in found.values() for pair in study.pairs]
    cases = [pair for pair in pairs if pair.case != "damper"]
    claims, notes = chapter2_claims.claim_tables(
        cases,
        [p for study in found.values() for p in study.single],
        [p for study in found.values() for p in study.recommended_single],
    )
    errors = {m.name: done[m.name] for m in mechanisms()}
    bandwidth_table, bandwidth_curves = done["bandwidth"]
    intrinsic_table, intrinsic_curves = done["intrinsic impedance"]
    return Reproduction(
        chapter=2,
        title="The series-elastic exoskeleton on its bench",
        tables=(
            bandwidth_table,
            intrinsic_table,
            *chapter2_loads.error_tables(cases, found[loads[0]].torque_gain),
            chapter2_loads.vaf_table(found),
            claims,
            mechanism_table(errors),
            chapter2_loads.pair_table(pairs),
            chapter2_loads.other_devices(),
            audit_claims(2),
        ),
        curves={
            "bandwidth": bandwidth_curves,
            "intrinsic": intrinsic_curves,
            "loads": [pair._asdict() for pair in pairs],
            "mechanisms": [
                {
                    "mechanism": name,
                    "stiffness_pct": values["stiffness"],
                    "damping": values["damping"],
                    "inertia_pct": values["inertia"],
                }
                for name, values in errors.items()
            ],
        },
        notes=(
            "The bench is simulated: the numbers say what the method does on a machine like the "
            "dissertation's whose truth is known, not what the dissertation's machine did.",
            "The errors of the bench are one set of parameters, chosen before this comparison; "
            "docs/sea-bench.md tells the reason for each, and what was changed after a look.",
            *notes,
        ),
        provenance=provenance(2, seed, preset),
    )


def _load(folder: str, load: str, seed: int, preset: str) -> chapter2_loads.LoadStudy:
    study = run_study(folder, "sea-mass-spring", seed, preset, load=load)
    return chapter2_loads.analyze_load(study, load, study_truth(study, load), seed)


def _bandwidth(folder: str, seed: int, preset: str) -> Any:
    return chapter2.bandwidth(run_study(folder, "sea-bandwidth", seed, preset))


def _intrinsic(folder: str, seed: int, preset: str) -> Any:
    study = run_study(folder, "sea-intrinsic", seed, preset)
    return chapter2.intrinsic(study, study_truth(study, "free")["intrinsic"])


def _mechanism(mechanism: Mechanism, seed: int) -> dict[str, float]:
    return mechanism_errors(mechanism, seed=seed)
