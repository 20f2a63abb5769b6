"""What is done when the files of an interrupted run are not as it left them."""

import errno
import fcntl
import itertools
import json
import os
import shutil
from unittest.mock import Mock

import pandas as pd
import pytest

import jointz
from jointz.core.errors import DataError, DeviceError, OutputError, ProtocolError, WriteError
from jointz.rig.experiment.files.journal import read_journal
from jointz.rig.experiment.files.recorder import Recorder
from jointz.rig.session.session_check import write_down_losses
from jointz.rig.sim.simulated_devices import SimulatedActuator

PULSES = 4


@pytest.fixture(scope="module")
def protocol(short_walking):
    """A few strides, then 2 pulses at each of two points."""
    points = {"LRE": 7.0, "ISW": 68.5}
    conditions = ["unperturbed", "perturbed"]
    return short_walking(conditions=conditions, count_per_point=2, timing_points=points)


def run(protocol, out, **options):
    return jointz.run(protocol, out=out, seed=5, **options)


@pytest.fixture(scope="module")
def interrupted(protocol, tmp_path_factory):
    """A run that was stopped when most of its pulses were done."""
    out = tmp_path_factory.mktemp("interrupted") / "study"
    write, ticks = Recorder.write, itertools.count(1)

    def stop_late(self, *records):
        write(self, *records)
        if next(ticks) == 17_000:
            raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Recorder, "write", stop_late)
        with pytest.raises(KeyboardInterrupt):
            run(protocol, out)
    assert 2 <= len(completed(out)) < PULSES
    return out


@pytest.fixture
def out(interrupted, tmp_path):
    return shutil.copytree(interrupted, tmp_path / "study")


@pytest.fixture
def session(out):
    return out / "sessions" / "S01"


def completed(out):
    return [e["pulse"] for e in events_of(out / "sessions" / "S01", "pulse_completed")]


def events_of(session, kind):
    return [e for e in read_journal(session / "journal.jsonl") if e["event"] == kind]


def assert_whole(out, made, *, lost):
    """Every planned pulse is in the recordings once, the lost ones were done again."""
    table = made.report.to_frame()
    assert set(table["completed"]) == {2}
    assert table["lost"].sum() == lost
    pulses = pd.read_csv(out / "S01_perturbed_pulses.csv")
    excluded = out / "exclusions.csv"
    left_out = len(pd.read_csv(excluded)) if excluded.exists() else 0
    assert len(pulses) - left_out == PULSES


def test_pulses_whose_log_is_gone_are_done_again(protocol, out, session):
    before = len(completed(out))
    (session / "logs" / "perturbed-0.jzlog").unlink()
    assert_whole(out, run(protocol, out, resume=True), lost=before)


def test_pulses_that_were_cut_off_the_log_are_done_again(protocol, out, session):
    log = session / "logs" / "perturbed-0.jzlog"
    half = log.stat().st_size // 2
    log.write_bytes(log.read_bytes()[:half])
    made = run(protocol, out, resume=True)
    lost = events_of(session, "pulse_lost")
    assert lost
    assert {e["reason"] for e in lost} == {"not in perturbed-0.jzlog"}
    assert_whole(out, made, lost=len(lost))


def test_junk_after_the_last_record_costs_nothing(protocol, out, session):
    with (session / "logs" / "perturbed-0.jzlog").open("ab") as log:
        log.write(b"\xff" * 300 + bytes(4096))
    assert_whole(out, run(protocol, out, resume=True), lost=0)


def test_a_condition_whose_log_is_gone_is_walked_again(protocol, out, session):
    (session / "logs" / "unperturbed-0.jzlog").unlink()
    assert_whole(out, run(protocol, out, resume=True), lost=0)
    assert len(events_of(session, "records_lost")) == 1
    assert (session / "logs" / "unperturbed-1.jzlog").exists()


def test_the_damaged_end_of_a_condition_that_is_done_costs_nothing(protocol, out, session):
    log = session / "logs" / "unperturbed-0.jzlog"
    log.write_bytes(log.read_bytes()[:-3] + b"\0\0\0")
    assert_whole(out, run(protocol, out, resume=True), lost=0)
    assert not events_of(session, "records_lost")


@pytest.fixture(scope="module")
def finished(protocol, tmp_path_factory):
    """A run that was killed when all was recorded and nothing converted."""
    out = tmp_path_factory.mktemp("finished") / "study"
    run(protocol, out)
    unconverted(out)
    return out


def unconverted(out):
    """Take away what was made of the logs, as if the run had been killed before."""
    made = [*out.glob("*.nc"), *out.glob("*.csv"), *out.glob("sessions/*/report.json")]
    for file in [*made, out / "study.toml", out / "run_report.json"]:
        file.unlink()


@pytest.mark.parametrize("left", [pytest.param(0.0, marks=pytest.mark.slow), 0.5])
def test_pulses_lost_from_a_condition_that_was_done_are_done_again(
    protocol, finished, tmp_path, left
):
    out = shutil.copytree(finished, tmp_path / "study")
    log = out / "sessions" / "S01" / "logs" / "perturbed-0.jzlog"
    log.write_bytes(log.read_bytes()[: int(left * log.stat().st_size)])
    made = run(protocol, out, resume=True)
    lost = len(events_of(out / "sessions" / "S01", "pulse_lost"))
    assert lost == PULSES if left == 0.0 else 0 < lost < PULSES
    assert_whole(out, made, lost=lost)
    assert (log.parent / "perturbed-1.jzlog").exists()


def test_pulses_lost_from_the_first_of_two_stretches_are_done_again(protocol, out, session):
    run(protocol, out, resume=True)
    unconverted(out)
    first = session / "logs" / "perturbed-0.jzlog"
    first.write_bytes(first.read_bytes()[: first.stat().st_size // 2])
    made = run(protocol, out, resume=True)
    lost = len(events_of(session, "pulse_lost"))
    assert lost > 0
    assert_whole(out, made, lost=lost)
    assert (session / "logs" / "perturbed-2.jzlog").exists()


def test_a_loss_that_was_made_good_is_not_told_again(protocol, finished, tmp_path):
    out = shutil.copytree(finished, tmp_path / "study")
    session = out / "sessions" / "S01"
    (session / "logs" / "unperturbed-0.jzlog").unlink()
    log = session / "logs" / "perturbed-0.jzlog"
    log.write_bytes(log.read_bytes()[: log.stat().st_size // 2])
    run(protocol, out, resume=True)
    before = read_journal(session / "journal.jsonl")
    assert {"records_lost", "pulse_lost"} <= {event["event"] for event in before}
    write_down_losses(session, protocol)  # as a later --resume of the session does
    assert read_journal(session / "journal.jsonl") == before


def test_a_run_that_was_killed_before_it_was_described_begins(protocol, tmp_path):
    out = tmp_path / "study"
    out.mkdir()
    (out / "run.json").touch()
    with pytest.raises(OutputError, match="exists and is kept"):
        run(protocol, out)
    assert_whole(out, run(protocol, out, resume=True), lost=0)


def test_a_disk_that_is_full_from_the_beginning_leaves_nothing(protocol, tmp_path, monkeypatch):
    def full(fd, data):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "write", full)
        with pytest.raises(WriteError, match=r"run.json: cannot be written \(No space"):
            run(protocol, tmp_path / "study")
    assert list(tmp_path.iterdir()) == []


def test_a_study_that_lacks_a_recording_is_not_called_complete(protocol, finished, tmp_path):
    out = shutil.copytree(finished, tmp_path / "study")
    run(protocol, out, resume=True)
    (out / "S01_perturbed.nc").unlink()
    (out / "study.toml").unlink()
    with pytest.raises(OutputError, match=r"expected S01_perturbed\.nc, found none"):
        run(protocol, out, resume=True)
    assert not (out / "study.toml").exists()

    (out / "sessions" / "S01" / "report.json").unlink()
    assert_whole(out, run(protocol, out, resume=True), lost=0)
    assert (out / "S01_perturbed.nc").exists()


def test_no_device_is_opened_while_another_process_runs_the_study(protocol, out, monkeypatch):
    opened = []
    monkeypatch.setattr("jointz.rig.session.run.open_rig", lambda *_: opened.append("rig"))
    with (out / "run.json").open("a") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        with pytest.raises(OutputError, match="another process is running this"):
            run(protocol, out, resume=True)
    assert opened == []


def test_an_error_of_a_driver_before_the_trial_names_it(protocol, tmp_path, monkeypatch):
    def unplugged(self):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(SimulatedActuator, "describe", unplugged)
    with pytest.raises(DeviceError, match=r"^actuator: its driver raised OSError"):
        run(protocol, tmp_path / "study")
    assert list(tmp_path.iterdir()) == []


def damage_middle(session):
    log = session / "logs" / "perturbed-0.jzlog"
    content = bytearray(log.read_bytes())
    content[len(content) // 2] ^= 1
    log.write_bytes(content)


def write_alone(session, name, text):
    """Write a file that has no copy, as earlier versions did."""
    (session / name).write_text(text)
    (session / f"{name}.copy").unlink()


def stronger_pulse(session):
    plan = json.loads((session / "plan.json").read_text())
    plan["perturbed"][-1]["amplitude_nm"] = 24.0
    write_alone(session, "plan.json", json.dumps(plan))


def other_wearer(session):
    about = json.loads((session / "session.json").read_text())
    about["wearer"]["mass_kg"] = 140.0
    write_alone(session, "session.json", json.dumps(about))


def twice_completed(session):
    lines = (session / "journal.jsonl").read_bytes().splitlines(keepends=True)
    (pulse, *_) = [line for line in lines if b"pulse_completed" in line]
    (session / "journal.jsonl").write_bytes(b"".join([*lines, pulse]))


def overwritten(place, content):
    """Return what writes something else into a file of the session."""
    return lambda session: (session / place).write_bytes(content)


@pytest.mark.parametrize(
    ("harm", "message"),
    [
        (damage_middle, r"perturbed-0.jzlog: record \d+ of \d+ is damaged"),
        (lambda session: (session / "journal.jsonl").unlink(), r"-0.jzlog: .*\(2 in all\)"),
        (lambda session: write_alone(session, "plan.json", "{}"), r"plan.json: altered"),
        (stronger_pulse, r"plan.json: altered"),
        (lambda session: write_alone(session, "plan.json", "["), r"plan.json: damaged"),
        (lambda session: write_alone(session, "session.json", ""), r"session.json: damaged"),
        (other_wearer, r"session.json: .*140"),
        (overwritten("../../run.json", b"\xff\xfe\0"), r"run.json: damaged"),
        (overwritten("../../run.json", b"[1]"), r"run.json: damaged"),
        (overwritten("report.json", b'{"onsets": []}'), r"report.json: damaged"),
        (twice_completed, r"pulse \d+ of perturbed was completed twice"),
    ],
)
def test_a_file_that_was_altered_is_told_before_anybody_walks(
    protocol, out, session, harm, message
):
    class Operator:
        def prompt(self, text):
            pytest.fail(f"prompted: {text}")

    harm(session)
    with pytest.raises(DataError, match=message):
        run(protocol, out, resume=True, operator=Operator())
    assert not (out / "study.toml").exists()


def test_a_study_file_of_another_is_not_taken_for_ones_own(protocol, out):
    (out / "study.toml").write_text("title = 'mine'")
    with pytest.raises(OutputError, match=r"study.toml: not of this run.*Move it away"):
        run(protocol, out, resume=True)


def test_a_refused_protocol_makes_no_folder(protocol, tmp_path):
    pulse = protocol.pulse.model_copy(update={"amplitude_nm": 1e300})
    with pytest.raises(ProtocolError, match=r"pulse.amplitude_nm: 1e\+300 N\*m is above"):
        run(protocol.model_copy(update={"pulse": pulse}), tmp_path / "study")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("count", [0, 1001])
def test_too_few_and_too_many_participants_are_refused(protocol, tmp_path, count):
    with pytest.raises(DataError, match="expected 1 to 1000 participants"):
        run(protocol, tmp_path / "study", participants=count)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_the_number_of_workers_does_not_change_the_error(protocol, tmp_path, monkeypatch, workers):
    out = tmp_path / "study"
    pair = protocol.model_copy(update={"participants": 2})
    with monkeypatch.context() as patch:
        patch.setattr(Recorder, "write", Mock(side_effect=KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            run(pair, out)
    (out / "sessions" / "S02").write_text("in the way")
    with pytest.raises(WriteError, match=r"S02.*: cannot be written \((File exists|Not a dir)"):
        run(pair, out, resume=True, workers=workers)
