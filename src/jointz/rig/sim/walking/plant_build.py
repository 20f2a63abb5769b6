"""Packed constants of a plant, from a person, a preset and the person's instruments."""

from dataclasses import dataclass
from math import exp, pi, sqrt

import numpy as np

from jointz.core.errors import DataError
from jointz.rig.sim.people import Instruments, Person, draw_instruments, personal_preset
from jointz.rig.sim.presets import Preset
from jointz.rig.sim.walking.impedance_curves import frame_gravity, leg_of, packed_curves
from jointz.rig.sim.walking.known_addition import KnownAddition
from jointz.rig.sim.walking.layout import COMMANDS, HISTORY, INTEGRATED, Param, State

_LOWEST_PHYSICS_HZ = 5000.0


@dataclass(frozen=True, slots=True)
class Grid:
    """Samples and the steps of the physics between them.

    Parameters
    ----------
    sample_rate_hz : float
        Of all devices of the rig, Hz; its period is a whole number of nanoseconds.
    substeps : int
        Steps of the physics to a sample; 0: enough for 5 kHz.
    """

    sample_rate_hz: float = 500.0
    substeps: int = 0

    def __post_init__(self) -> None:
        if not self.sample_rate_hz > 0.0 or self.substeps < 0:
            raise DataError(
                "Grid: expected sample_rate_hz > 0 and substeps >= 0, got "
                f"{self.sample_rate_hz} and {self.substeps}."
            )
        if self.substeps == 0:
            needed = -int(-_LOWEST_PHYSICS_HZ // self.sample_rate_hz)
            object.__setattr__(self, "substeps", max(1, needed))

    @property
    def period_ns(self) -> int:
        """Sample period, ns."""
        return round(1e9 / self.sample_rate_hz)

    @property
    def period_s(self) -> float:
        """Sample period, s."""
        return self.period_ns * 1e-9

    @property
    def step_s(self) -> float:
        """Step of the physics, s."""
        return self.period_s / self.substeps


@dataclass(frozen=True, slots=True, eq=False)
class PlantBuild:
    """Everything constant about a plant."""

    person: Person
    preset: Preset
    instruments: Instruments
    grid: Grid
    worn: bool  # whether the exoskeleton is worn
    params: np.ndarray  # argument of :func:`jointz.rig.sim.walking.plant.advance`
    curves: np.ndarray  # argument of :func:`jointz.rig.sim.walking.plant.advance`
    load: KnownAddition | None = None  # known addition to the joint, part of params and curves


def build_plant(
    person: Person, preset: Preset, *, grid: Grid, worn: bool, load: KnownAddition | None = None
) -> PlantBuild:
    """Return the constants of a plant."""
    preset = personal_preset(person, preset)
    instruments = draw_instruments(person, preset)
    params = np.zeros(len(Param))
    params[Param.STEP_S], params[Param.PERIOD_S] = grid.step_s, grid.period_s
    params[Param.SAMPLE_RATE_HZ] = 1.0 / grid.period_s
    params[Param.SIGN_RATE] = 1.0 / preset.actuator.sign_velocity_rad_s
    _fill_joint(params, preset, grid)
    _fill_goniometer(params, preset, instruments, grid)
    if preset.body is not None:
        params[Param.LIMB_GRAVITY] = leg_of(person, preset.body).gravity_nm
    if load is not None:
        params[Param.LIMB_GRAVITY] += load.gravity_nm
        params[Param.ADDED_STIFFNESS] = load.stiffness
    if worn:
        _fill_actuator(params, preset, instruments, grid)
        _fill_exoskeleton(params, preset, instruments)
    params[Param.SUBSTEPS] = grid.substeps
    params[Param.ACTIVE] = _active(preset)
    longest = params[[Param.REFLEX_DELAY, Param.ANGLE_DELAY]].max()
    if longest >= HISTORY - 2 or params[Param.COMMAND_DELAY] >= (COMMANDS - 2) * grid.substeps:
        raise DataError(
            f"simulated rig: a delay is too long for {grid.sample_rate_hz:g} Hz with "
            f"{grid.substeps} substeps. Use fewer substeps or a shorter delay."
        )
    curves = packed_curves(person, preset, load)
    return PlantBuild(person, preset, instruments, grid, worn, params, curves, load)


def _fill_joint(params: np.ndarray, preset: Preset, grid: Grid) -> None:
    joint = preset.joint
    if joint.softening_rad is not None:
        params[Param.SOFTENING] = joint.softening_rad**-2
    if joint.reflex is not None:
        params[Param.REFLEX_GAIN] = joint.reflex.gain
        params[Param.REFLEX_DELAY] = round(joint.reflex.latency_s / grid.step_s)
        params[Param.REFLEX_RATE] = 1.0 / joint.reflex.twitch_s
        if joint.reflex.kind == "velocity":
            params[Param.REFLEX_SCALE] = joint.reflex.velocity_time_s
    params[Param.VOLUNTARY_KEEP], params[Param.VOLUNTARY_DRIVE] = _autoregression(
        joint.voluntary_sd_nm, joint.voluntary_time_s, grid
    )


def _fill_goniometer(
    params: np.ndarray, preset: Preset, instruments: Instruments, grid: Grid
) -> None:
    settings = preset.goniometer
    params[Param.ANGLE_DELAY] = round(settings.delay_s / grid.step_s)
    rest = instruments.angle_lag_s - settings.delay_s
    params[Param.ANGLE_LAG_RATE] = 1.0 / rest if rest > 0.0 else 0.0
    params[Param.ANGLE_GAIN] = instruments.angle_gain
    params[Param.TORSION] = settings.torsion_rad_nm
    params[Param.WHITE] = settings.white_sd_rad
    params[Param.COLOURED_KEEP], params[Param.COLOURED_DRIVE] = _autoregression(
        settings.coloured_sd_rad, settings.coloured_time_s, grid
    )
    params[Param.DRIFT_KEEP], params[Param.DRIFT_DRIVE] = _autoregression(
        settings.drift_sd_rad, settings.drift_time_s, grid
    )
    if settings.tissue_range_hz is not None:
        params[Param.TISSUE_RATE] = 2.0 * pi * instruments.tissue_hz
        params[Param.TISSUE_DAMPING] = settings.tissue_damping


def _fill_actuator(
    params: np.ndarray, preset: Preset, instruments: Instruments, grid: Grid
) -> None:
    settings = preset.actuator
    nominal = settings.gear_ratio * settings.torque_constant
    params[Param.TORQUE_PER_AMPERE] = nominal / instruments.torque_gain
    params[Param.AMPERE_PER_TORQUE] = 1.0 / nominal
    params[Param.CURRENT_MAX_A] = settings.current_max_a
    params[Param.COMMAND_DELAY] = round(settings.delay_s / grid.step_s)
    keep = exp(-grid.step_s / settings.time_constant_s)
    params[Param.CURRENT_KEEP], params[Param.CURRENT_KEEP_HALF] = keep, sqrt(keep)
    params[Param.COULOMB_FRICTION] = settings.coulomb_friction * instruments.friction_gain
    params[Param.GEAR_FRICTION] = settings.gear_friction * instruments.friction_gain
    params[Param.ANGLE_STEP] = settings.angle_step_rad
    params[Param.VELOCITY_STEP] = settings.velocity_step_rad_s
    params[Param.CURRENT_STEP] = settings.current_step_a
    params[Param.SUPPLY_V], params[Param.SUPPLY_OHM] = settings.supply_v, settings.supply_ohm
    params[Param.AMBIENT_C] = settings.ambient_c
    params[Param.HEATING_C_A2] = settings.heating_c_a2
    params[Param.THERMAL_KEEP] = exp(-grid.period_s / settings.thermal_s)
    params[Param.TEMPERATURE_MAX_C] = settings.temperature_max_c
    params[Param.TORQUE_ERROR_KEEP], params[Param.TORQUE_ERROR_DRIVE] = _autoregression(
        settings.torque_error_sd_nm, settings.torque_error_time_s, grid
    )


def _fill_exoskeleton(params: np.ndarray, preset: Preset, instruments: Instruments) -> None:
    params[Param.EXO_INERTIA] = preset.actuator.rotor_inertia
    body = preset.body
    if body is not None:
        params[Param.EXO_INERTIA] += body.frame_mass_kg * body.frame_distance_m**2
        params[Param.EXO_GRAVITY] = frame_gravity(body.frame_mass_kg, body.frame_distance_m)
        params[Param.STRAP_STIFFNESS] = instruments.strap_stiffness
        params[Param.STRAP_DAMPING] = instruments.strap_stiffness * body.strap_damping_time_s


def _active(preset: Preset) -> int:
    """Return how many of the first states have to be integrated."""
    if preset.body is not None:
        return INTEGRATED
    if preset.goniometer.tissue_range_hz is not None:
        return int(State.EXO_ANGLE)
    return int(State.TISSUE if preset.joint.reflex is not None else State.REFLEX)


def _autoregression(sd: float, time_s: float, grid: Grid) -> tuple[float, float]:
    """Return factor and drive, per sample, of an Ornstein-Uhlenbeck process."""
    keep = exp(-grid.period_s / time_s)
    return keep, sd * sqrt(1.0 - keep**2)
