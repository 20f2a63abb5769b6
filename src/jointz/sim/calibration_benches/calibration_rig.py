"""A simulated person, device or bench in one step of a calibration, as an experiment gets it.

Person and instruments are those of :mod:`jointz.sim.rig` with the same number, seed and preset:
what a calibration finds is what walking is measured with.
"""

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

from jointz.core.clock import Clock
from jointz.core.errors import DataError
from jointz.core.protocols.protocol import CalibrationStep, LoadSpec
from jointz.core.study import CalibrationSpec, DeviceSpec
from jointz.devices.interface import Devices, SensorDescription, Wearer
from jointz.sim.benches.bench_load import BenchLoad
from jointz.sim.benches.running_plant import Motion, RunningPlant
from jointz.sim.calibration_benches.calibration_instruments import (
    OffsetSensor,
    VoltageFootswitch,
    draw_angle_zero,
    draw_contact_levels,
)
from jointz.sim.calibration_benches.calibration_motion import HandSwing, StillMotion
from jointz.sim.calibration_benches.calibration_plant import (
    CalibratedBody,
    calibrated_plant,
    draw_known_load,
    frame_body,
    hanging_leg,
    held_body,
    spring_body,
)
from jointz.sim.descriptions import exoskeleton, footswitch, goniometer
from jointz.sim.injection import Injection
from jointz.sim.people import draw_person
from jointz.sim.plant_build import Grid, PlantBuild
from jointz.sim.presets import preset as preset_named
from jointz.sim.rig import SimulatedRig
from jointz.sim.simulated_devices import SimulatedActuator, Wiring

_HELD = ("zero", "hinge", "torsion")


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
            _in_volts(footswitch(build)),
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
        """Return what the actuator moves; None for a person who walks."""
        person, preset = self.walking.person, self.walking.preset
        if self.step in _HELD:
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


def _in_volts(switch: SensorDescription) -> SensorDescription:
    return replace(switch, kind="voltage", unit="V")
