"""Every way a trial can end badly: the last command that the device got, and how soon."""

import errno
import os
import signal
from contextlib import suppress

import numpy as np
import pytest

from jointz.core.errors import DeviceError, NotConnectedError, ProtocolError, SafetyStop
from jointz.core.limits import LimitsOverride, tightened
from jointz.core.session_log import Flag
from jointz.io.protocols import load_protocol
from jointz.rig.devices.interface import Lifecycle
from jointz.rig.experiment import trial
from jointz.rig.experiment.timing import timing_report
from jointz.rig.session.participant_run import _stopped_by_signals
from jointz.rig.sim.simulated_devices import SimulatedActuator, SimulatedSensor

PERIOD_S = 0.002
#: The first pulse of the plan fires after the warm-up; by then gait has long been steady.
BEFORE_PULSES_S = 6.0


@pytest.fixture
def walk(spied_session, short_walking, tmp_path):
    """Perturbed walking only, two pulses a point."""
    protocol = short_walking(conditions=["perturbed"], count_per_point=2, warm_up_strides=4)
    return spied_session(protocol, tmp_path)


def limited(walk, **limits):
    return walk.protocol.model_copy(update={"safety": LimitsOverride(**limits)})


@pytest.fixture
def from_then_on(walk, monkeypatch):
    """Do something before every call of a method once the time before the pulses is over."""

    def patch(owner, name, act):
        whole = getattr(owner, name)

        def called(self, *args, **kwargs):
            if walk.clock is not None and walk.clock.now_ns() >= BEFORE_PULSES_S * 1e9:
                act()
            return whole(self, *args, **kwargs)

        monkeypatch.setattr(owner, name, called)

    return patch


def raising(error):
    def act():
        raise error

    return act


def bus_is_gone(self):
    raise RuntimeError("bus is gone")


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
def test_a_device_that_misbehaves_trips_the_gate(walk, device, kind, value, code, ticks):
    walk.rig.inject.order(device, kind, from_s=BEFORE_PULSES_S, value=value)
    with pytest.raises(SafetyStop, match=code):
        walk.run()
    walk.assert_stopped(BEFORE_PULSES_S, within_ticks=ticks)
    assert walk.devices.actuator.state is Lifecycle.FINALISED
    assert walk.records()["flags"][-1] & Flag.TRIPPED
    assert walk.records()["sent_torque"][-1] == 0.0
    assert walk.event_names()[-1] == "tripped"


@pytest.mark.parametrize("device", ["actuator", "angle", "contact"])
def test_a_device_that_is_gone_ends_the_trial_in_the_same_tick(walk, device):
    walk.rig.inject.order(device, "disconnect", from_s=BEFORE_PULSES_S)
    with pytest.raises(NotConnectedError):
        walk.run()
    walk.assert_stopped(BEFORE_PULSES_S)
    assert walk.devices.actuator.state is Lifecycle.FINALISED
    assert walk.event_names()[-1] == "tripped"


@pytest.mark.parametrize(
    ("limit", "code"), [({"angle_max_rad": 0.5}, "posture"), ({"velocity_rad_s": 1.0}, "velocity")]
)
def test_measured_limits_of_the_protocol_trip(walk, limit, code):
    with pytest.raises(SafetyStop, match=code):
        walk.run(protocol=limited(walk, **limit))
    tripped = walk.records()
    assert tripped["flags"][-1] & Flag.TRIPPED
    assert not (tripped["flags"][:-1] & Flag.TRIPPED).any()
    assert tripped["sent_torque"][-1] == 0.0
    assert walk.commands[-1][1] == "stop"


def test_torque_and_its_rate_are_clamped(walk, monkeypatch):
    # The gate does not rely on the check before the trial.
    tight = limited(walk, torque_nm=10.0, torque_rate_nm_s=500.0)
    monkeypatch.setattr(
        "jointz.rig.experiment.session.limits_on_device",
        lambda _, own, **__: tightened(own, tight.safety),
    )
    walk.run(protocol=tight)
    ticks = walk.records()
    assert abs(ticks["sent_torque"]).max() == pytest.approx(10.0)
    assert abs(ticks["requested_torque"]).max() > 16.0
    assert abs(np.diff(ticks["sent_torque"])).max() <= 500.0 * PERIOD_S + 1e-5
    assert (ticks["flags"] & Flag.CLAMPED).any()
    assert timing_report(ticks, round(PERIOD_S * 1e9))["clamped_ticks"] > 100


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"torque_nm": 10.0}, r"pulse.amplitude_nm: 17 N\*m is above safety.torque_nm = 10"),
        ({"torque_rate_nm_s": 500.0}, "pulse.ramp_up_s: .*steeper than safety.torque_rate"),
        ({"current_a": 5.0}, "pulse.amplitude_nm: .* above safety.torque_nm = 4.95"),
        ({"pulse_count": 3}, r"conditions\[1\].perturbations: 12 pulses are more than"),
        ({"torque_nm": 1e3, "angle_min_rad": -3.0, "fade_s": 9.0}, "looser(?s:.*looser){2}"),
    ],
)
def test_limits_that_cut_the_plan_or_are_loose_are_refused_before_the_devices_are_on(
    walk, limits, message
):
    with pytest.raises(ProtocolError, match=message):
        walk.run(protocol=limited(walk, **limits))
    assert {command for _, command in walk.commands} == {"stop"}
    assert walk.devices.actuator.state is Lifecycle.FINALISED
    assert not list((walk.folder / "logs").iterdir())


@pytest.mark.parametrize("torque", [float("nan"), -float("inf")])
def test_a_request_that_is_no_number_trips(walk, monkeypatch, torque):
    def request(self, wanted, velocity):
        return torque if walk.clock.now_ns() >= BEFORE_PULSES_S * 1e9 else wanted

    monkeypatch.setattr(trial.ZeroTorque, "request", request)
    with pytest.raises(SafetyStop, match="request_not_finite"):
        walk.run()
    walk.assert_stopped(BEFORE_PULSES_S, within_ticks=0)


def test_an_over_torque_request_is_clamped_within_the_tick(walk, monkeypatch):
    monkeypatch.setattr(trial.ZeroTorque, "request", lambda *_: 1e6)
    with pytest.raises(SafetyStop):  # the joint is pushed out of its range, and that trips
        walk.run()
    limit = walk.devices.actuator.describe().limits.torque_nm
    assert max(torque for _, torque in walk.commands if torque != "stop") <= limit
    assert walk.commands[-1][1] == "stop"


@pytest.mark.parametrize(
    ("owner", "name", "error", "event"),
    [
        (trial.Streams, "read", ZeroDivisionError("a bug"), "failed"),
        (trial.GaitWatch, "update", ZeroDivisionError("a bug"), "failed"),
        (trial.PulseRunner, "torque", ZeroDivisionError("a bug"), "failed"),
        (trial.SafetyGate, "check", ZeroDivisionError("a bug"), "failed"),
        (trial.Recorder, "write", ZeroDivisionError("a bug"), "failed"),
        (trial.GaitWatch, "update", KeyboardInterrupt(), "stopped"),  # a second Ctrl-C
    ],
)
def test_an_exception_in_any_stage_stops_the_device_in_the_same_tick(
    walk, from_then_on, owner, name, error, event
):
    from_then_on(owner, name, raising(error))
    with pytest.raises(type(error)):
        walk.run()
    assert walk.commands[-1] == (pytest.approx(BEFORE_PULSES_S), "stop")
    assert walk.event_names()[-1] == event


def test_a_lost_footswitch_fires_no_pulse_and_ends_the_trial(walk):
    walk.rig.inject.order("contact", "freeze", from_s=BEFORE_PULSES_S)
    with pytest.raises(SafetyStop, match="no_strides"):
        walk.run()
    ticks = walk.records()
    after = ticks[ticks["contact_time_ns"] > (BEFORE_PULSES_S + 2.0) * 1e9]
    assert not after["command"].any()
    assert not (after["flags"] & Flag.STEADY).any()
    assert after["contact_time_ns"][-1] * 1e-9 < BEFORE_PULSES_S + 22.0
    assert walk.commands[-1][1] == "stop"


def assert_all_pulses_began_in_steady_gait(walk):
    """Return ticks, and whether gait was steady in each."""
    ticks = walk.records()
    steady = (ticks["flags"] & Flag.STEADY) != 0
    begins = np.flatnonzero((ticks["pulse"][1:] > 0) & (ticks["pulse"][:-1] == 0)) + 1
    assert steady[begins].all()
    done = [e["pulse"] for e in walk.events() if e["event"] == "pulse_completed"]
    assert sorted(done) == list(range(1, 13))
    return ticks, steady


@pytest.mark.parametrize("factor", [0.55, 1.6])
def test_after_a_stumble_no_pulse_fires_until_gait_is_steady(walk, factor):
    walk.rig.inject.stumbles.update(dict.fromkeys(range(9, 60, 7), factor))
    walk.run()
    ticks, steady = assert_all_pulses_began_in_steady_gait(walk)
    assert (~steady).sum() > 1000
    # A pulse that was on when gait became unsteady is at zero within the fade of the limits.
    fade_ticks = round(walk.devices.actuator.describe().limits.fade_s / PERIOD_S)
    for at in np.flatnonzero(steady[:-1] & ~steady[1:] & (ticks["pulse"][1:] > 0)) + 1:
        after = ticks["sent_torque"][at : at + fade_ticks + 2]
        assert after[-1] == 0.0
        assert (np.diff(np.abs(after)) <= 1e-6).all()


def test_double_heel_strikes_in_a_pulse_fade_it_and_it_is_done_again(walk):
    # Heel strikes in mid-stance all the time: some of them fall into a pulse.
    walk.rig.inject.order("contact", "double", from_s=BEFORE_PULSES_S, until_s=60.0)
    walk.run()
    assert_all_pulses_began_in_steady_gait(walk)


def test_an_overrun_of_several_slots_trips(walk, from_then_on):
    slow = []

    def three_slots():
        slow.append(walk.clock.now_ns())
        walk.clock.wait_until_ns(slow[-1] + 3 * 2_000_000)

    from_then_on(trial.GaitWatch, "update", three_slots)
    with pytest.raises(SafetyStop, match="overrun"):
        walk.run()
    assert len(slow) <= walk.devices.actuator.describe().limits.consecutive_overruns // 2 + 2
    assert walk.records()["sent_torque"][-1] == 0.0
    assert walk.commands[-1][1] == "stop"


def test_the_device_ends_a_hang_by_itself(walk, monkeypatch):
    torque = trial.PulseRunner.torque
    hung = []

    def hanging(self, slot, slot_ns, watch):
        wanted = torque(self, slot, slot_ns, watch)
        if wanted and not hung and slot_ns > self._onset_ns + 50_000_000:
            hung.append(walk.clock.now_ns())
            walk.clock.wait_until_ns(walk.clock.now_ns() + 1_000_000_000)
        return wanted

    monkeypatch.setattr(trial.PulseRunner, "torque", hanging)
    with pytest.raises(SafetyStop, match="overrun"):
        walk.run()
    ticks = walk.records()
    timeout_s = walk.devices.actuator.describe().command_timeout_s
    time_s = ticks["actuator_time_ns"] * 1e-9
    hang_s = time_s[ticks["slot"] == ticks["slot"][-1]][0]
    late = ticks[time_s > hang_s + timeout_s + 0.1]
    assert late.size > 100
    assert abs(late["current"]).max() < 0.2


@pytest.mark.usefixtures("terminal_signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_fades_the_pulse_that_is_on(walk, monkeypatch, number):
    running = walk.session()
    write = trial.Recorder.write
    asked = []

    def ask_in_a_pulse(self, *records):
        write(self, *records)
        if records[0][15] != 0.0 and not asked:
            asked.append(walk.clock.now_ns() * 1e-9)
            os.kill(os.getpid(), number)

    monkeypatch.setattr(trial.Recorder, "write", ask_in_a_pulse)
    with _stopped_by_signals(running), pytest.raises(KeyboardInterrupt):
        running.run()
    sent = [(t, torque) for t, torque in walk.commands if t > asked[0] and torque != "stop"]
    fade_s = walk.devices.actuator.describe().limits.fade_s
    values = [abs(torque) for _, torque in sent]
    assert values == sorted(values, reverse=True)
    assert all(torque == 0.0 for t, torque in sent if t > asked[0] + fade_s + 2 * PERIOD_S)
    assert walk.commands[-1][1] == "stop"
    assert walk.event_names()[-3:] == ["pulse_aborted", "devices_stopped", "stopped"]


def test_a_stop_ends_walking_without_the_device_in_the_same_tick(walk, from_then_on):
    conditions = (load_protocol("walking").conditions[0],)
    running = walk.session(protocol=walk.protocol.model_copy(update={"conditions": conditions}))
    from_then_on(trial.Recorder, "write", running.request_stop)
    with pytest.raises(KeyboardInterrupt):
        running.run()
    last_s = walk.records("no_device")["slot"][-1] * PERIOD_S
    assert last_s == pytest.approx(BEFORE_PULSES_S, abs=2 * PERIOD_S)
    assert walk.event_names()[-1] == "stopped"


class AskedToStop:
    """An operator whose prompt a signal ends, unless a library swallows what it raises."""

    def __init__(self, *swallowed):
        self.swallowed = swallowed

    def prompt(self, text):
        with suppress(*self.swallowed):
            os.kill(os.getpid(), signal.SIGTERM)
            pytest.fail(f"still waiting: {text}")


@pytest.mark.parametrize(
    ("swallowed", "events"),
    [((), []), ((KeyboardInterrupt,), ["segment_started", "devices_stopped", "stopped"])],
)
def test_a_signal_at_a_prompt_lets_no_trial_begin(walk, swallowed, events):
    running = walk.session(operator=AskedToStop(*swallowed))
    with _stopped_by_signals(running), pytest.raises(KeyboardInterrupt):
        running.run()
    assert walk.event_names() == events
    assert {torque for _, torque in walk.commands} <= {"stop"}


def test_a_signal_that_is_ignored_stays_ignored(walk):
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with _stopped_by_signals(walk.session()):
            assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_an_error_of_a_driver_names_its_device(walk, from_then_on):
    from_then_on(SimulatedSensor, "read", raising(OSError(errno.EIO, "Input/output error")))
    with pytest.raises(DeviceError, match=r"^(angle|contact): its driver raised OSError.*cable"):
        walk.run()
    walk.assert_stopped(BEFORE_PULSES_S)
    assert walk.event_names()[-1] == "tripped"


def test_an_error_while_the_rig_opens_is_journaled(walk, monkeypatch):
    def unplugged(self, *_, **__):
        raise FileNotFoundError(2, "No such file or directory", "/dev/ttyUSB0")

    monkeypatch.setattr(walk.rig, "open", unplugged.__get__(walk.rig))
    with pytest.raises(DeviceError, match=r"^rig: its driver raised FileNotFoundError.*ttyUSB0"):
        walk.run()
    assert walk.event_names()[-1] == "tripped"


def test_every_device_is_stopped_though_one_cannot_be(walk, monkeypatch):
    stopped = []
    stop = SimulatedSensor.stop
    monkeypatch.setattr(SimulatedSensor, "stop", lambda self: (stopped.append(self), stop(self)))
    monkeypatch.setattr(SimulatedActuator, "stop", bus_is_gone)
    walk.rig.inject.order("angle", "disconnect", from_s=BEFORE_PULSES_S)
    message = (
        r"actuator: could not be stopped \(RuntimeError: bus is gone\). Switch its power off. "
        r"What came before: .*angle"
    )
    with pytest.raises(DeviceError, match=message):
        walk.run()
    assert walk.devices.angle in stopped
    assert walk.event_names()[-1] == "tripped"
    assert "devices_stopped" not in walk.event_names()


def test_a_device_that_cannot_be_stopped_is_told_though_the_disk_is_full(
    walk, from_then_on, monkeypatch
):
    from_then_on(os, "write", raising(OSError(errno.ENOSPC, "No space left on device")))
    monkeypatch.setattr(SimulatedActuator, "stop", bus_is_gone)
    message = r"actuator: could not be stopped .*Switch its power off. What came before: .*No space"
    with pytest.raises(DeviceError, match=message) as raised:
        walk.run()
    monkeypatch.undo()
    assert "journal could not be written either" in raised.value.__notes__[-1]
    assert walk.devices.angle.state is Lifecycle.FINALISED


def test_devices_are_closed_when_one_cannot_be_activated(walk):
    walk.rig.inject.order("angle", "disconnect")
    with pytest.raises(DeviceError):
        walk.run()
    assert walk.devices.actuator.state is Lifecycle.FINALISED
