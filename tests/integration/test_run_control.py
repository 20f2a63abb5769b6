"""A controller commands torque while a person walks: every fault, every fade, read from the log."""

import sys
from importlib.metadata import EntryPoint
from math import nan
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from jointz.core.errors import DataError, DeviceError, ProtocolError, SafetyStop
from jointz.core.limits import LimitsOverride
from jointz.core.protocols.protocol_models import ControllerSpec
from jointz.core.session_log import Flag
from jointz.io.log_reader import read_log
from jointz.io.protocols import load_protocol
from jointz.io.recordings import read_recording
from jointz.io.study_reader import open_study
from jointz.rig.experiment import trial
from jointz.rig.experiment.controller_runner import FADE_IN_S
from jointz.rig.experiment.controllers import GROUP, ControlParameter
from jointz.rig.session.run import run
from jointz.rig.sim.simulated_devices import SimulatedSensor

PERIOD_S = 0.002
#: By then gait has long been steady and the torque has faded in.
FAULT_S = 8.0
TORQUE_NM = 3.0
STRIDES = 14


class Push:
    """A constant torque times its share; a test may have it answer something else from a time."""

    parameters: ClassVar = {"share": ControlParameter(1.0, 0.0, 2.0, 0.5, "1")}
    answer = None

    def torque(self, state, values):
        if Push.answer is not None and state.time_s >= FAULT_S - 1e-9:
            return Push.answer(values)
        return TORQUE_NM * values["share"]

    def describe(self):
        return {"torque_nm": TORQUE_NM}


def make_push(spec, *, protocol, wearer):
    return Push()


@pytest.fixture(autouse=True)
def installed(monkeypatch):
    """Install a package that registers the controller ``push``."""
    points = [EntryPoint("push", f"{__name__}:make_push", GROUP)]
    monkeypatch.setitem(sys.modules, __name__, SimpleNamespace(**globals()))
    monkeypatch.setattr("jointz.core.entry_points.entry_points", lambda **_group: points)
    monkeypatch.setattr(Push, "answer", None)


@pytest.fixture
def pushing():
    """One condition of the built-in protocol with the controller ``push``."""
    whole = load_protocol("knee_controller")
    changes = {"name": "push", "strides": STRIDES, "controller": ControllerSpec(name="push")}
    condition = whole.conditions[0].model_copy(update=changes)
    return whole.model_copy(update={"conditions": (condition,), "participants": 1})


@pytest.fixture
def walk(spied_session, pushing, tmp_path):
    return spied_session(pushing, tmp_path)


def limited(walk, **limits):
    return walk.protocol.model_copy(update={"safety": LimitsOverride(**limits)})


def ticks_of(walk, segment=0):
    """Return the first record of every tick and the time of its slot, s."""
    records = read_log(walk.folder / "logs" / f"push-{segment}.jzlog").records
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


def stop_at_fault(walk, monkeypatch):
    """Run a session and ask it to stop at :data:`FAULT_S`."""
    running = walk.session()
    write = trial.Recorder.write

    def stop(self, *records):
        write(self, *records)
        if walk.clock.now_ns() >= FAULT_S * 1e9:
            running.request_stop()

    with monkeypatch.context() as patched:
        patched.setattr(trial.Recorder, "write", stop)
        with pytest.raises(KeyboardInterrupt):
            running.run()


def assert_zero_after(walk, fault_s, *, within_s):
    """Torque was on until the fault, is zero a while after it, in the log and at the device."""
    ticks, time_s = ticks_of(walk)
    before = (time_s > fault_s - 0.2) & (time_s < fault_s - PERIOD_S / 2)
    assert (ticks["sent_torque"][before] > 1.0).all()
    after = time_s >= fault_s + within_s - PERIOD_S / 2
    assert not ticks["sent_torque"][after].any()
    assert ticks["sent_torque"][-1] == 0.0
    last = [torque for t, torque in walk.commands if t >= fault_s + within_s - 1e-9]
    assert set(last) <= {0.0, "stop"}
    assert walk.commands[-1][1] == "stop"


@pytest.mark.parametrize(
    ("device", "kind", "value", "code", "within_s"),
    [
        ("actuator", "fault", 2, "device_fault", PERIOD_S),
        ("angle", "nan", 0.0, "sensor_not_finite", PERIOD_S),
        ("contact", "silence", 0.0, "sensor_stale", 0.05 + 2 * PERIOD_S),
        ("angle", "freeze", 0.0, "sensor_frozen", 0.8),
    ],
)
def test_a_device_that_misbehaves_ends_the_torque(walk, device, kind, value, code, within_s):
    walk.rig.inject.order(device, kind, from_s=FAULT_S, value=value)
    with pytest.raises(SafetyStop, match=code):
        walk.run()
    assert_zero_after(walk, FAULT_S, within_s=within_s)
    assert ticks_of(walk)[0]["flags"][-1] & Flag.TRIPPED
    assert walk.event_names()[-1] == "tripped"


def test_torque_that_is_no_number_trips_in_its_tick(walk, monkeypatch):
    monkeypatch.setattr(Push, "answer", lambda _: nan)
    with pytest.raises(SafetyStop, match="request_not_finite"):
        walk.run()
    assert_zero_after(walk, FAULT_S, within_s=0.0)


def test_an_exception_of_a_controller_trips_in_its_tick_and_stands_in_the_journal(
    walk, monkeypatch
):
    monkeypatch.setattr(Push, "answer", lambda _: {}["no such key"])
    with pytest.raises(
        SafetyStop, match=r"request_not_finite.*push raised KeyError: 'no such key'"
    ):
        walk.run()
    assert_zero_after(walk, FAULT_S, within_s=0.0)
    (failed,) = [e for e in walk.events() if e["event"] == "controller_failed"]
    assert failed["reason"] == "KeyError: 'no such key'"
    assert failed["slot"] * PERIOD_S == pytest.approx(FAULT_S)


def test_a_lost_heel_strike_fades_the_torque_and_steady_gait_brings_it_back(walk):
    walk.rig.inject.order("contact", "freeze", from_s=FAULT_S, until_s=FAULT_S + 2.0)
    walk.run(protocol=with_strides(walk, 20))
    ticks, time_s = ticks_of(walk)
    steady = (ticks["flags"] & Flag.STEADY) != 0
    lost, *_ = np.flatnonzero(steady[:-1] & ~steady[1:] & (time_s[1:] > FAULT_S)) + 1
    fade_s = walk.devices.actuator.describe().limits.fade_s
    fade = slice(lost, lost + round(fade_s / PERIOD_S))
    command = ticks["command"]
    assert command[lost - 1] == pytest.approx(TORQUE_NM)
    assert (np.diff(command[lost - 1 : fade.stop]) < 0.0).all()
    assert (ticks["flags"][fade][:-1] & Flag.FADING).all()
    back = lost + np.flatnonzero(steady[lost:])[0]
    assert not command[fade.stop - 1 : back].any()
    assert not (ticks["flags"][fade.stop : back] & Flag.FADING).any()
    rise = command[back : back + round(FADE_IN_S / PERIOD_S)]
    np.testing.assert_allclose(np.diff(rise), TORQUE_NM * PERIOD_S / FADE_IN_S, rtol=1e-3)
    assert rise[-1] == pytest.approx(TORQUE_NM)


def with_strides(walk, strides):
    (condition,) = walk.protocol.conditions
    changed = condition.model_copy(update={"strides": strides})
    return walk.protocol.model_copy(update={"conditions": (changed,)})


def test_torque_is_zero_before_gait_is_steady_and_fades_before_the_end(walk):
    walk.run()
    ticks, _ = ticks_of(walk)
    first = np.flatnonzero(ticks["flags"] & Flag.STEADY)[0]
    assert not ticks["command"][:first].any()
    assert not ticks["pulse"].any()
    fade_ticks = round(walk.devices.actuator.describe().limits.fade_s / PERIOD_S)
    end = ticks["command"][-fade_ticks - 1 :]
    assert end[0] == pytest.approx(TORQUE_NM)
    assert (np.diff(end) < 0.0).all()
    assert end[-1] == 0.0
    assert ticks["stride"][-1] == STRIDES
    assert walk.event_names() == [
        "segment_started",
        "controller",
        "devices_stopped",
        "condition_completed",
    ]


def test_a_stop_fades_the_torque_and_a_session_that_goes_on_begins_with_declared_values(
    walk, monkeypatch
):
    at_time(monkeypatch, 6.0, lambda t: t.set_parameter("share", 1.5))
    stop_at_fault(walk, monkeypatch)
    ticks, time_s = ticks_of(walk)
    fade_s = walk.devices.actuator.describe().limits.fade_s
    assert time_s[-1] == pytest.approx(FAULT_S + fade_s, abs=2 * PERIOD_S)
    command = ticks["command"][time_s >= FAULT_S - PERIOD_S / 2]
    assert command[0] == pytest.approx(1.5 * TORQUE_NM, rel=0.1)
    assert (np.diff(command) < 0.0).all()
    assert command[-1] == ticks["sent_torque"][-1] == 0.0
    assert walk.commands[-1][1] == "stop"

    walk.run()
    again, _ = ticks_of(walk, segment=1)
    assert again["command"].max() == pytest.approx(TORQUE_NM)
    begun = [e for e in walk.events() if e["event"] == "controller"]
    assert [(e["segment"], e["values"]) for e in begun] == [(0, "as declared"), (1, "as declared")]
    assert walk.event_names()[-1] == "condition_completed"


def test_a_stretch_does_not_go_on_with_another_controller(walk, monkeypatch):
    stop_at_fault(walk, monkeypatch)
    monkeypatch.setattr(Push, "describe", lambda _: {"profile": "another"})
    with pytest.raises(DataError, match="another controller than in the stretch before"):
        walk.run()


def test_a_trial_without_a_controller_has_no_parameters(
    spied_session, short_walking, tmp_path, monkeypatch
):
    walk = spied_session(short_walking(conditions=["unperturbed"]), tmp_path)
    answers = []
    at_time(monkeypatch, 1.0, lambda t: answers.append(t.set_parameter("share", 1.0)))
    at_time(monkeypatch, 2.0, lambda t: answers.append(t.undo_parameter()))
    walk.run()
    assert answers == [trial.NO_CONTROLLER] * 2


def test_a_moment_sensor_that_falls_silent_stops_nothing(walk):
    walk.rig.inject.order("torque", "silence", from_s=FAULT_S)
    walk.run()
    records = read_log(walk.folder / "logs" / "push-0.jzlog").records
    sampled = records["moment_time_ns"] >= 0
    assert sampled[records["slot"] * PERIOD_S < FAULT_S - 0.1].any()
    assert not sampled[records["slot"] * PERIOD_S > FAULT_S + 0.1].any()
    assert (records["sent_torque"][records["slot"] * PERIOD_S > FAULT_S + 0.5] != 0.0).any()
    assert walk.event_names()[-1] == "condition_completed"


def test_a_moment_sensor_whose_driver_raises_stops_all(walk, monkeypatch):
    read = SimulatedSensor.read

    def failing(self):
        if self.describe().channel == "joint_moment" and walk.clock.now_ns() >= FAULT_S * 1e9:
            raise OSError("gone")
        return read(self)

    monkeypatch.setattr(SimulatedSensor, "read", failing)
    with pytest.raises(DeviceError, match=r"^torque: its driver raised OSError"):
        walk.run()
    walk.assert_stopped(FAULT_S)


def test_the_study_has_the_command_and_the_joints_moment_of_every_condition(pushing, tmp_path):
    run(pushing, out=tmp_path / "study", progress=False)
    study = open_study(tmp_path / "study")
    (recording,) = read_recording(study, study.spec.recordings[0])
    assert study.spec.recordings[0].condition == "unperturbed"
    command = recording["command"].to_numpy()
    assert command.max() == pytest.approx(TORQUE_NM)
    moment = recording["joint_moment"].to_numpy()
    assert np.isfinite(moment).mean() > 0.99
    assert np.ptp(moment) > 20.0


def test_all_controllers_that_do_not_fit_are_refused_before_anything_is_written(pushing, tmp_path):
    (condition,) = pushing.conditions
    conditions = [
        condition.model_copy(update={"name": name, "controller": ControllerSpec(name=name)})
        for name in ("push", "pull", "torque_replay")
    ]
    protocol = pushing.model_copy(update={"conditions": tuple(conditions)})
    with pytest.raises(ProtocolError) as raised:
        run(protocol, out=tmp_path / "study", progress=False)
    first, second = raised.value.problems
    assert first.startswith("conditions[2].controller: name: expected one of four_state, ")
    assert second.startswith("conditions[3].controller: profile")
    assert not (tmp_path / "study").exists()
