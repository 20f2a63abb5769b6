"""Inputs of the timed commands: simulated walkers, their recordings as csv, a minute, a table.

Made by a process of its own, ``python -m benchmarks.speed.inputs FOLDER PARTICIPANTS PULSES``: a
timed command starts with the memory of the process that starts it.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from benchmarks.speed.commands import jointz
from benchmarks.speed.csv_copy import write_csv_copy

_LEVELS, _PEOPLE = "abcdef", 10
_LMER = """
suppressPackageStartupMessages(library(lmerTest))
rows <- read.csv("rows.csv")
fit <- lmer(y ~ level + (1 | who), rows)
anova(fit, ddf = "Kenward-Roger")
ranova(fit)
"""


def make_inputs(folder: Path, *, people: int, pulses: int) -> None:
    """Make them; ``pulses`` is the number at each of six timing points."""
    protocol = _jointz("jointz protocols show walking --quiet", folder)
    few = protocol.replace("count_per_point = 50", f"count_per_point = {pulses}")
    (folder / "walking.toml").write_text(few)
    _jointz(f"jointz run walking.toml --participants {people} --seed 1 --out walkers", folder)
    write_csv_copy(folder / "walkers", folder / "walkers-csv")
    _a_minute().to_csv(folder / "knee.csv", index=False)
    _rows().to_csv(folder / "rows.csv", index=False)
    (folder / "rows.R").write_text(_LMER)


def _jointz(typed: str, folder: Path) -> str:
    command = jointz(typed)
    return subprocess.run(command, cwd=folder, check=True, stdout=subprocess.PIPE, text=True).stdout


def _a_minute() -> pd.DataFrame:
    """Return a minute at 1 kHz of a joint whose angle is perturbed below 25 Hz, with noise."""
    rng = np.random.default_rng(8)
    t = np.arange(60_000) / 1000.0
    speed = 2.0 * np.pi * rng.uniform(0.2, 25.0, 200)
    phase = rng.uniform(0.0, 2.0 * np.pi, 200)
    angle, velocity, acceleration = np.zeros((3, t.size))
    for w, p in zip(speed, phase, strict=True):
        angle += 0.002 * np.sin(w * t + p)
        velocity += 0.002 * w * np.cos(w * t + p)
        acceleration -= 0.002 * w**2 * np.sin(w * t + p)
    torque = 80.0 * angle + 1.2 * velocity + 0.03 * acceleration + rng.normal(0.0, 0.1, t.size)
    return pd.DataFrame({"t": t, "knee": angle, "tau": torque}).round(6)


def _rows() -> pd.DataFrame:
    """Return 60 rows: ten people at six levels."""
    rng = np.random.default_rng(0)
    people = np.repeat([f"S{k}" for k in range(_PEOPLE)], len(_LEVELS))
    y = np.repeat(rng.normal(size=_PEOPLE), len(_LEVELS)) + rng.normal(size=people.size)
    return pd.DataFrame({"who": people, "level": list(_LEVELS) * _PEOPLE, "y": y})


if __name__ == "__main__":
    make_inputs(Path(sys.argv[1]), people=int(sys.argv[2]), pulses=int(sys.argv[3]))
