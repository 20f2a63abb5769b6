"""Study folders of the cases."""

import json
import zlib
from pathlib import Path

import numpy as np
from benchmarks.attacks.cases import Case, plant
from benchmarks.attacks.people import DEVICE, WINDOW_S, Walker
from benchmarks.worlds import make

_FURTHER_SENSORS = ("joint_encoder", "shank_velocity", "thigh_velocity")


def _person(case: Case, walker: Walker) -> str:
    calibration = {k: v for k, v in walker.calibration.items() if k not in case.uncalibrated}
    if case.device_inertia is not None:
        calibration["intrinsic_inertia"] = (case.device_inertia, 0.002)
    if case.goniometer_only:
        calibration = {
            key: entry for key, entry in calibration.items() if not key.startswith(_FURTHER_SENSORS)
        }
    text = make._describe(walker.person, calibration)
    table = f'perturbations = "{walker.person.name}_pulses.csv"\n'
    return text if case.table else text.replace(table, "")


def _head(case: Case) -> str:
    left_out = _FURTHER_SENSORS if case.goniometer_only else ()
    left_out += ("command",) if case.table else ()
    lines = [line for line in make._HEAD.splitlines() if not line.startswith(left_out)]
    mass, centre, _ = DEVICE
    source = "table" if case.table else "command"
    lines += ["", "[perturbations]", f'source = "{source}"', f"window_s = {WINDOW_S}"]
    return "\n".join([*lines, "", "[device]", f"mass_kg = {mass}", f"centre_m = {centre}", ""])


def write_study(case: Case, walkers: list[Walker], folder: Path) -> Path:
    """Write a study with the case's error, and `truth.json`; return its folder."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(zlib.crc32(case.name.encode()))
    for walker in walkers:
        name = walker.person.name
        for condition in ("unperturbed", "perturbed"):
            recording = plant(case, getattr(walker, condition), rng)
            recording.to_csv(folder / f"{name}_{condition}.csv", index=False)
        if case.table:
            walker.pulses.to_csv(folder / f"{name}_pulses.csv", index=False)
    people = [_person(case, walker) for walker in walkers]
    (folder / "study.toml").write_text("".join([_head(case), *people]))
    truth = {walker.person.name: walker.truth for walker in walkers}
    (folder / "truth.json").write_text(json.dumps(truth, indent=1))
    return folder
