"""Tests of a controller in the bed, and their scores."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from jointz.control.testbed.knee_bed import PUSH_EVERY, STEP_S, STEPS_PER_SAMPLE, KneeBed, Walk

STRIDES: Final = 12
#: Variability from stride to stride: stride time (share), thigh (rad).
_STRIDE_CV, _THIGH_SD = 0.03, float(np.radians(2.0))
_LAG_S, _LIMIT_NM = 0.015, 120.0
_PUSH_NM, _PUSH_S, _FIRST_PUSH = 15.0, 0.1, 2
SAMPLE_S = STEP_S * STEPS_PER_SAMPLE
#: Swing in which the toe passes the ground, share of the cycle.
_PASSING: Final = (0.70, 0.95)
#: A push is over when the deviation stays below this part of its largest.
_RETURNED: Final = 1.0 / 3.0


@dataclass(frozen=True, slots=True)
class BedTest:
    """Changes of a test against plain walking."""

    label: str
    speed: float = 1.0
    delay_s: float = 0.005
    phase_sd: float = 0.02  # of the phase estimate, share of the cycle, one draw a stride
    push_at: float | None = None  # share of the cycle


PLAIN: Final = "plain"
TESTS: Final[Mapping[str, BedTest]] = {
    PLAIN: BedTest("plain walking"),
    "push_stance": BedTest("pushes at 20 %", push_at=0.20),
    "push_swing": BedTest("pushes at 75 %", push_at=0.75),
    "faster": BedTest("speed +15 %", speed=1.15),
    "slower": BedTest("speed -15 %", speed=0.85),
    "delay": BedTest("delay of 20 ms", delay_s=0.020),
    "phase_error": BedTest("phase error of 5 %", phase_sd=0.05),
}
#: Score -> words, unit.
SCORES: Final[Mapping[str, tuple[str, str]]] = {
    "tracking": ("RMS deviation from the intact angle", "deg"),
    "falls": ("share of runs with a fall", "1"),
    "fallen_strides": ("share of strides with a fall", "1"),
    "net_work": ("net work of the joint", "J/stride"),
    "absolute_work": ("absolute work of the joint", "J/stride"),
    "peak_torque": ("largest torque", "N*m"),
    "clearance": ("smallest clearance of the toe, minus the intact one", "m"),
    "push_deviation": ("largest deviation after a push", "deg"),
    "return_time": ("time from the push until a third of it", "s"),
}


def drawn_walk(test: BedTest, bed: KneeBed, seed: tuple[int, ...]) -> Walk:
    """Return strides of a test; a seed has the same draws in all tests."""
    rng = np.random.default_rng(seed)
    times = bed.stride_s * (1.0 + _STRIDE_CV * rng.standard_normal(STRIDES).clip(-3.0, 3.0))
    phase = test.phase_sd * rng.standard_normal(STRIDES)
    thigh = _THIGH_SD * rng.standard_normal(STRIDES + 1)
    pushed = test.push_at is not None
    return Walk(
        1.0 / times, phase, thigh, round(test.delay_s / STEP_S), _LAG_S, _LIMIT_NM,
        push_nm=_PUSH_NM if pushed else 0.0,
        push_at=_FIRST_PUSH + (test.push_at or 0.0), push_s=_PUSH_S,
    )  # fmt: skip


def run_scores(bed: KneeBed, record: np.ndarray, fallen: np.ndarray) -> dict[str, float]:
    """Return the scores of a run.

    In the tracking the knee stays where it fell until the person starts anew; work and clearance
    are means over strides without a fall.
    """
    phase, angle, velocity, torque, toe = record.T
    stride = phase.astype(int)
    whole = ~fallen[stride]
    away = _held(angle) - intact_angle(bed, phase)
    scores = {
        "tracking": float(np.degrees(np.sqrt(np.mean(away**2)))),
        "falls": float(fallen.any()),
        "fallen_strides": float(fallen.mean()),
        "peak_torque": float(np.nanmax(np.abs(torque))),
    }
    n = int((~fallen).sum())
    power = (torque * velocity)[whole]
    scores["net_work"] = float(power.sum() * SAMPLE_S / n) if n else np.nan
    scores["absolute_work"] = float(np.abs(power).sum() * SAMPLE_S / n) if n else np.nan
    scores["clearance"] = _clearance(bed, phase[whole], toe[whole]) if n else np.nan
    return scores


def _held(angle: np.ndarray) -> np.ndarray:
    """Return angles with the last one before a fall where there are none."""
    last = np.maximum.accumulate(np.where(np.isfinite(angle), np.arange(angle.size), 0))
    return np.asarray(angle[last])


def intact_angle(bed: KneeBed, phase: np.ndarray) -> np.ndarray:
    """Return the intact angle at phases (share of the cycle), rad."""
    nodes = bed.column("angle")
    return np.asarray(np.interp(phase, np.arange(nodes.size) / nodes.size, nodes, period=1.0))


def _clearance(bed: KneeBed, phase: np.ndarray, toe: np.ndarray) -> float:
    """Return the mean over strides of the toe's lowest place in swing, minus the intact one."""
    nodes = bed.toe_m()
    own = np.arange(nodes.size) / nodes.size
    passing = (phase % 1.0 > _PASSING[0]) & (phase % 1.0 < _PASSING[1])
    lowest = [toe[passing & (phase.astype(int) == n)].min() for n in np.unique(phase.astype(int))]
    intact = nodes[(own > _PASSING[0]) & (own < _PASSING[1])].min()
    return float(np.mean(lowest) - intact)


def push_scores(pushed: np.ndarray, plain: np.ndarray, push_at: float) -> dict[str, float]:
    """Return the scores of pushes: the run with them minus the same one without.

    Means over the pushes after which no run fell for a cycle; the time is at most a cycle.
    """
    phase, away = plain[:, 0], np.degrees(np.abs(pushed[:, 1] - plain[:, 1]))
    found = []
    for first in np.arange(_FIRST_PUSH, STRIDES - 1, PUSH_EVERY):
        own = away[(phase >= first + push_at) & (phase < first + push_at + 1.0)]
        if np.isfinite(own).all():
            largest = float(own.max())
            over = np.flatnonzero(own >= _RETURNED * largest)
            found.append((largest, float((over[-1] + 1) * SAMPLE_S)))
    deviation, time = np.mean(found, axis=0) if found else (np.nan, np.nan)
    return {"push_deviation": float(deviation), "return_time": float(time)}
