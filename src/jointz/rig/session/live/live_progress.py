"""Progress of a session from its journal: state, pulses done, pulse that is due next."""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from jointz.rig.experiment.files.journal import Event

#: Event -> state of the session from then on.
_STATES = {
    "prompted": "waiting",
    "started": "starting",
    "segment_started": "running",
    "paused": "paused",
    "went_on": "running",
    "stop_asked": "stopping",
    "stopped_without_console": "stopping",
    "stopped": "stopped",
    "tripped": "tripped",
    "failed": "failed",
    "condition_completed": "between",
}
#: Worth a line to whoever watches; pulses have bars of their own.
_TOLD = frozenset(_STATES) | {
    "note",
    "control_refused",
    "parameter_changed",
    "parameter_undone",
    "controller_failed",
    "console_lost",
    "console_back",
    "pulse_aborted",
    "pulse_missed",
    "pulse_withdrawn",
    "pulse_lost",
    "records_lost",
    "decided",
}
_MOST_TOLD = 100
#: Written only after every device was stopped.
_DEVICES_STOPPED = frozenset({"devices_stopped", "condition_completed"})


@dataclass(slots=True)
class TrialProgress:
    """Progress of a trial."""

    planned: Sequence[Mapping[str, Any]]  # planned pulses of the trial, in order
    done: set[int] = field(default_factory=set)  # numbers of the completed pulses
    withdrawn: set[int] = field(default_factory=set)  # and of those that are not tried again
    # numbers of the pulses still to be done, in the order in which they are due
    queue: deque[int] = field(default_factory=deque)
    missed: int = 0  # pulses to be done again, so far
    aborted: int = 0
    completed: bool = False  # whether the trial is over

    def begin(self) -> None:
        """Begin a new stretch: pulses that are not done are due in the order of the plan."""
        left = (pulse["number"] for pulse in self.planned)
        self.queue = deque(number for number in left if number not in self.done | self.withdrawn)

    def take(self, kind: str, number: int) -> None:
        """Record the outcome of a pulse."""
        if kind == "pulse_completed":
            self.done.add(number)
            return
        if kind in ("pulse_lost", "pulse_damaged"):
            self.done.discard(number)
            return
        if number in self.queue:
            self.queue.remove(number)
        if kind == "pulse_withdrawn":
            self.withdrawn.add(number)
        elif kind in ("pulse_missed", "pulse_aborted"):
            self.missed += kind == "pulse_missed"
            self.aborted += kind == "pulse_aborted"
            self.queue.append(number)

    def decide(self, event: Event) -> None:
        """Follow a decision: pulses go to other timing points, or end."""
        changed = {pulse["number"]: pulse for pulse in event["pulses"]}
        self.planned = [changed.get(pulse["number"], pulse) for pulse in self.planned]
        if event["stop"]:
            self.withdrawn |= set(self.queue)
            self.queue.clear()

    def points(self) -> list[dict[str, Any]]:
        """Return how many pulses of every timing point are done, of how many."""
        points: dict[str, dict[str, Any]] = {}
        for pulse in self.planned:
            name = pulse["timing_point"]
            new = {"name": name, "pct": pulse.get("gait_pct"), "planned": 0, "done": 0}
            row = points.setdefault(name, new)
            row["planned"] += pulse["number"] not in self.withdrawn
            row["done"] += pulse["number"] in self.done
        return sorted(points.values(), key=lambda row: (row["pct"] is None, row["pct"] or 0.0))

    def next_pulse(self) -> Mapping[str, Any] | None:
        """Return the pulse that is due next, if any is left."""
        if not self.queue:
            return None
        return next(pulse for pulse in self.planned if pulse["number"] == self.queue[0])


class SessionProgress:
    """A session by its journal, event by event."""

    def __init__(self, plan: Mapping[str, Sequence[Mapping[str, Any]]]) -> None:
        self._plan = plan
        self.trials: dict[str, TrialProgress] = {}
        self.state = "idle"
        self.condition = self.prompt = self.reason = ""
        self.segment = -1
        self.unconfirmed = ""
        self._lost = False
        self._controllers: dict[str, dict[str, Any]] = {}  # by trial, latest stretch
        self.told: deque[dict[str, Any]] = deque(maxlen=_MOST_TOLD)

    def take(self, event: Event) -> None:
        """Process an event."""
        kind, condition = event["event"], event["condition"]
        trial = self.trial(condition)
        if kind == "segment_started":
            self.segment = event["segment"]
            trial.begin()
            self.unconfirmed = f"{condition}-{self.segment}"
        elif kind in ("condition_completed", "records_lost"):
            trial.completed = kind == "condition_completed"
        elif kind.startswith("pulse_"):
            trial.take(kind, event["pulse"])
            trial.completed = trial.completed and kind != "pulse_lost"
        elif kind == "decided":
            trial.decide(event)
        else:
            self._follow_controller(kind, event)
        if kind in _DEVICES_STOPPED:
            self.unconfirmed = ""
        if kind in _STATES:
            self._enter(kind, event)
        if kind in _TOLD:
            self.told.append(event)

    def trial(self, condition: str) -> TrialProgress:
        """Return what is done of a trial."""
        if condition not in self.trials:
            self.trials[condition] = TrialProgress(self._plan.get(condition, ()))
        return self.trials[condition]

    @property
    def controller(self) -> dict[str, Any] | None:
        """The condition's controller and the target values of its parameters; None without one."""
        return self._controllers.get(self.condition)

    def _follow_controller(self, kind: str, event: Event) -> None:
        condition = event["condition"]
        if kind == "controller":
            parameters = {name: dict(one) for name, one in event["parameters"].items()}
            self._controllers[condition] = {"name": event["name"], "parameters": parameters}
        elif kind in ("parameter_changed", "parameter_undone") and condition in self._controllers:
            parameter = self._controllers[condition]["parameters"].get(event["name"], {})
            parameter["value"] = event["after"]

    def _enter(self, kind: str, event: Event) -> None:
        if event["condition"] != self.condition:
            self.segment = event.get("segment", -1)
        self.condition = event["condition"]
        # A note taken late, or a page that came back, is no way out of a stop.
        if self.state == "stopping" and kind in ("paused", "went_on"):
            return
        self.state = _STATES[kind]
        if kind == "prompted":
            self.prompt, self.segment = event["text"], -1
        without_page = kind == "stopped" and self._lost
        self._lost = kind == "stopped_without_console"
        if kind in ("stopped", "tripped", "failed"):
            self.reason = "the page was lost" if without_page else event.get("reason", "")
        else:
            self.reason = ""
