"""Chapters again: the arithmetic of the tables on made-up pairs, and a chapter written whole."""

import json
import re

import numpy as np
import pytest
from reproduction import chapter2_loads, printed_numbers, reproduce, reproduce_chapter2
from reproduction.chapter2_loads import Pair
from reproduction.chapter_runs import run_study, study_truth
from reproduction.reproduction_result import Reproduction
from reproduction.reproduction_tables import Compared, ComparedTable

from jointz.core.errors import OutputError
from jointz.core.events import PulseEstimate

TRUTH = {"k1": 168.0, "k2": 273.0, "I1": 0.0364, "I2": 0.07}


def pairs(stiffness=0.95, inertia=0.85, ours=0.99):
    """Return all pairs of the four cases, off by the same factors."""
    found = []
    for case, (spring, mass) in printed_numbers.CASE_LOADS.items():
        for trajectory in printed_numbers.TRAJECTORIES:
            for name, truth, factor in (
                ("stiffness", TRUTH[spring], stiffness),
                ("inertia", TRUTH[mass], inertia),
            ):
                spread = (0.98 * truth, 1.01 * truth)
                values = (truth, factor * truth, 1e-3 * truth, ours * truth, *spread)
                found.append(Pair(case, trajectory, name, *values))
            found.append(Pair(case, trajectory, "damping", 0.0, -0.14, 0.01, 0.0, -0.01, 0.01))
    return found


def test_every_cell_of_tables_2_1_and_2_2_stands_beside_the_printed_one():
    stiffness, inertia, averages = chapter2_loads.error_tables(pairs(), 0.9725)
    assert [len(t.rows) for t in (stiffness, inertia, averages)] == [10, 10, 4]
    assert stiffness.rows[0].printed == 3.73
    for table, letter in ((stiffness, -5.0), (inertia, -15.0)):
        for row in table.rows:
            assert row.dissertation == pytest.approx(letter)
            assert row.recommended == pytest.approx(-1.0)
    assert [row.printed for row in averages.rows] == [-2.15, -2.51, -15.2, -13.1]


def test_shares_of_pairs_below_the_truth_are_counted():
    rows = {r.quantity: r for r in chapter2_loads._below_rows(pairs(stiffness=1.02))}
    assert rows["stiffness below the truth, pairs"].dissertation == 0.0
    assert rows["inertia below the truth, pairs"].dissertation == 100.0
    assert rows["inertia below the truth, trajectories"].recommended == 100.0


def pulses(method, effect):
    """Return pulses of all loads; direction is type along E; ``effect`` is that of the type."""
    rng = np.random.default_rng(5)
    return [
        PulseEstimate(
            load, trajectory, "", str(trial), float(k), sign, "with" if along > 0 else "against",
            168.0 + effect * sign + rng.standard_normal(), 0.0,
            0.0364 + 1e-4 * rng.standard_normal(), 99.0, method,
        )
        for load in chapter2_loads.CASES
        for trajectory in printed_numbers.TRAJECTORIES
        for trial in range(4)
        for k, (sign, other) in enumerate([(1, 1), (1, -1), (-1, 1), (-1, -1)] * 2)
        for along in [sign if trajectory == "E" else other]
    ]  # fmt: skip


def test_shares_of_anovas_stand_beside_shares_of_the_same_anovas():
    table, _ = chapter2_loads.claim_tables(
        pairs(), pulses("dissertation", 5.0), pulses("pulse_likelihood", 0.0)
    )
    rows = {r.quantity: r for r in table.rows}
    whole = rows["ANOVAs with p < 0.05, type"]
    assert whole.recommended is None  # 32 of the 40 only
    without_e = rows["ANOVAs with p < 0.05, type, without E"]
    assert without_e.printed == 96.9  # 2.3.3 lists 1C
    counted = re.findall(r"\d+ of (\d+)", without_e.note)
    assert counted == ["32", "32", "32"]
    assert without_e.dissertation >= 50.0 > without_e.recommended
    direction = rows["ANOVAs with p < 0.05, direction, without E"]
    assert direction.printed == 87.5  # 4C, 4D, 1A and 2A are listed
    assert rows["ANOVAs with p < 0.05 after Holm, type, without E"].recommended == 0.0


@pytest.fixture
def tiny(monkeypatch):
    """A chapter that takes no time."""

    def made(seed, preset, tell):
        tell(1, 1, preset)
        rows = (Compared("error", "%", -2.15, -5.0, -1.0, note="of 20"),)
        table = ComparedTable("average_errors", "Average errors", "Why.", rows)
        return Reproduction(2, "The bench", (table,), provenance={"settings": {"seed": seed}})

    monkeypatch.setattr(reproduce, "_CHAPTERS", {2: made})


@pytest.mark.usefixtures("tiny")
def test_a_chapter_is_written_whole_with_page_tables_and_numbers(tmp_path):
    (chapter,) = reproduce.reproduce([2], out=tmp_path / "out", seed=3)
    folder = tmp_path / "out" / "chapter2"
    assert chapter.page == folder / "chapter2.html"
    assert "The bench" in chapter.page.read_text(encoding="utf-8")
    again = Reproduction.from_dict(json.loads((folder / "chapter2.json").read_text()))
    assert again == chapter.reproduction
    table = (folder / "tables" / "average_errors.csv").read_text()
    assert table.startswith("quantity,unit,printed")
    assert json.loads((folder / "provenance.json").read_text())["settings"] == {"seed": 3}


@pytest.mark.usefixtures("tiny")
def test_one_page_holds_all_chapters_that_are_there(tmp_path, monkeypatch):
    def third(seed, preset, tell):
        del preset, tell
        table = ComparedTable("errors", f"Errors of seed {seed}", "", (Compared("error"),))
        return Reproduction(3, "The actuator", (table,))

    monkeypatch.setitem(reproduce._CHAPTERS, 3, third)
    reproduce.reproduce([2, 3], out=tmp_path, seed=1)
    page = tmp_path / "validation.html"
    assert "Errors of seed 1" in page.read_text(encoding="utf-8")
    reproduce.reproduce([3], out=tmp_path, seed=99, overwrite=True)
    text = page.read_text(encoding="utf-8")
    assert "Errors of seed 99" in text
    assert "Errors of seed 1<" not in text
    assert "The bench" in text


@pytest.mark.usefixtures("tiny")
def test_a_chapter_that_is_there_is_found_before_another_is_made(tmp_path, monkeypatch):
    reproduce.reproduce([2], out=tmp_path)
    made = []
    monkeypatch.setitem(reproduce._CHAPTERS, 3, lambda *_: made.append(3))
    with pytest.raises(OutputError, match="exists and is kept"):
        reproduce.reproduce([3, 2], out=tmp_path)
    assert made == []


@pytest.mark.usefixtures("tiny")
def test_the_command_prints_tables_and_page(command, tmp_path):
    code, out = command("2", "--out", tmp_path / "a")
    assert code == 0
    rows = [line.split() for line in out.splitlines() if line.startswith("  ")]
    assert rows[1] == ["error", "%", "-2.15", "-5", "-1", "of", "20"]
    _, told = command("2", "--out", tmp_path / "b", "--json")
    assert told["chapters"][0]["tables"][0]["rows"][0]["printed"] == -2.15
    code, told = command("2", "--out", tmp_path / "b", "--json")
    assert (code, told["error"]) == (2, "OutputError")


@pytest.mark.slow
def test_intrinsic_impedance_shows_what_least_squares_gives_though_a_lag_leaves_it_undecided(
    tmp_path,
):
    study = run_study(str(tmp_path), "sea-intrinsic", 1, "nominal")
    table, _ = reproduce_chapter2.intrinsic(study, study_truth(study, "free")["intrinsic"])
    assert [row.quantity.split()[1] for row in table.rows] == ["stiffness", "damping", "inertia"]
    for row in table.rows:
        assert np.isfinite([row.dissertation, row.dissertation_sd]).all()
        assert row.recommended_low < row.recommended < row.recommended_high
    inertia = table.rows[2]
    assert inertia.recommended == pytest.approx(inertia.truth, rel=0.1)
