"""The page of layouts: its commands and answers lead from files to estimates, in both forms."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "lab-layout.md").read_text(encoding="utf-8")
_FENCE = re.compile(r"^```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)


def blocks(language: str) -> list[str]:
    return [body for found, body in _FENCE.findall(PAGE) if found == language]


def answer(study: Path) -> None:
    """Replace the lines of a draft by the answers of the page, as a user does."""
    text = study.read_text(encoding="utf-8")
    for line in filter(re.compile(r"\w+ = ").match, blocks("toml")[0].splitlines()):
        key = line.split(" = ")[0]
        text, n = re.subn(rf"^(# )?{key} = .*$", line, text, flags=re.MULTILINE)
        assert n == (4 if key == "side" else 1)
    study.write_text(text, encoding="utf-8")


@pytest.mark.slow
def test_the_commands_of_the_page_lead_to_its_estimates(jointz, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    asked, said = blocks("text")
    outcomes = {}
    for line in "".join(blocks("bash")).splitlines():
        program, *words = shlex.split(line)
        if program == "python":
            subprocess.run([sys.executable, ROOT / words[0], *words[1:]], check=True)
            continue
        if words[0] == "analyze":
            refused = jointz(*words)
            assert refused.code == 2
            assert "torque_model.gear_ratio: open" in refused.err
            answer(Path(words[1], "study.toml"))
        outcomes[words[0], words[1]] = made = jointz(*words)
        assert made.code == 0
        told = {"inspect": asked, "analyze": said}[words[0]]
        assert [row for row in told.splitlines() if row not in made.out] == []

    answer(Path("lab-csv/study.toml"))
    assert jointz("analyze", "lab-csv", "--out", "csv-results", "--no-figures").code == 0
    first, second = (
        pd.read_csv(f"{name}/estimates.csv") for name in ("lab-results", "csv-results")
    )
    assert (first["status"] == "ok").sum() >= 9
    assert list(first["status"]) == list(second["status"])
    assert first["value"].to_numpy() == pytest.approx(second["value"], rel=0.01, nan_ok=True)
