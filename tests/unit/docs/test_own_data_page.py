"""The tutorial of own files: its study is that of the folder, and every command runs as told."""

import re
import shlex
import shutil
import tomllib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pandas as pd
import pytest

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "own-data.md").read_text(encoding="utf-8")
FOLDER = ROOT / "examples" / "own_data"

_FENCE = re.compile(r"^```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)


def blocks(language: str) -> list[str]:
    """Return the blocks of a language in the order of the page."""
    return [body for found, body in _FENCE.findall(PAGE) if found == language]


def studies() -> tuple[str, str]:
    """Return the whole study, and what is changed in it later."""
    whole, later = blocks("toml")[:2]
    return whole, later


@pytest.fixture(scope="module")
def maker(load_script: Callable[[Path], ModuleType]) -> ModuleType:
    return load_script(FOLDER / "make.py")


# --- the files -----------------------------------------------------------------------------------


def test_the_files_come_out_of_their_seed_bit_for_bit(maker, tmp_path):
    maker.make(tmp_path)

    made = {file.name for file in tmp_path.iterdir()}
    assert made == {f.name for f in FOLDER.iterdir() if f.suffix in (".csv", ".txt")}
    differ = [n for n in made if (tmp_path / n).read_bytes() != (FOLDER / n).read_bytes()]
    assert differ == []


# --- the page ------------------------------------------------------------------------------------


def test_the_study_names_every_recording_of_the_folder():
    study = tomllib.loads(studies()[0])

    assert {r["file"] for r in study["recordings"]} == {f.name for f in FOLDER.glob("P*.csv")}


def test_a_new_user_gets_what_the_page_says(jointz, tmp_path, monkeypatch):
    whole, later = studies()
    monkeypatch.chdir(tmp_path)
    shutil.copytree(FOLDER, "my-study")
    commands = [shlex.split(line)[1:] for body in blocks("bash") for line in body.splitlines()]
    proposed, analyse, again = commands

    inspected = jointz(*proposed)
    assert inspected.code == 0
    asked = next(body for body in blocks("text") if "To decide" in body)
    assert [line for line in asked.splitlines() if line not in inspected.out] == []
    text = Path("my-study/study.toml").read_text(encoding="utf-8")
    check_proposal(text, tomllib.loads(whole))
    Path("my-study/study.toml").write_text(whole, encoding="utf-8")

    made = jointz(*analyse, "--no-figures")

    assert made.code == 0
    told = next(body for body in blocks("text") if "cells, method" in body)
    assert [line for line in told.splitlines() if line not in made.out] == []
    table = own_estimates("results")
    assert set(table["status"]) == {"ok", "undecided"}
    excluded = pd.read_csv("results/excluded.csv")
    assert list(zip(excluded["onset_s"], excluded["code"], strict=True)) == [
        (62.496, "unusual_response")
    ]
    means = pd.read_csv("results/population.csv").query("parameter == 'inertia'")
    assert set(means["status"]) == {"failed:too_few_participants"}

    Path("my-study/exclusions.csv").write_text(blocks("csv")[0], encoding="utf-8")
    # The later participants stand where the earlier did, as the page tells the reader.
    start, stop = whole.index("[[participants]]"), whole.index("[[recordings]]")
    with_lags = whole[:start] + later + "\n" + whole[stop:]
    Path("my-study/study.toml").write_text(with_lags, encoding="utf-8")

    assert jointz(*again, "--no-figures").code == 0
    check_second_run()


def check_proposal(text: str, study: dict) -> None:
    """Assert that all guesses are right, and nothing but the lab book's answers is missing."""
    found = tomllib.loads(text)
    by_file = [sorted(s["recordings"], key=lambda r: r["file"]) for s in (found, study)]
    assert by_file[0] == by_file[1]
    assert found["files"].items() >= study["files"].items()
    for key in ("joint", "kind", "positive", "torque_acts_on"):
        assert found[key] == study[key]
    missing = {
        name: study["channels"][name].items() - c.items() for name, c in found["channels"].items()
    }
    assert not {name: entries for name, entries in missing.items() if entries}


def check_second_run() -> None:
    """Assert that the page's number is decided, that it is true, and that its row is of it."""
    table = own_estimates("results-2")
    whole = table[table["parameter"].isin(("stiffness", "damping", "inertia"))]
    assert f"Now {(whole['status'] == 'ok').sum()} of 18 estimates are available" in PAGE
    truth = pd.read_csv("my-study/truth.csv").melt(
        ["participant", "timing_point"], var_name="parameter", value_name="truth"
    )
    beside = table.merge(truth, on=["participant", "timing_point", "parameter"], validate="1:1")
    assert len(beside) == 18
    beside = beside[beside["status"] == "ok"]
    assert beside["truth"].between(beside["ci_low"], beside["ci_high"]).all()
    assert set(pd.read_csv("results-2/excluded.csv")["code"]) == {"user"}
    row = table.query("participant == 'P01' and parameter == 'inertia'").iloc[0]
    shown = f"| {row['value']:.3f}, {row['ci_low']:.3f} to {row['ci_high']:.3f} | 0.0469 |"
    assert shown in PAGE


def own_estimates(folder: str) -> pd.DataFrame:
    """Return the rows of K, B and J without those per kg."""
    table = pd.read_csv(Path(folder) / "estimates.csv")
    return table[~table["parameter"].str.endswith("_per_mass")]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"device"', '"joint"', "failed:opposite_sign"),
        ('positive = "extension"\n', "", "failed:opposite_sign"),
        ('unit = "deg"', 'unit = "rad"', "P01_pulses.csv"),
        ('unit = "ms"', 'unit = "s"', "channels.time (ms?)"),
        ("skip_rows = 6\n", "", "t_ms"),
    ],
)
def test_wrong_answers_look_as_the_page_says(jointz, tmp_path, old, new, said):
    whole = studies()[0]
    assert whole.count(old) == 1
    study = tmp_path / "s"
    study.mkdir()
    (study / "P01_pulses.csv").symlink_to(FOLDER / "P01_pulses.csv")
    lines = whole[: whole.index("[[participants]]")].replace(old, new)
    person = '[[participants]]\nid = "P01"\n[[recordings]]\nparticipant = "P01"\n'
    text = f'{lines}{person}condition = "perturbed"\nfile = "P01_pulses.csv"\n'
    (study / "study.toml").write_text(text, encoding="utf-8")

    outcome = jointz("analyze", study, "--out", tmp_path / "r", "--no-figures")

    assert outcome.code in (1, 2)
    assert said in outcome.out + outcome.err
