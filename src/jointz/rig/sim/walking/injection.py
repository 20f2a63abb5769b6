"""Misbehaviour on order: what the devices of a simulated rig are to do wrong, and when."""

from dataclasses import dataclass, field
from math import inf, isfinite
from typing import Literal, get_args

DeviceName = Literal[
    "actuator",
    "angle",
    "contact",
    "torque",
    "positioner",
    "joint_encoder",
    "shank_velocity",
    "thigh_velocity",
]
Kind = Literal["freeze", "silence", "nan", "disconnect", "fault", "heat", "double"]
KINDS: tuple[Kind, ...] = get_args(Kind)


@dataclass(frozen=True, slots=True)
class Misbehaviour:
    """One misbehaviour of a device."""

    device: DeviceName
    # ``freeze``: samples arrive with constant values. ``silence``: no samples. ``nan``: angles or
    # values are NaN. ``disconnect``: every call but stop and close raises. ``fault``: fault bits of
    # ``value``, and the actuator faults. ``heat``: temperature raised by ``value``, degrees
    # Celsius. ``double``: the contact opens in mid-stance, between 25 and 35 % of the stride
    kind: Kind
    from_s: float = 0.0  # s: begin, on the device's clock
    until_s: float = inf  # s: end, on the device's clock
    value: float = 0.0  # fault bits of ``fault``, or degrees Celsius of ``heat``


@dataclass(slots=True)
class Injection:
    """Misbehaviour ordered from a rig; orders may be given at any time."""

    orders: list[Misbehaviour] = field(default_factory=list)  # all orders; see :meth:`order`
    # number of a stride -> factor on its duration; to be set before the devices are opened
    stumbles: dict[int, float] = field(default_factory=dict)

    def order(
        self,
        device: DeviceName,
        kind: Kind,
        *,
        from_s: float = 0.0,
        until_s: float = inf,
        value: float = 0.0,
    ) -> None:
        """Order a misbehaviour."""
        if device not in get_args(DeviceName) or kind not in KINDS:
            raise ValueError(
                f"expected a device of {get_args(DeviceName)} and a kind of {KINDS}; "
                f"got {device!r}, {kind!r}."
            )
        self.orders.append(Misbehaviour(device, kind, from_s, until_s, value))

    def found(self, device: DeviceName, device_time_ns: int) -> list[Misbehaviour]:
        """Return what goes wrong with a device at a time."""
        return [
            order
            for order in self.orders
            if order.device == device
            and order.from_s * 1e9 <= device_time_ns
            and (not isfinite(order.until_s) or device_time_ns < order.until_s * 1e9)
        ]
