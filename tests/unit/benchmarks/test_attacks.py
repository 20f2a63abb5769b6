"""Attacks: the planted errors, the table, and one study written and read back."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from benchmarks.attacks.__main__ import first_sentences, line
from benchmarks.attacks.cases import ANGLE, ENCODER, TORQUE, cases, plant

import jointz


@pytest.fixture
def recording() -> pd.DataFrame:
    return pd.DataFrame(dict.fromkeys((ANGLE, TORQUE, ENCODER), np.full(20_000, 2.0)))


def test_a_gain_changes_its_column_only(recording: pd.DataFrame) -> None:
    planted = plant(cases()["torque_table_x1.6"], recording, np.random.default_rng(0))
    assert planted[TORQUE].eq(3.2).all()
    assert planted[ANGLE].eq(recording[ANGLE]).all()


@pytest.mark.parametrize(
    ("name", "share"), [("angle_missing_3", 0.03), ("angle_missing_runs", 0.1)]
)
def test_the_share_of_missing_samples_is_that_of_the_case(
    recording: pd.DataFrame, name: str, share: float
) -> None:
    planted = plant(cases()[name], recording, np.random.default_rng(0))
    assert planted[ANGLE].isna().mean() == pytest.approx(share, rel=0.15)
    assert planted[TORQUE].notna().all()


def test_a_line_counts_wrong_values() -> None:
    rows = pd.DataFrame({
        "parameter": ["stiffness", "damping", "inertia"],
        "status": ["ok", "undecided", "failed:opposite_sign"],
        "truth": [100.0, 2.0, 0.3], "value": [140.0, None, None],
        "ci_low": [120.0, 1.0, None], "ci_high": [160.0, None, None],
    })  # fmt: skip
    text = line("a", rows, ["P00, P01: odd. More."], 1.0)
    assert text == "| a | 3 | 1 | 1 (K 1) | 0 of 1 | 1 | opposite_sign 1 | 1 | P: odd. |"
    assert first_sentences(["P00: odd. Why.", "P01: odd. Else."]) == ["P: odd."]


def test_a_study_is_read_back(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="mujoco (dependency group worlds) is not installed")
    from benchmarks.attacks.people import POINTS, walk
    from benchmarks.attacks.studies import write_study

    walker = walk(1, 0, per_point=1, minutes=0.3)
    study = write_study(cases()["angle_alone_x0.6"], [walker], tmp_path / "study")
    assert "joint_encoder" not in (study / "study.toml").read_text()
    spec = jointz.open_study(study).spec
    assert spec.perturbations.source == "command"
    assert [person.id for person in spec.participants] == ["P00"]
    truth = json.loads((study / "truth.json").read_text())["P00"]
    assert set(truth) == set(POINTS)
    assert all(value > 0 for point in truth.values() for value in point.values())
    angle = pd.read_csv(study / "P00_perturbed.csv")[ANGLE]
    np.testing.assert_allclose(angle, 0.6 * walker.perturbed[ANGLE], atol=1e-3)
