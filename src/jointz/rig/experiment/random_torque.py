"""Continuous random torque of a walking condition, as a controller without parameters."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from jointz.core.protocols.reference_signal_models import Noise
from jointz.rig.experiment.bench.reference_signals import endless_noise
from jointz.rig.experiment.controllers import ControlParameter, ControlState


class RandomTorque:
    """Gives the next sample of a noise in every tick, whatever the wearer does."""

    parameters: ClassVar[Mapping[str, ControlParameter]] = {}

    def __init__(self, noise: Noise, *, rate_hz: float, rng: np.random.Generator) -> None:
        self._noise = noise
        self._samples = endless_noise(noise, rate_hz=rate_hz, rng=rng)
        self._next = next(self._samples)  # the filter is made now, not in a tick

    def torque(self, state: ControlState, values: Mapping[str, float]) -> float:
        """Return the torque, N*m."""
        del state, values
        torque_nm, self._next = self._next, next(self._samples)
        return torque_nm

    def describe(self) -> Mapping[str, Any]:
        """Return the reference."""
        return {"torque_nm": self._noise.model_dump(mode="json")}
