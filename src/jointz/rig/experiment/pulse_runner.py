"""Fires the pulses of the plan and writes down what became of each."""

from collections import Counter

from jointz.core.codes import Trip
from jointz.core.errors import SafetyStop
from jointz.core.limits import ACTUATOR_LATE_S, LOOK_AHEAD_S
from jointz.core.protocols.pulse_models import Pulse, name_of
from jointz.core.protocols.pulse_waveform import PulseWaveform
from jointz.rig.experiment.decisions import Decision, Decisions, PulseHistory
from jointz.rig.experiment.files.journal import Event, Journal
from jointz.rig.experiment.gait.gait_watch import GaitWatch
from jointz.rig.experiment.plan import PlannedPulse, written_pulse
from jointz.rig.experiment.scheduler import Scheduler

#: So many pulses broken off one after the other, and none done: it would never end.
_MOST_BROKEN_OFF = 10
#: So often in a row a pulse of one timing point, shape and amplitude is cut before all of them are
#: withdrawn: this knee is too soft for them there, and every cut is an exposure without data.
_MOST_CUT = 3


class PulseRunner:
    """Runs one pulse at a time, from its timing point to its end."""

    def __init__(
        self,
        condition: str,
        segment: int,
        pulses: tuple[Pulse, ...],
        scheduler: Scheduler,
        *,
        journal: Journal,
        period_ns: int,
        inertia: float | None = None,
        decisions: Decisions | None = None,
    ) -> None:
        self._decisions = decisions
        self._history = PulseHistory() if decisions is None else decisions.history
        self._condition, self._segment = condition, segment
        self._courses = {name_of(pulse): PulseWaveform(pulse) for pulse in pulses}
        self._course = next(iter(self._courses.values()))
        # Of the expected joint: how far a pulse will still move it, N*m -> rad.
        self._to_come = {
            name: [moved / inertia for moved in _moved(course)] if inertia else []
            for name, course in self._courses.items()
        }
        self._scheduler = scheduler
        self._journal = journal
        self._half_period_ns = period_ns // 2
        self._onset_ns = self._onset_slot = self._slot = 0
        self._was_steady = self._paused = self._counted = self._ended = False
        self._broken_off, self._why = 0, ""
        self._cuts: Counter[tuple[str, str, float]] = Counter()
        self.active: PlannedPulse | None = None
        self.aborted = False
        self.withheld = ""  # why no pulse may begin, for the journal
        self.completed = 0

    @property
    def done(self) -> bool:
        """Whether every pulse of the plan is done."""
        return self.active is None and not self._scheduler.queue

    def stride(self) -> None:
        """Count an accepted stride; while paused it counts towards no gap."""
        self._counted = not self._paused
        if self._counted:
            self._missed(self._scheduler.stride(), "timing point passed")

    def decide(self, stride: int) -> None:
        """Ask for a decision when it is time for one, and put it into effect at its stride."""
        decisions = self._decisions
        if decisions is None:
            return
        if decisions.is_due:
            question = {"condition": self._condition, "segment": self._segment,
                        "slot": self._slot, "stride": stride}  # fmt: skip
            self._journal.write("decision_asked", **decisions.ask(question))
        answer = decisions.answered(stride)
        if answer is not None:
            self._put_into_effect(decisions, *answer, stride=stride)

    def _put_into_effect(
        self, decisions: Decisions, question: Event, decision: Decision, *, stride: int
    ) -> None:
        before = after = list(self._scheduler.queue)
        if decision.stop:
            after = []
        elif decision.shares:
            after = decisions.steered(decision, before)
        self._journal.write(
            "decided",
            condition=self._condition,
            segment=self._segment,
            slot=self._slot,
            stride=stride,
            number=question["number"],
            n_done=question["n_done"],
            stop=decision.stop,
            shares=dict(decision.shares),
            # Pair by pair: a search of every pulse in the queue would cost the loop slots.
            pulses=[
                written_pulse(new)
                for old, new in zip(before, after, strict=not decision.stop)
                if new != old
            ],
            **decision.about,
        )
        self._ended = decision.stop
        self._scheduler.replace(after)

    def retract_stride(self) -> None:
        """Take back the last accepted stride, whose heel strike was spurious."""
        if self._counted:
            self._scheduler.retract_stride()

    def pause(self, *, on: bool) -> None:
        """Begin no more pulses, or go on; a pulse that is on is done to its end."""
        self._paused = on
        if on:
            self._missed(self._scheduler.miss(), "paused")

    def torque(self, slot: int, slot_ns: int, watch: GaitWatch) -> float:
        """Return the perturbation torque that the plan wants now, N*m."""
        self._slot, steady = slot, watch.steady
        if self._was_steady and not steady:
            self._missed(self._scheduler.miss(), "gait not steady")
        self._was_steady = steady
        if self.active is None:
            if not steady:
                return 0.0
            if self.withheld:
                self._missed(self._scheduler.miss(), self.withheld)
                return 0.0
            started = self._scheduler.pulse_at(
                watch.strides.phase_pct(slot_ns + self._half_period_ns)
            )
            if started is None:
                return 0.0
            self._start(started, slot_ns)
        return self._value(slot_ns)

    def displacement_to_come(self, slot_ns: int) -> float:
        """Return how far the rest of the pulse will move the expected joint, rad."""
        pulse = self.active
        if pulse is None:
            return 0.0
        to_come, at = self._to_come[pulse.shape], (slot_ns - self._onset_ns) // 1_000_000
        return pulse.amplitude_nm * to_come[at] if at < len(to_come) else 0.0

    def abort(self, why: str, *, cut: bool = False) -> None:
        """Count the pulse that is on as not done; its torque is faded or cut by the safety gate."""
        pulse = self.active
        if pulse is None or self.aborted:
            return
        self.aborted, self._why = True, why
        self._write("pulse_aborted", pulse, reason=why)
        self._cuts[pulse.variant] += cut
        if self._cuts[pulse.variant] < _MOST_CUT:
            if not self._ended:
                self._scheduler.requeue(pulse)
            return
        self._history.withdrawn.add(pulse.variant)
        for withdrawn in (pulse, *self._scheduler.withdraw(pulse.variant)):
            self._write("pulse_withdrawn", withdrawn, reason=f"cut {_MOST_CUT} times in a row")

    def _start(self, pulse: PlannedPulse, slot_ns: int) -> None:
        self.active, self.aborted = pulse, False
        self._course = self._courses[pulse.shape]
        self._onset_ns, self._onset_slot = slot_ns, self._slot
        self._history.begun.add(pulse.number)
        # What a decision changed stands twice, should its own line be damaged.
        of_pulse = written_pulse(pulse) if self._decisions else {}
        self._write("pulse_started", pulse, **of_pulse)

    def _value(self, slot_ns: int) -> float:
        pulse, elapsed_ns = self.active, slot_ns - self._onset_ns
        if pulse is None:
            return 0.0
        if elapsed_ns >= self._course.duration_ns:
            self.active = None
            self._end(pulse)
            return 0.0
        return pulse.amplitude_nm * self._course.share(elapsed_ns)

    def _end(self, pulse: PlannedPulse) -> None:
        if not self.aborted:
            self._broken_off = self._cuts[pulse.variant] = 0
            self.completed += 1
            self._history.done[pulse.variant] += not pulse.sham
            self._write("pulse_completed", pulse, onset_slot=self._onset_slot)
            return
        self._broken_off += 1
        if self._broken_off >= _MOST_BROKEN_OFF:
            raise SafetyStop(
                Trip.BROKEN_OFF,
                f"{self._broken_off} pulses in a row were broken off, the last because of: "
                f"{self._why}. Correct the cause.",
            )

    def _missed(self, pulse: PlannedPulse | None, why: str) -> None:
        if pulse is not None:
            self._write("pulse_missed", pulse, reason=why)

    def _write(self, event: str, pulse: PlannedPulse, **details: object) -> None:
        self._journal.write(
            event,
            condition=self._condition,
            segment=self._segment,
            pulse=pulse.number,
            slot=self._slot,
            **details,
        )


def _moved(course: PulseWaveform) -> list[float]:
    return course.displacements(ahead_s=LOOK_AHEAD_S, actuator_lag_s=ACTUATOR_LATE_S)
