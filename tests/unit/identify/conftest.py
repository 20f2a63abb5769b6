"""A walker made by hand: known K, B, J, lag and noise, without the package's own simulation."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
import pytest

from jointz.core.recording import build_recording
from jointz.core.study import Calibrated, CalibrationSpec, PerturbationsSpec
from jointz.identify.participant import ParticipantResult, analyze_participant
from jointz.identify.preparation.sources import ParticipantSettings, RecordingInput
from jointz.identify.study_kinds import WALKING

STRIDE_S, STEP_S, LONGEST_S = 1.1, 0.0005, 0.6


@dataclass(frozen=True)
class Joint:
    """K (with a slope per s after the onset), B and J of a timing point."""

    K: float
    B: float
    J: float
    slope: float = 0.0


@dataclass(frozen=True)
class Walker:
    """Who walks, how often and how hard they are pushed, and what the sensors make of it."""

    joints: Mapping[str, Joint] = field(
        default_factory=lambda: {"A": Joint(60.0, 2.5, 0.06), "B": Joint(35.0, 3.0, 0.06)}
    )
    points: Mapping[str, float] = field(default_factory=lambda: {"A": 30.0, "B": 70.0})
    counts: Mapping[str, int] = field(default_factory=lambda: {"A": 20, "B": 20})
    signs: Sequence[float] = (1.0,)
    sizes_nm: Sequence[float] = (17.0,)
    between: int = 3
    rate_hz: float = 500.0
    lag_s: float = 0.008
    noise_rad: float = np.radians(0.3)
    wandering_rad: float = np.radians(1.0)
    seed: int = 0
    known_lag_sd_s: float | None = 0.0005
    jitter_s: float = 0.0
    start_s: float = 0.0


def respond(joint: Joint, torque: Callable[[float], float]) -> np.ndarray:
    """Return the motion from rest at steps of 0.5 ms, by Runge and Kutta's method."""
    n = int(LONGEST_S / STEP_S)
    state, out = np.zeros(2), np.zeros(n)

    def rates(t: float, now: np.ndarray) -> np.ndarray:
        spring = (joint.K + joint.slope * t) * now[0]
        return np.array([now[1], (torque(t) - joint.B * now[1] - spring) / joint.J])

    for i in range(n - 1):
        t = i * STEP_S
        a = rates(t, state)
        b = rates(t + STEP_S / 2, state + STEP_S / 2 * a)
        c = rates(t + STEP_S / 2, state + STEP_S / 2 * b)
        d = rates(t + STEP_S, state + STEP_S * c)
        state = state + STEP_S / 6 * (a + 2 * b + 2 * c + d)
        out[i + 1] = state[0]
    return out


def pulse(t: np.ndarray | float) -> np.ndarray:
    """Return the torque of a pulse of 1 N*m, 0.25 s long, that follows its command slowly."""
    t = np.asarray(t, dtype=float)
    rise = np.where(t > 0.006, 1.0 - np.exp(-(t - 0.006).clip(0.0) / 0.012), 0.0)
    fall = np.where(t > 0.256, 1.0 - np.exp(-(t - 0.256).clip(0.0) / 0.012), 0.0)
    return rise - fall


_ANSWERS: dict[Joint, np.ndarray] = {}


def answer(joint: Joint, t: np.ndarray) -> np.ndarray:
    """Return the motion after a pulse of 1 N*m; one joint is simulated once."""
    if joint not in _ANSWERS:
        _ANSWERS[joint] = respond(joint, lambda s: float(pulse(s)))
    return np.interp(t, np.arange(_ANSWERS[joint].size) * STEP_S, _ANSWERS[joint], left=0.0)


def walk(walker: Walker) -> RecordingInput:
    """Return what is recorded of a walk with pulses every few strides."""
    rng = np.random.default_rng(walker.seed)
    labels = [name for name, n in walker.counts.items() for _ in range(n)]
    labels = [labels[k] for k in rng.permutation(len(labels))]
    n_strides = 8 + walker.between * len(labels) + 3
    durations = STRIDE_S * (1.0 + 0.02 * rng.standard_normal(n_strides))
    strikes = walker.start_s + 0.3 + np.concatenate([[0.0], np.cumsum(durations)])
    time = np.arange(walker.start_s, strikes[-1], 1.0 / walker.rate_hz)
    knots = np.concatenate([[strikes[0] - STRIDE_S], strikes])
    phase = np.interp(time, knots, np.arange(knots.size) - 1.0)
    sizes = 0.4 * (1.0 + 0.03 * rng.standard_normal(knots.size + 1))
    offsets = walker.wandering_rad * rng.standard_normal(knots.size + 1)
    across = np.arange(knots.size + 1) - 1.0
    size, offset = np.interp(phase, across, sizes), np.interp(phase, across, offsets)
    angle = offset + size * np.sin(2 * np.pi * phase) + 0.15 * np.sin(4 * np.pi * phase + 0.7)
    torque = 0.2 * np.sin(2 * np.pi * phase) + 0.05 * rng.standard_normal(time.size)
    rows = []
    for k, label in enumerate(labels):
        first = 8 + walker.between * k
        onset = strikes[first] + walker.points[label] / 100.0 * STRIDE_S
        amplitude = walker.signs[k % len(walker.signs)] * walker.sizes_nm[k % len(walker.sizes_nm)]
        since = time - onset
        torque = torque + amplitude * pulse(since)
        # Delay of 2 ms and a first-order lag of the rest: the answer of a linear sensor, late.
        grid = np.arange(int(LONGEST_S / STEP_S)) * STEP_S
        shown = _lagged(answer(walker.joints[label], grid), walker.lag_s - 0.002)
        angle = angle + amplitude * np.interp(since - 0.002, grid, shown, left=0.0, right=0.0)
        rows.append((onset, 0.25, amplitude, label))
    angle = angle + walker.noise_rad * rng.standard_normal(time.size)
    stamped = time + walker.jitter_s * rng.uniform(-1.0, 1.0, time.size)
    recording = build_recording(
        stamped,
        {"angle": angle, "torque": torque, "contact": phase % 1.0 < 0.6},
        condition="perturbed",
        file=f"walk{walker.seed}.csv",
        contact_kind="contact",
    )
    known = CalibrationSpec()
    if walker.known_lag_sd_s is not None:
        lag = Calibrated(value=walker.lag_s, sd=walker.known_lag_sd_s)
        known = CalibrationSpec(angle_lag_s=lag)
    columns = ["onset_s", "duration_s", "amplitude_nm", "timing_point"]
    return RecordingInput(recording, known, pd.DataFrame(rows, columns=columns))


def _lagged(values: np.ndarray, lag_s: float) -> np.ndarray:
    if lag_s <= 0.0:
        return values
    out, keep = np.zeros_like(values), np.exp(-STEP_S / lag_s)
    for i in range(1, values.size):
        out[i] = keep * out[i - 1] + (1.0 - keep) * 0.5 * (values[i] + values[i - 1])
    return out


def walk_settings(
    walker: Walker, perturbations: PerturbationsSpec | None = None, **more: object
) -> ParticipantSettings:
    """Return what a study asks for about a walker."""
    return ParticipantSettings(
        kind=WALKING,
        perturbations=perturbations
        or PerturbationsSpec(timing_points=dict(walker.points), source="table"),
        n_resamples=10,
        mass_kg=70.0,
        coupling="rigid",
        **more,
    )


def analyze_walk(
    walker: Walker,
    *recordings: RecordingInput,
    perturbations: PerturbationsSpec | None = None,
    **more: object,
) -> ParticipantResult:
    """Return what the recommended method makes of recordings."""
    settings = walk_settings(walker, perturbations, **more)
    return analyze_participant("S01", recordings or [walk(walker)], settings)


@dataclass(frozen=True)
class Walkers:
    """What tests need to make walkers."""

    Joint = Joint
    Walker = Walker
    walk = staticmethod(walk)
    settings = staticmethod(walk_settings)
    analyze = staticmethod(analyze_walk)
    respond = staticmethod(respond)
    pulse = staticmethod(pulse)


@pytest.fixture(scope="session")
def walkers() -> type[Walkers]:
    """Walkers with known joints, and their analysis."""
    return Walkers
