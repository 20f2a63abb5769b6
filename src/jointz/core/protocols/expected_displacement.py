"""Motion of the expected joint after a pulse, computed before a session."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from jointz.core.protocols.pulse_models import Pulse, TorquePart

if TYPE_CHECKING:
    from jointz.core.protocols.protocol_models import ExpectedJoint

#: Step of the computation; a joint oscillates a hundred times more slowly.
STEP_S = 5e-4
#: The longest pulse that it is computed for; the limit of displacement is for short ones.
LONGEST_PULSE_S = 10.0
#: A joint goes on moving for so long after the torque.
_AFTER_S = 0.3


@dataclass(frozen=True, slots=True)
class ExpectedMotion:
    """Torque and displacement for an amplitude of 1 N*m, every ``STEP_S`` from the onset."""

    torque: tuple[float, ...]  # share of the amplitude
    displacement_rad: tuple[float, ...]

    @property
    def largest_rad(self) -> float:
        """The largest displacement, rad for 1 N*m."""
        return max(map(abs, self.displacement_rad))


def expected_displacement(pulse: Pulse, joint: "ExpectedJoint") -> ExpectedMotion:
    """Return the motion of a joint with constant stiffness, damping and inertia."""
    torque = torque_course(pulse.course) + [0.0] * round(_AFTER_S / STEP_S)
    x = v = 0.0
    moved = []
    for share in torque:
        moved.append(x)
        # Implicit in the velocity: a stiff or strongly damped joint stays stable.
        stiff = joint.damping + STEP_S * joint.stiffness
        v = (joint.inertia * v + STEP_S * (share - joint.stiffness * x)) / (
            joint.inertia + STEP_S * stiff
        )
        x += STEP_S * v
    return ExpectedMotion(tuple(torque), tuple(moved))


def torque_course(course: tuple[TorquePart, ...]) -> list[float]:
    """Return the share of the amplitude every ``STEP_S``."""
    shares: list[float] = []
    for part in course:
        n = max(1, round(part.duration_s / STEP_S))
        shares += [part.begin + (part.end - part.begin) * k / n for k in range(n)]
    return shares
