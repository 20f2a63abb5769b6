"""Walking with a continuous random torque: from the protocol to curves of K, B and J."""

import json

import numpy as np
import pytest

from jointz.core.errors import ProtocolError
from jointz.core.limits import LimitsOverride
from jointz.core.session_log import Flag
from jointz.io.log_reader import read_log
from jointz.io.protocols import load_protocol
from jointz.rig.experiment import trial
from jointz.rig.experiment.controller_runner import FADE_IN_S
from jointz.rig.session.run import run

PERIOD_S = 0.002
#: By then gait has long been steady and the torque has faded in.
FAULT_S = 8.0


def short(strides=14, **changes):
    """Return the perturbed condition of the built-in protocol, with few strides."""
    whole = load_protocol("walking_random")
    condition = whole.conditions[1].model_copy(update={"strides": strides})
    return whole.model_copy(update={"conditions": (condition,), "participants": 1, **changes})


@pytest.fixture
def walk(spied_session, tmp_path):
    return spied_session(short(), tmp_path)


def ticks_of(walk, segment=0):
    """Return the first record of every tick and the time of its slot, s."""
    records = read_log(walk.folder / "logs" / f"perturbed-{segment}.jzlog").records
    ticks = records[records["part"] == 0]
    return ticks, ticks["slot"] * PERIOD_S


def at_time(monkeypatch, time_s, act):
    """Do something with the trial once, before the tick of a time."""
    whole, done = trial.Trial.tick, []

    def tick(self, slot, host_ns, skipped):
        if not done and slot * PERIOD_S >= time_s - 1e-9:
            done.append(slot)
            act(self)
        return whole(self, slot, host_ns, skipped)

    monkeypatch.setattr(trial.Trial, "tick", tick)


def assert_stopped(walk):
    assert walk.commands[-1][1] == "stop"
    assert ticks_of(walk)[0]["sent_torque"][-1] == 0.0


def test_torque_is_zero_before_steady_gait_random_in_it_and_fades_at_the_end(walk):
    walk.run()
    ticks, _ = ticks_of(walk)
    command = ticks["command"]
    first = np.flatnonzero(ticks["flags"] & Flag.STEADY)[0]
    assert not command[:first].any()
    assert not ticks["pulse"].any()
    fade = round(walk.devices.actuator.describe().limits.fade_s / PERIOD_S)
    on = command[first + round(FADE_IN_S / PERIOD_S) : -fade - 1]
    assert np.abs(on).max() <= 4.5
    assert on.std() == pytest.approx(1.5, rel=0.3)
    assert (np.diff(np.abs(command[-fade - 1 :])) <= 0.0).all()
    assert ticks["stride"][-1] == 14
    assert_stopped(walk)
    (event,) = (e for e in walk.events() if e["event"] == "controller")
    assert event["description"]["torque_nm"]["cutoff_hz"] == 4.0


def test_a_pause_fades_the_torque_and_going_on_fades_it_in_again(walk, monkeypatch):
    at_time(monkeypatch, FAULT_S, lambda t: t.pause(on=True))
    at_time(monkeypatch, FAULT_S + 2.0, lambda t: t.pause(on=False))
    walk.run()
    ticks, time_s = ticks_of(walk)
    size = np.abs(ticks["command"])
    fade_s = walk.devices.actuator.describe().limits.fade_s
    fading = (time_s > FAULT_S - 2 * PERIOD_S) & (time_s < FAULT_S + fade_s)
    assert (np.diff(size[fading]) <= 0.0).all()
    resumed_s = FAULT_S + 2.0
    assert not size[(time_s >= FAULT_S + fade_s) & (time_s < resumed_s - PERIOD_S / 2)].any()
    share = (time_s - resumed_s + PERIOD_S) / FADE_IN_S
    rising = (time_s >= resumed_s - PERIOD_S / 2) & (share <= 1.0)
    assert size[rising].any()
    assert (size[rising] <= 4.5 * share[rising] + 1e-6).all()


def test_a_stop_fades_and_the_next_stretch_has_another_torque(walk, monkeypatch):
    running = walk.session()
    with monkeypatch.context() as patched:
        at_time(patched, FAULT_S, lambda _: running.request_stop())
        with pytest.raises(KeyboardInterrupt):
            running.run()
    first, time_s = ticks_of(walk)
    fade_s = walk.devices.actuator.describe().limits.fade_s
    assert time_s[-1] == pytest.approx(FAULT_S + fade_s, abs=2 * PERIOD_S)
    assert (np.diff(np.abs(first["command"][time_s >= FAULT_S - PERIOD_S])) <= 0.0).all()
    assert_stopped(walk)
    walk.run()
    again, _ = ticks_of(walk, segment=1)
    begins = [np.flatnonzero(ticks["command"])[0] for ticks in (first, again)]
    n = round(2.0 / PERIOD_S)
    one, other = first["command"][begins[0] :][:n], again["command"][begins[1] :][:n]
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.9


def test_the_torque_is_that_of_the_seed(tmp_path):
    commands = []
    for name, seed in (("one", 1), ("same", 1), ("other", 2)):
        run(short(strides=5), out=tmp_path / name, seed=seed, progress=False)
        log = tmp_path / name / "sessions" / "S01" / "logs" / "perturbed-0.jzlog"
        commands.append(read_log(log).records["command"])
    one, same, other = commands
    assert one.any()
    np.testing.assert_array_equal(one, same)
    n = min(one.size, other.size)
    assert not np.array_equal(one[:n], other[:n])


def test_a_torque_beyond_the_device_is_refused_before_anything_is_written(tmp_path):
    (condition,) = short().conditions
    strong = condition.torque_nm.model_copy(update={"sd": 20.0})
    strong_condition = condition.model_copy(update={"torque_nm": strong})
    protocol = short(conditions=(strong_condition,), safety=LimitsOverride())
    with pytest.raises(ProtocolError, match=r"torque_nm: reaches 60 N\*m"):
        run(protocol, out=tmp_path / "study", progress=False)
    assert not (tmp_path / "study").exists()


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The built-in protocol with 120 strides of a torque twice as large."""
    (condition,) = short(120).conditions
    larger = condition.torque_nm.model_copy(update={"sd": 3.0})
    protocol = short(
        conditions=(condition.model_copy(update={"torque_nm": larger}),), safety=LimitsOverride()
    )
    out = tmp_path_factory.mktemp("random") / "study"
    run(protocol, out=out, progress=False)
    return out


def test_one_command_gives_curves_beside_the_truth(study, jointz):
    columns = (
        "--angle angle --torque applied_torque --command command --contact contact --time time"
    )
    outcome = jointz(
        *("identify", "time-varying", study / "S01_perturbed.nc", *columns.split()),
        *("--n-phases", 10, "--resamples", 200, "--json"),
    )
    assert outcome.code == 0
    (stiffness,) = (p for p in outcome.json["parameters"] if p["name"] == "stiffness")
    truth = json.loads((study / "ground_truth.json").read_text())
    curves = truth["participants"]["S01"]["perturbed"]["curves"]
    known = np.add(curves["stiffness"], curves["gravity_stiffness"])
    at_phases = np.interp(np.arange(5.0, 100.0, 10.0), curves["gait_pct"], known)
    found = np.array(stiffness["value"], dtype=float)
    assert np.isfinite(found).sum() >= 8
    assert np.nanmean(np.abs(found - at_phases)) < 0.25 * at_phases.mean()


def test_analyze_refuses_and_names_the_command_that_does_it(study, jointz, tmp_path):
    outcome = jointz("analyze", study, "--out", tmp_path / "results")
    assert outcome.code == 2
    assert "S01_perturbed.nc: the command is on for" in outcome.err
    assert "jointz identify time-varying" in outcome.err
