"""Trials of another generator, ``make.py OUT --seed N``, from its .mat files and truth.json."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
from benchmarks.lab_folder.simulation import PARAMETERS, POINTS, Person, Trial
from scipy.interpolate import CubicSpline
from scipy.io import loadmat


def make_people(source: Path, folder: Path, seed: int) -> list[Person]:
    """Run the generator and return its people; the joint is the same at all timing points."""
    command = [sys.executable, source / "lab_folder" / "make.py", folder, "--seed", str(seed)]
    subprocess.run(command, check=True)
    people = []
    for name, joint in json.loads((folder / "truth.json").read_text()).items():
        values = {parameter: joint[key] for parameter, key in zip(PARAMETERS, "KBJ", strict=True)}
        content = loadmat(folder / f"{name}.mat", squeeze_me=True, struct_as_record=False)
        without, with_pulses = (_read_trial(trial) for trial in content["trial"])
        trials = {"unperturbed": without, "perturbed": with_pulses}
        truth = dict.fromkeys(POINTS, values)
        people.append(Person(name, joint["mass_kg"], truth, joint["lag_s"], trials))
    return people


def _read_trial(trial: object) -> Trial:
    mocap, daq = trial.mocap, trial.daq  # type: ignore[attr-defined]
    return Trial(
        angle_deg=CubicSpline(mocap.time, mocap.kneeAngle),  # its noise is in the samples
        angle_noise_deg=0.0,
        end_s=float(mocap.time[-1]),
        daq_s=np.asarray(daq.time),
        current_a=daq.motorCurrent,
        trigger_v=daq.pulseTrigger,
        strikes_s=trial.events.heelStrike,  # type: ignore[attr-defined]
    )
