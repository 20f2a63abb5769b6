"""The leg beyond a joint, by body mass and height."""

from typing import NamedTuple

from numpy import mean

_GRAVITY = 9.81  # m/s^2
#: Where the ankle is, which the table does not say: above the centre line of the foot (m), and
#: from the heel as a share of the foot's length.
_ANKLE_M, _HEEL = 0.04, 0.25
#: For an unknown height.
_AVERAGE_HEIGHT_M = 1.70


class Segment(NamedTuple):
    """Shares of body mass, height and segment length."""

    mass: float  # of body mass
    centre: float  # of the length: centre of mass from the proximal end, of the foot from the heel
    gyration: float  # of the length: radius of gyration about the mediolateral axis
    length: float  # of height


# P. de Leva, "Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters", J Biomech 29,
# 1223 (1996), doi 10.1016/0021-9290(95)00178-6, table 4: 100 men (1.741 m) and 15 women (1.735 m),
# measured alive.
MEN = {
    "thigh": Segment(0.1416, 0.4095, 0.329, 0.4222 / 1.741),
    "shank": Segment(0.0433, 0.4459, 0.249, 0.4340 / 1.741),
    "foot": Segment(0.0137, 0.4415, 0.245, 0.2581 / 1.741),
}
WOMEN = {
    "thigh": Segment(0.1478, 0.3612, 0.364, 0.3685 / 1.735),
    "shank": Segment(0.0481, 0.4416, 0.267, 0.4323 / 1.735),
    "foot": Segment(0.0129, 0.4014, 0.279, 0.2283 / 1.735),
}
_ABOVE_FOOT = {"knee": ("shank",), "hip": ("thigh", "shank")}


class Limb(NamedTuple):
    """A straight leg with the foot at a right angle, beyond a joint."""

    mass_kg: float
    moment_nm: float  # weight times distance of its centre from the joint
    inertia: float  # kg*m^2, about the joint

    @property
    def centre_m(self) -> float:
        """Distance of its centre from the joint, m."""
        return self.moment_nm / (_GRAVITY * self.mass_kg)


def leg_beyond(joint: str, mass_kg: float, height_m: float) -> Limb:
    """Return the leg beyond ``knee`` or ``hip``: the mean of a man's and a woman's."""
    sexes = [_leg_beyond(joint, table, mass_kg, height_m) for table in (MEN, WOMEN)]
    return Limb(*(float(mean(both)) for both in zip(*sexes, strict=True)))


def segment_length(name: str, height_m: float | None) -> float:
    """Return the length of a segment, m: the mean of a man's and a woman's."""
    shares = [table[name].length for table in (MEN, WOMEN)]
    return float(mean(shares)) * (height_m or _AVERAGE_HEIGHT_M)


def _leg_beyond(joint: str, table: dict[str, Segment], mass_kg: float, height_m: float) -> Limb:
    mass = moment = inertia = reach = 0.0
    for name in _ABOVE_FOOT[joint]:
        one = table[name]
        length = one.length * height_m
        mass += one.mass
        moment += one.mass * one.centre * length + one.mass * reach
        inertia += one.mass * mass_kg * length**2 * (one.centre**2 + one.gyration**2)
        inertia += one.mass * mass_kg * reach * (reach + 2.0 * one.centre * length)
        reach += length
    foot, below = table["foot"], reach + _ANKLE_M
    length = foot.length * height_m
    square = below**2 + ((foot.centre - _HEEL) * length) ** 2 + (foot.gyration * length) ** 2
    return Limb(
        mass_kg=mass_kg * (mass + foot.mass),
        moment_nm=_GRAVITY * mass_kg * (moment + foot.mass * below),
        inertia=inertia + foot.mass * mass_kg * square,
    )
