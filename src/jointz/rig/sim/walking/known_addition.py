"""A known addition to the knee of a simulated walker: a weight on the shank, a spring.

Assumptions: the muscles supply what the addition needs along the unperturbed path, so the path
stays that of the person, and so does the measured moment, whose inverse dynamics does not include
the addition. Impedance does not rise with that effort. Cuff and band are fixed rigidly to the bone.
The inertia that the knee feels is that of the leg as the preset has it (``added_inertia``); gravity
acts as on the limb: with a fixed thigh in stance.
"""

from dataclasses import dataclass

from jointz.core.protocols.protocol_models import LoadSpec
from jointz.rig.sim.benches.bench_load import draw_value
from jointz.rig.sim.people import Person
from jointz.rig.sim.presets import Preset

GRAVITY = 9.81  # m/s^2


@dataclass(frozen=True, slots=True)
class KnownAddition:
    """The true addition."""

    name: str  # name in the protocol
    inertia: float = 0.0  # kg*m^2, about the knee; m d^2 of a weight
    stiffness: float = 0.0  # N*m/rad: of a spring across the knee
    mass_kg: float = 0.0  # mass of a weight on the shank
    distance_m: float = 0.0  # distance of the weight from the knee

    gravity_nm: float = 0.0  # weight times distance


def draw_addition(spec: LoadSpec, person: Person, preset: Preset) -> KnownAddition:
    """Return what is really mounted: the addition stated, or one drawn within its sd."""
    seed = int(person.stream("known loads").integers(2**32))

    def drawn(part: str) -> float:
        return draw_value(spec, part, seed=seed, spread=preset.name != "clean")

    mass, distance = drawn("mass_kg"), drawn("distance_m")
    inertia = drawn("inertia") + mass * distance**2
    gravity_nm = mass * GRAVITY * distance
    return KnownAddition(spec.name, inertia, drawn("stiffness"), mass, distance, gravity_nm)
