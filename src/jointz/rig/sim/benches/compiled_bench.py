"""Compiled physics of a bench, sample by sample."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import fields
from enum import IntEnum
from math import nan
from typing import Any, ClassVar

import numpy as np

from jointz.core.errors import DataError
from jointz.rig.sim.sensors.sampled_time import Sample

_NOISE_ROWS = 4096
_RATES_HZ = (100.0, 20_000.0)
#: Sample times deviate by at most so much of a period: they stay in order.
JITTER_MAX = 0.45


class CompiledBench(ABC):
    """A bench from its start on; a subclass gives it constants and the compiled step."""

    STEP: ClassVar[Callable[..., Any]]  # advances parameters and state by one sample
    NOISES: ClassVar[int]  # standard normal numbers that a sample needs

    def __init__(self, params: np.ndarray, state_size: int, noise: np.random.Generator) -> None:
        self._params, self._rng = params, noise
        self._noise = np.zeros((_NOISE_ROWS, self.NOISES))
        self._state = np.zeros(state_size)
        self._left = 0

    def advance(self, torque_nm: float, angle_rad: float) -> tuple[float, ...]:
        """Compute what is measured at the next sample; the first is the state at rest."""
        if self._left == 0:
            self._draw()
            self._left = _NOISE_ROWS
        self._left -= 1
        row: tuple[float, ...] = self.STEP(
            self._params, self._state, self._noise, torque_nm, angle_rad
        )
        return row

    @abstractmethod
    def sample(self, torque_nm: float, angle_rad: float) -> Sample:
        """Compute the next sample as the devices give it."""

    def _compile(self) -> None:
        """Take a step without effect: the first one compiles, or loads the compiled code."""
        self.STEP(self._params, self._state.copy(), self._noise, 0.0, nan)

    def _draw(self) -> None:
        self._rng.standard_normal(out=self._noise)


def packed(places: type[IntEnum], derived: Mapping[Any, float], *parts: Any) -> np.ndarray:
    """Return constants in the order in which the compiled physics takes them.

    A place without a derived value holds the field of that name of one of the parts.
    """
    stated = {f.name.upper(): getattr(part, f.name) for part in parts for f in fields(part)}
    values = (derived[at] if at in derived else stated[at.name] for at in places)
    return np.array([*values], dtype=float)


def check_rate(bench: str, sample_rate_hz: float) -> None:
    """Refuse a sample rate that no device's own loop has."""
    low, high = _RATES_HZ
    if not low <= sample_rate_hz <= high:
        raise DataError(
            f"{bench} bench: expected sample_rate_hz in {low:.0f}..{high:.0f} Hz, got "
            f"{sample_rate_hz:g}. Choose the rate of the device's own loop."
        )
