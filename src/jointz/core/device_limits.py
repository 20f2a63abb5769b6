"""What a protocol may ask of a device: decided before the device is switched on."""

from jointz.core.checked_model import place_of
from jointz.core.errors import ProtocolError
from jointz.core.limits import LimitsOverride, SafetyLimits, tightened
from jointz.core.protocols.protocol import Protocol
from jointz.core.protocols.protocol_limit_checks import (
    CONDITION_LIMIT_CHECKS,
    PROTOCOL_LIMIT_CHECKS,
)


def limits_on_device(
    protocol: Protocol, own: SafetyLimits, *, torque_per_ampere: float
) -> SafetyLimits:
    """Return a device's limits as a protocol tightens them."""
    limits = tightened(own, protocol.safety)
    torque_nm = min(limits.torque_nm, limits.current_a * torque_per_ampere)
    limited = LimitsOverride.model_validate({**limits.model_dump(), "torque_nm": torque_nm})
    asked = protocol.model_copy(update={"safety": limited})
    problems = [problem for check in PROTOCOL_LIMIT_CHECKS for problem in check(asked)]
    for i in range(len(protocol.conditions)):
        problems += [problem for check in CONDITION_LIMIT_CHECKS for problem in check(asked, i)]
    if problems:
        raise ProtocolError(
            f"{protocol.name} with the limits of this device",
            [f"{place_of(p.key)}: {p.message}" for p in problems],
        )
    return limits
