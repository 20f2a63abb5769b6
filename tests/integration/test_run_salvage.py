"""Nothing intact is lost to damaged files: flipped bits and cut ends in log, journal and plan."""

import shutil

import numpy as np
import pytest

import jointz
from jointz.core.errors import DataError
from jointz.core.recording import damage_of
from jointz.io.formats.netcdf_recording import read_recording
from jointz.io.log_reader import read_log
from jointz.rig.experiment.files.journal import (
    decode_event,
    is_completed,
    pulses_done,
    read_journal,
)
from jointz.rig.experiment.files.session_files import keep_plan
from jointz.rig.experiment.plan import written_pulse
from jointz.rig.experiment.trial_kinds import WALKING_TRIALS
from jointz.rig.session.recordings_report import open_recordings
from jointz.rig.session.salvage import salvage_advice, salvage_recordings
from jointz.rig.session.session_check import missing_events, write_down_losses

TRIES = pytest.mark.parametrize("tries", [4, pytest.param(100, marks=pytest.mark.slow)])
CONDITION = "perturbed"


@pytest.fixture(scope="module")
def protocol(short_walking):
    """A few strides, then one pulse a point, at three points."""
    points = {"LRE": 7.0, "TST": 40.5, "ISW": 68.5}
    conditions = ["unperturbed", CONDITION]
    return short_walking(conditions=conditions, count_per_point=1, timing_points=points)


def run(protocol, out, **options):
    # Without gyroscopes: by their own clock, which is fitted to all that is left, they are
    # resampled anew.
    return jointz.run(protocol, out=out, seed=5, preset="nominal", **options)


@pytest.fixture(scope="module")
def complete(protocol, tmp_path_factory):
    out = tmp_path_factory.mktemp("complete") / "study"
    run(protocol, out)
    return out


@pytest.fixture
def out(complete, tmp_path):
    """A run that was killed when all was recorded and nothing converted."""
    return unconverted(complete, tmp_path / "study")


def unconverted(complete, out):
    """Copy a run, without what was made of its logs."""
    shutil.copytree(complete, out)
    made = [*out.glob("*.nc"), *out.glob("*.csv"), *out.glob("sessions/*/report.json")]
    for file in [*made, out / "study.toml", out / "run_report.json"]:
        file.unlink()
    return out


@pytest.fixture
def session(out):
    return out / "sessions" / "S01"


def flipped(content, rng):
    spoilt = bytearray(content)
    spoilt[int(rng.integers(len(content)))] ^= 1 << int(rng.integers(8))
    return bytes(spoilt)


def cut_off(content, rng):
    return content[: int(rng.integers(len(content)))]


def flip_record(log, slot):
    """Flip a bit in the record of a tick."""
    read = read_log(log)
    at = int(np.flatnonzero(read.records["slot"] == slot)[0]) - read.records.size
    content = bytearray(log.read_bytes())
    content[at * read.records.itemsize] ^= 4
    log.write_bytes(content)


def events_of(session):
    return read_journal(session / "journal.jsonl")


def recorded(session, protocol):
    recordings = open_recordings(session, protocol, events_of(session), salvage=True)
    return recordings.record(protocol.conditions[-1])


def assert_equal_outside(found, whole):
    """Every sample that is there is the undamaged one; what is not there lies in the damage."""
    time, truth = found.recording["time"].to_numpy(), whole.recording["time"].to_numpy()
    place = np.searchsorted(truth, time - 1e-9).clip(max=truth.size - 1)
    np.testing.assert_allclose(time, truth[place], rtol=0, atol=1e-9)
    for name in whole.recording:
        np.testing.assert_allclose(
            found.recording[name].to_numpy(), whole.recording[name].to_numpy()[place], rtol=1e-12
        )
    gone = np.setdiff1d(np.arange(truth.size), place)
    damage_s = damage_of(found.recording)
    lost_end = truth[gone] > time[-1]
    inside = [any(a < t < b + 1e-9 for a, b in damage_s) for t in truth[gone][~lost_end]]
    assert all(inside)
    assert len(found.logs[0].damage) == len(damage_s)
    return damage_s, time[-1]


@TRIES
@pytest.mark.parametrize("harm", [flipped, cut_off])
def test_a_damaged_log_costs_what_is_damaged(protocol, session, harm, tries):
    log, journal = session / "logs" / f"{CONDITION}-0.jzlog", session / "journal.jsonl"
    content, lines, whole = log.read_bytes(), journal.read_bytes(), recorded(session, protocol)
    rng, n_lost = np.random.default_rng(3), 0
    for _ in range(tries):
        spoilt = harm(content, rng)
        log.write_bytes(spoilt)
        journal.write_bytes(lines)
        write_down_losses(session, protocol, salvage=True)
        assert log.read_bytes() == spoilt
        assert journal.read_bytes().startswith(lines)
        done = pulses_done(events_of(session), CONDITION)
        if len(spoilt) < 20_000:  # little more than a header
            assert not done
            continue
        found = recorded(session, protocol)
        damage_s, end_s = assert_equal_outside(found, whole)
        columns = ["onset_s", "duration_s", "amplitude_nm", "timing_point"]
        table, shown = whole.pulses.set_index("pulse"), found.pulses.set_index("pulse")
        for number, pulse in table.iterrows():
            pulse_end_s = pulse["onset_s"] + pulse["duration_s"]
            touched = any(a <= pulse_end_s and b >= pulse["onset_s"] for a, b in damage_s)
            assert (number in done) == (not touched and pulse_end_s <= end_s)
            n_lost += touched
            if number in done or touched:
                assert shown.loc[number, "damaged"] == touched
                assert shown.loc[number, columns].tolist() == pytest.approx(pulse[columns].tolist())
    assert n_lost > 0 or harm is cut_off or tries < 100  # a few flips may hit no pulse


def places_of(events, condition):
    done = pulses_done(events, condition)
    return {n: (e["segment"], e["onset_slot"], e["slot"]) for n, e in done.items()}


@TRIES
@pytest.mark.parametrize("harm", [flipped, cut_off])
def test_a_damaged_journal_costs_no_pulse(protocol, session, harm, tries):
    journal, logs = session / "journal.jsonl", sorted(session.glob("logs/*"))
    content, before = journal.read_bytes(), events_of(session)
    contents, rng = [log.read_bytes() for log in logs], np.random.default_rng(4)
    assert missing_events(session, protocol, before) == []
    for _ in range(tries):
        for kept in session.glob("journal.jsonl.damaged*"):
            kept.unlink()
        spoilt = harm(content, rng)
        journal.write_bytes(spoilt)
        write_down_losses(session, protocol, salvage=True)
        after = events_of(session)
        intact = [e for e in map(decode_event, spoilt.split(b"\n")) if e is not None]
        assert [e for e in after if e in intact] == intact
        for condition in ("unperturbed", CONDITION):
            assert places_of(after, condition) == places_of(before, condition)
            assert is_completed(after, condition)
        assert [log.read_bytes() for log in logs] == contents
        whole_lines = spoilt.endswith(b"\n") and content.startswith(spoilt)
        kept = list(session.glob("journal.jsonl.damaged*"))
        assert [file.read_bytes() for file in kept] == (
            [] if whole_lines or not spoilt else [spoilt]
        )
        told = [e["text"] for e in after if e["event"] == "salvaged"]
        assert ("damaged and left out" in "".join(told)) == bool(kept)


@pytest.mark.parametrize("name", ["plan.json", "plan.json.copy"])
@TRIES
@pytest.mark.parametrize("harm", [flipped, cut_off])
def test_a_damaged_plan_is_read_from_its_other_copy(session, name, harm, tries):
    file, whole = session / name, WALKING_TRIALS.read_plan(session)
    content, rng = file.read_bytes(), np.random.default_rng(5)
    plan = {trial: [written_pulse(pulse) for pulse in pulses] for trial, pulses in whole.items()}
    assert keep_plan(session, plan) == ""
    for _ in range(tries):
        spoilt = harm(content, rng)
        file.write_bytes(spoilt)
        assert WALKING_TRIALS.read_plan(session) == whole
        assert keep_plan(session, plan).startswith(f"{name}: damaged")
        assert file.read_bytes() == spoilt


def test_a_session_with_a_flipped_bit_ends_and_says_what_it_cost(protocol, out, session):
    (pulse,) = [
        e for e in events_of(session) if e["event"] == "pulse_completed" and e["pulse"] == 2
    ]
    log = session / "logs" / f"{CONDITION}-0.jzlog"
    flip_record(log, pulse["onset_slot"])
    plan = bytearray((session / "plan.json").read_bytes())
    plan[100] ^= 1
    (session / "plan.json").write_bytes(plan)
    with pytest.raises(DataError, match=r"record \d+ of \d+ is damaged.*--salvage"):
        run(protocol, out, resume=True)
    made = run(protocol, out, resume=True, salvage=True)
    assert not (session / "logs" / f"{CONDITION}-1.jzlog").exists()
    told = "\n".join(made.report.salvaged)
    at_s = pulse["onset_slot"] / protocol.rates.control_hz
    assert f"from {at_s - 0.002:.3f} to {at_s + 0.002:.3f} s" in told
    assert "pulses 2 are lost" in told
    assert "S01: plan.json: damaged" in told
    assert told in made.report.summary()
    assert not (out / "exclusions.csv").exists()

    analysis = jointz.analyze(out, resamples=2)
    (lost,) = [p for p in analysis.pulses if p.code == "damaged_log"]
    (numbered,) = [p for p in WALKING_TRIALS.read_plan(session)[CONDITION] if p.number == 2]
    assert lost.timing_point == numbered.timing_point
    assert "damaged from" in lost.detail
    assert len(analysis.pulses) == 3
    (note,) = [n for n in analysis.statistics["notes"] if "log is damaged" in n]
    assert note.endswith("these records and 1 pulse are excluded.")


def test_a_damaged_pulse_of_a_trial_that_goes_on_is_done_again(protocol, out, session):
    """The end of the log is lost after a flipped bit inside a pulse."""
    log, journal = session / "logs" / f"{CONDITION}-0.jzlog", session / "journal.jsonl"
    done = [e for e in events_of(session) if e["event"] == "pulse_completed"]
    first, second = sorted(done, key=lambda e: e["slot"])[:2]
    records = read_log(log).records
    kept = int(np.flatnonzero(records["slot"] == second["slot"])[-1]) + 1
    content = log.read_bytes()
    log.write_bytes(content[: len(content) - (records.size - kept) * records.itemsize])
    flip_record(log, (first["onset_slot"] + first["slot"]) // 2)
    lines = journal.read_bytes().splitlines(keepends=True)
    ends = [i for i, line in enumerate(lines) if b"pulse_completed" in line]
    journal.write_bytes(b"".join(lines[: ends[1] + 1]))

    made = run(protocol, out, resume=True, salvage=True)

    events = events_of(session)
    planned = [p.number for p in WALKING_TRIALS.read_plan(session)[CONDITION]]
    assert sorted(pulses_done(events, CONDITION)) == planned
    begun = [e["pulse"] for e in events if e["event"] == "pulse_started"]
    assert begun.count(first["pulse"]) == 2
    assert begun.count(second["pulse"]) == 1
    table = made.report.to_frame()
    assert set(table["completed"]) == set(table["planned"])


def test_a_damaged_recording_is_made_again_from_the_logs(complete, tmp_path):
    out = shutil.copytree(complete, tmp_path / "study")
    file = out / "S01_perturbed.nc"
    whole, table = read_recording(file), (out / "S01_perturbed_pulses.csv").read_bytes()
    assert salvage_recordings(out) == []
    assert salvage_advice(out, file.name) == ""
    spoilt = bytearray(file.read_bytes())
    spoilt[len(spoilt) // 2] ^= 1
    file.write_bytes(spoilt)
    assert salvage_advice(out, "study.toml: a problem") == ""  # it reads what an error names
    assert "--salvage" in salvage_advice(out, f"{file.name}: damaged")
    (told,) = salvage_recordings(out)
    assert "S01_perturbed.nc" in told
    assert read_recording(file).identical(whole)
    assert (out / "S01_perturbed_pulses.csv").read_bytes() == table
    assert (out / "S01_perturbed.nc.damaged").read_bytes() == bytes(spoilt)


def test_a_lost_end_of_a_log_is_told_with_its_seconds(protocol, out, session, complete, tmp_path):
    log = session / "logs" / f"{CONDITION}-0.jzlog"
    read = read_log(log)
    hz, size = protocol.rates.control_hz, read.records.itemsize
    content, n_lost = log.read_bytes(), 2000
    spoilt = content[: -n_lost * size] + b"\xff" * (n_lost * size)
    begin_s = read.records["slot"][-n_lost - 1] / hz
    log.write_bytes(spoilt)
    write_down_losses(session, protocol, salvage=True)
    (told,) = [e["text"] for e in events_of(session) if e["event"] == "salvaged"]
    assert f"{n_lost} damaged records left out, from {begin_s:.3f} to" in told
    assert float(told.split(" to ")[1].split()[0]) == pytest.approx(
        read.records["slot"][-1] / hz, abs=0.1
    )

    study = shutil.copytree(complete, tmp_path / "complete")
    (study / "sessions" / "S01" / "logs" / log.name).write_bytes(spoilt)
    (study / "S01_perturbed.nc").write_bytes(b"damaged")
    assert len(salvage_recordings(study)) == 1
    made = read_recording(study / "S01_perturbed.nc")
    ((begin, end),) = damage_of(made)
    assert begin == made["time"].to_numpy()[-1]
    assert end - begin == pytest.approx(read.records["slot"][-1] / hz - begin_s, abs=0.1)


def test_a_recording_over_the_memory_limit_is_refused_not_salvaged(complete, tmp_path, monkeypatch):
    study = shutil.copytree(complete, tmp_path / "study")
    content = {file: file.read_bytes() for file in study.glob("*.nc")}
    monkeypatch.setenv("JOINTZ_MEMORY_LIMIT", "1kB")
    with pytest.raises(DataError, match=r"S01_\w+.nc: unpacks to more than"):
        jointz.analyze(study, salvage=True)
    assert {file: file.read_bytes() for file in study.glob("*.nc*")} == content


@pytest.fixture(scope="module")
def bench(short_bench):
    return short_bench()


@pytest.fixture(scope="module")
def complete_bench(bench, tmp_path_factory):
    out = tmp_path_factory.mktemp("bench") / "study"
    run(bench, out)
    return out


def test_a_trial_of_a_bench_with_a_flipped_bit_is_coded(bench, complete_bench, tmp_path):
    out = unconverted(complete_bench, tmp_path / "study")
    flip_record(out / "sessions" / "case-1" / "logs" / "A-perturbed-1-0.jzlog", 3000)
    made = run(bench, out, resume=True, salvage=True)
    assert "1 damaged records left out" in "\n".join(made.report.salvaged)
    analysis = jointz.analyze(out, resamples=2)
    codes = [p.code for p in sorted(analysis.pulses, key=lambda pulse: pulse.onset_s)]
    half = len(codes) // 2
    assert codes == ["damaged_log"] * half + [""] * half


def test_a_trial_of_a_bench_whose_log_is_gone_is_done_again(bench, complete_bench, tmp_path):
    out = unconverted(complete_bench, tmp_path / "study")
    logs = out / "sessions" / "case-1" / "logs"
    (logs / "A-perturbed-1-0.jzlog").unlink()
    made = run(bench, out, resume=True)
    assert made.report.to_frame()["completed"].sum() == 16
    assert (logs / "A-perturbed-1-1.jzlog").exists()
    assert len(read_recording(out / "case-1_A-perturbed.nc")["time"]) == 2 * 12 * 900
