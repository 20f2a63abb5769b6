"""Every way a trial can end badly: the last command that the device got, and how soon."""

import errno
import os
import signal
from contextlib import contextmanager, suppress

import numpy as np
import pytest

from jointz.core.clock import VirtualClock
from jointz.core.errors import DeviceError, NotConnectedError, ProtocolError, SafetyStop
from jointz.core.limits import LimitsOverride, tightened
from jointz.core.session_log import Flag
from jointz.devices.interface import Lifecycle
from jointz.experiment import trial
from jointz.experiment.files.journal import read_journal
from jointz.experiment.session import Session, SessionPlan
from jointz.experiment.timing import timing_report
from jointz.io.log_reader import read_log
from jointz.io.protocols import load_protocol
from jointz.session.participant_run import _stopped_by_signals
from jointz.session.rigs.rig_settings import RigSettings, open_rig
from jointz.session.worker_pool import NoOperator
from jointz.sim.simulated_devices import SimulatedActuator, SimulatedSensor

PERIOD_S = 0.002
#: The first pulse of the plan fires after the warm-up; by then gait has long been steady.
BEFORE_PULSES_S = 6.0


class Spy:
    """Keeps every command to the actuator of a rig, with the tick's time."""

    def __init__(self, rig):
        self.commands = []
        self.clock = None
        self.devices = None
        opened = rig.open

        def spying(condition, *, worn, segment, clock):
            devices = opened(condition, worn=worn, segment=segment, clock=clock)
            self.clock, self.devices = clock, devices
            if devices.actuator is None:
                return devices
            command, stop = devices.actuator.command_torque, devices.actuator.stop

            def command_torque(torque_nm):
                self.commands.append((clock.now_ns() * 1e-9, torque_nm))
                command(torque_nm)

            def stopped():
                self.commands.append((clock.now_ns() * 1e-9, "stop"))
                stop()

            devices.actuator.command_torque = command_torque
            devices.actuator.stop = stopped
            return devices

        rig.open = spying


@pytest.fixture
def protocol():
    """Perturbed walking only, two pulses a point."""
    whole = load_protocol("walking")
    condition = whole.conditions[-1]
    few = condition.perturbations.model_copy(update={"count_per_point": 2, "warm_up_strides": 4})
    return whole.model_copy(
        update={"conditions": (condition.model_copy(update={"perturbations": few}),)}
    )


@pytest.fixture
def rig():
    return open_rig(RigSettings(preset="nominal", seed=2), 0)


@pytest.fixture
def spy(rig):
    return Spy(rig)


def session(rig, protocol, folder, operator=None):
    return Session(
        SessionPlan(protocol, 1, folder),
        rig,
        clocks=VirtualClock,
        operator=operator or NoOperator(),
        progress=lambda *_told: None,
        real_time=False,
    )


def records(folder):
    return read_log(folder / "logs" / "perturbed-0.jzlog").records


def last_events(folder):
    return [e["event"] for e in read_journal(folder / "journal.jsonl")][-1]


def assert_stopped(spy, at_s, *, within_ticks=1):
    """Zero torque was commanded, and stop called, within so many ticks of a time."""
    zeros = [t for t, torque in spy.commands if torque in (0.0, "stop") and t >= at_s - 1e-9]
    assert zeros[0] <= at_s + within_ticks * PERIOD_S + 1e-9
    after = [torque for t, torque in spy.commands if t > zeros[0]]
    assert set(after) <= {0.0, "stop"}
    assert spy.commands[-1][1] == "stop"
    assert spy.devices.actuator.state is Lifecycle.FINALISED


@pytest.mark.parametrize(
    ("device", "kind", "value", "code", "ticks"),
    [
        ("actuator", "fault", 2, "device_fault", 1),
        ("actuator", "heat", 200.0, "temperature", 1),
        ("actuator", "nan", 0.0, "sensor_not_finite", 1),
        ("angle", "nan", 0.0, "sensor_not_finite", 1),
        ("angle", "silence", 0.0, "sensor_stale", 27),
        ("actuator", "silence", 0.0, "sensor_stale", 27),
        ("contact", "silence", 0.0, "sensor_stale", 27),
        ("actuator", "freeze", 0.0, "sensor_frozen", 400),
        ("angle", "freeze", 0.0, "sensor_frozen", 400),
    ],
)
def test_a_device_that_misbehaves_trips_the_gate(
    rig, spy, protocol, tmp_path, device, kind, value, code, ticks
):
    at_s = BEFORE_PULSES_S
    rig.inject.order(device, kind, from_s=at_s, value=value)
    with pytest.raises(SafetyStop, match=code):
        session(rig, protocol, tmp_path).run()
    assert_stopped(spy, at_s, within_ticks=ticks)
    assert records(tmp_path)["flags"][-1] & Flag.TRIPPED
    assert records(tmp_path)["sent_torque"][-1] == 0.0
    assert last_events(tmp_path) == "tripped"


@pytest.mark.parametrize("device", ["actuator", "angle", "contact"])
def test_a_device_that_is_gone_ends_the_trial_in_the_same_tick(
    rig, spy, protocol, tmp_path, device
):
    rig.inject.order(device, "disconnect", from_s=BEFORE_PULSES_S)
    with pytest.raises(NotConnectedError):
        session(rig, protocol, tmp_path).run()
    assert_stopped(spy, BEFORE_PULSES_S)
    assert last_events(tmp_path) == "tripped"


@pytest.mark.parametrize(
    ("limit", "value", "code"),
    [("angle_max_rad", 0.5, "posture"), ("velocity_rad_s", 1.0, "velocity")],
)
def test_measured_limits_of_the_protocol_trip(rig, spy, protocol, tmp_path, limit, value, code):
    tight = protocol.model_copy(update={"safety": LimitsOverride(**{limit: value})})
    with pytest.raises(SafetyStop, match=code):
        session(rig, tight, tmp_path).run()
    tripped = records(tmp_path)
    assert tripped["flags"][-1] & Flag.TRIPPED
    assert not (tripped["flags"][:-1] & Flag.TRIPPED).any()
    assert tripped["sent_torque"][-1] == 0.0
    assert spy.commands[-1][1] == "stop"


def test_torque_and_its_rate_are_clamped(rig, spy, protocol, tmp_path, monkeypatch):
    # The gate does not rely on the check before the trial.
    monkeypatch.setattr(
        "jointz.experiment.session.limits_on_device",
        lambda protocol, own, **_: tightened(own, protocol.safety),
    )
    limits = LimitsOverride(torque_nm=10.0, torque_rate_nm_s=500.0)
    tight = protocol.model_copy(update={"safety": limits})
    session(rig, tight, tmp_path).run()
    found = records(tmp_path)
    assert abs(found["sent_torque"]).max() == pytest.approx(10.0)
    assert abs(found["requested_torque"]).max() > 16.0
    steps = abs(found["sent_torque"][1:] - found["sent_torque"][:-1])
    assert steps.max() <= 500.0 * PERIOD_S + 1e-5
    assert (found["flags"] & Flag.CLAMPED).any()
    assert timing_report(found, round(PERIOD_S * 1e9))["clamped_ticks"] > 100


@pytest.mark.parametrize(
    ("limits", "told"),
    [
        ({"torque_nm": 10.0}, r"pulse.amplitude_nm: 17 N\*m is above safety.torque_nm = 10"),
        ({"torque_rate_nm_s": 500.0}, "pulse.ramp_up_s: .*steeper than safety.torque_rate"),
        ({"current_a": 5.0}, "pulse.amplitude_nm: .* above safety.torque_nm = 4.95"),
        ({"pulse_count": 3}, r"conditions\[1\].perturbations: 12 pulses are more than"),
    ],
)
def test_what_a_limit_would_cut_is_refused_before_the_devices_are_on(
    rig, spy, protocol, tmp_path, limits, told
):
    tight = protocol.model_copy(update={"safety": LimitsOverride(**limits)})
    with pytest.raises(ProtocolError, match=told):
        session(rig, tight, tmp_path).run()
    assert {command for _, command in spy.commands} == {"stop"}
    assert spy.devices.actuator.state is Lifecycle.FINALISED
    assert not list((tmp_path / "logs").iterdir())


@pytest.mark.parametrize("torque", [float("nan"), float("inf"), -float("inf")])
def test_a_request_that_is_no_number_trips(rig, spy, protocol, tmp_path, monkeypatch, torque):
    request = trial.ZeroTorque.request
    at_s = BEFORE_PULSES_S
    monkeypatch.setattr(
        trial.ZeroTorque,
        "request",
        lambda self, wanted, v: (
            torque if spy.clock.now_ns() >= at_s * 1e9 else request(self, wanted, v)
        ),
    )
    with pytest.raises(SafetyStop, match="request_not_finite"):
        session(rig, protocol, tmp_path).run()
    assert_stopped(spy, at_s, within_ticks=0)


def test_an_over_torque_request_is_clamped_within_the_tick(
    rig, spy, protocol, tmp_path, monkeypatch
):
    monkeypatch.setattr(trial.ZeroTorque, "request", lambda *_: 1e6)
    with pytest.raises(SafetyStop):  # the joint is pushed out of its range, and that trips
        session(rig, protocol, tmp_path).run()
    limit = spy.devices.actuator.describe().limits.torque_nm
    assert max(torque for _, torque in spy.commands if torque != "stop") <= limit
    assert spy.commands[-1][1] == "stop"


@pytest.mark.parametrize("stage", ["read", "watch", "pulses", "gate", "recorder"])
def test_an_exception_in_any_stage_stops_the_device_in_the_same_tick(
    rig, spy, protocol, tmp_path, monkeypatch, stage
):
    owner, name = {
        "read": (trial.Streams, "read"),
        "watch": (trial.GaitWatch, "update"),
        "pulses": (trial.PulseRunner, "torque"),
        "gate": (trial.SafetyGate, "check"),
        "recorder": (trial.Recorder, "write"),
    }[stage]
    whole = getattr(owner, name)

    def broken(self, *args, **kwargs):
        if spy.clock.now_ns() >= BEFORE_PULSES_S * 1e9:
            raise ZeroDivisionError("a bug")
        return whole(self, *args, **kwargs)

    monkeypatch.setattr(owner, name, broken)
    with pytest.raises(ZeroDivisionError):
        session(rig, protocol, tmp_path).run()
    assert spy.commands[-1] == (pytest.approx(BEFORE_PULSES_S), "stop")
    assert last_events(tmp_path) == "failed"


def test_a_second_ctrl_c_stops_at_once(rig, spy, protocol, tmp_path, monkeypatch):
    update = trial.GaitWatch.update

    def interrupted(self, *args):
        if spy.clock.now_ns() >= BEFORE_PULSES_S * 1e9:
            raise KeyboardInterrupt
        return update(self, *args)

    monkeypatch.setattr(trial.GaitWatch, "update", interrupted)
    with pytest.raises(KeyboardInterrupt):
        session(rig, protocol, tmp_path).run()
    assert spy.commands[-1] == (pytest.approx(BEFORE_PULSES_S), "stop")
    assert last_events(tmp_path) == "stopped"


def test_a_lost_footswitch_fires_no_pulse_and_ends_the_trial(rig, spy, protocol, tmp_path):
    rig.inject.order("contact", "freeze", from_s=BEFORE_PULSES_S)
    with pytest.raises(SafetyStop, match="no_strides"):
        session(rig, protocol, tmp_path).run()
    found = records(tmp_path)
    after = found[found["contact_time_ns"] > (BEFORE_PULSES_S + 2.0) * 1e9]
    assert not after["command"].any()
    assert not (after["flags"] & Flag.STEADY).any()
    assert after["contact_time_ns"][-1] * 1e-9 < BEFORE_PULSES_S + 22.0
    assert spy.commands[-1][1] == "stop"


@pytest.mark.parametrize("factor", [0.55, 1.6])
def test_after_a_stumble_no_pulse_fires_until_gait_is_steady(rig, spy, protocol, tmp_path, factor):
    rig.inject.stumbles.update(dict.fromkeys(range(9, 60, 7), factor))
    session(rig, protocol, tmp_path).run()
    found = records(tmp_path)
    steady = (found["flags"] & Flag.STEADY) != 0
    begins = np.flatnonzero((found["pulse"][1:] > 0) & (found["pulse"][:-1] == 0)) + 1
    assert (~steady).sum() > 1000
    assert steady[begins].all()
    events = read_journal(tmp_path / "journal.jsonl")
    done = [e["pulse"] for e in events if e["event"] == "pulse_completed"]
    assert sorted(done) == list(range(1, 13))
    # A pulse that was on when gait became unsteady is at zero within the fade of the limits.
    fade_ticks = round(spy.devices.actuator.describe().limits.fade_s / PERIOD_S)
    lost = np.flatnonzero(steady[:-1] & ~steady[1:] & (found["pulse"][1:] > 0)) + 1
    for at in lost:
        after = found["sent_torque"][at : at + fade_ticks + 2]
        assert after[-1] == 0.0
        assert (np.diff(np.abs(after)) <= 1e-6).all()


def test_double_heel_strikes_in_a_pulse_fade_it_and_it_is_done_again(rig, spy, protocol, tmp_path):
    # Heel strikes in mid-stance all the time: some of them fall into a pulse.
    rig.inject.order("contact", "double", from_s=BEFORE_PULSES_S, until_s=60.0)
    session(rig, protocol, tmp_path).run()
    events = read_journal(tmp_path / "journal.jsonl")
    done = [e["pulse"] for e in events if e["event"] == "pulse_completed"]
    assert sorted(done) == list(range(1, 13))
    found = records(tmp_path)
    unsteady = (found["flags"] & Flag.STEADY) == 0
    starts = (found["pulse"][1:] > 0) & (found["pulse"][:-1] == 0)
    assert not unsteady[1:][starts].any()  # a pulse never fires without a phase


def test_an_overrun_of_several_slots_trips(rig, spy, protocol, tmp_path, monkeypatch):
    update = trial.GaitWatch.update
    slow = []

    def slowed(self, *args):
        if spy.clock.now_ns() >= BEFORE_PULSES_S * 1e9:
            slow.append(spy.clock.now_ns())
            spy.clock.wait_until_ns(spy.clock.now_ns() + 3 * 2_000_000)
        return update(self, *args)

    monkeypatch.setattr(trial.GaitWatch, "update", slowed)
    with pytest.raises(SafetyStop, match="overrun"):
        session(rig, protocol, tmp_path).run()
    most = spy.devices.actuator.describe().limits.consecutive_overruns
    assert len(slow) <= most // 2 + 2
    assert records(tmp_path)["sent_torque"][-1] == 0.0
    assert spy.commands[-1][1] == "stop"


def test_the_device_ends_a_hang_by_itself(rig, spy, protocol, tmp_path, monkeypatch):
    torque = trial.PulseRunner.torque
    hung = []

    def hanging(self, slot, slot_ns, watch):
        wanted = torque(self, slot, slot_ns, watch)
        if wanted and not hung and slot_ns > self._onset_ns + 50_000_000:
            hung.append(spy.clock.now_ns())
            spy.clock.wait_until_ns(spy.clock.now_ns() + 1_000_000_000)
        return wanted

    monkeypatch.setattr(trial.PulseRunner, "torque", hanging)
    with pytest.raises(SafetyStop, match="overrun"):
        session(rig, protocol, tmp_path).run()
    found = records(tmp_path)
    timeout_s = spy.devices.actuator.describe().command_timeout_s
    hang_s = found["actuator_time_ns"][found["slot"] == found["slot"][-1]][0] * 1e-9
    time_s = found["actuator_time_ns"] * 1e-9
    late = found[(time_s > hang_s + timeout_s + 0.1)]
    assert late.size > 100
    assert abs(late["current"]).max() < 0.2


def test_limits_cannot_be_loosened_from_a_protocol(rig, spy, protocol, tmp_path):
    loose = protocol.model_copy(
        update={"safety": LimitsOverride(torque_nm=1e3, angle_min_rad=-3.0, fade_s=9.0)}
    )
    with pytest.raises(ProtocolError, match="looser") as error:
        session(rig, loose, tmp_path).run()
    assert len(error.value.problems) == 3
    assert spy.commands == [(pytest.approx(0.0, abs=1.0), "stop")] or not spy.commands


@pytest.mark.usefixtures("terminal_signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_fades_the_pulse_that_is_on(rig, spy, protocol, tmp_path, monkeypatch, number):
    running = session(rig, protocol, tmp_path)
    write = trial.Recorder.write
    asked = []

    def ask_in_a_pulse(self, *records):
        write(self, *records)
        if records[0][15] != 0.0 and not asked:
            asked.append(spy.clock.now_ns() * 1e-9)
            os.kill(os.getpid(), number)

    monkeypatch.setattr(trial.Recorder, "write", ask_in_a_pulse)
    with _stopped_by_signals(running), pytest.raises(KeyboardInterrupt):
        running.run()
    sent = [(t, torque) for t, torque in spy.commands if t > asked[0] and torque != "stop"]
    fade_s = spy.devices.actuator.describe().limits.fade_s
    values = [abs(torque) for _, torque in sent]
    assert values == sorted(values, reverse=True)
    assert all(torque == 0.0 for t, torque in sent if t > asked[0] + fade_s + 2 * PERIOD_S)
    assert spy.commands[-1][1] == "stop"
    events = [e["event"] for e in read_journal(tmp_path / "journal.jsonl")]
    assert events[-3:] == ["pulse_aborted", "devices_stopped", "stopped"]


def test_a_stop_ends_walking_without_the_device_in_the_same_tick(rig, spy, protocol, tmp_path):
    without = load_protocol("walking").conditions[0]
    running = session(rig, protocol.model_copy(update={"conditions": (without,)}), tmp_path)
    look = spy_on_ticks(spy, at_s=4.0, then=running.request_stop)
    with look, pytest.raises(KeyboardInterrupt):
        running.run()
    log = read_log(tmp_path / "logs" / f"{without.name}-0.jzlog").records
    assert log["slot"][-1] * PERIOD_S == pytest.approx(4.0, abs=2 * PERIOD_S)
    assert last_events(tmp_path) == "stopped"


@contextmanager
def spy_on_ticks(spy, *, at_s, then):
    """Do something when a tick was recorded at a time."""
    write = trial.Recorder.write
    done = []

    def watched(self, *records):
        write(self, *records)
        if spy.clock.now_ns() >= at_s * 1e9 and not done:
            done.append(True)
            then()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trial.Recorder, "write", watched)
        yield


def test_a_signal_ends_the_wait_at_a_prompt(rig, protocol, tmp_path):
    class Waiting:
        def prompt(self, text):
            os.kill(os.getpid(), signal.SIGTERM)
            pytest.fail(f"still waiting: {text}")

    running = session(rig, protocol, tmp_path, operator=Waiting())
    with _stopped_by_signals(running), pytest.raises(KeyboardInterrupt):
        running.run()
    assert read_journal(tmp_path / "journal.jsonl") == []


def test_a_stop_that_a_library_swallows_lets_no_trial_begin(rig, spy, protocol, tmp_path):
    class Swallowing:
        def prompt(self, text):
            with suppress(KeyboardInterrupt):
                os.kill(os.getpid(), signal.SIGTERM)
                pytest.fail(f"still waiting: {text}")

    running = session(rig, protocol, tmp_path, operator=Swallowing())
    with _stopped_by_signals(running), pytest.raises(KeyboardInterrupt):
        running.run()
    events = [e["event"] for e in read_journal(tmp_path / "journal.jsonl")]
    assert events == ["segment_started", "devices_stopped", "stopped"]
    assert {torque for _, torque in spy.commands} <= {"stop"}


def test_a_signal_that_is_ignored_stays_ignored(rig, protocol, tmp_path):
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with _stopped_by_signals(session(rig, protocol, tmp_path)):
            assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_an_error_of_a_driver_names_its_device(rig, spy, protocol, tmp_path, monkeypatch):
    read = SimulatedSensor.read

    def broken_bus(self):
        if spy.clock is not None and spy.clock.now_ns() >= BEFORE_PULSES_S * 1e9:
            raise OSError(errno.EIO, "Input/output error")
        return read(self)

    monkeypatch.setattr(SimulatedSensor, "read", broken_bus)
    with pytest.raises(DeviceError, match=r"^(angle|contact): its driver raised OSError.*cable"):
        session(rig, protocol, tmp_path).run()
    assert_stopped(spy, BEFORE_PULSES_S)
    assert last_events(tmp_path) == "tripped"


def test_an_error_while_the_rig_opens_is_journaled(rig, protocol, tmp_path, monkeypatch):
    class Unplugged:
        def __init__(self, rig):
            self.wearer, self.calibration, self.notes = rig.wearer, rig.calibration, rig.notes

        def open(self, *_, **__):
            raise FileNotFoundError(2, "No such file or directory", "/dev/ttyUSB0")

    with pytest.raises(DeviceError, match=r"^rig: its driver raised FileNotFoundError.*ttyUSB0"):
        session(Unplugged(rig), protocol, tmp_path).run()
    assert last_events(tmp_path) == "tripped"


def test_every_device_is_stopped_though_one_cannot_be(rig, spy, protocol, tmp_path, monkeypatch):
    stopped = []
    stop = SimulatedSensor.stop

    def noted(self):
        stopped.append(self)
        stop(self)

    def stuck(self):
        raise RuntimeError("bus is gone")

    monkeypatch.setattr(SimulatedSensor, "stop", noted)
    monkeypatch.setattr(SimulatedActuator, "stop", stuck)
    rig.inject.order("angle", "disconnect", from_s=BEFORE_PULSES_S)
    told = (
        r"actuator: could not be stopped \(RuntimeError: bus is gone\). Switch its power off. What"
    )
    with pytest.raises(DeviceError, match=told + " came before: .*angle"):
        session(rig, protocol, tmp_path).run()
    assert spy.devices.angle in stopped
    events = [e["event"] for e in read_journal(tmp_path / "journal.jsonl")]
    assert events[-1] == "tripped"
    assert "devices_stopped" not in events


def test_a_device_that_cannot_be_stopped_is_told_though_the_disk_is_full(
    rig, spy, protocol, tmp_path, monkeypatch
):
    write = os.write

    def full(fd, data):
        if spy.clock is not None and spy.clock.now_ns() >= BEFORE_PULSES_S * 1e9:
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(fd, data)

    def stuck(self):
        raise RuntimeError("bus is gone")

    monkeypatch.setattr(os, "write", full)
    monkeypatch.setattr(SimulatedActuator, "stop", stuck)
    told = r"actuator: could not be stopped .*Switch its power off. What came before: .*No space"
    with pytest.raises(DeviceError, match=told) as raised:
        session(rig, protocol, tmp_path).run()
    monkeypatch.undo()
    assert "journal could not be written either" in raised.value.__notes__[-1]
    assert spy.devices.angle.state is Lifecycle.FINALISED


def test_devices_are_closed_when_one_cannot_be_activated(rig, spy, protocol, tmp_path):
    rig.inject.order("angle", "disconnect")
    with pytest.raises(DeviceError):
        session(rig, protocol, tmp_path).run()
    assert spy.devices.actuator.state is Lifecycle.FINALISED
