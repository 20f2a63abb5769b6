"""A whole study: methods, order, notes, provenance."""

import contextlib
import hashlib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import jointz
from jointz.analysis import participant_jobs as participants
from jointz.analysis.analyze import analyze
from jointz.core.errors import DataError, EngineError, StudyError, WorkerLostError
from jointz.io.study_reader import open_study
from jointz.tasks.engine import Engine, Serial
from jointz.tasks.open_engine import open_engine
from jointz.tasks.task_store import TaskStore


@pytest.fixture(autouse=True)
def cache_home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.fixture
def whole(rigid_analysis):
    return rigid_analysis


#: The quickest analysis there is, for what does not depend on the method.
QUICK = {"method": "pre_pulse", "resamples": 2}


@pytest.fixture(scope="module")
def quick(small_study_source):
    """Analyse the study once; progress is reported before each participant and at the end."""
    steps = []
    analysis = analyze(small_study_source, **QUICK, progress=lambda *step: steps.append(step))
    assert steps == [(0, 2, "S01"), (1, 2, "S02"), (2, 2, "done")]
    return analysis


@pytest.fixture
def break_analysis(monkeypatch):
    """Raise an error in the analysis of a participant."""
    analyze_participant = participants.analyze_participant

    def plant(person, error):
        def analyze_or_raise(person_id, *arguments):
            if person_id == person:
                raise error
            return analyze_participant(person_id, *arguments)

        monkeypatch.setattr(participants, "analyze_participant", analyze_or_raise)

    return plant


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "nope"}, r"one of recommended, .*'nope'"),
        ({"resamples": 1}, "resamples: expected at least 2, got 1"),
        ({"certify": True, "method": "pre_pulse"}, "certify: .* this is pre_pulse"),
    ],
)
def test_options_out_of_range_are_refused(small_study_source, options, message):
    with pytest.raises(ValueError, match=message):
        analyze(small_study_source, **options)


def test_a_certificate_is_made_on_request_and_changes_no_estimate(whole, small_study_source):
    certified = analyze(small_study_source, resamples=50, seed=3, certify=1)
    found = certified.certificate
    assert whole.certificate is None
    assert found.n_participants == 1
    assert (found.method, found.world) == ("bayesian", "realistic, rigid coupling")
    assert len(found.estimates) == 6 * 3
    pd.testing.assert_frame_equal(certified.to_frame(), whole.to_frame())


def test_the_other_methods_stand_in_the_comparison(whole):
    assert set(whole.to_frame()["method"]) == {"bayesian"}
    assert list(whole.comparison_frame()["method"].unique()) == ["dissertation"]
    assert len(whole.comparison) == len(whole.cells)


def test_a_method_chosen_by_name_is_the_same_as_in_the_comparison(small_study_source, whole):
    chosen = analyze(small_study_source, method="dissertation", resamples=50, seed=3)

    pd.testing.assert_frame_equal(chosen.to_frame(), whole.comparison_frame())
    assert set(chosen.comparison_frame()["method"]) == {"matched_strides"}


def test_processes_find_what_one_process_finds(small_study_source, whole):
    with open_engine(workers=2, tasks=2, needs="jointz.analysis.participant_jobs") as engine:
        shared = analyze(small_study_source, resamples=50, seed=3, engine=engine)

    pd.testing.assert_frame_equal(shared.to_frame(), whole.to_frame(), check_exact=True)
    assert shared.pulses == whole.pulses
    assert list(shared.provenance["inputs"]) == list(whole.provenance["inputs"])


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (ZeroDivisionError("planted"), "S01 (seed 0)"),
        (WorkerLostError("S01: its worker was killed."), "S01: its worker was killed."),
        (MemoryError("2 GiB"), "S01: too little memory (2 GiB)"),
    ],
)
def test_a_participant_whose_analysis_breaks_keeps_nobody_else_back(
    small_study_source, quick, break_analysis, error, told
):
    break_analysis("S01", error)
    found = analyze(small_study_source, **QUICK)

    before, after = quick.to_frame(), found.to_frame()
    failed = after[after["participant"] == "S01"]
    assert set(failed["status"]) == {"failed:analysis_broke"}
    assert len(failed) == (before["participant"] == "S01").sum()
    pd.testing.assert_frame_equal(
        after[after["participant"] != "S01"], before[before["participant"] != "S01"]
    )
    [note] = [n for n in found.statistics["notes"] if n.startswith(told)]
    assert ("report it" in note) == isinstance(error, ZeroDivisionError)


class Elsewhere(Engine):
    """Makes calls in another folder, where a worker may have been started."""

    def __init__(self, folder):
        self._folder, self._serial = folder, Serial()

    def submit(self, call):
        with contextlib.chdir(self._folder):
            return self._serial.submit(call)

    def renew(self):
        raise AssertionError


def test_workers_in_another_folder_find_a_study_that_was_named_from_here(
    small_study, tmp_path, monkeypatch
):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(small_study.root.parent)

    assert analyze(small_study.root.name, engine=Elsewhere(elsewhere), **QUICK).n_standing


def test_an_analysis_goes_on_where_another_was_killed(small_study, tmp_path, monkeypatch):
    store = TaskStore(tmp_path / "tasks")
    first = analyze(small_study.root, store=store, **QUICK)
    assert len(list(store.folder.iterdir())) == len(first.provenance["study"]["participants"])

    monkeypatch.setattr(participants, "analyze_participant", None)  # nothing is done again
    again = analyze(small_study.root, store=store, **QUICK)
    pd.testing.assert_frame_equal(again.to_frame(), first.to_frame(), check_exact=True)
    assert again.pulses == first.pulses

    with pytest.raises(TypeError):  # another question
        analyze(small_study.root, store=store, **QUICK | {"resamples": 3})


class GoneAfter(Engine):
    """Does what it is told to a few times, and then is gone."""

    def __init__(self, calls):
        self._left, self._serial = calls, Serial()

    @property
    def ahead(self):
        return 1

    def submit(self, call):
        if self._left == 0:
            raise RuntimeError("the client is closed")
        self._left -= 1
        return self._serial.submit(call)

    def renew(self):
        raise AssertionError


def test_an_engine_that_fails_is_nobody_s_failure_and_what_is_done_is_kept(
    small_study, tmp_path, monkeypatch
):
    store = TaskStore(tmp_path / "tasks")
    given = {**QUICK, "store": store}
    with pytest.raises(EngineError, match="the client is closed"):
        analyze(small_study.root, engine=GoneAfter(1), **given)

    done = []
    monkeypatch.setattr(participants, "_analyzed", noted(participants._analyzed, done))
    assert analyze(small_study.root, **given).n_standing
    assert done == ["S02"]


def test_problems_are_not_kept_for_they_may_lie_outside_of_the_files(
    small_study, tmp_path, monkeypatch
):
    def missing(study, entry):
        if entry.participant == "S01":
            raise DataError("a reader is not installed.")
        return read_recording(study, entry)

    store = TaskStore(tmp_path / "tasks")
    read_recording = participants.read_recording
    with monkeypatch.context() as patch:
        patch.setattr(participants, "read_recording", missing)
        with pytest.raises(StudyError, match="a reader is not installed"):
            analyze(small_study.root, store=store, **QUICK)
    assert len(list(store.folder.iterdir())) == 1
    assert analyze(small_study.root, store=store, **QUICK).n_standing


def test_who_is_kept_is_not_read_again_and_who_broke_is_done_again(
    small_study, tmp_path, monkeypatch, break_analysis
):
    store = TaskStore(tmp_path / "tasks")
    break_analysis("S02", ZeroDivisionError("planted"))
    assert "planted" in str(analyze(small_study.root, store=store, **QUICK).statistics)
    break_analysis("", None)
    read = []
    monkeypatch.setattr(
        participants, "read_participant", noted(participants.read_participant, read)
    )
    again = analyze(small_study.root, store=store, **QUICK)

    assert [second for _, second in read] == ["S02"]
    assert "planted" not in str(again.statistics)


def noted(call, calls):
    """Return a call that notes what it was given first; of a study, with the participant."""

    def made(first, *given):
        calls.append(first if isinstance(first, str) else (first, given[0]))
        return call(first, *given)

    return made


def test_a_file_is_hashed_as_a_stream(small_study, monkeypatch):
    opened = open_study(small_study.root)
    monkeypatch.setattr(Path, "read_bytes", None)  # a recording may be larger than memory
    found = participants.hashed(opened, "S01_perturbed.csv")
    with (small_study.root / "S01_perturbed.csv").open("rb") as file:
        assert found["sha256"] == hashlib.sha256(file.read()).hexdigest()


def test_a_baseline_named_by_the_study_leaves_nothing_to_compare(small_study):
    toml = small_study.toml + '\n[perturbations]\nbaseline = "pre_pulse"\n'
    (small_study.root / "study.toml").write_text(toml)
    found = jointz.analyze(small_study.root, resamples=20)

    assert found.comparison == ()
    assert {c.baseline for c in found.cells} == {"pre_pulse"}
    assert found.settings["baseline"] == "pre_pulse"


@pytest.mark.parametrize(
    ("method", "perturbations", "named"),
    [
        ("full_record", "", "full_record"),
        ("dissertation", 'baseline = "predicted"', "predicted"),
        ("recommended", 'baseline = "predicted"\nsource = "angle"', "predicted"),
    ],
)
def test_a_method_that_does_not_fit_the_study_is_bad_input(
    small_study, method, perturbations, named
):
    toml = f"{small_study.toml}\n[perturbations]\n{perturbations}\n"
    (small_study.root / "study.toml").write_text(toml)
    with pytest.raises(DataError, match=named):
        jointz.analyze(small_study.root, method=method, resamples=20)


def test_a_bench_study_says_which_baseline_its_method_took(small_study):
    small_study.edit_toml('kind = "walking"\ncoupling = "rigid"', 'kind = "bench"')
    found = jointz.analyze(small_study.root, method="least_squares", resamples=20)

    assert found.settings["baseline"] == "unperturbed_mean"  # no strides to match on a bench
    assert {c.baseline for c in found.cells} == {"unperturbed_mean"}


def test_settings_and_provenance_say_what_was_done(small_study_source, whole):
    assert whole.settings["resamples"] == 50
    assert whole.settings["seed"] == whole.provenance["seed"] == 3
    assert whole.settings["study"] == "study"
    toml = (small_study_source / "study.toml").read_bytes()
    assert whole.provenance["study_sha256"] == hashlib.sha256(toml).hexdigest()
    for entry in whole.provenance["inputs"]:
        content = (small_study_source / entry["file"]).read_bytes()
        assert entry["sha256"] == hashlib.sha256(content).hexdigest()
        assert entry["history"][0]["step"] == "read"
    assert len(whole.provenance["inputs"]) == 4


def test_all_unreadable_recordings_stand_in_one_error(small_study):
    for file in ("S01_perturbed.csv", "S01_unperturbed.csv", "S02_perturbed.csv"):
        small_study.edit_table(file, lambda t: t.assign(angle=100.0 * t["angle"]))
    with pytest.raises(StudyError) as refused:
        analyze(small_study.root, resamples=2)
    assert len(refused.value.problems) == 3


def user_lines(*lines):
    head = "participant,recording,onset_s,action,reason,time\n"
    return head + "".join(f"{line},because,2026-01-01\n" for line in lines)


def test_the_users_exclusions_are_honoured_and_a_line_without_effect_is_noted(small_study, whole):
    pulse = next(p for p in whole.pulses if not p.code)
    stride = next(s for s in whole.strides if s.condition == "unperturbed" and not s.code)
    where = f"{pulse.participant},{pulse.recording}"
    lines = [f"{where},{pulse.onset_s},exclude", f"{where},0.123,exclude"]
    lines.append(f"{stride.participant},{stride.recording},{stride.start_s},exclude")
    (small_study.root / "exclusions.csv").write_text(user_lines(*lines))
    found = analyze(small_study.root, resamples=20)

    assert found.provenance["study"]["joint"] == "knee"
    assert "exclusions.csv" in [entry["file"] for entry in found.provenance["inputs"]]
    assert [p.onset_s for p in found.pulses if p.code == "user"] == [pulse.onset_s]
    assert [s.start_s for s in found.strides if s.code == "user"] == [stride.start_s]
    (note,) = set(found.statistics["notes"]) - set(whole.statistics["notes"])
    assert "0.123 s" in note
    same = (pulse.participant, pulse.timing_point)
    before, after = (
        next(c for c in a.cells if (c.participant, c.timing_point) == same) for a in (whole, found)
    )
    assert after.n_used == before.n_used - 1
    assert after.n_used + after.n_excluded == before.n_used + before.n_excluded
    # The baseline of cells that kept their pulses is another without the stride.
    person, point = stride.participant, pulse.timing_point
    values = [
        [c.parameters[0].value for c in a.comparison
         if c.participant == person and c.timing_point != point]
        for a in (whole, found)
    ]  # fmt: skip
    assert values[0] != values[1]


def test_participants_without_a_perturbed_recording_have_rows_that_say_so(small_study):
    block = '\n[[recordings]]\nparticipant = "S02"\ncondition = "perturbed"\n'
    small_study.edit_toml(block + 'file = "S02_perturbed.csv"\n', "")
    file = small_study.root / "study.toml"
    file.write_text(file.read_text() + '\n[[participants]]\nid = "idle"\n')
    found = analyze(small_study.root, **QUICK).to_frame()

    for person in ("S02", "idle"):
        rows = found[found["participant"] == person]
        assert set(rows["status"]) == {"failed:no_perturbed_recording"}
    assert (found["participant"] == "S02").sum() == 30


def test_a_turned_sign_is_suspected_where_everything_is_zero(small_study):
    small_study.edit_toml('torque_acts_on = "joint"', 'torque_acts_on = "device"')
    found = analyze(small_study.root, resamples=20)
    assert any("torque_acts_on" in note for note in found.statistics["notes"])


def test_a_voltage_that_is_declared_as_a_switch_is_noted(small_study, quick):
    file = small_study.root / "S01_perturbed.csv"
    table = pd.read_csv(file)
    drift = 0.1 * np.sin(np.linspace(0.0, 9.0, len(table)))
    table["contact"] = (0.3 + 4.3 * table["contact"] + drift).round(2)
    table.to_csv(file, index=False)
    found = analyze(small_study.root, **QUICK)

    (note,) = (n for n in found.statistics["notes"] if n.startswith("contact in 1 recording"))
    assert all(word in note for word in (file.name, 'kind = "voltage"', 'unit = "V"'))
    assert not any(n.startswith("contact in") for n in quick.statistics["notes"])


def test_a_file_behind_a_variable_goes_by_its_own_name(small_study, monkeypatch):
    monkeypatch.setenv("LAB_DISK", str(small_study.root))
    small_study.edit_toml('file = "S01_perturbed', 'file = "${LAB_DISK:-nowhere}/S01_perturbed')
    inputs = analyze(small_study.root, **QUICK).provenance["inputs"]

    names = {entry["file"]: entry["name"] for entry in inputs}
    assert names["${LAB_DISK:-nowhere}/S01_perturbed.csv"] == "S01_perturbed.csv"
    assert names["S02_perturbed.csv"] == "S02_perturbed.csv"
