"""A seeded population of people, and the instruments that each of them is measured with."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import exp, log, pi, sqrt
from typing import Literal
from zlib import crc32

import numpy as np

from jointz.core.gait_phases import TIMING_POINTS
from jointz.rig.sim.presets import PersonalSettings, Preset, ReflexSettings
from jointz.rig.sim.sensors.sensor_settings import Range

#: Means over people at the six timing points, N*m/rad/kg and N*m*s/rad/kg: near tables 4.1, 4.2.
MEAN_STIFFNESS_PER_MASS = (2.0, 0.65, 1.15, 1.15, 0.32, 0.38)
MEAN_DAMPING_PER_MASS = (0.035, 0.040, 0.050, 0.030, 0.036, 0.027)
INERTIA_RANGE = (0.03, 0.07)  # kg*m^2, assumed
_SPREAD_OVER_PEOPLE = 0.25
_LARGEST_ERROR = 3.0  # sd


@dataclass(frozen=True, slots=True)
class Person:
    """A simulated person and the truth about the knee."""

    number: int  # index in the population, from 0
    seed: int  # seed of the population
    mass_kg: float
    height_m: float
    stride_time_s: float  # mean duration of a stride at 1.2 m/s
    stiffness_per_mass: Mapping[str, float]  # timing point -> N*m/rad/kg
    damping_per_mass: Mapping[str, float]  # timing point -> N*m*s/rad/kg
    inertia: float  # kg*m^2: joint, limb and frame together; not used by presets with a body

    @property
    def id(self) -> str:
        """Name in the study."""
        return f"S{self.number + 1:02d}"

    @property
    def sex(self) -> Literal["female", "male"]:
        """Sex, which sets the proportions of the leg by de Leva's table."""
        # An own stream: all else about a person stays the same.
        return "female" if self.stream("sex").random() < 0.5 else "male"

    def stream(self, purpose: str, number: int = 0) -> np.random.Generator:
        """Return the random numbers of one purpose; nothing else draws from them."""
        return np.random.default_rng([self.seed, self.number, crc32(purpose.encode()), number])


def draw_person(number: int, *, seed: int) -> Person:
    """Draw a person: impedances spread by 25 % (log-normal) about means of able-bodied adults.

    Parameters
    ----------
    number : int
        Place in the population, from 0; does not depend on how many are drawn.
    seed : int
        Of the population.

    Returns
    -------
    Person
        The person.

    Examples
    --------
    >>> draw_person(3, seed=1).id
    'S04'
    """
    rng = np.random.default_rng([seed, number])
    sigma = sqrt(log(1.0 + _SPREAD_OVER_PEOPLE**2))

    def around(means: tuple[float, ...]) -> dict[str, float]:
        factors = [exp(sigma * rng.standard_normal() - sigma**2 / 2.0) for _ in means]
        return {
            point: mean * factor
            for point, mean, factor in zip(TIMING_POINTS, means, factors, strict=True)
        }

    return Person(
        number=number,
        seed=seed,
        mass_kg=_within(rng, 73.0, 10.0, low=52.0, high=100.0),
        height_m=_within(rng, 1.74, 0.08, low=1.55, high=1.95),
        stride_time_s=_within(rng, 1.10, 0.05, low=1.0, high=1.2),
        stiffness_per_mass=around(MEAN_STIFFNESS_PER_MASS),
        damping_per_mass=around(MEAN_DAMPING_PER_MASS),
        inertia=float(rng.uniform(*INERTIA_RANGE)),
    )


def personal_preset(person: Person, preset: Preset) -> Preset:
    """Return the preset with the person's own values of the settings that differ between people.

    A preset without ``personal`` ranges is returned as it is.
    """
    ranges = preset.personal
    if ranges is None:
        return preset
    softening = _drawn_log(person, "softening", ranges.softening_range_rad)
    shape = _drawn_log(person, "shape of strides", ranges.shape_sd_range_rad)
    joint = replace(
        preset.joint,
        stiffness_change=_drawn(person, "change of stiffness", ranges.change_range),
        damping_change=_drawn(person, "change of damping", ranges.change_range),
        softening_rad=softening,
        reflex=_personal_reflex(person, ranges),
    )
    tissue_hz = _drawn(person, "tissue", ranges.tissue_range_hz)
    goniometer = replace(
        preset.goniometer,
        tissue_range_hz=(tissue_hz, tissue_hz),
        tissue_damping=_drawn(person, "tissue damping", ranges.tissue_damping_range),
    )
    return replace(
        _with_personal_strap(person, preset, ranges),
        gait=replace(preset.gait, shape_sd_rad=shape),
        joint=joint,
        goniometer=goniometer,
        personal=None,
    )


def _personal_reflex(person: Person, ranges: PersonalSettings) -> ReflexSettings:
    return ReflexSettings(
        gain=_drawn(person, "reflex gain", ranges.reflex_gain_range),
        latency_s=_drawn(person, "reflex latency", ranges.reflex_latency_range_s),
        twitch_s=_drawn(person, "reflex twitch", ranges.reflex_twitch_range_s),
    )


def _with_personal_strap(person: Person, preset: Preset, ranges: PersonalSettings) -> Preset:
    """Return the preset with the strap whose resonance with frame and rotor is the person's."""
    body = preset.body
    if body is None:
        return preset
    inertia = preset.actuator.rotor_inertia + body.frame_mass_kg * body.frame_distance_m**2
    rate = 2.0 * pi * _drawn(person, "strap", ranges.strap_range_hz)
    damping = _drawn(person, "strap damping", ranges.strap_damping_range)
    stiffness = inertia * rate**2
    strap = replace(
        body,
        strap_range_nm_rad=(stiffness, stiffness),
        strap_damping_time_s=2.0 * damping / rate,
    )
    return replace(preset, body=strap)


def _share(person: Person, purpose: str) -> float:
    return float(person.stream(f"personal {purpose}").random())


def _drawn(person: Person, purpose: str, limits: Range) -> float:
    return limits[0] + _share(person, purpose) * (limits[1] - limits[0])


def _drawn_log(person: Person, purpose: str, limits: Range) -> float:
    low, high = limits
    return float(low * (high / low) ** _share(person, purpose))


@dataclass(frozen=True, slots=True)
class Instruments:
    """True properties of one person's instruments; the same in all conditions."""

    torque_gain: float  # measured over true torque
    angle_gain: float  # measured over true angle
    friction_gain: float  # true over stated friction
    angle_lag_s: float  # s: total lag of the goniometer behind the joint, without tissue
    strap_stiffness: float  # N*m/rad: stiffness between frame and leg; 0: rigid strap
    tissue_hz: float  # Hz: resonance of the tissue between joint and goniometer; 0: rigid tissue
    moment_gain: float = 1.0  # measured over true internal moment


def draw_instruments(person: Person, preset: Preset) -> Instruments:
    """Draw the errors of a person's instruments."""
    preset = personal_preset(person, preset)
    rng = person.stream("instruments")
    deviations = np.clip(rng.standard_normal(3), -_LARGEST_ERROR, _LARGEST_ERROR).tolist()
    shares = rng.random(3).tolist()
    body, goniometer = preset.body, preset.goniometer
    tissue, gain_error = goniometer.tissue_range_hz, goniometer.gain_error
    if gain_error is None:
        gain_error = goniometer.gain_error_sd * deviations[1]

    def between(limits: Range, share: float) -> float:
        return limits[0] + share * (limits[1] - limits[0])

    return Instruments(
        torque_gain=1.0 + preset.actuator.gain_error_sd * deviations[0],
        angle_gain=1.0 + gain_error,
        friction_gain=1.0 + preset.actuator.friction_error_sd * deviations[2],
        angle_lag_s=between(goniometer.lag_range_s, shares[0]),
        strap_stiffness=between(body.strap_range_nm_rad, shares[1]) if body else 0.0,
        tissue_hz=between(tissue, shares[2]) if tissue else 0.0,
        moment_gain=_moment_gain(person, preset.moment.gain_error_sd),
    )


def _moment_gain(person: Person, error_sd: float) -> float:
    # An own stream: the other instruments of a person stay the same.
    deviation = float(person.stream("moment instruments").standard_normal())
    return 1.0 + error_sd * within_errors(deviation)


def within_errors(deviation: float) -> float:
    """Return a standard normal number, cut off where no instrument is so wrong."""
    return min(max(deviation, -_LARGEST_ERROR), _LARGEST_ERROR)


def _within(rng: np.random.Generator, mean: float, sd: float, *, low: float, high: float) -> float:
    while not low <= (value := float(rng.normal(mean, sd))) <= high:
        pass
    return value
