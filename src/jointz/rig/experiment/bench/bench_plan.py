"""The plan of a bench: which pulse fires when, and what every tick asks for.

Nothing on a bench has to be waited for, so the whole of a trial is laid out before
it begins.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jointz.core.protocols.bench_timing import onsets_after_rests, onsets_in_cycle
from jointz.core.protocols.protocol_models import ConditionSpec, PerturbationPlan
from jointz.core.protocols.pulse_models import Pulse
from jointz.core.protocols.pulse_waveform import PulseWaveform
from jointz.rig.experiment.bench.reference_signals import reference_samples
from jointz.rig.experiment.plan import ordered_pulses

#: A bench is led from rest to where its reference begins, then rests; and led back in the end.
LEAD_S = 1.0
REST_S = 1.0


@dataclass(frozen=True, slots=True)
class TimedPulse:
    """A pulse of the plan of a trial."""

    number: int  # position in the plan, from 1
    timing_point: str  # timing point in the cycle of the reference; "" without timing points
    onset_s: float  # time since the start of the reference
    amplitude_nm: float  # signed height; 0 for a sham


def make_bench_plan(
    condition: ConditionSpec, pulses: tuple[Pulse, ...], rng: np.random.Generator
) -> tuple[TimedPulse, ...]:
    """Lay out the pulses of one trial of a bench."""
    plan = condition.perturbations
    if plan is None:
        return ()
    order = ordered_pulses(plan, pulses, rng)
    onsets = _onsets_s(plan, condition, pulses[0].length_s, [point for point, _ in order])
    return tuple(
        TimedPulse(i + 1, point, onset_s, variant.amplitude_nm)
        for i, ((point, variant), onset_s) in enumerate(zip(order, onsets, strict=True))
    )


def _onsets_s(
    plan: PerturbationPlan, condition: ConditionSpec, pulse_s: float, points: Sequence[str]
) -> tuple[float, ...]:
    pause_s = plan.pause_s or 0.0
    if plan.timing_points is None:
        return onsets_after_rests(len(points), pause_s=pause_s, duration_s=pulse_s)
    (cycle_s,) = (r.cycle_s for r in condition.references.values() if r.cycle_s is not None)
    return onsets_in_cycle(
        [plan.timing_points[point] for point in points],
        cycle_s=cycle_s,
        apart_s=pause_s + pulse_s,
    )


@dataclass(frozen=True, slots=True)
class BenchSchedule:
    """Torque and position that a trial requests, tick by tick."""

    torque: list[float]  # N*m: reference, without pulses
    command: list[float]  # N*m: pulses, added to ``torque``
    position: list[float]  # rad: position of the far side
    pulse: list[int]  # number of the pulse in progress, 0 for none
    first: int  # first tick of the reference; ticks before it lead the bench there
    stop: int  # tick after the last one of the reference; ticks from it on lead the bench back
    torque_controlled: bool  # whether torque is commanded
    position_controlled: bool  # whether position is commanded


def bench_course(
    condition: ConditionSpec,
    pulses: Sequence[TimedPulse],
    shape: Pulse | None,
    *,
    duration_s: float,
    rate_hz: float,
    rng: np.random.Generator,
) -> BenchSchedule:
    """Lay out a trial tick by tick."""
    n = round(duration_s * rate_hz)
    lead = round(LEAD_S * rate_hz) + round(REST_S * rate_hz)

    def followed(quantity: str) -> np.ndarray:
        reference = condition.references.get(quantity)
        if reference is None:
            return np.zeros(n)
        return reference_samples(reference, n, rate_hz=rate_hz, rng=rng)

    velocity = followed("velocity_rad_s")
    position = followed("position_rad") + np.cumsum(velocity) / rate_hz
    torque = followed("torque_nm")
    command, number = _pulse_samples(pulses, shape, n, rate_hz)
    after = round(LEAD_S * rate_hz)
    moves = {"position_rad", "velocity_rad_s"} & set(condition.references)
    return BenchSchedule(
        torque=_led(torque, rate_hz, back=True),
        command=np.pad(command, (lead, after)).tolist(),
        position=_led(position, rate_hz, back=False),
        pulse=np.pad(number, (lead, after)).tolist(),
        first=lead,
        stop=lead + n,
        torque_controlled="torque_nm" in condition.references or bool(pulses) or not moves,
        position_controlled=bool(moves),
    )


def _led(values: np.ndarray, rate_hz: float, *, back: bool) -> list[float]:
    """Lead from 0 to the first value, rest there, and in the end back to 0 or hold still."""
    ramp = 0.5 - 0.5 * np.cos(np.pi * np.arange(round(LEAD_S * rate_hz)) / (LEAD_S * rate_hz))
    rest = np.full(round(REST_S * rate_hz), values[0])
    tail = values[-1] * (1.0 - ramp) if back else np.full(ramp.size, values[-1])
    led: list[float] = np.concatenate([values[0] * ramp, rest, values, tail]).tolist()
    return led


def _pulse_samples(
    pulses: Sequence[TimedPulse], shape: Pulse | None, n: int, rate_hz: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return torque (N*m) and number of the pulse at every tick, from the tick nearest to it."""
    command, number = np.zeros(n), np.zeros(n, dtype=int)
    if shape is None:
        return command, number
    course = PulseWaveform(shape)
    ticks = int(np.ceil(shape.length_s * rate_hz))
    share = np.array([course.share(round(k * 1e9 / rate_hz)) for k in range(ticks)])
    for pulse in pulses:
        first = round(pulse.onset_s * rate_hz)
        part = slice(first, min(n, first + ticks))
        command[part] = pulse.amplitude_nm * share[: part.stop - first]
        number[part] = pulse.number
    return command, number
