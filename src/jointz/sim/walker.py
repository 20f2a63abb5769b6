"""People who walk on a treadmill while an exoskeleton perturbs one knee.

A small exact simulation: unperturbed knee motion plus the joint's response to
the applied torque (:mod:`jointz.sim.joint`), recorded with the instruments'
errors. The truth of every participant is known, a number per timing point.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from math import exp, log, radians, sqrt
from typing import Any, Literal

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.signal import lfilter

from jointz.core.errors import DataError
from jointz.core.gait_phases import TIMING_POINTS
from jointz.sim.joint import FLAT_AFTER_PCT, impedance_curve, knee_angle, respond

# Means over people at the six timing points, N*m/rad/kg and N*m*s/rad/kg: near tables 4.1, 4.2.
_MEAN_STIFFNESS_PER_MASS = (2.0, 0.65, 1.15, 1.15, 0.32, 0.38)
_MEAN_DAMPING_PER_MASS = (0.035, 0.040, 0.050, 0.030, 0.036, 0.027)
_SPREAD_OVER_PEOPLE = 0.25

_STANCE = 0.62  # share of the cycle with the foot on the ground
_STEADY = 0.15  # K and B stand still for this share of a mean stride after an onset

_STRIDES_OF_ESTIMATE = 3  # the device's stride time is the mean of the last three
_FEWEST_STRIDES_APART, _MOST_STRIDES_APART = 3, 7
_STRIDES_BEFORE_PULSES, _STRIDES_AFTER_PULSES = 10, 5
_LARGEST_DEVIATION = 3.0  # sd; longer tails would let a stride end before its pulse fires
_LARGEST_STRIDE_SD = 0.035  # the same, for the last timing point at 81 %
_TIME_CONSTANTS_TO_REST = 30.0  # 17 N*m have fallen to 2e-12 N*m by then


@dataclass(frozen=True, slots=True)
class Participant:
    """A simulated person and the truth about the knee.

    Parameters
    ----------
    id : str
        Name.
    mass_kg, height_m, stride_time_s : float
        Body, and mean stride time.
    stiffness_per_mass, damping_per_mass : mapping of str to float
        Timing point -> N*m/rad/kg, N*m*s/rad/kg.
    inertia : float, kg*m^2
        Of the joint, the same all over the cycle.
    """

    id: str
    mass_kg: float
    height_m: float
    stride_time_s: float
    stiffness_per_mass: Mapping[str, float]
    damping_per_mass: Mapping[str, float]
    inertia: float


@dataclass(frozen=True, slots=True)
class WalkerSettings:
    """How people walk, what the device does, and how well it is measured.

    Parameters
    ----------
    rate_hz, substeps : float, int
        Sample rate of record and device; steps of the physics to a sample.
    stride_sd : float
        Stride time between strides, share of the mean; at most 0.035.
    amplitude_sd, offset_sd_rad, stride_correlation : float
        Autoregressive change of the knee curve between strides: share of it, rad.
    condition_offset_sd_rad, condition_amplitude_sd, condition_phase_sd : float
        Shift of the mean curve in a perturbed recording; phase in cycles.
    angle_white_sd_rad, angle_coloured_sd_rad, angle_coloured_time_s, angle_lag_s : float
        Noise and pure delay of the measured angle.
    torque_noise_sd_nm, torque_noise_time_s : float
        Error of the measured torque, an Ornstein-Uhlenbeck process.
    pulse_nm, pulse_s : float
        Commanded pulse, flexion positive.
    actuator_delay_s, actuator_time_constant_s : float
        From command to applied torque: pure delay, then first order.
    """

    rate_hz: float = 1000.0
    substeps: int = 4
    stride_sd: float = 0.025
    amplitude_sd: float = 0.03
    offset_sd_rad: float = radians(1.0)
    stride_correlation: float = 0.5
    condition_offset_sd_rad: float = radians(1.5)
    condition_amplitude_sd: float = 0.02
    condition_phase_sd: float = 0.005
    angle_white_sd_rad: float = radians(0.3)
    angle_coloured_sd_rad: float = radians(0.15)
    angle_coloured_time_s: float = 0.1
    angle_lag_s: float = 0.0
    torque_noise_sd_nm: float = 0.25
    torque_noise_time_s: float = 0.25
    pulse_nm: float = 17.0
    pulse_s: float = 0.25
    actuator_delay_s: float = 0.006
    actuator_time_constant_s: float = 0.012

    def __post_init__(self) -> None:
        spans = (self.pulse_s, self.angle_coloured_time_s, self.torque_noise_time_s)
        if min(self.rate_hz, self.actuator_time_constant_s, *spans) <= 0:
            raise DataError(
                "WalkerSettings: rate_hz, pulse_s, actuator_time_constant_s, angle_coloured_time_s "
                f"and torque_noise_time_s must be positive, got {self}."
            )
        if not 0 <= self.stride_sd <= _LARGEST_STRIDE_SD:
            raise DataError(
                f"WalkerSettings: stride_sd must lie in 0..{_LARGEST_STRIDE_SD}, got "
                f"{self.stride_sd}: in more variable strides a pulse may fire after its stride."
            )

    @classmethod
    def exact(cls) -> "WalkerSettings":
        """Return settings without errors and variability; the actuator stays as it is."""
        silent: dict[str, Any] = {f.name: 0.0 for f in fields(cls) if "_sd" in f.name}
        return replace(cls(), **silent)


@dataclass(frozen=True, slots=True)
class Pulse:
    """A pulse as commanded.

    Parameters
    ----------
    onset_s : float, s
        Its first sample.
    timing_point : str
        Where in the gait cycle it was meant to be.
    """

    onset_s: float
    timing_point: str


@dataclass(frozen=True, slots=True, eq=False)
class Simulated:
    """A recording and its truth; arrays are (n,) float.

    Parameters
    ----------
    time, angle, torque : s, rad, N*m
        As measured; knee flexion, torque on the joint, both positive in flexion.
    command : N*m
        Commanded perturbation torque, 0 outside pulses.
    contact : 0 or 1
        Foot on the ground.
    heel_strike_s : (n_strike,) float, s
        True heel strikes inside the recording.
    pulses : tuple of Pulse
        True pulses, in order of time.
    """

    time: np.ndarray
    angle: np.ndarray
    torque: np.ndarray
    command: np.ndarray
    contact: np.ndarray
    heel_strike_s: np.ndarray
    pulses: tuple[Pulse, ...]


@dataclass(frozen=True, slots=True)
class _Walk:
    """Heel strikes and pulses as sample numbers; the record is [start, stop)."""

    strikes: np.ndarray
    onsets: np.ndarray
    reached: np.ndarray  # cycles: number of each pulse's stride + share of its timing point
    points: np.ndarray
    start: int
    stop: int


def draw_participants(n: int, rng: np.random.Generator) -> tuple[Participant, ...]:
    """Draw people: impedances spread by 25 % (log-normal) about means of able-bodied adults.

    Parameters
    ----------
    n : int
        How many.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    tuple of Participant
        ``S01``, ``S02``, ...; the first k do not depend on n.
    """
    return tuple(_draw_participant(f"S{i + 1:02d}", rng) for i in range(n))


def simulate_recording(
    participant: Participant,
    *,
    condition: Literal["unperturbed", "perturbed"],
    rng: np.random.Generator,
    settings: WalkerSettings | None = None,
    n_strides: int = 60,
    n_pulses_per_point: int = 50,
) -> Simulated:
    """Simulate one recording of a participant.

    The record begins in swing before a heel strike. A pulse fires when the
    time since the last heel strike reaches its timing point in units of the
    mean of the last three strides, every 3 to 7 strides, in random order. In a
    stride with a pulse K and B reach their timing point when the pulse fires
    and stand still for 12 % of a mean stride: irregular strides disturb the
    motion, not the truth.

    Parameters
    ----------
    participant : Participant
        Who walks.
    condition : {"unperturbed", "perturbed"}
        Which recording.
    rng : numpy.random.Generator
        Source of randomness.
    settings : WalkerSettings, optional
        The demo's by default.
    n_strides, n_pulses_per_point : int
        Whole strides of an unperturbed recording; pulses at each timing point of a
        perturbed one, whose length follows.

    Returns
    -------
    Simulated
        The recording and its truth.

    Raises
    ------
    DataError
        When the condition is unknown or the recording would be empty.
    """
    if condition not in ("unperturbed", "perturbed"):
        raise DataError(f"condition must be 'unperturbed' or 'perturbed', got {condition!r}.")
    if (n_pulses_per_point if condition == "perturbed" else n_strides) < 1:
        raise DataError(f"a recording ({condition}) needs at least one stride or pulse a point.")
    settings = settings or WalkerSettings()
    per_point = n_pulses_per_point if condition == "perturbed" else 0
    walk = _plan(participant, rng, settings, n_strides=n_strides, per_point=per_point)
    command, applied = _device(walk, settings)
    sample = np.arange(walk.start, walk.stop)
    cycles = PchipInterpolator(walk.strikes, np.arange(walk.strikes.size))(sample)
    angle = _unperturbed_angle(cycles, rng, settings, shifted=condition == "perturbed")
    angle += _response(participant, walk, applied, settings)
    angle, torque = _measure(angle, applied, rng, settings)
    time = np.arange(sample.size) / settings.rate_hz
    contact = np.concatenate([np.arange(n) < _STANCE * n for n in np.diff(walk.strikes)])
    inside = walk.strikes[(walk.strikes >= walk.start) & (walk.strikes < walk.stop)]
    return Simulated(
        time=time,
        angle=angle,
        torque=torque,
        command=command,
        contact=contact[walk.start : walk.stop].astype(float),
        heel_strike_s=time[inside - walk.start],
        pulses=tuple(
            Pulse(onset_s=float(time[onset - walk.start]), timing_point=str(point))
            for onset, point in zip(walk.onsets, walk.points, strict=True)
        ),
    )


def _draw_participant(name: str, rng: np.random.Generator) -> Participant:
    sigma = sqrt(log(1.0 + _SPREAD_OVER_PEOPLE**2))

    def around(means: tuple[float, ...]) -> dict[str, float]:
        factors = np.exp(sigma * rng.standard_normal(len(means)) - sigma**2 / 2.0)
        return dict(zip(TIMING_POINTS, (factors * means).tolist(), strict=True))

    return Participant(
        id=name,
        mass_kg=_within(rng, 73.0, 10.0, low=52.0, high=100.0),
        height_m=_within(rng, 1.74, 0.08, low=1.55, high=1.95),
        stride_time_s=_within(rng, 1.10, 0.05, low=1.0, high=1.2),
        stiffness_per_mass=around(_MEAN_STIFFNESS_PER_MASS),
        damping_per_mass=around(_MEAN_DAMPING_PER_MASS),
        inertia=float(rng.uniform(0.03, 0.07)),
    )


def _within(rng: np.random.Generator, mean: float, sd: float, *, low: float, high: float) -> float:
    while not low <= (value := float(rng.normal(mean, sd))) <= high:
        pass
    return value


def _plan(
    participant: Participant,
    rng: np.random.Generator,
    settings: WalkerSettings,
    *,
    n_strides: int,
    per_point: int,
) -> _Walk:
    """Lay out strides and pulses; the first and last stride are only partly recorded."""
    points = rng.permutation(np.repeat(list(TIMING_POINTS), per_point))
    apart = rng.integers(_FEWEST_STRIDES_APART, _MOST_STRIDES_APART + 1, size=points.size)
    strides = _STRIDES_BEFORE_PULSES + np.cumsum(apart)
    whole = int(strides[-1]) + _STRIDES_AFTER_PULSES if per_point else n_strides
    deviation = rng.standard_normal(whole + 2).clip(-_LARGEST_DEVIATION, _LARGEST_DEVIATION)
    seconds = participant.stride_time_s * (1.0 + settings.stride_sd * deviation)
    lengths = np.rint(seconds * settings.rate_hz).astype(int)
    strikes = np.concatenate([[0], np.cumsum(lengths)])
    last = strikes[strides] - strikes[strides - _STRIDES_OF_ESTIMATE]
    share = np.array([TIMING_POINTS[str(point)] / 100.0 for point in points])
    # Rounded first: 77.00000000000001 samples are 77.
    wait = np.ceil(np.round(share * last / _STRIDES_OF_ESTIMATE, 6)).astype(int)
    return _Walk(
        strikes=strikes,
        onsets=strikes[strides] + wait,
        reached=strides + share,
        points=points,
        start=int(0.75 * strikes[1]),
        stop=int(strikes[-2] + 0.5 * lengths[-1]),
    )


def _device(walk: _Walk, settings: WalkerSettings) -> tuple[np.ndarray, np.ndarray]:
    """Return the commanded and the applied torque of all pulses (N*m)."""
    tau = settings.actuator_time_constant_s
    width = round(settings.pulse_s * settings.rate_hz)
    rest = settings.actuator_delay_s + _TIME_CONSTANTS_TO_REST * tau
    since = np.arange(width + int(rest * settings.rate_hz)) / settings.rate_hz
    since -= settings.actuator_delay_s
    rise = -np.expm1(-np.maximum(since, 0.0) / tau)
    fall = -np.expm1(-np.maximum(since - width / settings.rate_hz, 0.0) / tau)
    command, applied = np.zeros((2, walk.stop - walk.start))
    for onset in walk.onsets - walk.start:
        command[onset : onset + width] = settings.pulse_nm
        applied[onset : onset + since.size] += settings.pulse_nm * (rise - fall)
    return command, applied


def _response(
    participant: Participant, walk: _Walk, applied: np.ndarray, settings: WalkerSettings
) -> np.ndarray:
    """Return the deviation from the unperturbed motion (rad)."""
    steady = int(np.ceil(_STEADY * participant.stride_time_s * settings.rate_hz))
    cycles = _impedance_cycles(walk, steady)
    angle, _ = respond(
        applied,
        participant.mass_kg * impedance_curve(participant.stiffness_per_mass, cycles),
        participant.mass_kg * impedance_curve(participant.damping_per_mass, cycles),
        participant.inertia,
        rate_hz=settings.rate_hz,
        substeps=settings.substeps,
    )
    return angle


def _impedance_cycles(walk: _Walk, steady: int) -> np.ndarray:
    """Return the phase of K and B (cycles), which follows strikes and pulses."""
    begins = walk.strikes.copy()
    # A heel strike that comes early does not cut the steady stretch short.
    following = walk.reached.astype(int) + 1
    begins[following] = np.maximum(begins[following], walk.onsets + steady + 1)
    left = walk.reached + FLAT_AFTER_PCT / 100.0
    when = np.concatenate([begins, walk.onsets, walk.onsets + steady])
    cycles = np.concatenate([np.arange(begins.size), walk.reached, left])
    sample = np.arange(walk.start, walk.stop)
    return np.asarray(np.interp(sample, np.sort(when), np.sort(cycles)), dtype=float)


def _unperturbed_angle(
    cycles: np.ndarray, rng: np.random.Generator, settings: WalkerSettings, *, shifted: bool
) -> np.ndarray:
    """Return the knee motion with its variability between strides and conditions (rad)."""
    shift = rng.standard_normal(3) if shifted else np.zeros(3)
    strikes = np.arange(int(cycles[-1]) + 2)
    memory = settings.stride_correlation
    amplitude = _coloured(strikes.size, rng, sd=settings.amplitude_sd, memory=memory)
    offset = _coloured(strikes.size, rng, sd=settings.offset_sd_rad, memory=memory)
    amplitude += 1.0 + settings.condition_amplitude_sd * shift[1]
    offset += settings.condition_offset_sd_rad * shift[0]
    angle = knee_angle(cycles + settings.condition_phase_sd * shift[2])
    angle *= PchipInterpolator(strikes, amplitude)(cycles)
    angle += PchipInterpolator(strikes, offset)(cycles)
    return angle


def _measure(
    angle: np.ndarray, torque: np.ndarray, rng: np.random.Generator, settings: WalkerSettings
) -> tuple[np.ndarray, np.ndarray]:
    """Return angle and torque as the instruments give them."""
    n, rate_hz = angle.size, settings.rate_hz
    sample = np.arange(n)
    measured = np.interp(sample - settings.angle_lag_s * rate_hz, sample, angle)
    measured += settings.angle_white_sd_rad * rng.standard_normal(n)
    memory = exp(-1.0 / (rate_hz * settings.angle_coloured_time_s))
    measured += _coloured(n, rng, sd=settings.angle_coloured_sd_rad, memory=memory)
    memory = exp(-1.0 / (rate_hz * settings.torque_noise_time_s))
    return measured, torque + _coloured(n, rng, sd=settings.torque_noise_sd_nm, memory=memory)


def _coloured(n: int, rng: np.random.Generator, *, sd: float, memory: float) -> np.ndarray:
    """Return a stationary first-order autoregressive series of this sd."""
    drive = rng.standard_normal(n) * (sd * sqrt(1.0 - memory**2))
    drive[0] /= sqrt(1.0 - memory**2)
    return np.asarray(lfilter([1.0], [1.0, -memory], drive), dtype=float)
