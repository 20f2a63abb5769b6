"""Nothing recorded is lost: kill, full disk, resume; every planned pulse counts once."""

import itertools
import json
import os
import resource
import signal
from collections import Counter

import numpy as np
import pandas as pd
import pytest

import jointz
from jointz.core.errors import DataError, OutputError, WriteError
from jointz.core.session_log import WALKING
from jointz.io.formats.netcdf_recording import read_recording
from jointz.io.log_reader import read_log
from jointz.rig.experiment.files.journal import read_journal
from jointz.rig.experiment.files.recorder import Recorder
from jointz.rig.experiment.trial_kinds import WALKING_TRIALS
from jointz.rig.sim.simulated_devices import SimulatedActuator

#: Place of the number of the pulse in a record.
PULSE = [field.name for field in WALKING.fields].index("pulse")


@pytest.fixture(scope="module")
def protocol(short_walking):
    return short_walking(count_per_point=3)


def run(protocol, out, **options):
    return jointz.run(protocol, out=out, seed=5, **options)


@pytest.fixture(scope="module", autouse=True)
def compiled(protocol, tmp_path_factory):
    """Compile the physics once, before children are forked."""
    return run(protocol, tmp_path_factory.mktemp("warm") / "study")


def in_child(work):
    """Do the work in a forked process and return its exit status."""
    child = os.fork()
    if child == 0:
        status = 1
        try:
            work()
            status = 0
        finally:
            os._exit(status)
    return os.waitpid(child, 0)[1]


def killed_at(protocol, out, tick, *, in_pulses=False):
    """Run until the log has taken so many ticks, then be killed; False where it ended before.

    With ``in_pulses`` only ticks count in which a pulse is on.
    """
    write, ticks = Recorder.write, itertools.count(1)

    def counted(self, *records):
        write(self, *records)
        if (not in_pulses or records[0][PULSE]) and next(ticks) == tick:
            os.kill(os.getpid(), signal.SIGKILL)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Recorder, "write", counted)
        return os.WIFSIGNALED(in_child(lambda: run(protocol, out, resume=True)))


def completed(out):
    events = read_journal(out / "sessions" / "S01" / "journal.jsonl")
    return [e["pulse"] for e in events if e["event"] == "pulse_completed"]


@pytest.mark.parametrize("times", [4, pytest.param(20, marks=pytest.mark.slow)])
def test_kills_lose_no_record_and_no_pulse_counts_twice(protocol, tmp_path, times):
    out, rng = tmp_path / "study", np.random.default_rng(11)
    before = 0
    for kills in range(times):
        tick = int(rng.integers(1, 8000))
        if not killed_at(protocol, out, tick):
            pytest.fail(f"the run ended after {kills} kills: make it longer")
        logs = (out / "sessions" / "S01" / "logs").glob("*.jzlog")
        on_disk = sum(int((read_log(log).records["part"] == 0).sum()) for log in logs)
        assert on_disk == before + tick
        before = on_disk
        assert not (out / "study.toml").exists()
        numbers = completed(out)
        assert len(numbers) == len(set(numbers))
    made = run(protocol, out, resume=True)

    assert sorted(completed(out)) == list(range(1, 19))
    assert set(made.report.to_frame()["completed"]) == {3}
    table = pd.read_csv(out / "S01_perturbed_pulses.csv")
    left_out = out / "exclusions.csv"
    n_left_out = len(pd.read_csv(left_out)) if left_out.exists() else 0
    assert len(table) - n_left_out == 18
    analysis = jointz.analyze(out, method="pre_pulse", resamples=2)
    assert Counter(p.timing_point for p in analysis.pulses if p.code != "aborted") == dict.fromkeys(
        ("LRE", "MST", "TST", "PSW", "ISW", "MSW"), 3
    )


def pulses_in_logs(session):
    """Return number, torque at the onset and ticks of each pulse that began, and all samples."""
    pulses, n_samples = [], 0
    logs = (session / "logs").glob("perturbed-*.jzlog")
    for log in sorted(logs, key=lambda path: int(path.stem.split("-")[-1])):
        records = read_log(log).records
        n_samples += np.unique(records["actuator_time_ns"]).size
        ticks = records[records["part"] == 0]
        number = ticks["pulse"].astype(int)
        edges = np.flatnonzero(np.diff(number, prepend=0, append=0))
        for begin, end in itertools.pairwise(edges):
            if number[begin]:
                pulses.append((number[begin], float(ticks["command"][begin]), end - begin))
    return pulses, n_samples


@pytest.mark.parametrize("kills", [3, pytest.param(10, marks=pytest.mark.slow)])
def test_kills_in_pulses_of_several_shapes_keep_the_plan_balanced(short_walking, tmp_path, kills):
    protocol = short_walking(
        "walking_doublets",
        ["perturbed"],
        count_per_point=8,
        sham_share=0.25,
        timing_points={"LRE": 7.0, "ISW": 68.5},
    )
    out, rng = tmp_path / "study", np.random.default_rng(7)
    session = out / "sessions" / "S01"
    for _ in range(kills):
        assert killed_at(protocol, out, int(rng.integers(1, 150)), in_pulses=True)
    run(protocol, out, resume=True)

    plan = {pulse.number: pulse for pulse in WALKING_TRIALS.read_plan(session)["perturbed"]}
    assert sorted(completed(out)) == sorted(plan)
    of_variants = Counter((p.timing_point, p.shape, p.amplitude_nm) for p in plan.values())
    assert len(of_variants) == 2 * (8 + 1)
    assert {count for (*_, torque), count in of_variants.items() if torque} == {1}

    begun, n_samples = pulses_in_logs(session)
    felt = [pulse for pulse in begun if not plan[pulse[0]].sham]
    table = pd.read_csv(out / "S01_perturbed_pulses.csv")
    assert table["amplitude_nm"].tolist() == [torque for _, torque, _ in felt]
    assert table["timing_point"].tolist() == [plan[number].timing_point for number, *_ in felt]
    assert read_recording(out / "S01_perturbed.nc")["time"].size == n_samples
    cut_s = pd.read_csv(out / "exclusions.csv")["onset_s"].to_numpy()
    cut = np.isclose(table["onset_s"].to_numpy()[:, None], cut_s, atol=1e-3).any(axis=1)
    whole = [pulse for pulse, is_cut in zip(felt, cut, strict=True) if not is_cut]
    assert sorted(number for number, *_ in whole) == [n for n, p in plan.items() if not p.sham]
    lasts = {"short": 31, "long": 71}  # ticks
    assert all(ticks == lasts[plan[number].shape] for number, _, ticks in whole)
    broken_off = [ticks < lasts[plan[number].shape] for number, _, ticks in felt]
    assert any(broken_off)
    assert not np.any(np.array(broken_off) & ~cut)


def test_a_finished_run_is_left_as_it_is(protocol, compiled):
    before = {p: p.stat().st_mtime_ns for p in compiled.study.rglob("*.jzlog")}
    again = run(protocol, compiled.study, resume=True)
    assert again.report.to_dict() == compiled.report.to_dict()
    assert {p: p.stat().st_mtime_ns for p in compiled.study.rglob("*.jzlog")} == before


def test_a_run_of_another_seed_or_plan_and_a_folder_that_exists_are_kept(
    protocol, compiled, tmp_path
):
    with pytest.raises(DataError, match="seed 5, now 6"):
        jointz.run(protocol, out=compiled.study, seed=6, resume=True)
    other = protocol.model_copy(update={"name": "mine"})
    with pytest.raises(DataError, match="protocol 'walking', now 'mine'"):
        run(other, compiled.study, resume=True)
    with pytest.raises(OutputError, match="--resume"):
        run(protocol, compiled.study)
    (tmp_path / "thesis.doc").write_text("years")
    with pytest.raises(OutputError, match=r"run\.json"):
        run(protocol, tmp_path, resume=True)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.doc"]


def test_a_full_disk_stops_the_run_safely_and_resume_completes_it(protocol, tmp_path):
    out = tmp_path / "study"
    told = tmp_path / "told.json"

    def work():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        size = 1_000_000  # bytes that a file may take: enough for all but the pulses
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
        commands, stop = [], SimulatedActuator.stop
        SimulatedActuator.stop = lambda self: (commands.append("stop"), stop(self))
        try:
            run(protocol, out)
        except WriteError as exc:
            told.write_text(json.dumps([str(exc), exc.__notes__, commands]))

    assert in_child(work) == 0
    message, notes, commands = json.loads(told.read_text())
    assert "perturbed-0.jzlog: cannot be written (" in message
    assert notes == ["The devices were stopped.", "It was participant 1 (seed 5)."]
    assert "stop" in commands
    made = run(protocol, out, resume=True)
    assert set(made.report.to_frame()["completed"]) == {3}
