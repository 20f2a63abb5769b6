"""Priors of the method ``strapped``: what is assumed of a leg and a device before any data."""

from pydantic import BaseModel, Field

from jointz.core.checked_model import STRICT


class _Prior(BaseModel):
    model_config = STRICT


class LogPrior(_Prior):
    """A positive quantity whose logarithm is normal."""

    median: float = Field(gt=0)
    log_sd: float = Field(ge=1e-4, le=5)


class SharePrior(_Prior):
    """A quantity between 0 and 1 whose logit is normal."""

    median: float = Field(gt=0, lt=1)
    logit_sd: float = Field(ge=1e-4, le=5)


class NormalPrior(_Prior):
    """A normal quantity."""

    mean: float = Field(ge=-5, le=5)
    sd: float = Field(ge=1e-4, le=10)


AnyPrior = LogPrior | SharePrior | NormalPrior


class Spread(_Prior):
    """A normal deviation about zero."""

    sd: float = Field(ge=1e-4, le=10)


def spread_of(prior: AnyPrior | Spread) -> float:
    """Return the sd of the transformed quantity."""
    if isinstance(prior, LogPrior):
        return prior.log_sd
    return prior.logit_sd if isinstance(prior, SharePrior) else prior.sd


def _log(median: float, log_sd: float, source: str) -> LogPrior:
    prior: LogPrior = Field(LogPrior(median=median, log_sd=log_sd), description=source)
    return prior


def _share(median: float, logit_sd: float, source: str) -> SharePrior:
    prior: SharePrior = Field(SharePrior(median=median, logit_sd=logit_sd), description=source)
    return prior


def _normal(mean: float, sd: float, source: str) -> NormalPrior:
    prior: NormalPrior = Field(NormalPrior(mean=mean, sd=sd), description=source)
    return prior


def _spread(sd: float, source: str) -> Spread:
    prior: Spread = Field(Spread(sd=sd), description=source)
    return prior


class PriorsSpec(_Prior):
    """``[priors]`` of a study: every entry replaces one default; SI, angles in rad.

    The description of each field is its source. Spreads "over the cycle" are those of a curve of
    K or B over the gait cycle, beside the person's level.
    """

    stiffness_per_mass: LogPrior = _log(
        1.0, 0.6, "N*m/rad/kg, level of a person: knees in walking, 0.3 to 3"
    )
    stiffness_unknown_body: LogPrior = _log(70.0, 1.0, "N*m/rad: without mass, or another joint")
    stiffness_over_cycle: Spread = _spread(0.6, "of its logarithm: 29 % in 0.1 s")
    damping: LogPrior = _log(2.5, 0.6, "N*m*s/rad, level of a person: knees, 0.7 to 8")
    damping_over_cycle: Spread = _spread(0.5, "of its logarithm")
    inertia_over_body: LogPrior = _log(
        1.0, 0.45, "of 0.65 of shank and foot (de Leva 1996) and 0.02 kg*m^2 of a device"
    )
    inertia_unknown_body: LogPrior = _log(0.2, 1.0, "kg*m^2: without mass and height")
    inertia_of_point: Spread = _spread(
        0.45, "of its logarithm: a leg with a free hip differs three-fold over the cycle"
    )
    device_share: LogPrior = _log(0.17, 0.4, "of the inertia: frame, cuff and calf, 0.08 to 0.38")
    strap_hz: LogPrior = _log(20.0, 0.45, "Hz: strap and tissue with the device, 8 to 49")
    strap_damping: LogPrior = _log(0.3, 0.5, "of critical damping, 0.1 to 0.8")
    skin_share: SharePrior = _share(0.3, 1.0, "of strap and tissue: a goniometer on the skin")
    sensor_delay_s: LogPrior = _log(0.003, 0.8, "s: of the goniometer, 0.6 to 15 ms")
    sensor_lag_s: LogPrior = _log(0.003, 0.8, "s: of its first-order lag, likewise")
    half_angle_rad: LogPrior = _log(0.41887902, 0.6, "rad: K is half at 7 to 80 degrees")
    softening_power: NormalPrior = _normal(1.6, 0.4, "no source: the form is not known")
    reflex_gain: LogPrior = _log(0.12, 0.8, "share of K, 0.02 to 0.6")
    reflex_of_point: Spread = _spread(0.4, "of its logarithm: reflexes change over the cycle")
    reflex_latency_s: LogPrior = _log(0.045, 0.3, "s: stretch reflexes of the leg, 25 to 80 ms")
    reflex_time_s: LogPrior = _log(0.04, 0.35, "s: twitch of a muscle, 20 to 80 ms")
    reflex_position: SharePrior = _share(0.5, 1.2, "no source: displacement against velocity")
    reflex_shortening: SharePrior = _share(0.65, 1.0, "no source: of shortening muscles")
    friction_nm: LogPrior = _log(1.0, 0.7, "N*m of Coulomb that the torque does not include")
    torque_error: NormalPrior = _normal(0.0, 0.02, "gain of the stated torque, +-2 %")
    goniometer_gain: NormalPrior = _normal(0.0, 0.02, "beside other sensors, +-2 %")
    goniometer_hz: LogPrior = _log(25.0, 0.5, "Hz: on the skin, 9 to 67")
    goniometer_damping: LogPrior = _log(0.3, 0.5, "of critical damping, 0.1 to 0.8")
    encoder_delay_s: NormalPrior = _normal(0.001, 0.001, "s: clock of the torque")
    encoder_gain: NormalPrior = _normal(0.0, 0.01, "the axes of device and joint are not one")
    gyroscope_delay_s: NormalPrior = _normal(
        0.003, 0.003, "s: low-pass of the chip (2 to 5 ms at 190 to 40 Hz) and clock"
    )
    gyroscope_gain: NormalPrior = _normal(0.0, 0.015, "sensitivity of usual chips, +-3 %")
    shank_hz: LogPrior = _log(30.0, 0.4, "Hz: gyroscope on the skin, 13 to 67")
    shank_damping: LogPrior = _log(0.3, 0.5, "of critical damping, 0.1 to 0.8")
    thigh_hz: LogPrior = _log(30.0, 0.4, "Hz: likewise")
    thigh_damping: LogPrior = _log(0.3, 0.5, "of critical damping, 0.1 to 0.8")
    shank_share: SharePrior = _share(
        0.6, 0.8, "of the joint's motion that the shank makes: two links, 0.2 to 0.9"
    )
