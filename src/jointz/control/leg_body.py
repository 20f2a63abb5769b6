"""Segments of a leg by the proportions of an average body."""

from dataclasses import dataclass
from typing import Final

HEIGHT_M: Final = 1.74
GRAVITY: Final = 9.81
#: Segments as shares of height, and shank and foot as shares of mass (Winter, table 4.1).
_THIGH_LENGTH, _SHANK_LENGTH, _ANKLE_HEIGHT, _FOOT_LENGTH = 0.245, 0.246, 0.039, 0.152
_MASS, _CENTRE, _GYRATION = 0.061, 0.606, 0.735


@dataclass(frozen=True, slots=True, eq=False)
class LegBody:
    """Segments of a leg, SI."""

    inertia: float  # kg m^2, of shank and foot about the knee
    mass_centre: float  # kg m, mass times distance of its centre from the knee
    thigh_m: float
    sole_m: float  # from knee to sole
    foot_m: float
    weight_n: float


def leg_body(mass_kg: float, height_m: float = HEIGHT_M) -> LegBody:
    """Return the leg of a body."""
    shank, mass = _SHANK_LENGTH * height_m, _MASS * mass_kg
    return LegBody(
        inertia=mass * (_GYRATION * shank) ** 2,
        mass_centre=mass * _CENTRE * shank,
        thigh_m=_THIGH_LENGTH * height_m,
        sole_m=shank + _ANKLE_HEIGHT * height_m,
        foot_m=_FOOT_LENGTH * height_m,
        weight_n=GRAVITY * mass_kg,
    )
