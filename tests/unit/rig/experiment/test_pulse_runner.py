"""The runner: shape and onset of pulses, and what the journal says of each."""

from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jointz.core.errors import SafetyStop
from jointz.core.protocols.protocol_models import PerturbationPlan
from jointz.core.protocols.pulse_models import PulseSpec
from jointz.rig.experiment.files.journal import Journal, pulses_done, pulses_withdrawn, read_journal
from jointz.rig.experiment.plan import PlannedPulse
from jointz.rig.experiment.pulse_runner import PulseRunner
from jointz.rig.experiment.scheduler import Scheduler

MS = 1_000_000
PERIOD = 2 * MS
STRIDE = 1_100 * MS
SHAPE = PulseSpec(amplitude_nm=17.0, duration_s=0.25, ramp_up_s=0.05, hold_s=0.15, ramp_down_s=0.05)


class Strides:
    """Even strides from time zero on."""

    def phase_pct(self, time_ns):
        return 100.0 * (time_ns % STRIDE) / STRIDE


class Watch:
    def __init__(self):
        self.steady = True
        self.strides = Strides()


class Walk:
    """Ticks through strides and notes every torque."""

    def __init__(self, folder, *pulses, shape=SHAPE):
        self.file = folder / "journal.jsonl"
        self.journal = Journal(self.file)
        self.watch = Watch()
        self.runner = PulseRunner(
            "perturbed",
            2,
            (shape,),
            Scheduler(pulses, PerturbationPlan(warm_up_strides=0)),
            journal=self.journal,
            period_ns=PERIOD,
        )
        self.slot = -1
        self.torque = {}

    def until(self, time_ns):
        while (self.slot + 1) * PERIOD < time_ns:
            self.slot += 1
            at = self.slot * PERIOD
            self.torque[self.slot] = self.runner.torque(self.slot, at, self.watch)
            if self.watch.steady and at % STRIDE == 0:
                self.runner.stride()
        return self

    def events(self, name=None):
        found = read_journal(self.file)
        return found if name is None else [e for e in found if e["event"] == name]


@pytest.fixture
def walk(tmp_path):
    """Make a walk; its journal is closed at the end."""
    walks = []

    def make(*pulses, **more):
        walks.append(Walk(tmp_path, *pulses, **more))
        return walks[-1]

    yield make
    for one in walks:
        one.journal.__exit__(None, None, None)


def pulse(number=1, *, pct=20.0, amplitude_nm=17.0, gap=1):
    return PlannedPulse(number, "MST", pct, amplitude_nm, gap)


def test_a_pulse_is_a_trapezoid_from_the_tick_nearest_to_its_timing_point(walk):
    one = walk(pulse()).until(2 * STRIDE)
    # 20 % of 1.1 s are 220 ms: slot 110.
    assert [one.torque[slot] for slot in (109, 110, 120, 135, 209, 210, 234, 235)] == (
        pytest.approx([0.0, 0.0, 17.0 * 20 / 50, 17.0, 17.0, 17.0, 17.0 * 2 / 50, 0.0])
    )
    assert sum(one.torque.values()) * 0.002 == pytest.approx(17.0 * 0.2)


@pytest.mark.parametrize(("pct", "slot"), [(20.0, 110), (20.08, 110), (20.1, 111), (19.95, 110)])
def test_onset_is_within_half_a_period_of_its_timing_point(walk, pct, slot):
    one = walk(pulse(pct=pct)).until(STRIDE)
    (started,) = one.events("pulse_started")
    assert started["slot"] == slot
    assert abs(slot * PERIOD - pct / 100 * STRIDE) <= PERIOD / 2


def test_the_journal_tells_start_and_end_of_a_pulse(walk):
    one = walk(pulse(7)).until(STRIDE)
    about = {"condition": "perturbed", "segment": 2, "pulse": 7}
    assert one.events() == [
        {"event": "pulse_started", **about, "slot": 110},
        {"event": "pulse_completed", **about, "slot": 235, "onset_slot": 110},
    ]
    assert one.runner.completed == 1
    assert one.runner.done


def test_a_sham_takes_its_time_and_is_counted_but_not_felt(walk):
    one = walk(pulse(amplitude_nm=0.0)).until(STRIDE)
    assert set(one.torque.values()) == {0.0}
    assert [e["slot"] for e in one.events()] == [110, 235]
    assert one.runner.completed == 1


def test_no_pulse_fires_while_gait_is_not_steady(walk):
    one = walk(pulse())
    one.watch.steady = False
    one.until(5 * STRIDE)
    assert one.events() == []
    assert not any(one.torque.values())
    assert not one.runner.done


def test_a_pulse_that_was_due_when_gait_became_unsteady_is_missed_and_done_later(walk):
    one = walk(pulse(1), pulse(2)).until(100 * MS)
    one.watch.steady = False
    one.until(3 * STRIDE + PERIOD)
    (missed,) = one.events("pulse_missed")
    assert (missed["pulse"], missed["reason"]) == (1, "gait not steady")
    one.watch.steady = True
    one.until(7 * STRIDE)
    assert [e["pulse"] for e in one.events("pulse_completed")] == [2, 1]


def test_a_timing_point_that_passed_while_the_loop_was_late_is_missed(walk):
    one = walk(pulse(1)).until(200 * MS)
    one.slot = 130  # 40 ms were skipped: the phase is 24 % by now
    one.until(2 * STRIDE)
    (missed,) = one.events("pulse_missed")
    assert missed["reason"] == "timing point passed"
    assert [e["onset_slot"] for e in one.events("pulse_completed")] == [660]


def broken_off(one, *strides):
    """Walk to the end of each stride, breaking its pulse off."""
    for stride in strides:
        one.until(stride * STRIDE + 300 * MS)
        one.runner.abort("too much of the time under pulses")
        one.until((stride + 1) * STRIDE)


def test_after_ten_pulses_broken_off_in_a_row_the_trial_ends(walk):
    one = walk(pulse(1), pulse(2))
    broken_off(one, *range(9))
    one.until(9 * STRIDE + 300 * MS)
    one.runner.abort("too much of the time under pulses")
    with pytest.raises(SafetyStop, match="too much of the time under pulses"):
        one.until(10 * STRIDE)
    assert one.slot == (9 * 550 + 110) + 125  # when the last one's time is over: torque is faded
    assert len(one.events("pulse_aborted")) == 10


def test_a_pulse_done_between_those_broken_off_lets_the_trial_go_on(walk):
    one = walk(*[pulse(number) for number in range(1, 4)])
    broken_off(one, *range(9))
    one.until(10 * STRIDE)
    broken_off(one, *range(10, 19))
    one.until(22 * STRIDE)
    assert len(one.events("pulse_aborted")) == 18
    assert one.runner.done


# Ten broken off in a row would end the trial.
@settings(max_examples=30, deadline=None)
@given(st.lists(st.sampled_from(["well", "abort", "unsteady"]), max_size=9), st.integers(1, 5))
def test_whatever_happens_every_pulse_is_completed_once_in_the_journal(
    tmp_path_factory, history, count
):
    one = Walk(tmp_path_factory.mktemp("walk"), *[pulse(i + 1) for i in range(count)])
    with one.journal:
        for strides, happening in enumerate([*history, *["well"] * (count + 1)]):
            begin = strides * STRIDE
            one.until(begin + 300 * MS)
            if happening == "abort":
                one.runner.abort("test")
            one.until(begin + 600 * MS)
            one.watch.steady = happening != "unsteady"
            one.until(begin + STRIDE)
            one.watch.steady = True
    assert one.runner.done
    done = Counter(e["pulse"] for e in one.events("pulse_completed"))
    assert done == dict.fromkeys(range(1, count + 1), 1)
    assert set(pulses_done(one.events(), "perturbed")) == set(done)
    ended = Counter(e["event"] for e in one.events())
    assert ended["pulse_started"] == ended["pulse_completed"] + ended["pulse_aborted"]


def test_a_pulse_that_may_not_begin_is_missed_and_done_later(walk):
    one = walk(pulse())
    one.runner.withheld = "unperturbed angle not known yet"
    one.until(2 * STRIDE)
    assert {e["reason"] for e in one.events("pulse_missed")} == {"unperturbed angle not known yet"}
    assert set(one.torque.values()) == {0.0}
    one.runner.withheld = ""
    one.until(4 * STRIDE)
    assert one.runner.completed == 1


# --- pauses --------------------------------------------------------------------------------------


def test_while_paused_no_pulse_begins_and_its_stride_counts_towards_no_gap(walk):
    one = walk(pulse(gap=2))
    one.runner.pause(on=True)
    one.until(5 * STRIDE)
    assert set(one.torque.values()) == {0.0}
    one.runner.pause(on=False)
    one.until(6.1 * STRIDE)
    assert set(one.torque.values()) == {0.0}  # the gap of two strides begins only now
    one.until(8 * STRIDE)
    assert one.runner.completed == 1


def test_a_pulse_that_was_due_when_a_pause_began_is_written_down_and_done_later(walk):
    one = walk(pulse())
    one.until(0.1 * STRIDE)
    one.runner.pause(on=True)
    assert [e["reason"] for e in one.events("pulse_missed")] == ["paused"]
    one.runner.pause(on=False)
    one.until(4 * STRIDE)
    assert one.runner.completed == 1


def cut_at(one, slots):
    """Walk on; a pulse that is on at one of these ticks after its onset is cut."""
    for _ in range(8 * STRIDE // PERIOD):
        one.until((one.slot + 2) * PERIOD)
        active = one.runner.active
        if active is not None and active.number in slots:
            one.runner.abort("too far", cut=True)
    return one


def test_pulses_that_are_cut_three_times_in_a_row_are_withdrawn(walk):
    one = cut_at(walk(pulse(1), pulse(2), pulse(3, amplitude_nm=-17.0)), {1, 2})
    assert [e["pulse"] for e in one.events("pulse_aborted")] == [1, 2, 1]
    assert [e["pulse"] for e in one.events("pulse_withdrawn")] == [1, 2]
    assert [e["pulse"] for e in one.events("pulse_completed")] == [3]
    assert one.runner.done
    assert pulses_withdrawn(one.events(), "perturbed") == {1, 2}


def test_a_pulse_that_is_completed_between_two_cuts_breaks_the_row(walk):
    one = cut_at(walk(pulse(1), pulse(2), pulse(3), pulse(4)), {1, 3})
    told = [(e["event"], e["pulse"]) for e in one.events() if e["event"] != "pulse_started"]
    aborted, completed, withdrawn = "pulse_aborted", "pulse_completed", "pulse_withdrawn"
    assert told == [
        *((aborted, 1), (completed, 2), (aborted, 3), (completed, 4)),
        *((aborted, 1), (aborted, 3), (aborted, 1), (withdrawn, 1), (withdrawn, 3)),
    ]
