"""Chapter III again: every table and figure of the quasi-direct-drive actuator's bench."""

import tempfile
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from jointz.reproduction.audit_claims import audit_claims
from jointz.reproduction.chapter3 import chapter3_numbers as chapter3
from jointz.reproduction.chapter3 import chapter3_stiffness
from jointz.reproduction.reproduction_result import Reproduction
from jointz.reproduction.reproduction_tasks import (
    in_processes,
    provenance,
    run_study,
    study_truth,
)
from jointz.tasks.engine import Task
from jointz.tasks.progress import Progress

_QDD = ("qdd-torque-speed", "qdd-chirp", "qdd-static", "qdd-dither", "qdd-perturbation")


def reproduce_chapter3(seed: int, preset: str, tell: Progress) -> Reproduction:
    """Run the protocols of chapter III on the simulated bench and set the numbers beside."""
    with tempfile.TemporaryDirectory() as folder:
        tasks = [Task(name, partial(run_study, folder, name, seed, preset)) for name in _QDD]
        studies: dict[str, Path] = dict(in_processes(tasks, tell))
        truth = study_truth(studies["qdd-static"], "springs")
        spring, gain_sd = truth["load"]["stiffness"], truth["errors"]["sensor_gain_sd"]
        models, model_curves, fit = chapter3.torque_models(
            chapter3.recorded(studies["qdd-torque-speed"]), _as_sensed(truth)
        )
        chirp, chirp_curves = chapter3.chirp(chapter3.recorded(studies["qdd-chirp"]), fit)
        static, static_curves = chapter3_stiffness.static_stiffness(
            chapter3.recorded(studies["qdd-static"]), fit, spring, gain_sd=gain_sd
        )
        dither = chapter3_stiffness.dither_stiffness(
            chapter3.recorded(studies["qdd-dither"]), fit, spring, gain_sd=gain_sd
        )
        by_sensor = dither.rows[0].dissertation or spring
        pulses, pulse_curves = chapter3_stiffness.perturbation(
            studies["qdd-perturbation"], by_sensor, spring
        )
    return Reproduction(
        chapter=3,
        title="The quasi-direct-drive actuator on its bench",
        tables=(
            models,
            chirp,
            static,
            dither,
            pulses,
            chapter3.other_devices(),
            audit_claims(3),
        ),
        curves={
            "torque_models": model_curves,
            "chirp": chirp_curves,
            "static": static_curves,
            "perturbation": pulse_curves,
        },
        notes=(
            "The bench is simulated: the numbers say what the method does on a machine like the "
            "dissertation's whose truth is known, not what the dissertation's machine did.",
            "docs/qdd-bench.md holds the reason for every constant of the bench.",
        ),
        provenance=provenance(3, seed, preset),
    )


def _as_sensed(truth: Mapping[str, Any]) -> dict[str, float]:
    """Return the motor's constants as the torque sensor, with its gain, reads them."""
    machine, errors, gain = truth["machine"], truth["errors"], truth["sensor_gain"]
    constant = machine["torque_constant"] * (1.0 + errors["torque_constant_error"])
    return {
        "bias": errors["sensor_bias_nm"],
        "torque_constant": gain * constant,
        "coulomb_friction": gain * machine["coulomb_friction"],
        "gear_friction": gain * machine["gear_friction"],
        "rotor_inertia": gain * machine["rotor_inertia"],
    }
