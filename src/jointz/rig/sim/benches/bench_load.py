"""Known loads of a simulated bench."""

from dataclasses import dataclass
from zlib import crc32

import numpy as np

from jointz.core.protocols.protocol_models import LoadSpec
from jointz.core.study import Calibrated


@dataclass(frozen=True, slots=True)
class BenchLoad:
    """A known load."""

    name: str  # name in the protocol
    stiffness: float = 0.0  # N*m/rad: stiffness of the spring, with its rest at the angle 0
    damping: float = 0.0  # N*m*s/rad: damping of the damper
    inertia: float = 0.0  # kg*m^2: inertia of the mass about the output
    locked: bool = False  # whether the output is held; then the other fields have no effect


def draw_load(spec: LoadSpec, *, seed: int, spread: bool) -> BenchLoad:
    """Return the load that really hangs there: the one stated, or one drawn within its sd.

    Two loads that state the same spring have the same spring.
    """
    parts = {
        part: draw_value(spec, part, seed=seed, spread=spread)
        for part in ("stiffness", "damping", "inertia")
    }
    return BenchLoad(name=spec.name, **parts, locked=spec.locked)


def draw_value(spec: LoadSpec, part: str, *, seed: int, spread: bool) -> float:
    """Return the true value of a property of a load; 0 where it has none."""
    entry: Calibrated | None = getattr(spec, part)
    if entry is None:
        return 0.0
    if not spread:
        return entry.value
    key = crc32(f"{part} {entry.value!r} {entry.sd!r}".encode())
    error = np.random.default_rng([seed, key]).standard_normal()
    return max(0.0, entry.value + entry.sd * float(error))
