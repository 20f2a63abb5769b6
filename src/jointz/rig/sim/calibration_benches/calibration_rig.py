"""Rig of a simulated person, device or bench in one step of a calibration.

Person and instruments are those of :mod:`jointz.rig.sim.rig` with the same number, seed and preset:
a calibration estimates the instruments with which walking is measured.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from math import cos, exp, log, pi, radians, sqrt
from typing import Any

import numpy as np

from jointz.core.clock import Clock
from jointz.core.errors import DataError
from jointz.core.protocols.protocol_models import CalibrationStep, LoadSpec
from jointz.core.study import CalibrationSpec, DeviceSpec
from jointz.rig.devices.interface import Devices, Wearer
from jointz.rig.sim.benches.bench_load import BenchLoad, draw_load
from jointz.rig.sim.benches.running_plant import Motion, RunningPlant
from jointz.rig.sim.calibration_benches.calibration_instruments import (
    OffsetSensor,
    VoltageFootswitch,
    draw_angle_zero,
    draw_contact_levels,
)
from jointz.rig.sim.descriptions import exoskeleton, footswitch, goniometer
from jointz.rig.sim.people import Person, draw_person
from jointz.rig.sim.presets import Preset
from jointz.rig.sim.presets import preset as preset_named
from jointz.rig.sim.rig import SimulatedRig
from jointz.rig.sim.simulated_devices import SimulatedActuator, Wiring
from jointz.rig.sim.walking.gait_motion import Stride, make_stride
from jointz.rig.sim.walking.impedance_curves import frame_gravity, leg_of
from jointz.rig.sim.walking.injection import Injection
from jointz.rig.sim.walking.layout import CURVE_PIECES, CURVES, HARMONICS, Param
from jointz.rig.sim.walking.plant_build import Grid, PlantBuild

# A held joint: 12 N*m turn it by 12 urad, a hundredth of what a goniometer on it shows.
_HELD_STIFFNESS, _HELD_DAMPING, _HELD_INERTIA = 1e6, 1400.0, 1.0
# Where the joint is, rad of flexion: far from the device's limits where it swings.
_STRAIGHT, _LOCKED, _MIDDLE, _SITTING = 0.0, 0.35, 0.9, 1.2
_HELD_POSTURES = {"zero": _STRAIGHT, "hinge": _MIDDLE, "torsion": _LOCKED}
_FIXTURE_INERTIA = 0.005  # kg*m^2, between spring and output
# A relaxed leg: passive stiffness (N*m/rad) and damping ratio, and how people differ.
_PASSIVE_STIFFNESS, _PASSIVE_RATIO, _PASSIVE_SPREAD = 4.0, 0.08, 0.2


@dataclass(frozen=True, slots=True)
class CalibratedBody:
    """The body that the actuator moves in one condition of a calibration."""

    stiffness: float  # N*m/rad, beyond the torque sensor; on a leg, beyond the strap
    damping: float  # N*m*s/rad, likewise
    inertia: float  # kg*m^2, likewise
    gravity_nm: float  # weight times distance of a hanging body; 0 for a held or lying one
    posture_rad: float  # joint angle about which the body moves
    # whether strap and goniometer are on the leg, with tissue and torsion; otherwise both are rigid
    on_leg: bool


def held_body(step: str) -> CalibratedBody:
    """Return a joint that is held still, or moved by hand whatever the torque."""
    posture, on_leg = _HELD_POSTURES[step], step != "hinge"
    return CalibratedBody(_HELD_STIFFNESS, _HELD_DAMPING, _HELD_INERTIA, 0.0, posture, on_leg)


def frame_body(preset: Preset) -> CalibratedBody:
    """Return the exoskeleton's frame, hanging alone; nothing where the preset gives it none."""
    body = preset.body
    if body is None:
        return CalibratedBody(0.0, 0.0, 0.0, 0.0, _MIDDLE, on_leg=False)
    inertia = body.frame_mass_kg * body.frame_distance_m**2
    gravity = frame_gravity(body.frame_mass_kg, body.frame_distance_m)
    return CalibratedBody(0.0, 0.0, inertia, gravity, _MIDDLE, on_leg=False)


def spring_body(preset: Preset, spring: BenchLoad) -> CalibratedBody:
    """Return a known spring on the frame, which lies so that gravity does not turn it."""
    inertia = frame_body(preset).inertia + _FIXTURE_INERTIA + spring.inertia
    return CalibratedBody(spring.stiffness, spring.damping, inertia, 0.0, _MIDDLE, on_leg=False)


def hanging_leg(person: Person, preset: Preset, weight: BenchLoad | None) -> CalibratedBody:
    """Return the relaxed leg that hangs, the thigh on a bench."""
    leg = leg_of(person, preset.body)
    inertia = person.inertia if preset.body is None else leg.inertia
    gravity = leg.gravity_nm * inertia / leg.inertia
    deviations = np.clip(person.stream("hanging leg").standard_normal(2), -3.0, 3.0).tolist()
    stiffness, ratio = (
        mean * exp(_PASSIVE_SPREAD * deviation)
        for mean, deviation in zip((_PASSIVE_STIFFNESS, _PASSIVE_RATIO), deviations, strict=True)
    )
    # The leg's own: what is strapped to it hangs on the same muscles.
    damping = 2.0 * ratio * sqrt((stiffness + gravity) * inertia)
    if weight is not None:
        inertia, gravity = inertia + weight.inertia, gravity + weight.stiffness
    return CalibratedBody(stiffness, damping, inertia, gravity, _SITTING, on_leg=True)


def draw_known_load(spec: LoadSpec, person: Person, preset: Preset) -> BenchLoad:
    """Return what is really mounted: the load stated, or one drawn within its sd.

    Every person has one of their own, as after every mounting.
    """
    seed = int(person.stream("known loads").integers(2**32))
    return draw_load(spec, seed=seed, spread=preset.name != "clean")


def calibrated_plant(build: PlantBuild, body: CalibratedBody) -> PlantBuild:
    """Return the plant of walking with another joint."""
    params = build.params.copy()
    params[Param.LIMB_GRAVITY] = body.gravity_nm
    for place in (Param.SOFTENING, Param.REFLEX_GAIN, Param.VOLUNTARY_DRIVE):
        params[place] = 0.0
    if not body.on_leg:
        # The frame is the body then; the rotor alone turns with the motor.
        params[Param.EXO_INERTIA] = build.preset.actuator.rotor_inertia
        for place in (Param.STRAP_STIFFNESS, Param.EXO_GRAVITY, Param.TISSUE_RATE, Param.TORSION):
            params[place] = 0.0
    curves = np.zeros((CURVE_PIECES, 4 * CURVES))
    # The thigh is so that what hangs, hangs; on what is held gravity has no effect.
    constants = (body.stiffness, body.damping, body.inertia, body.posture_rad, 0.0)
    curves[:, ::4] = constants
    return replace(build, params=params, curves=curves)


class CalibrationRig:
    """One person, or the device alone, in one step of a calibration."""

    def __init__(
        self, walking: SimulatedRig, step: CalibrationStep, loads: tuple[LoadSpec, ...] = ()
    ) -> None:
        person, preset = walking.person, walking.preset
        self.walking = walking
        self.step = step
        self.inject = Injection()
        self.loads: Mapping[str, BenchLoad] = {
            load.name: draw_known_load(load, person, preset) for load in loads
        }
        if step == "spring" and "spring" not in self.loads:
            raise DataError("calibration rig: expected the load 'spring'; state it under loads.")

    @property
    def wearer(self) -> Wearer:
        """The participant who wears the device, or for whose session it is calibrated."""
        return self.walking.wearer

    @property
    def calibration(self) -> CalibrationSpec:
        """The calibration before the experiment, as in walking."""
        return self.walking.calibration

    @property
    def device(self) -> DeviceSpec | None:
        """The frame on the shank, where one is worn."""
        return self.walking.device if self.step in ("leg", "footswitch") else None

    def notes(self) -> Mapping[str, Any]:
        """Return step, preset and grid."""
        return {**self.walking.notes(), "calibration": self.step}

    def open(self, condition: str, *, worn: bool, segment: int, clock: Clock) -> Devices:
        """Return the devices, ``UNCONFIGURED``, for one condition."""
        del worn
        person, preset = self.walking.person, self.walking.preset
        build, purpose = self.build(condition), f"calibration {self.step} {condition}"
        motion = self.motion(condition, segment)
        running = RunningPlant(build, motion, purpose=purpose, segment=segment)
        wiring = Wiring(running, clock, self.inject)
        switch = VoltageFootswitch(
            wiring,
            running,
            replace(footswitch(build), kind="voltage", unit="V"),
            levels=draw_contact_levels(person, preset),
            rng=person.stream(f"volts {purpose}", segment),
        )
        return Devices(
            angle=OffsetSensor(
                wiring, goniometer(build), offset_rad=draw_angle_zero(person, preset)
            ),
            contact=switch if self.step == "footswitch" else None,
            actuator=SimulatedActuator(wiring, exoskeleton(build)),
        )

    def build(self, condition: str) -> PlantBuild:
        """Return the constants of the plant."""
        build, body = self.walking.build(worn=True), self.body(condition)
        return build if body is None else calibrated_plant(build, body)

    def body(self, condition: str) -> CalibratedBody | None:
        """Return the body that the actuator moves; None for a person who walks."""
        person, preset = self.walking.person, self.walking.preset
        if self.step in _HELD_POSTURES:
            return held_body(self.step)
        if self.step == "frame":
            return frame_body(preset)
        if self.step == "spring":
            return spring_body(preset, self.loads["spring"])
        if self.step == "leg":
            return hanging_leg(person, preset, self.loads.get(condition))
        return None

    def motion(self, condition: str, segment: int) -> Motion:
        """Return the unperturbed path of one condition, from its beginning."""
        body, purpose = self.body(condition), f"calibration {self.step} {condition}"
        if body is None:
            return self.walking.motion(purpose, segment)
        if self.step == "hinge":
            return HandSwing(body.posture_rad, self.walking.person.stream(purpose, segment))
        return StillMotion(body.posture_rad)

    def bench_truth(self) -> dict[str, Any]:
        """Return the truth, ready for JSON, entries of a calibration under their own names."""
        person, preset = self.walking.person, self.walking.preset
        instruments = self.walking.build(worn=True).instruments
        leg, frame = hanging_leg(person, preset, None), frame_body(preset)
        contact = draw_contact_levels(person, preset)
        rotor = preset.actuator.rotor_inertia
        nominal = preset.actuator.gear_ratio * preset.actuator.torque_constant
        return {
            "step": self.step,
            "entries": {
                "angle_zero_rad": draw_angle_zero(person, preset),
                "angle_lag_s": instruments.angle_lag_s,
                "angle_gain": instruments.angle_gain,
                "angle_per_torque": preset.goniometer.torsion_rad_nm,
                "torque_gain": instruments.torque_gain,
                "friction_gain": instruments.friction_gain,
                "tissue_hz": instruments.tissue_hz,
                "intrinsic_inertia": frame.inertia,
                "intrinsic_damping": frame.damping,
                "intrinsic_stiffness": frame.gravity_nm,
            },
            "limb": {
                "inertia": leg.inertia,
                "damping": leg.damping,
                "stiffness": leg.stiffness,
                "gravity_stiffness": leg.gravity_nm,
            },
            "device": {
                "rotor_inertia": rotor,
                "inertia": rotor + frame.inertia,
                "limb_and_device_inertia": rotor + frame.inertia + leg.inertia,
                "torque_per_ampere": nominal / instruments.torque_gain,
                "coulomb_friction": preset.actuator.coulomb_friction * instruments.friction_gain,
                "gear_friction": preset.actuator.gear_friction * instruments.friction_gain,
                "strap_stiffness": instruments.strap_stiffness,
            },
            "contact": {"open_level_v": contact.open_v, "contact_level_v": contact.closed_v},
            "loads": {name: asdict(load) for name, load in self.loads.items()},
            "instruments": asdict(instruments),
        }


def calibration_rig(
    number: int,
    step: CalibrationStep,
    *,
    loads: tuple[LoadSpec, ...] = (),
    preset: str = "nominal",
    seed: int = 1,
    sample_rate_hz: float = 500.0,
) -> CalibrationRig:
    """Return the rig of one participant of the seeded population in one step."""
    walking = SimulatedRig(
        draw_person(number, seed=seed), preset_named(preset), grid=Grid(sample_rate_hz)
    )
    return CalibrationRig(walking, step, loads)


# By hand: from slow to fast and back, never twice the same.
_SLOWEST_HZ, _FASTEST_HZ = 0.5, 3.0
_SWEEP_S = 20.0
_FREQUENCY_SD, _SIZE_SD = 0.06, 0.1  # of log frequency; of the amplitude, share
_HALF_SWING_RAD = radians(20.0)
_SHAPE_SD = 0.04  # of the second harmonic, share of the amplitude
_LARGEST_DEVIATION = 2.5  # sd
_STILL_S = 1.0


class StillMotion:
    """A path that does not move."""

    def __init__(self, angle_rad: float) -> None:
        self._curve = np.zeros((2, HARMONICS))
        self._curve[0, 0] = angle_rad
        self._start_s = 0.0

    def next(self) -> Stride:
        """Return the next second of it."""
        durations = (_STILL_S, _STILL_S, _STILL_S)
        stride = make_stride(self._start_s, durations, (self._curve, self._curve))
        self._start_s += _STILL_S
        return stride


class HandSwing:
    """A hinge swung by hand about an angle: 0.5 to 3 Hz, about 40 degrees from end to end."""

    def __init__(self, centre_rad: float, rng: np.random.Generator) -> None:
        self._centre_rad, self._rng = centre_rad, rng
        self._start_s = 0.0
        self._durations = (1.0 / _SLOWEST_HZ, 1.0 / _SLOWEST_HZ, 1.0 / _SLOWEST_HZ)
        self._curve = self._new_curve()

    def next(self) -> Stride:
        """Return the next swing, there and back."""
        curve, following = self._curve, self._new_curve()
        stride = make_stride(self._start_s, self._durations, (curve, following))
        self._start_s = stride.end_s
        _, previous_s, duration_s = self._durations
        self._durations = previous_s, duration_s, self._duration_at(stride.end_s + duration_s)
        self._curve = following
        return stride

    def _duration_at(self, time_s: float) -> float:
        """Return how long a swing that begins then lasts, s."""
        middle, half = log(_SLOWEST_HZ * _FASTEST_HZ) / 2.0, log(_FASTEST_HZ / _SLOWEST_HZ) / 2.0
        slowly = middle - half * cos(2.0 * pi * time_s / _SWEEP_S)
        return exp(-slowly - _FREQUENCY_SD * self._drawn())

    def _new_curve(self) -> np.ndarray:
        """Return Fourier coefficients, (2, HARMONICS): cosines and sines, rad."""
        size = _HALF_SWING_RAD * (1.0 + _SIZE_SD * self._drawn())
        curve = np.zeros((2, HARMONICS))
        curve[0, 0], curve[0, 1] = self._centre_rad, -size
        curve[:, 2] = _SHAPE_SD * size * np.array([self._drawn(), self._drawn()])
        return curve

    def _drawn(self) -> float:
        normal = float(self._rng.standard_normal())
        return min(max(normal, -_LARGEST_DEVIATION), _LARGEST_DEVIATION)
