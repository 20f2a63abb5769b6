"""Controllers of the comparison: their laws for a person."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from jointz.control.controllers import controller_tables
from jointz.control.impedance_profile import ImpedanceProfile, mean_velocity

#: Controller that the others are compared with.
REFERENCE: Final = "impedance_continuous"
#: The mean of the other people's profiles, for each person by mass.
OTHERS: Final = "impedance_continuous, others' mean"


def _of(name: str, **settings: float) -> Callable[[ImpedanceProfile], np.ndarray]:
    return lambda profile: _nodes(name, profile, settings)


def _nodes(
    name: str, profile: ImpedanceProfile | None, settings: Mapping[str, float] | None = None
) -> np.ndarray:
    law = controller_tables(name, profile, settings)
    return np.column_stack([law.feedforward, law.stiffness, law.damping, law.equilibrium])


#: Controller -> its law for a profile: feedforward, stiffness, damping, equilibrium, (100, 4).
LAWS: Final[Mapping[str, Callable[[ImpedanceProfile], np.ndarray]]] = {
    "zero_torque": _of("zero_torque"),
    "torque_replay": _of("torque_replay"),
    "kinematic_pd, 10 N*m/rad": _of("kinematic_pd", stiffness=10.0, damping=1.0),
    # Half of critical damping with the load, and more than delay and lag take from it.
    "kinematic_pd, 100 N*m/rad": _of("kinematic_pd", stiffness=100.0, damping=6.0),
    "four_state, published": lambda _: _nodes("four_state", None),
    "four_state, fitted": _of("four_state"),
    "quasi_stiffness": _of("quasi_stiffness"),
    "impedance_constant": _of("impedance_constant"),
    "impedance_per_phase": _of("impedance_per_phase"),
    REFERENCE: _of(REFERENCE),
}


def persons_laws(profiles: Sequence[ImpedanceProfile], person: int) -> dict[str, np.ndarray]:
    """Return the laws for a person; the mean of the others is among them if there are any."""
    laws = {name: law(profiles[person]) for name, law in LAWS.items()}
    others = [other for n, other in enumerate(profiles) if n != person]
    if others:
        laws[OTHERS] = _nodes(REFERENCE, mean_profile(others, profiles[person].mass_kg))
    return laws


def mean_profile(profiles: Sequence[ImpedanceProfile], mass_kg: float) -> ImpedanceProfile:
    """Return the mean law of people for a body mass; it has no interval of its own.

    Stiffness and damping are geometric means per kg, angle and moment arithmetic ones; the
    equilibrium follows from these.
    """
    logs = {
        name: mass_kg * np.exp(np.mean([np.log(getattr(p, name) / p.mass_kg) for p in profiles], 0))
        for name in ("stiffness", "damping")
    }
    moment = mass_kg * np.mean([p.moment / p.mass_kg for p in profiles], axis=0)
    angle = np.mean([p.angle for p in profiles], axis=0)
    stride_s = float(np.mean([p.stride_s for p in profiles]))
    drive = moment + logs["damping"] * mean_velocity(angle, stride_s)
    equilibrium = angle + drive / logs["stiffness"]
    return replace(
        profiles[0], subject="mean of the others", mass_kg=mass_kg, stride_s=stride_s,
        angle=angle, moment=moment, equilibrium=equilibrium, **logs,
    )  # fmt: skip
