"""Runs a controller tick by tick: fades its torque, moves its parameters, journals both."""

from dataclasses import dataclass
from math import isfinite
from types import MappingProxyType
from typing import Any

from jointz.core.protocols.protocol_models import ControllerSpec
from jointz.rig.experiment.controllers import Controller, ControlState
from jointz.rig.experiment.files.journal import Journal
from jointz.rig.experiment.gait.gait_watch import GaitWatch

#: Steady gait that brings torque from zero to all of it.
FADE_IN_S = 1.0
_NAN = float("nan")
#: A gain below this is zero: steps of binary fractions do not add up to one.
_NO_GAIN = 1e-9


@dataclass(frozen=True, slots=True)
class RunnerSettings:
    """Settings of the runner: of the loop, the safety gate and the goniometer."""

    period_ns: int  # period of the loop
    fade_s: float  # time in which torque fades to zero
    # what the goniometer shows at the joint's zero; None: not calibrated, taken as 0
    angle_zero_rad: float | None = None
    angle_gain: float = 1.0  # measured over true angle


class ControllerRunner:
    """Calls a controller while gait is steady and fades its torque in and out.

    ``failure`` is what the controller raised, "" if nothing; ``fading`` tells whether torque fades
    out in this tick.
    """

    def __init__(
        self,
        condition: str,
        segment: int,
        spec: ControllerSpec,
        controller: Controller,
        *,
        journal: Journal,
        settings: RunnerSettings,
    ) -> None:
        self.name = spec.name
        self._condition, self._segment = condition, segment
        self._controller = controller
        self._journal = journal
        self._angle_zero_rad, self._angle_gain = settings.angle_zero_rad or 0.0, settings.angle_gain
        self._period_s = settings.period_ns * 1e-9
        self._rise, self._fade_step = self._period_s / FADE_IN_S, self._period_s / settings.fade_s
        self._values = {name: float(one.value) for name, one in controller.parameters.items()}
        self._values_view = MappingProxyType(self._values)
        self._targets = dict(self._values)
        self._changes: list[tuple[str, float]] = []
        self._gain = self._held = 0.0
        self._slot = -1
        self._paused = self.fading = False
        self.failure = ""
        self._write_begin(spec, settings)

    def pause(self, *, on: bool) -> None:
        """Fade torque out and keep it at zero, or go on."""
        self._paused = on

    def set_parameter(self, name: str, value: float) -> str:
        """Move a parameter to a value at its rate; return why it is refused, "" if it is not."""
        parameter = self._controller.parameters.get(name)
        if parameter is None:
            known = ", ".join(self._targets) or "none"
            return f"'{name}' is no parameter of {self.name}; it has {known}"
        if not isfinite(value):
            return f"{name}: expected a finite number, got {value}"
        if not parameter.low <= value <= parameter.high:
            unit = "" if parameter.unit == "1" else f" {parameter.unit}"
            return f"{name}: expected {parameter.low:g} to {parameter.high:g}{unit}, got {value:g}"
        before = self._targets[name]
        if value == before:
            return f"{name} is {value:g} already"
        self._changes.append((name, before))
        self._move("parameter_changed", name, float(value))
        return ""

    def undo(self) -> str:
        """Take the last change back, then the one before; return why not, "" if it was."""
        if not self._changes:
            return "no change to undo"
        self._move("parameter_undone", *self._changes.pop())
        return ""

    def torque(
        self,
        slot: int,
        slot_ns: int,
        watch: GaitWatch,
        *,
        angle: float,
        velocity: float,
        contact: float,
        steady: bool,
        clamped_nm: float | None = None,
    ) -> float:
        """Return the torque that the controller wants now, N*m; NaN if it failed.

        While it fades, the last torque is scaled down and the controller is not called: without
        steady gait there is no phase to call it with, and a phase that runs on would go through
        the torque of another part of the cycle. ``clamped_nm`` is what the safety gate let through
        in the tick before, None if it was all: torque fades from there, not from what was asked.
        """
        self._slot = slot
        if steady and not self._paused:
            self._move_values()  # not while there is no torque: a change would come all at once
            self.fading = False
            self._gain = min(1.0, self._gain + self._rise)
            self._held = self._called(slot_ns, watch, angle, velocity, contact)
            return self._gain * self._held
        if not self.fading and self._gain > 0.0 and clamped_nm is not None:
            self._held = clamped_nm / self._gain
        self._gain -= self._fade_step
        if self._gain < _NO_GAIN:
            self._gain = self._held = 0.0
        self.fading = self._gain > 0.0
        return self._gain * self._held

    def write_failure(self) -> None:
        """Write down what the controller raised."""
        self._write("controller_failed", name=self.name, slot=self._slot, reason=self.failure)

    def _called(
        self, slot_ns: int, watch: GaitWatch, angle: float, velocity: float, contact: float
    ) -> float:
        state = ControlState(
            slot_ns * 1e-9,
            # A heel strike that is late leaves it at the end of the cycle.
            min(watch.phase_pct, 100.0),
            (angle - self._angle_zero_rad) / self._angle_gain,
            velocity,
            contact,
            watch.strides.strides,
        )
        try:
            # Added to zero: a text that spells a number is no torque.
            return float(0.0 + self._controller.torque(state, self._values_view))
        except Exception as exc:  # noqa: BLE001 - no number: the safety gate trips in this tick
            self.failure = f"{type(exc).__name__}: {exc}"
            return _NAN

    def _move_values(self) -> None:
        """Move every parameter towards its target, no faster than its rate."""
        values, targets = self._values, self._targets
        if values == targets:
            return
        for name, target in targets.items():
            step = self._controller.parameters[name].rate_per_s * self._period_s
            values[name] = min(max(target, values[name] - step), values[name] + step)

    def _move(self, event: str, name: str, value: float) -> None:
        before, self._targets[name] = self._targets[name], value
        # It holds from the tick that follows.
        self._write(event, name=name, before=before, after=value, slot=self._slot + 1)

    def _write_begin(self, spec: ControllerSpec, settings: RunnerSettings) -> None:
        numbers = ("value", "low", "high", "rate_per_s")
        parameters = {
            name: {**{key: float(getattr(one, key)) for key in numbers}, "unit": one.unit}
            for name, one in self._controller.parameters.items()
        }
        self._write(
            "controller",
            name=spec.name,
            spec=spec.model_dump(mode="json"),
            parameters=parameters,
            # Also after --resume: an operator's changes end with their stretch.
            values="as declared",
            angle_zero_rad=settings.angle_zero_rad,
            angle_gain=settings.angle_gain,
            description=dict(self._controller.describe()),
        )

    def _write(self, event: str, **details: Any) -> None:
        self._journal.write(event, condition=self._condition, segment=self._segment, **details)
