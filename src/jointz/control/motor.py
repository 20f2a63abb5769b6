"""Motors: limits, files, and current, voltage and energy with a gear."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from pydantic import Field

from jointz.core.checked_model import Check, CheckedModel, Problem
from jointz.core.study import TorqueModelSpec
from jointz.io.toml_problems import read_device_model
from jointz.reference.chapter3 import TORQUE_MODELS

#: Gear ratios that are tried.
RATIOS: Final = np.arange(1.0, 201.0)
#: Limits, in the order of :attr:`GearTable.load`.
LIMITS: Final = ("peak current", "continuous current", "supply voltage")
_NOT_NEGATIVE = ("viscous_friction", "coulomb_friction", "gear_friction", "rotor_inertia")


class Motor(CheckedModel):
    """A motor with its limits.

    Parameters
    ----------
    resistance_ohm : float, ohm
        Winding resistance: resistance times squared current is the heat.
    supply_v : float, V
        Supply voltage.
    peak_current_a, continuous_current_a : float, A
        Limits of the current and of its RMS.
    torque_model : TorqueModelSpec
        As ``[torque_model]`` of a study, at the gear ratio that it states.
    source : str
        Where the values come from.
    """

    resistance_ohm: float = Field(gt=0)
    supply_v: float = Field(gt=0)
    peak_current_a: float = Field(gt=0)
    continuous_current_a: float = Field(gt=0)
    torque_model: TorqueModelSpec
    source: str = ""

    def checks(self) -> tuple[Check, ...]:
        """Return the checks of relations between fields."""
        return self._signs, self._gear_friction, self._currents

    def _signs(self) -> Iterator[Problem]:
        if self.torque_model.torque_constant <= 0.0:
            yield Problem(("torque_model", "torque_constant"), "expected a number > 0")
        for name in _NOT_NEGATIVE:
            if getattr(self.torque_model, name) < 0.0:
                yield Problem(("torque_model", name), "expected a number >= 0")

    def _gear_friction(self) -> Iterator[Problem]:
        model = self.torque_model
        if model.gear_friction >= model.torque_per_ampere > 0.0:
            text = f"expected less than gear_ratio * torque_constant, {model.torque_per_ampere:g}"
            yield Problem(("torque_model", "gear_friction"), text)

    def _currents(self) -> Iterator[Problem]:
        if self.continuous_current_a > self.peak_current_a:
            text = f"expected at most peak_current_a, {self.peak_current_a:g}"
            yield Problem(("continuous_current_a",), text)


def built_in_motor() -> Motor:
    """Return the quasi-direct drive of chapter III; its limits are not printed there."""
    model = {name: printed.value for name, printed in TORQUE_MODELS["3.3"].items()}
    del model["bias"]  # of the torque sensor
    return Motor(
        resistance_ohm=0.2,
        supply_v=36.0,
        peak_current_a=25.0,
        continuous_current_a=8.0,
        torque_model=TorqueModelSpec(**model),
        source="torque model: dissertation, table 3.1, model 3.3; resistance, supply and current "
        "limits: assumed",
    )


def read_motor(file: str | os.PathLike[str]) -> Motor:
    """Read a motor file.

    Parameters
    ----------
    file : path
        TOML with the fields of :class:`Motor`.

    Returns
    -------
    Motor
        The motor.

    Raises
    ------
    DataError
        With all problems of the file.
    """
    where = os.fspath(file)
    absent = f"{where}: no such file. Give a motor file (TOML)."
    return read_device_model(where, Motor, absent=absent)


@dataclass(frozen=True, slots=True)
class GearTable:
    """Load of a motor by gear ratio."""

    peak_current: np.ndarray  # (m,) A
    rms_current: np.ndarray  # (m,) A
    peak_voltage: np.ndarray  # (m,) V
    energy: np.ndarray  # (m,) J a stride, from the supply
    load: np.ndarray  # (3, m) parts of the limits that are used


def gear_table(
    motor: Motor,
    ratios: np.ndarray,
    motion: tuple[np.ndarray, np.ndarray, np.ndarray],
    *,
    step_s: float,
    efficiency: float,
) -> GearTable:
    """Return the load of a motor that gives a torque along a motion of the joint.

    ``motion`` holds torque, velocity and acceleration of the joint, (n,) each, ``step_s`` apart.
    """
    model = motor.torque_model
    stated, constant = model.gear_ratio, model.torque_constant
    torque, velocity, acceleration = motion
    gear = ratios[:, None]
    speed = gear * velocity  # of the motor, as all that follows
    way = np.sign(speed)
    inertia, viscous = model.rotor_inertia / stated**2, model.viscous_friction / stated**2
    drive = torque / gear + inertia * gear * acceleration + viscous * speed
    drive = drive + model.coulomb_friction / stated * way
    # Gear friction opposes motion: it costs current where the motor drives, and saves it where
    # the joint does.
    current = drive / (constant - model.gear_friction / stated * way * np.sign(drive))
    voltage = motor.resistance_ohm * current + constant * speed
    power = voltage * current
    peak, rms = np.abs(current).max(axis=1), np.sqrt(np.mean(current**2, axis=1))
    highest = np.abs(voltage).max(axis=1)
    energy = step_s * (np.maximum(power, 0.0) + efficiency * np.minimum(power, 0.0)).sum(axis=1)
    limits = np.array([[motor.peak_current_a], [motor.continuous_current_a], [motor.supply_v]])
    return GearTable(peak, rms, highest, energy, np.stack([peak, rms, highest]) / limits)
