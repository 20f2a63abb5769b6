"""People of the world: bodies, muscles, reflexes, device cuffs and errors of sensors."""

from dataclasses import dataclass

import numpy as np

from . import muscles as mu

GRAVITY = 9.81
#                F_MAX  L_OPT L_SLACK V_MAX cos  knee    hip    ankle  curve; optimum (deg)
_MUSCLES = {
    "vasti": (5000, 0.093, 0.16, 10, 0.98, 0.042, 0.0, 0.0, 0.25, 0, 45, 0),
    "rectus": (1200, 0.080, 0.33, 10, 0.98, 0.042, -0.040, 0.0, 0.25, 10, 40, 0),
    "hamstrings": (2600, 0.105, 0.31, 10, 0.97, -0.038, 0.060, 0.0, 0.10, 25, 30, 0),
    "gastrocnemius": (1900, 0.055, 0.39, 10, 0.96, -0.020, 0.0, 0.045, 0.0, 0, 20, 5),
    "biceps_short": (550, 0.130, 0.10, 10, 0.96, -0.032, 0.0, 0.0, 0.10, 0, 20, 0),
}


@dataclass(frozen=True)
class Segment:
    """A rigid segment: mass, length, distance of the centre from the proximal end, inertia."""

    mass: float
    length: float
    centre: float
    inertia: float


@dataclass(frozen=True)
class Person:
    """A person with a device and sensors; units are SI."""

    name: str
    mass: float
    height: float
    stride_s: float
    co_contraction: float
    muscles: np.ndarray
    passive: np.ndarray  # scale and viscosity of the passive torque
    reflex_delay_s: float
    inhibition: float
    correction: tuple[float, float]  # excitation per rad of knee error, and its delay in s
    hip: tuple[float, float]  # stiffness and damping of hip muscles
    ankle: tuple[float, float]
    pad: tuple[float, float]  # stiffness and damping of sole and shoe, N/m and N*s/m
    cuff: tuple[float, float, float]  # stiffness, angle that doubles it, damping
    device: tuple[float, float, float]  # mass, centre and inertia about the knee of the shank part
    actuator: tuple[
        float, float, float, float
    ]  # bandwidth, Coulomb, viscous, friction after sensor
    sensors: dict[str, float]
    knee_gain: float  # size of the person's knee motion over the published one
    variability: float

    @property
    def thigh(self) -> Segment:
        """Return the thigh (Winter 2009, table 4.1)."""
        return self._segment(0.100, 0.245, 0.433, 0.323)

    @property
    def shank(self) -> Segment:
        """Return the shank."""
        return self._segment(0.0465, 0.246, 0.433, 0.302)

    @property
    def foot(self) -> Segment:
        """Return the foot."""
        return self._segment(0.0145, 0.152, 0.5, 0.475)

    def _segment(self, share: float, length: float, centre: float, gyration: float) -> Segment:
        mass, size = share * self.mass, length * self.height
        return Segment(mass, size, centre * size, mass * (gyration * size) ** 2)


def draw_person(seed: int, number: int) -> Person:
    """Draw person `number` of a population; equal arguments give the same person."""
    rng = np.random.default_rng([seed, number])

    def spread(middle: float, share: float) -> float:
        return float(middle * np.exp(share * np.clip(rng.standard_normal(), -2.2, 2.2)))

    device, actuator = _draw_device(seed)
    height = float(np.clip(rng.normal(1.73, 0.09), 1.52, 1.95))
    mass = spread(23.3, 0.11) * height**2
    return Person(
        name=f"P{number:02d}",
        mass=mass,
        height=height,
        stride_s=float(np.clip(rng.normal(1.15, 0.05), 1.03, 1.28)),
        co_contraction=spread(0.05, 0.35),
        muscles=_draw_muscles(rng, mass, height, spread),
        passive=np.array([spread(0.8, 0.25), spread(0.25, 0.3)]),
        reflex_delay_s=float(rng.uniform(0.027, 0.048)),
        inhibition=float(rng.uniform(0.2, 0.7)),
        correction=(spread(0.5, 0.15), float(rng.uniform(0.075, 0.09))),
        hip=(spread(120.0, 0.25), spread(6.0, 0.25)),
        ankle=(spread(4.0 * mass, 0.2), spread(0.02 * mass, 0.3)),
        pad=(spread(60e3, 0.25), spread(200.0, 0.25)),
        cuff=(spread(260.0, 0.35), spread(0.09, 0.3), spread(2.0, 0.3)),
        device=device,
        actuator=actuator,
        sensors=_draw_sensors(rng),
        knee_gain=float(np.clip(rng.normal(1.0, 0.06), 0.88, 1.12)),
        variability=spread(1.0, 0.2),
    )


def _draw_device(seed: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Draw the laboratory's device: its arm along the shank, and its motor."""
    rng = np.random.default_rng([seed, 10**6])
    mass, centre = rng.uniform(0.6, 1.3), rng.uniform(0.13, 0.19)
    arm = mass, centre, mass * centre**2 * rng.uniform(1.2, 1.5)
    motor = (
        rng.uniform(28, 45),
        rng.uniform(0.15, 0.4),
        rng.uniform(0.02, 0.05),
        rng.uniform(0.1, 0.25),
    )
    return tuple(map(float, arm)), tuple(map(float, motor))


def _draw_muscles(rng, mass, height, spread) -> np.ndarray:
    strength, size = spread(mass / 75.0, 0.15), height / 1.75
    strain_0, slack_error = spread(0.047, 0.18), rng.normal(0.0, 0.03, mu.N_MUSCLES)
    srs, yielding = spread(23.4, 0.15), spread(0.012, 0.25)  # Cui et al. 2008
    gain_length, gain_speed = spread(0.25, 0.5), spread(0.05, 0.5)
    threshold = float(rng.uniform(0.0, 0.02))
    table = np.zeros((mu.N_MUSCLES, 18))
    for m, name in enumerate(mu.MUSCLES):
        f_max, l_opt, slack, v_max, cosine, knee, hip, ankle, curve, *best = _MUSCLES[name]
        l_opt, slack = l_opt * size, slack * size
        arms = np.array([hip, knee, ankle]) * size
        best = np.radians(best)
        bent = best[1] - mu.REFERENCE_KNEE
        # At the optimum posture and a tendon strain of 2 %, fibres have their optimum length
        length_0 = 1.02 * slack + l_opt * cosine * (1.0 + slack_error[m])
        length_0 -= arms[1] * (bent - curve * bent**3 / 3) + arms[0] * best[0] + arms[2] * best[2]
        table[m] = (
            f_max * strength, l_opt, slack, v_max, cosine, arms[1], arms[0], arms[2], length_0,
            strain_0, srs, yielding, 0.012, 0.045, gain_length, gain_speed, threshold, curve,
        )  # fmt: skip
    return table


def _draw_sensors(rng: np.random.Generator) -> dict[str, float]:
    lags = {
        "angle_lag_s": rng.uniform(0.002, 0.008),
        "torque_lag_s": rng.uniform(0.0005, 0.002),
        "joint_encoder_lag_s": rng.uniform(0.0005, 0.002),
        "shank_velocity_lag_s": rng.uniform(0.001, 0.004),
        "thigh_velocity_lag_s": rng.uniform(0.001, 0.004),
    }
    gains = {
        "angle_gain": rng.normal(0.97, 0.04),
        "torque_gain": rng.normal(1.0, 0.015),
        "joint_encoder_gain": rng.normal(1.0, 0.003),
        "shank_velocity_gain": rng.normal(1.0, 0.015),
        "thigh_velocity_gain": rng.normal(1.0, 0.015),
    }
    mounts = {
        "angle_mount_hz": rng.uniform(18.0, 40.0),
        "shank_mount_hz": rng.uniform(20.0, 45.0),
        "thigh_mount_hz": rng.uniform(12.0, 25.0),
        "angle_mount_damping": rng.uniform(0.4, 0.9),
        "shank_mount_damping": rng.uniform(0.3, 0.7),
        "thigh_mount_damping": rng.uniform(0.3, 0.7),
        "angle_noise_deg": rng.uniform(0.05, 0.15),
        "gyroscope_noise_deg_s": rng.uniform(0.3, 0.8),
        "torque_noise_nm": rng.uniform(0.03, 0.1),
    }
    return {key: float(value) for key, value in (lags | gains | mounts).items()}
