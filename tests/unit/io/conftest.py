"""A good study to spoil: the example of the format's description, with its files."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from jointz.core.acquisition import Acquisition
from jointz.core.errors import DataError, StudyError
from jointz.core.study import Study
from jointz.io.formats.registry import read_acquisition
from jointz.io.recordings import read_recording
from jointz.io.study_reader import open_study

# An example of the study format with every kind of key.
EXAMPLE = (Path(__file__).parent / "example_study.toml").read_text(encoding="utf-8")

# The example's group is one of a channel that its [channels] does not name; this adds it.
GROUP_CHANNEL = """\
[channels.ankle_position]
column = "ankle_position"
unit = "rad"
"""


def samples() -> pd.DataFrame:
    """Fifty samples at 1 kHz in the columns of the example."""
    step = np.arange(50)
    return pd.DataFrame(
        {
            "time_s": step / 1000.0,
            "knee_angle_deg": np.round(20.0 + 10.0 * np.sin(step / 9.0), 6),
            "torque_nm": np.round(3.0 * np.cos(step / 7.0), 6),
            "commanded_torque_nm": np.where((step > 20) & (step < 30), 5.0, 0.0),
            "footswitch": (step % 25 < 12).astype(int),
            "ankle_position": np.round(-0.2 + 0.001 * step, 6),
        }
    )


@dataclass
class Bench:
    """A study folder, its text, and what comes of opening it."""

    root: Path
    text: str

    def edit(self, old: str, new: str) -> "Bench":
        assert old in self.text, old
        self.text = self.text.replace(old, new)
        return self

    def channel(self, name: str, *lines: str, column: str = "") -> "Bench":
        """Add a channel, in the column of its name unless another is given."""
        table = "\n".join([f"[channels.{name}]", f'column = "{column or name}"', *lines, ""])
        return self.edit("[[participants]]", table + "[[participants]]")

    def table(self, file: str, change: Callable[[pd.DataFrame], pd.DataFrame]) -> "Bench":
        path = self.root / file
        change(pd.read_csv(path)).to_csv(path, index=False)
        return self

    def tables(self, change: Callable[[pd.DataFrame], pd.DataFrame]) -> "Bench":
        """Change the files of both recordings."""
        return self.table("S01_enp.csv", change).table("S01_ewp.csv", change)

    def open(self) -> Study:
        (self.root / "study.toml").write_text(self.text, encoding="utf-8")
        return open_study(self.root)

    def read(self, number: int = 0) -> Any:
        study = self.open()
        return read_recording(study, study.spec.recordings[number])

    def refused(self, *words: str) -> StudyError:
        """Open, expect one error, and look for every word in its message."""
        with pytest.raises(StudyError) as caught:
            self.open()
        for word in words:
            assert word in str(caught.value), str(caught.value)
        return caught.value

    def sole_problem(self) -> str:
        (problem,) = self.refused().problems
        return problem


@pytest.fixture
def study(tmp_path: Path) -> Bench:
    """The example with its files; a test spoils it and opens it."""
    for file in ("S01_enp.csv", "S01_ewp.csv"):
        samples().to_csv(tmp_path / file, index=False)
    (tmp_path / "S01_pulses.csv").write_text(
        "onset_s,duration_s,amplitude_nm,timing_point\n0.021,0.009,5.0,LRE\n"
    )
    return Bench(tmp_path, EXAMPLE.replace("[[participants]]", GROUP_CHANNEL + "[[participants]]"))


@pytest.fixture(scope="session")
def outcome() -> Callable[[Path], Acquisition | str]:
    """What is read of a file, or the message of its refusal; any other exception is a failure."""

    def read(path: Path) -> Acquisition | str:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                return read_acquisition(path)
            except DataError as exc:
                return str(exc)

    return read
