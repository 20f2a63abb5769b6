"""Check of a protocol against a device's limits, before the device is switched on."""

from jointz.core.checked_model import place_of
from jointz.core.errors import ProtocolError
from jointz.core.limits import LimitsOverride, SafetyLimits, tightened
from jointz.core.protocols.protocol import Protocol
from jointz.core.protocols.protocol_limit_checks import (
    CONDITION_LIMIT_CHECKS,
    PROTOCOL_LIMIT_CHECKS,
)


def limits_on_device(
    protocol: Protocol, device_limits: SafetyLimits, *, torque_per_ampere: float
) -> SafetyLimits:
    """Return a device's limits as tightened by a protocol; raise if the protocol exceeds them."""
    limits = tightened(device_limits, protocol.safety)
    torque_nm = min(limits.torque_nm, limits.current_a * torque_per_ampere)
    limited = LimitsOverride.model_validate({**limits.model_dump(), "torque_nm": torque_nm})
    limited_protocol = protocol.model_copy(update={"safety": limited})
    problems = [problem for check in PROTOCOL_LIMIT_CHECKS for problem in check(limited_protocol)]
    for i in range(len(protocol.conditions)):
        problems += [
            problem for check in CONDITION_LIMIT_CHECKS for problem in check(limited_protocol, i)
        ]
    if problems:
        raise ProtocolError(
            f"{protocol.name} with the limits of this device",
            [f"{place_of(p.key)}: {p.message}" for p in problems],
        )
    return limits
