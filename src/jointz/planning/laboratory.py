"""A lab before an experiment: people, sensors, actuator, calibration, walking."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import radians

from jointz.core.priors import PriorsSpec
from jointz.core.study import CalibrationSpec, ParticipantSpec, TorqueModelSpec
from jointz.identify.preparation.raw_signals import ENCODER, JOINT_VELOCITY
from jointz.identify.walking.body import Body, body_of
from jointz.identify.walking.coupling import STRAP, Coupling
from jointz.identify.walking.decisions import Decision
from jointz.identify.walking.instruments import calibrated_lag, instrument_priors
from jointz.identify.walking.prior import LegPriors
from jointz.identify.walking.responses import GONIOMETER, twist_sd_of
from jointz.planning.unperturbed_walking import PointWalking, with_channels

#: Name of a sensor of the joint's motion -> its channel, and white noise of a usual one, rad or
#: rad/s: a strain-gauge goniometer, a 14-bit encoder, two gyroscopes of .5 deg/s each.
SENSORS: Mapping[str, tuple[str, float]] = {
    "goniometer": (GONIOMETER, radians(0.3)),
    "encoder": (ENCODER, radians(0.017)),
    "gyroscopes": (JOINT_VELOCITY, radians(0.7)),
}


@dataclass(frozen=True, slots=True)
class Actuator:
    """How torque follows its command, and its limit."""

    torque_nm: float
    delay_s: float = 0.006
    time_constant_s: float = 0.012


@dataclass(frozen=True, slots=True)
class Laboratory:
    """People, sensors and device before the experiment."""

    people: tuple[ParticipantSpec, ...]
    walking: tuple[Mapping[str, PointWalking], ...]  # of one or more people; they take turns
    noise: Mapping[str, float]  # sensor -> white noise of its channel; sensors that are there
    actuator: Actuator
    calibration: CalibrationSpec = field(default_factory=CalibrationSpec)
    torque_model: TorqueModelSpec | None = None
    priors: PriorsSpec = field(default_factory=PriorsSpec)
    joint: str = "knee"
    coupling: Coupling = STRAP

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels of the sensors, goniometer first."""
        return tuple(SENSORS[name][0] for name in SENSORS if name in self.noise)

    def with_sensors(self, sensors: Mapping[str, float | None]) -> "Laboratory":
        """Return the same lab with other sensors, each with its noise, None for a usual one."""
        usual = {name: self.noise.get(name, SENSORS[name][1]) for name in sensors}
        noise = {name: usual[name] if sd is None else sd for name, sd in sensors.items()}
        by_channel = {SENSORS[name][0]: noise[name] for name in SENSORS if name in noise}
        walking = tuple(
            {point: with_channels(at, by_channel) for point, at in person.items()}
            for person in self.walking
        )
        return replace(self, noise=noise, walking=walking)

    def body(self, person: int) -> Body:
        """Return the priors of a person's leg."""
        who, spec = self.people[person % len(self.people)], self.coupling.spec(self.priors)
        return body_of(who, self.joint, spec, of_body=self.coupling.is_strap)

    def walking_of(self, person: int) -> Mapping[str, PointWalking]:
        """Return the walking for a person; with fewer walkers than people, walkers take turns."""
        return self.walking[person % len(self.walking)]

    def leg_priors(self, person: int) -> LegPriors:
        """Return the estimator's priors of a person with these instruments."""
        friction = 0.0 if self.torque_model is None else self.torque_model.coulomb_friction
        return LegPriors(
            self.coupling.spec(self.priors),
            self.body(person),
            instrument_priors(self.calibration, abs(friction), self.channels[1:]),
            calibrated_lag(self.calibration),
            self.coupling,
        )

    @property
    def twist_sd(self) -> float:
        """SD of the measured angle per torque, rad/(N*m)."""
        return twist_sd_of(self.calibration, self.coupling)

    @property
    def decision(self) -> Decision:
        """Settings that determine whether a value is decided."""
        return Decision(
            known=self.calibration,
            mass_kg=None,
            subtract=("inertia",),
            several_sensors=len(self.channels) > 1,
            by_person=self.coupling.is_strap,
        )
