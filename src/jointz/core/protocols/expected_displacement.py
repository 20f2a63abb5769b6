"""Motion of the expected joint after a pulse, computed before a session."""

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


def largest_displacement_rad(pulse: Pulse, joint: "ExpectedJoint") -> float:
    """Return the largest displacement for 1 N*m; stiffness, damping and inertia are constant."""
    x = v = largest = 0.0
    # Implicit in the velocity: a stiff or strongly damped joint stays stable.
    inertia = joint.inertia + STEP_S * (joint.damping + STEP_S * joint.stiffness)
    for share in _torque_course(pulse.course) + [0.0] * round(_AFTER_S / STEP_S):
        v = (joint.inertia * v + STEP_S * (share - joint.stiffness * x)) / inertia
        largest = max(largest, abs(x))
        x += STEP_S * v
    return largest


def _torque_course(course: tuple[TorquePart, ...]) -> list[float]:
    """Return the share of the amplitude every ``STEP_S``."""
    shares: list[float] = []
    for part in course:
        n = max(1, round(part.duration_s / STEP_S))
        shares += [part.begin + (part.end - part.begin) * k / n for k in range(n)]
    return shares
