"""What `jointz calibrate` finds of simulated people, beside what was planted.

``python -m benchmarks.calibration --people 20`` from the root of the repository; the table stands
in ``docs/calibration.md``. One person a seed; later steps know what earlier ones found.
"""

import argparse
import json
import tempfile
from functools import partial
from pathlib import Path

import pandas as pd

from jointz.core.study import CalibrationSpec
from jointz.io.calibration_file import write_into_study
from jointz.results.bench.calibration_fit import STEPS
from jointz.rig.calibration.calibrate import calibrate
from jointz.rig.session.run import run
from jointz.tasks.engine import Task, done_in_turn
from jointz.tasks.open_engine import open_engine

PRESETS = ("nominal", "hard", "anthropometric")
#: As the page tells people to take them, so that each knows what it uses.
ORDER = ("hinge", "frame", "spring", "zero", "leg", "torsion")
_WITH_FRAME = ("anthropometric",)
#: Tissue that is undecided stands beside the entries; only this preset has any.
_BESIDE = ("tissue_hz", "anthropometric")
_FIRST_SEED = 101
#: Step -> entries that later steps take from it.
_PASSED_ON = {
    "hinge": ("angle_lag_s", "angle_gain"),
    "frame": ("intrinsic_stiffness", "intrinsic_damping", "intrinsic_inertia"),
    "spring": ("torque_gain", "friction_gain"),
}


def calibrated_person(
    preset: str, seed: int, steps: tuple[str, ...], folder: Path
) -> list[dict[str, object]]:
    """Return one row an entry: planted and estimated."""
    rows, known = [], {}
    for step in steps:
        if step == "frame" and preset not in _WITH_FRAME:
            continue
        study = folder / preset / str(seed) / step
        if not study.exists():
            run(f"calibration-{step}", out=study, seed=seed, preset=preset, participants=1)
        if known:
            write_into_study(study, {"S01": CalibrationSpec(**known)})
        fit = calibrate(study, step=step).fits["S01"]
        truth = json.loads((study / "ground_truth.json").read_text())["participants"]["S01"]
        rows += [
            {
                "preset": preset,
                "seed": seed,
                "step": step,
                "entry": entry.name,
                "planted": truth["entries"].get(entry.name),
                "value": entry.value,
                "sd": entry.sd,
                "status": entry.status,
                "reason": entry.reason,
            }
            for entry in (*fit.entries, *fit.reported)
            if entry in fit.entries or (entry.name, preset) == _BESIDE
        ]
        found = fit.specification()
        for name in _PASSED_ON.get(step, ()):
            if (entry := getattr(found, name)) is not None:
                known[name] = entry
    return rows


def table(rows: pd.DataFrame) -> pd.DataFrame:
    """Return mean and sd of z, coverage and share decided, by preset and entry."""
    rows = rows.assign(z=(rows["value"] - rows["planted"]) / rows["sd"])
    found = []
    for (preset, step, entry), group in rows.groupby(["preset", "step", "entry"], sort=False):
        ok = group[group["status"] == "ok"]
        found.append(
            {
                "preset": preset,
                "step": step,
                "entry": entry,
                "decided": f"{len(ok)} of {len(group)}",
                "median sd": ok["sd"].median(),
                "mean z": ok["z"].mean(),
                "sd z": ok["z"].std(),
                "inside 95 %": f"{(ok['z'].abs() < 1.96).sum()} of {len(ok)}",
            }
        )
    return pd.DataFrame(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--people", type=int, default=20)
    parser.add_argument("--presets", nargs="+", default=PRESETS, choices=PRESETS)
    parser.add_argument("--steps", nargs="+", default=ORDER, choices=STEPS)
    parser.add_argument("--keep", type=Path, help="folder for the studies, taken up again")
    parser.add_argument("--csv", type=Path, help="file for all rows")
    parser.add_argument("--workers", type=int, default=None)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = asked.keep or Path(scratch)
        tasks = [
            Task(
                f"{preset} {seed}",
                partial(calibrated_person, preset, seed, tuple(asked.steps), folder),
            )
            for preset in asked.presets
            for seed in range(_FIRST_SEED, _FIRST_SEED + asked.people)
        ]
        rows: list[dict[str, object]] = []
        with open_engine(workers=asked.workers, tasks=len(tasks), needs=__name__) as engine:
            for done in done_in_turn(engine, tasks):
                rows += done.result()
    frame = pd.DataFrame(rows)
    if asked.csv:
        frame.to_csv(asked.csv, index=False)
    print(table(frame).to_string(index=False, float_format="{:.2g}".format))


if __name__ == "__main__":
    main()
