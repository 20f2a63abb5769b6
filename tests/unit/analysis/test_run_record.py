"""What an analysis says of the run that wrote its study."""

import json
import re
import shutil
from dataclasses import replace

import pytest
from tests.unit.report.pages import Page, words

from jointz.analysis.analyze import run_record
from jointz.analysis.page.report_page import render_report
from jointz.analysis.paper.methods_text import methods_text
from jointz.analysis.printed_analysis import print_analysis
from jointz.io.study_reader import open_study
from jointz.results.run_report import RunReport
from jointz.results.study_analysis import StudyAnalysis

SIM = {"protocol": "walking", "device": "sim", "preset": "realistic"}
HARDWARE = {"protocol": "walking", "device": "hardware", "preset": "hardware"}
TRUTH = {"protocol": "walking", "preset": "realistic", "participants": {"S01": {}}}


def onsets(participant="S01", **changes):
    row = {"participant": participant, "condition": "perturbed", "timing_point": "LRE"}
    row |= {
        "planned_pct": 7.0,
        "planned": 50,
        "completed": 48,
        "missed": 1,
        "aborted": 4,
        "lost": 0,
    }
    row |= {"withdrawn": 2, "n": 48, "n_missing": 0, "error_mean_pct": 0.1}
    return row | {"error_sd_pct": 1.5, "theory_sd_pct": 1.4} | changes


def report(*rows):
    timing = [
        {"participant": row["participant"], "ticks": 900, "missed_slots": 2, "clamped_ticks": 0}
        for row in rows
    ]
    return RunReport("walking", 1, tuple(rows), (), tuple(timing)).to_dict()


@pytest.fixture
def record(small_study_source, tmp_path):
    """Read the record of the small study with some files beside it, text or objects."""

    def read(**files):
        folder = shutil.copytree(small_study_source, tmp_path / "study")
        for name in ("run", "run_report", "ground_truth"):
            (folder / f"{name}.json").unlink(missing_ok=True)
        for name, content in files.items():
            text = content if isinstance(content, str) else json.dumps(content)
            (folder / f"{name}.json").write_text(text)
        return run_record(open_study(folder))

    return read


@pytest.mark.parametrize(
    ("files", "simulated"),
    [
        ({}, None),
        ({"run": SIM}, True),
        ({"run": HARDWARE}, False),
        ({"ground_truth": TRUTH}, True),
        ({"run": SIM | {"device": "ours"}}, None),
        ({"run": SIM | {"device": "ours"}, "ground_truth": TRUTH}, True),
        ({"run": HARDWARE, "ground_truth": TRUTH}, False),
    ],
)
def test_a_study_is_simulated_if_its_run_or_its_truth_says_so(record, files, simulated):
    found, notes = record(**files)
    assert found.get("simulated") is simulated
    assert notes == []


@pytest.mark.parametrize("name", ["run", "run_report", "ground_truth"])
@pytest.mark.parametrize("text", ["", "{", "[]", "7", "{}", "\0", '{"device": 3}', "[" * 100_000])
def test_a_damaged_or_foreign_file_is_a_note(record, name, text):
    found, (note,) = record(**{name: text})
    assert found == {}
    assert note.startswith(f"{name}.json: not used, as it is damaged or not from jointz run (")
    assert "\n" not in note


@pytest.mark.parametrize(
    "changed",
    [
        {"planned": "x"},
        {"planned_pct": "x"},
        {"timing_point": []},
        {"n": {}},
        {"withdrawn": "x"},
        {"planned_pct": None, "planned": "x"},
    ],
)
def test_a_report_that_the_page_cannot_show_is_a_note(record, changed):
    found, notes = record(run=SIM, run_report=report(onsets(**changed)))
    assert found == {"simulated": True}
    assert len(notes) == 1


def test_of_a_report_the_participants_of_the_study_count(record):
    found, notes = record(run_report=report(onsets(), onsets("X99")))
    assert [row["participant"] for row in found["report"]["onsets"]] == ["S01"]
    assert notes == []


def test_a_report_of_another_study_is_a_note(record):
    found, (note,) = record(run_report=report(onsets("X99")))
    assert found == {}
    assert "names no participant of the study" in note


@pytest.mark.parametrize("simulated", [True, False])
def test_page_terminal_and_methods_say_that_people_are_simulated(recommended, capsys, simulated):
    run = {"simulated": simulated, "report": report(onsets())}
    analysis = replace(recommended, provenance={**recommended.provenance, "run": run})
    again = StudyAnalysis.from_dict(json.loads(json.dumps(analysis.to_dict())))
    page = words(Page(render_report(again, {}, title="t")))
    print_analysis(again, "report.html")
    lead = "estimated in the knee of 3 simulated" if simulated else "measured in the knee of 3"
    assert f"Impedance was {lead} participants" in methods_text(again)
    assert "2 pulses were withdrawn" in methods_text(again)
    printed = capsys.readouterr().out
    assert "2 pulses were withdrawn, because pulses at the same timing point" in printed
    for text in (page, methods_text(again), printed, again.summary()):
        assert bool(re.search("3 simulated participant", text)) == simulated
    for text in (page, methods_text(again)):
        assert ("All recordings are simulated" in text) == simulated
    assert "The experiment" in page
    assert "50 pulses were planned" in page
    assert re.search(r"LRE\s*7\.0\s*48 of 50\s*1\s*4", page)
    assert "ran 900 ticks" in page
