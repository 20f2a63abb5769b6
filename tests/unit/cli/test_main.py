"""The command line: one JSON object, exit codes, no traceback, help."""

import errno
import json
import subprocess
import sys
from unittest.mock import Mock

import pytest

from jointz import __version__
from jointz.analysis import analyze as analysis
from jointz.analysis import participant_jobs as participants
from jointz.analysis import results_folder
from jointz.cli import main
from jointz.cli.command_line import _REPLACED, command_line
from jointz.core.errors import EngineError, JointzError, WorkerLostError
from jointz.rig.experiment.files import file_lock
from jointz.tasks.task_store import TaskStore

FEW = ("--method", "pre_pulse", "--resamples", 2, "--no-figures")


def test_python_runs_the_command_as_a_module():
    told = subprocess.run(
        [sys.executable, "-m", "jointz", "--version"], capture_output=True, text=True, check=True
    )
    assert told.stdout == f"jointz {__version__}\n"


@pytest.mark.parametrize("arguments", [(), ("identify",), ("--help",), ("analyze", "--help")])
def test_help_is_shown_where_a_command_is_missing(jointz, arguments):
    outcome = jointz(*arguments)
    assert "Usage: jointz" in outcome.out + outcome.err
    assert outcome.code == (0 if "--help" in arguments else 2)


def test_every_command_is_listed_unless_one_is_named_first():
    everything = {group.name for group in command_line().registered_groups}
    everything |= {command.name for command in command_line().registered_commands}
    assert {"analyze", "run", "identify"} < everything
    for first in ("run", "--memory-limit 1GB run", "--memory-limit=1GB run", "--debug run"):
        app = command_line(first.split())
        assert [c.name for c in app.registered_commands] == ["run"]
        assert not app.registered_groups
    for first in ("--help run", "rnu run", "--memory-limit run --help", ""):
        assert len(command_line(first.split()).registered_commands) > 5


USAGE_ERRORS = [
    ("frobnicate",),
    ("analyze", "study"),
    ("analyze", "study", "--out", "x", "--method", "nope"),
    ("analyze", "study", "--out", "x", "--resamples", "1"),
    ("identify", "joint", "f", "--angle", "a", "--torque", "b", "--model", "nope"),
    ("demo", "--seed", "x"),
]


@pytest.mark.parametrize("arguments", USAGE_ERRORS, ids=" ".join)
def test_wrong_options_exit_2_with_json_where_it_is_wanted(jointz, arguments):
    plain = jointz(*arguments)
    assert (plain.code, plain.out) == (2, "")
    assert "Usage:" in plain.err
    assert "Traceback" not in plain.err

    wanted = jointz(*arguments, "--json")
    assert wanted.code == 2
    assert wanted.json["status"] == "error"
    assert wanted.json["message"]


@pytest.mark.parametrize(
    ("name", "replacement"), [("collect", "jointz pool RESULTS"), ("reproduce", "make reproduce")]
)
def test_a_replaced_command_names_its_replacement(jointz, name, replacement):
    assert replacement in _REPLACED[name]
    for arguments in ((name,), (name, "anything", "--here"), ("--debug", name, "--help")):
        outcome = jointz(*arguments)
        assert (outcome.code, outcome.out) == (2, "")
        assert outcome.err == f"jointz: {_REPLACED[name]}\n"
    outcome = jointz(name, "all", "--json")
    assert (outcome.code, outcome.json["status"]) == (2, "error")
    assert outcome.json["message"] == _REPLACED[name]
    assert f" {name} " not in jointz("--help").out


def test_bad_input_is_one_json_object_and_one_message(jointz, tmp_path):
    arguments = ("analyze", tmp_path / "nowhere", "--out", tmp_path / "out")
    outcome = jointz(*arguments, "--json")

    assert outcome.code == 2
    assert outcome.json["error"] == "DataError"
    assert outcome.err == f"jointz: {outcome.json['message']}\n"
    assert jointz(*arguments).out == ""


@pytest.mark.usefixtures("terminal_signals")
@pytest.mark.parametrize("before", [True, False])
def test_debug_shows_the_traceback_before_and_after_the_command(monkeypatch, tmp_path, before):
    arguments = ["analyze", str(tmp_path / "nowhere"), "--out", str(tmp_path / "o")]
    debug = ["--debug", *arguments] if before else [*arguments, "--debug"]
    monkeypatch.setattr(sys, "argv", ["jointz", *debug])
    with pytest.raises(JointzError, match="no study"):
        main.run()


def bug_with_a_note():
    bug = ZeroDivisionError("oops")
    bug.add_note("It was participant 1 (seed 7).")
    return bug


@pytest.mark.parametrize(
    ("owner", "error", "code", "named"),
    [
        (participants, bug_with_a_note(), 70, "participant 1 (seed 7)"),
        (participants, KeyboardInterrupt(), 130, ""),
        (participants, MemoryError("2 GiB"), 1, "2 GiB"),
        (analysis, EngineError("gone."), 1, "gone."),
        (analysis, WorkerLostError("S01: killed."), 1, "S01"),
    ],
)
def test_whatever_happens_there_is_no_traceback(
    jointz, small_study, tmp_path, monkeypatch, owner, error, code, named
):
    name = "analyze_participant" if owner is participants else "outcomes"
    monkeypatch.setattr(owner, name, Mock(side_effect=error))
    outcome = jointz("analyze", small_study.root, "--out", tmp_path / "out", "--json")

    assert outcome.code == code
    assert named in outcome.json["message"]
    assert outcome.json["message"] in outcome.err
    assert "Traceback" not in outcome.err
    assert [p.name for p in tmp_path.iterdir()] == ["study"]


def test_results_are_absent_when_writing_fails_half_way(jointz, small_study, tmp_path, monkeypatch):
    out = tmp_path / "deep" / "out"
    full = OSError(errno.ENOSPC, "no space left on device")
    with monkeypatch.context() as patch:
        patch.setattr(results_folder, "render_report", Mock(side_effect=full))
        outcome = jointz("analyze", small_study.root, "--out", out, *FEW, "--json")

    assert (outcome.code, outcome.json["error"]) == (1, "WriteError")
    assert str(out) in outcome.json["message"]
    kept = TaskStore(out).folder  # who was analysed need not be so again
    assert not out.parent.exists()
    assert str(kept) in outcome.json["message"]

    monkeypatch.setattr(participants, "analyze_participant", None)
    again = jointz("analyze", small_study.root, "--out", out, *FEW)
    assert again.code == 0
    assert str(out / "report.html") in again.out
    assert list(out.parent.iterdir()) == [out]


def test_a_cache_folder_that_cannot_be_written_costs_a_warning(
    jointz, small_study, tmp_path, monkeypatch
):
    (tmp_path / "home").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    outcome = jointz("analyze", small_study.root, "--out", tmp_path / "out", *FEW, "--json")

    assert (outcome.code, outcome.json["n_standing"] > 0) == (0, True)
    assert str(tmp_path / "home") in outcome.err


def run_in_python(*arguments, then, cwd=None):
    """Run the command in a new Python; return what is printed last."""
    script = (
        f"import sys; sys.argv = {['jointz', *arguments]!r}\n"
        "from jointz.cli.main import run\n"
        "try: run()\n"
        "except SystemExit: pass\n"
        f"{then}"
    )
    words = [sys.executable, "-c", script]
    ended = subprocess.run(words, cwd=cwd, capture_output=True, text=True, check=True)
    return ended.stdout.splitlines()[-1]


def test_a_numba_configuration_in_the_working_folder_changes_nothing(tmp_path, monkeypatch):
    """Numba takes the folder of its cache, whose content runs, from such a file."""
    (tmp_path / ".numba_config.yaml").write_text(
        f"cache_dir: {tmp_path / 'planted'}\ncache_locator_classes: planted.Locator\n"
    )
    for name in ("NUMBA_CACHE_DIR", "NUMBA_CACHE_LOCATOR_CLASSES"):
        monkeypatch.delenv(name, raising=False)
    show = "from numba import config\nprint([config.CACHE_DIR, config.CACHE_LOCATOR_CLASSES])"

    assert run_in_python("--version", then=show, cwd=tmp_path) == "['', '']"


def test_help_imports_nothing_heavy():
    heavy = ("scipy.signal", "matplotlib", "numba", "statsmodels", "pandas", "xarray", "pint")
    show = f"print([name for name in {heavy!r} if name in sys.modules])"

    assert run_in_python("--help", then=show) == "[]"


def test_workers_import_nothing_from_the_working_folder(small_study, tmp_path):
    data, out, script = tmp_path / "data", tmp_path / "out", tmp_path / "bin" / "jointz"
    for folder in (data, out, script.parent):
        folder.mkdir()
    (data / "multiprocessing.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')\n")
    (out / "note.txt").touch()  # the folder is refused when the workers have started
    script.write_text("from jointz.cli.main import run\nif __name__ == '__main__':\n    run()\n")
    words = [sys.executable, script, "analyze", small_study.root, "--out", out, "--workers", "2"]
    ended = subprocess.run(words, cwd=data, capture_output=True, text=True, check=False)

    assert ended.returncode == 2, ended.stderr
    assert not (tmp_path / "ran").exists()


def test_what_is_kept_stays_for_those_whose_analysis_broke(
    jointz, small_study, tmp_path, monkeypatch
):
    def breaking(person_id, *given):
        if person_id == "S01":
            raise ZeroDivisionError("planted")
        return analyzed(person_id, *given)

    analyzed = participants.analyze_participant
    out = tmp_path / "out"
    kept = TaskStore(out).folder
    words = ("analyze", small_study.root, "--out", out, *FEW)
    monkeypatch.setattr(participants, "analyze_participant", breaking)
    first = jointz(*words, "--json")

    assert (first.code, len(list(kept.iterdir()))) == (0, 1)
    assert str(kept) in first.err
    monkeypatch.setattr(participants, "analyze_participant", analyzed)
    again = jointz(*words, "--overwrite")
    assert "analysis_broke" not in again.out
    assert str(kept) not in again.err
    assert not kept.exists()


def test_a_run_without_locks_ends_before_it_writes(jointz, tmp_path, monkeypatch):
    without_locks = OSError(errno.ENOLCK, "No locks available")
    monkeypatch.setattr(file_lock, "_lock", Mock(side_effect=without_locks))
    first = jointz("run", "walking", "--out", tmp_path, "--participants", 1)

    assert (first.code, "No locks available" in first.err) == (1, True)
    assert "--resume" not in first.err  # where nothing was recorded
    assert list(tmp_path.iterdir()) == []


def test_quiet_prints_nothing_and_writes_all(jointz, small_study, tmp_path):
    out = tmp_path / "out"
    outcome = jointz("analyze", small_study.root, "--out", out, *FEW[:-1], "--quiet")

    assert (outcome.code, outcome.out, outcome.err) == (0, "", "")
    written = {p.name for p in out.iterdir()}
    assert written >= {
        "estimates.csv", "comparison.csv", "population.csv", "excluded.csv", "statistics.json",
        "figures", "report.html", "provenance.json",
    }  # fmt: skip
    assert {p.suffix for p in (out / "figures").iterdir()} == {".svg"}
    assert json.loads((out / "provenance.json").read_text())["seed"] == 0


def test_one_person_reads_the_estimates_and_why_some_are_missing(jointz, small_study, tmp_path):
    head = small_study.toml.index('[[participants]]\nid = "S02"')
    tail = small_study.toml.index("[[recordings]]")
    only = small_study.toml[:head] + small_study.toml[tail:]
    only = only[: only.index('[[recordings]]\nparticipant = "S02"')]
    points = "[perturbations]\ntiming_points = { LRE = 7.0, TSW = 93.5, MST = 21.5 }\n"
    (small_study.root / "study.toml").write_text(only + points)
    line = "participant,recording,onset_s,action\nS01,S01_perturbed.csv,0.1,exclude\n"
    (small_study.root / "exclusions.csv").write_text(line)
    # A pulse table would name them; here the nearest of the three points takes each pulse.
    small_study.edit_table(
        "S01_perturbed.csv", lambda t: t.assign(command=t["command"].where(t["time"] < 8, 0.0))
    )
    outcome = jointz("analyze", small_study.root, "--out", tmp_path / "out", *FEW)

    assert outcome.code == 1
    assert "S01 LRE\tfailed:" in outcome.out
    assert "exclusions.csv: no pulse or stride begins at 0.1 s" in outcome.out
