"""Make the stored results that later versions must still read.

    python tests/regression/make_results.py

The truth is known: a spring, damper and inertia moved by trapezoids of torque,
with the exact solution of a linear system and no noise. Run it for a new schema
only, give the files its number, and keep the old ones.
"""

import json
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import lsim

import jointz

HERE = Path(__file__).parent
RATE_HZ = 250.0
INERTIA = 0.05
#: Case -> stiffness, damping, pulses. A lone pulse cannot be resampled.
CASES = {"soft": (40.0, 1.0, 4), "stiff": (90.0, 1.5, 4), "lone": (40.0, 1.0, 1)}
SPACING_S = 2.0

STUDY = """\
jointz = 1
joint = "knee"
kind = "bench"
participants = [{{ id = "soft", mass_kg = 70.0 }}, {{ id = "stiff" }}, {{ id = "lone" }}]
[channels]
time = {{ column = "time" }}
angle = {{ column = "angle" }}
torque = {{ column = "torque" }}
command = {{ column = "command" }}
[perturbations]
source = "command"
baseline = "pre_pulse"
{recordings}
"""
RECORDING = """\
[[recordings]]
participant = "{case}"
condition = "perturbed"
file = "{case}.csv"
"""


def record(stiffness: float, damping: float, n_pulses: int) -> pd.DataFrame:
    """Return a record of pulses of 5 N*m, 0.2 s long, with ramps of 20 ms."""
    time = np.arange(round(n_pulses * SPACING_S * RATE_HZ)) / RATE_HZ
    since = time % SPACING_S - 1.0
    command = 5.0 * np.clip(np.minimum(since / 0.02, (0.2 - since) / 0.02), 0.0, 1.0)
    joint = ([1.0], [INERTIA, damping, stiffness])
    _, angle, _ = lsim(joint, command, time)  # exact: torque is linear between samples
    return pd.DataFrame({"time": time, "angle": angle, "torque": command, "command": command})


def make_analysis() -> dict:
    with tempfile.TemporaryDirectory() as root:
        folder = Path(root) / "bench"
        folder.mkdir()
        for case, truth in CASES.items():
            record(*truth).to_csv(folder / f"{case}.csv", index=False)
        recordings = "".join(RECORDING.format(case=case) for case in CASES)
        (folder / "study.toml").write_text(STUDY.format(recordings=recordings))
        analysis = jointz.analyze(folder, method="dissertation", resamples=100, seed=1)
        return analysis.to_dict()


def make_fit() -> dict:
    stiffness, damping, _ = CASES["soft"]
    table = record(stiffness, damping, 2)
    fit = jointz.identify_joint(angle=table["angle"], torque=table["torque"], rate_hz=RATE_HZ)
    return fit.to_dict()


def store(name: str, content: dict) -> None:
    text = json.dumps(content, allow_nan=False)
    (HERE / name).write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    store("study_analysis_1.json", make_analysis())
    store("joint_fit_1.json", make_fit())
