"""Actuators: figures that limit what they can render, built in or from a TOML file."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from jointz.core.checked_model import CheckedModel
from jointz.io.toml_problems import read_device_model
from jointz.reference import chapter2, chapter3

_Positive = Annotated[float, Field(gt=0.0)]
_NotNegative = Annotated[float, Field(ge=0.0)]


@dataclass(frozen=True, slots=True)
class Actuator:
    """A torque-controlled actuator, as seen from its output.

    Parameters
    ----------
    name, source : str
        What it is; where the figures come from, and which are assumed.
    torque_nm : float, N*m
        Peak torque.
    delay_s, time_constant_s : float, s
        Pure delay and first-order lag of the torque behind its command.
    control_hz : float, Hz
        Rate at which the command is computed and held.
    inertia : float, kg*m^2
        Reflected inertia at the output.
    viscous : float, N*m*s/rad
        Viscous friction at the output.
    coulomb_nm : float, N*m
        Coulomb friction at the output.
    """

    name: str
    source: str
    torque_nm: float
    delay_s: float
    time_constant_s: float
    control_hz: float
    inertia: float
    viscous: float
    coulomb_nm: float

    @property
    def loop_delay_s(self) -> float:
        """Delay with the mean delay of a held command, half a control period, s."""
        return self.delay_s + 0.5 / self.control_hz

    def response(self, rad_s: ArrayLike) -> np.ndarray:
        """Return torque over commanded torque at angular frequencies, complex."""
        s = 1j * np.asarray(rad_s, dtype=float)
        return np.asarray(np.exp(-s * self.loop_delay_s) / (1.0 + s * self.time_constant_s))


class ActuatorFile(CheckedModel):
    """Keys of the TOML file of an actuator."""

    name: Annotated[str, Field(min_length=1)]
    source: Annotated[str, Field(min_length=1)]
    torque_nm: _Positive
    delay_s: Annotated[float, Field(ge=0.0, le=0.5)]
    time_constant_s: Annotated[float, Field(ge=0.0, le=0.5)]
    control_hz: Annotated[float, Field(ge=10.0, le=100_000.0)]
    inertia: _NotNegative
    viscous: _NotNegative
    coulomb_nm: _NotNegative


def read_actuator(name_or_file: str) -> Actuator:
    """Return a built-in actuator, or that of a TOML file.

    Parameters
    ----------
    name_or_file : str
        ``qdd``, ``sea``, or the path of a TOML file with every field of :class:`Actuator`.

    Returns
    -------
    Actuator
        The actuator.

    Raises
    ------
    DataError
        If there is no such file, or a key is missing, unknown or out of range; the message has
        all problems.
    """
    if name_or_file in BUILT_IN:
        return BUILT_IN[name_or_file]
    absent = (
        f"{name_or_file}: expected {' or '.join(BUILT_IN)}, or a TOML file with "
        f"{', '.join(ActuatorFile.model_fields)}; there is no such file."
    )
    return Actuator(**read_device_model(name_or_file, ActuatorFile, absent=absent).model_dump())


# --- built-in ------------------------------------------------------------------------------------


def _quasi_direct_drive() -> Actuator:
    printed = chapter3.TORQUE_MODELS["3.3"]
    per_ampere = printed["gear_ratio"].value * printed["torque_constant"].value
    return Actuator(
        name="qdd",
        source="quasi-direct drive, dissertation, chapter III, model 3.3 (gear 9, 0.11 N*m/A, "
        "Coulomb friction without that of the current, inertia). Assumed, since nothing is "
        "printed: 6 ms delay, 12 ms time constant, 30 A (as in the simulated rig), 500 Hz; "
        "no viscous friction, as the model has none.",
        torque_nm=per_ampere * 30.0,
        delay_s=0.006,
        time_constant_s=0.012,
        control_hz=500.0,
        inertia=printed["rotor_inertia"].value,
        viscous=0.0,
        coulomb_nm=printed["coulomb_friction"].value,
    )


def _series_elastic() -> Actuator:
    return Actuator(
        name="sea",
        source="series-elastic, dissertation, 2.3.1 (bandwidth 17.2 Hz at 40 N*m, taken as first "
        "order; intrinsic damping and inertia). Assumed: torque of the test as the largest, "
        "1 kHz (its sample rate), a delay of one period, no Coulomb friction. The intrinsic "
        "stiffness of 0.39 N*m/rad is left out.",
        torque_nm=40.0,
        delay_s=0.001,
        time_constant_s=1.0 / (2.0 * pi * chapter2.BANDWIDTH_40_NM.value),
        control_hz=1000.0,
        inertia=chapter2.INTRINSIC_INERTIA.value,
        viscous=chapter2.INTRINSIC_DAMPING.value,
        coulomb_nm=0.0,
    )


BUILT_IN: Mapping[str, Actuator] = {"qdd": _quasi_direct_drive(), "sea": _series_elastic()}
