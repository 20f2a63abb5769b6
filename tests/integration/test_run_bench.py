"""Benches on the real runtime: what is recorded, how a trial ends badly, what an analysis finds."""

import json
import os
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

import jointz
from jointz.analysis.results_folder import write_results
from jointz.core.errors import DeviceError, SafetyStop
from jointz.core.session_log import Flag
from jointz.io.protocols import load_protocol
from jointz.io.recordings import read_recording
from jointz.io.study_reader import open_study
from jointz.rig.experiment.files.journal import read_journal
from jointz.rig.experiment.trial_kinds import BENCH_TRIALS

PERIOD_S = 1.0 / 900.0


@pytest.fixture(scope="module")
def study(short_bench, tmp_path_factory):
    """Two trials without and two with pulses on case 1, without errors."""
    out = tmp_path_factory.mktemp("bench") / "study"
    made = jointz.run(short_bench(), out=out, preset="clean")
    assert made.report.to_frame()["completed"].sum() == 16
    return made.study


def test_a_bench_study_is_opened_with_nothing_special(study):
    opened = open_study(study)
    assert opened.spec.kind == "bench"
    assert [r.session for r in opened.spec.recordings] == ["A", "A"]
    for entry in opened.spec.recordings:
        trials = read_recording(opened, entry)
        assert [t.attrs["trial"] for t in trials] == ["1", "2"]
        for trial in trials:
            assert trial.sizes["time"] == 12 * 900
            reference = trial["reference"].to_numpy()
            seconds = np.arange(12 * 900) * PERIOD_S
            expected = 32.0 + 5.0 * np.sin(2 * np.pi * 1.4 * seconds)
            np.testing.assert_allclose(reference, expected, atol=1e-4)


def test_the_pulses_recorded_are_those_that_were_planned(study):
    opened = open_study(study)
    trials = read_recording(opened, opened.spec.recordings[1])
    plans = BENCH_TRIALS.read_plan(study / "sessions" / "case-1")
    for k, trial in enumerate(trials, start=1):
        command = trial["command"].to_numpy()
        time = trial["time"].to_numpy() - float(trial["time"][0])
        begins = np.flatnonzero((command != 0) & (np.roll(command, 1) == 0))
        plan = plans[f"A-perturbed-{k}"]
        assert time[begins] == pytest.approx([p.onset_s for p in plan], abs=2 * PERIOD_S)
        peaks = [command[b : b + 200][np.abs(command[b : b + 200]).argmax()] for b in begins]
        assert peaks == pytest.approx([p.amplitude_nm for p in plan])


def test_both_methods_find_a_clean_load(study, tmp_path):
    truth = json.loads((study / "ground_truth.json").read_text())["participants"]["case-1"]["load"]
    analysis = jointz.analyze(study, method="recommended", resamples=20)
    (cell,) = analysis.cells
    assert (cell.participant, cell.timing_point, cell.method) == ("case-1", "A", "full_record")
    assert (cell.n_used, cell.n_excluded) == (16, 0)
    for found in (cell, analysis.comparison[0]):
        for name in ("stiffness", "inertia"):
            assert found.parameter(name).value == pytest.approx(truth[name], rel=2e-3)
        damping = found.parameter("damping")  # the load has none
        assert damping.unbounded == pytest.approx(0.0, abs=0.01)
    assert cell.parameter("damping").status == "undecided"
    assert cell.parameter("damping").ci_low < 0.0 < cell.parameter("damping").ci_high
    lag = next(p for p in cell.nuisance if p.name == "torque_lag")
    assert lag.value == pytest.approx(0.0, abs=5e-5)
    write_results(analysis, tmp_path / "r", figures=False)
    single = pd.read_csv(tmp_path / "r" / "single_pulses.csv")
    assert len(single) == 16
    assert set(single["direction"]) == {"with", "against"}
    assert single["stiffness"].mean() == pytest.approx(truth["stiffness"] + 0.388, rel=5e-3)
    assert analysis.statistics["pulse_effects"]["tests"]


def test_the_same_seed_writes_the_same_logs(short_bench, tmp_path):
    protocol = short_bench(trials=1)
    made = [jointz.run(protocol, out=tmp_path / name, seed=4).study for name in ("a", "b")]
    one, other = ([f.read_bytes() for f in sorted(s.glob("**/*.jzlog"))] for s in made)
    assert len(one) == 2
    assert one == other


def test_a_motor_that_turns_all_the_way_is_recorded(tmp_path):
    whole = load_protocol("qdd-torque-speed")
    condition = whole.conditions[0]
    torque = condition.torque_nm.model_copy(update={"levels": (-5.0, 5.0), "hold_s": 4.0})
    speed = condition.velocity_rad_s.model_copy(update={"levels": (-4.0, 4.0), "hold_s": 2.0})
    few = condition.model_copy(update={"torque_nm": torque, "velocity_rad_s": speed})
    made = jointz.run(whole.model_copy(update={"conditions": (few,)}), out=tmp_path / "s")
    opened = open_study(made.study)
    (trial,) = read_recording(opened, opened.spec.recordings[0])
    velocity = trial["motor_velocity"].to_numpy()
    assert np.median(velocity[:900]) == pytest.approx(-4.0, abs=0.1)
    assert np.median(velocity[1100:1900]) == pytest.approx(4.0, abs=0.1)
    assert {"sensor_torque", "position", "current"} <= set(trial.data_vars)


# --- trials that end badly -----------------------------------------------------------------------


@pytest.fixture
def bench(spied_session, short_bench, tmp_path):
    return spied_session(short_bench(trials=1), tmp_path, seed=1)


@pytest.mark.parametrize(
    ("device", "kind", "value", "code"),
    [
        ("actuator", "fault", 2, "device_fault"),
        ("actuator", "heat", 200.0, "temperature"),
        ("actuator", "nan", 0.0, "sensor_not_finite"),
        ("torque", "silence", 0.0, "sensor_stale"),
        ("positioner", "silence", 0.0, "sensor_stale"),
    ],
)
def test_a_bench_trips_and_its_torque_is_off(bench, device, kind, value, code):
    bench.rig.inject.order(device, kind, from_s=6.0, value=value)
    with pytest.raises(SafetyStop, match=code):
        bench.run()
    bench.assert_stopped(6.0, within_ticks=25)
    ticks = bench.records("A-unperturbed")
    assert ticks["flags"][-1] & Flag.TRIPPED
    assert ticks["sent_torque"][-1] == 0.0


def test_a_bench_that_loses_a_device_stops(bench):
    bench.rig.inject.order("torque", "disconnect", from_s=6.0)
    with pytest.raises(DeviceError):
        bench.run()
    assert bench.commands[-1][1] == "stop"


def test_a_stop_fades_the_torque_of_a_bench_and_the_trial_is_done_again_whole(bench, spied_session):
    session = bench.session(
        progress=lambda _name, done, *_rest: session.request_stop() if done == 8 else None
    )
    with pytest.raises(KeyboardInterrupt):
        session.run()
    sent = np.array([c for t, c in bench.commands if t > 7.9 and c != "stop"])
    assert sent[0] > 20.0
    assert sent[-1] == 0.0 or bench.commands[-1][1] == "stop"
    # 90 N*m in the fade time of 0.2 s: no step.
    assert np.abs(np.diff(sent)).max() < 1.0
    assert bench.event_names()[-1] == "stopped"

    again = spied_session(bench.protocol, bench.folder, seed=1)
    again.run()
    done = [e["condition"] for e in again.events() if e["event"] == "condition_completed"]
    assert done == ["A-unperturbed", "A-perturbed"]
    logs = sorted(p.name for p in (bench.folder / "logs").iterdir())
    assert logs == ["A-perturbed-0.jzlog", "A-unperturbed-0.jzlog", "A-unperturbed-1.jzlog"]


@pytest.mark.slow
@pytest.mark.alone  # a compiler in the loop stops it every time
@pytest.mark.parametrize("name", ["qdd-perturbation", "sea-mass-spring"])
def test_nothing_is_compiled_in_a_loop_in_real_time(tmp_path, name):
    script = """
import sys
import jointz
from jointz.io.protocols import load_protocol
whole = load_protocol(sys.argv[1])
first = whole.conditions[0].model_copy(update={"duration_s": 2.8, "trials": 1})
short = whole.model_copy(update={"conditions": (first,), "loads": whole.loads[:1]})
jointz.run(short, out=sys.argv[2], clock="real", preset="clean")
"""
    run = subprocess.run(
        [sys.executable, "-c", script, name, str(tmp_path / "study")],
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "numba")},
        stderr=subprocess.PIPE,
        text=True,
        timeout=200,
    )
    assert run.returncode == 0, run.stderr
    [journal] = (tmp_path / "study").glob("sessions/*/journal.jsonl")
    started, *_, completed = read_journal(journal)
    took_s = (completed["time_ns"] - started["time_ns"]) * 1e-9
    assert completed["event"] == "condition_completed"
    assert 2.8 <= took_s < 10.0
