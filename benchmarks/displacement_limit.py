"""Displacement of the knee under a limit: ``python -m benchmarks.displacement_limit``.

Simulated people whose knee is half as stiff as usual walk with pulses of 17 N*m held for 250 ms.
Every session is walked three times with the same seed: with the limit, without it, and without
torque. The true displacement is the knee angle with pulses minus that without torque.
"""

import argparse
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from jointz.core.clock import VirtualClock
from jointz.core.limits import LimitsOverride, SafetyLimits, tightened
from jointz.core.protocols.protocol import Protocol
from jointz.core.session_log import Flag
from jointz.io.log_reader import read_log
from jointz.io.protocols import load_protocol
from jointz.rig.experiment import pulse_runner, scheduler, session
from jointz.rig.session.run import NoOperator
from jointz.rig.sim import rig as rigs
from jointz.rig.sim.benches.running_plant import RunningPlant
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import preset as preset_named
from jointz.rig.sim.walking.layout import State

PERIOD_S = 0.002
#: A knee is back after a pulse of 250 ms within so many ticks of its onset.
_TICKS = 300
#: A cut is false where the displacement without the limit stays below this share of the limit.
_NEAR = 0.8


class _KeptPlant(RunningPlant):
    """A simulated walker whose true knee angle is kept, sample by sample."""

    kept: list[float]

    def _step(self) -> None:
        super()._step()
        self.kept.append(float(self._state[State.PATH] + self._state[State.ANGLE]))


@dataclass(frozen=True, slots=True)
class Walk:
    """A session: its records and the true knee angle by sample."""

    records: np.ndarray
    angle: np.ndarray


@dataclass(frozen=True, slots=True)
class PushedKnee:
    """What became of one pulse."""

    timing_point_pct: float  # phase at its onset
    cut_tick: int | None  # after the onset
    at_cut: float  # rad, true displacement when the torque was cut, 0 if it was not
    rate_at_cut: float  # rad/s, of the true displacement then
    peak: float  # rad, largest true displacement
    peak_without_limit: float  # rad


def protocol_of(pulses_per_point: int, amplitude_nm: float = 17.0) -> Protocol:
    """Return the dissertation's walking with pulses of this size."""
    whole = load_protocol("walking")
    (condition,) = (c for c in whole.conditions if c.perturbations is not None)
    plan = condition.perturbations
    assert plan is not None
    few = plan.model_copy(update={"count_per_point": pulses_per_point})
    conditions = (condition.model_copy(update={"perturbations": few}),)
    assert whole.pulse is not None
    pulse = whole.pulse.model_copy(update={"amplitude_nm": amplitude_nm})
    return whole.model_copy(update={"conditions": conditions, "pulse": pulse})


def walk(
    protocol: Protocol,
    preset: str,
    number: int,
    *,
    seed: int,
    limit_rad: float | None = None,
    torque: bool = True,
) -> Walk:
    """Walk a session on a knee half as stiff; a pulse that is cut is not done again."""

    def limits(_: Protocol, own: SafetyLimits, **__: float) -> SafetyLimits:
        return tightened(own, LimitsOverride(displacement_rad=limit_rad))

    person = draw_person(number, seed=seed)
    half = {point: 0.5 * value for point, value in person.stiffness_per_mass.items()}
    rig = rigs.SimulatedRig(replace(person, stiffness_per_mass=half), preset_named(preset))
    kept: list[float] = []
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        stack.enter_context(patch.object(rigs, "RunningPlant", _KeptPlant))
        stack.enter_context(patch.object(_KeptPlant, "kept", kept, create=True))
        stack.enter_context(patch.object(session, "limits_on_device", limits))
        stack.enter_context(patch.object(pulse_runner, "_MOST_BROKEN_OFF", 10**9))
        stack.enter_context(patch.object(scheduler.Scheduler, "requeue", lambda *_: None))
        if not torque:
            stack.enter_context(patch.object(pulse_runner.PulseRunner, "torque", _no_torque()))
        session.Session(
            session.SessionPlan(protocol, seed, Path(folder)),
            rig,
            clocks=VirtualClock,
            operator=NoOperator(),
            progress=lambda *_: None,
            real_time=False,
        ).run()
        records = read_log(Path(folder) / "logs" / "perturbed-0.jzlog").records.copy()
    return Walk(records[records["part"] == 0], np.array(kept))


def _no_torque() -> Callable[..., float]:
    whole = pulse_runner.PulseRunner.torque

    def torque(self: Any, *args: Any) -> float:
        whole(self, *args)
        return 0.0

    return torque


def pulses_of(limited: Walk, unlimited: Walk, still: Walk) -> Iterator[PushedKnee]:
    """Yield what became of every pulse."""
    records = limited.records
    number = records["pulse"].astype(int)
    sample = np.rint(records["actuator_time_ns"] * 1e-9 / PERIOD_S).astype(int)
    # The first sample that is kept is the one at time 0 or the one after it.
    first = len(limited.angle) - 1 - int(sample[-1])
    for onset in np.flatnonzero((np.diff(number, prepend=0) != 0) & (number > 0)):
        at = int(sample[onset]) + first
        moved = [one.angle[at : at + _TICKS] for one in (limited, unlimited, still)]
        n = min(map(len, moved))
        displacement = moved[0][:n] - moved[2][:n]
        flags = records["flags"][onset : onset + n][number[onset : onset + n] == number[onset]]
        cuts = np.flatnonzero(flags & Flag.CUT)
        cut = int(cuts[0]) if cuts.size else None
        yield PushedKnee(
            float(records["phase_pct"][onset]),
            cut,
            at_cut=float(abs(displacement[cut])) if cut else 0.0,
            rate_at_cut=float(abs(np.gradient(displacement)[cut]) / PERIOD_S) if cut else 0.0,
            peak=float(abs(displacement).max()),
            peak_without_limit=float(abs(moved[1][:n] - moved[2][:n]).max()),
        )


def session_of(
    protocol: Protocol, preset: str, number: int, limits_rad: list[float], *, seed: int
) -> dict[float, list[PushedKnee]]:
    """Return what became of the pulses of one person, limit by limit."""
    unlimited = walk(protocol, preset, number, seed=seed)
    still = walk(protocol, preset, number, seed=seed, torque=False)
    return {
        limit: list(
            pulses_of(walk(protocol, preset, number, seed=seed, limit_rad=limit), unlimited, still)
        )
        for limit in limits_rad
    }


def summary(limit: float, pulses: list[PushedKnee]) -> str:
    """Return the figures of one limit as lines."""
    cut = [p for p in pulses if p.cut_tick is not None]
    false = [p for p in cut if p.peak_without_limit < _NEAR * limit]
    beyond = [p for p in pulses if p.peak_without_limit > limit]
    missed = [p for p in beyond if p.cut_tick is None]
    over_cut = np.array([p.at_cut - limit for p in cut] or [np.nan])
    rate = np.array([p.rate_at_cut for p in cut] or [np.nan])
    ticks = over_cut / np.maximum(rate * PERIOD_S, 1e-9)
    over_peak = np.array([p.peak - limit for p in cut] or [np.nan])
    free = np.array([p.peak_without_limit - limit for p in beyond] or [np.nan])
    worst = int(np.argmax(over_cut))
    return "\n".join(
        [
            f"limit {limit:g} rad: {len(pulses)} pulses, {len(beyond)} beyond it without the limit "
            f"(by {np.median(free):.3f}, at most {free.max():.3f} rad)",
            f"  cut {len(cut)}, of these false {len(false)}; beyond the limit and not cut "
            f"{len(missed)}, by at most "
            f"{max((p.peak - limit for p in missed), default=0.0):.3f} rad",
            f"  true displacement minus limit when cut: median {np.median(over_cut):.3f}, largest "
            f"{over_cut.max():.3f} rad ({ticks[worst]:.1f} ticks of its motion)",
            f"  at its peak: median {np.median(over_peak):.3f}, 95 % "
            f"{np.percentile(over_peak, 95):.3f}, largest {over_peak.max():.3f} rad",
        ]
    )


def by_point(limit: float, pulses: list[PushedKnee]) -> Iterator[str]:
    """Yield a line for each timing point."""
    points = sorted({round(p.timing_point_pct * 2) / 2 for p in pulses})
    for point in points:
        of = [p for p in pulses if abs(p.timing_point_pct - point) < 0.3]
        cut = [p for p in of if p.cut_tick is not None]
        false = sum(p.peak_without_limit < _NEAR * limit for p in cut)
        worst = max((p.peak - limit for p in of), default=0.0)
        yield f"    {point:5.1f} %: {len(of)} pulses, cut {len(cut)}, false {false}, " + (
            f"peak beyond the limit at most {worst:.3f} rad"
        )


def main() -> None:
    """Walk the sessions and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--people", type=int, default=10, help="of each preset")
    parser.add_argument("--per-point", type=int, default=6, help="pulses at each timing point")
    parser.add_argument("--limits", type=float, nargs="+", default=[0.12, 0.2, 0.3])
    parser.add_argument("--presets", nargs="+", default=["nominal", "anthropometric"])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--amplitude", type=float, default=17.0, help="N*m")
    args = parser.parse_args()
    protocol = protocol_of(args.per_point, args.amplitude)
    for preset in args.presets:
        all_pulses: dict[float, list[PushedKnee]] = {limit: [] for limit in args.limits}
        for number in range(args.people):
            found = session_of(protocol, preset, number, args.limits, seed=args.seed)
            for limit, pulses in found.items():
                all_pulses[limit] += pulses
        print(f"{preset}: {args.people} people")
        for limit, pulses in all_pulses.items():
            print(summary(limit, pulses))
            print("\n".join(by_point(limit, pulses)), flush=True)


if __name__ == "__main__":
    main()
