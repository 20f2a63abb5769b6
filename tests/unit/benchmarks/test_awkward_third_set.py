"""Third set of awkward files: its categories, reproducible files, and their truths."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from benchmarks.awkward_files.third_set import ITEMS
from benchmarks.awkward_files.truth import AwkwardFile, AwkwardFolder, People, Walk

BINARY = (".xlsx",)
CATEGORIES = ("encoding", "delimiter", "clock", "header", "unit", "language", "sampling")


def _walk(phase: float = 0.0, *, pulses: bool = True) -> Walk:
    """Sixty seconds of motion with pulses every 4 s."""
    time = np.arange(30_000) / 500.0
    command = 17.0 * ((time % 4.0 > 1.5) & (time % 4.0 < 1.75) & pulses).astype(np.float64)
    contact = (time % 1.1 > 0.4).astype(np.float64)
    return Walk(time, 0.5 + 0.5 * np.sin(5.7 * time + phase), command * 0.9, command, contact)


def _people() -> People:
    return {
        (person, condition): _walk(0.7 * person, pulses=condition == "perturbed")
        for person in (1, 2)
        for condition in ("perturbed", "unperturbed")
    }


def test_there_are_four_of_each_category_two_hopeless_and_eight_folders() -> None:
    counts = Counter(item.awkward.split(":")[0] for item in ITEMS.values())
    assert counts == dict.fromkeys(CATEGORIES, 4) | {"hopeless": 2}
    assert sum(isinstance(item, AwkwardFolder) for item in ITEMS.values()) == 8


@pytest.mark.parametrize("name", list(ITEMS))
def test_files_are_written_the_same_for_the_same_seed(tmp_path: Path, name: str) -> None:
    item = ITEMS[name]
    for run in ("a", "b"):
        rng = np.random.default_rng(3)
        (tmp_path / run).mkdir()
        if isinstance(item, AwkwardFile):
            truth = item.write(_walk().at(500.0, 2.0, 40.0), tmp_path / run / name, rng)
            assert truth.hopeless == ("hopeless" in item.awkward)
        else:
            truths = item.write(_people(), tmp_path / run, rng)
            assert truths.hopeless == ("hopeless" in item.awkward)
            assert len({file.truth.participant for file in truths.recordings.values()}) == 2
            written = {path.name for path in (tmp_path / run).rglob("*.*")}
            assert written >= set(truths.recordings)
    for path in (tmp_path / "a").rglob("*.*"):
        if path.suffix not in BINARY:
            other = tmp_path / "b" / path.relative_to(tmp_path / "a")
            assert path.read_bytes() == other.read_bytes()
