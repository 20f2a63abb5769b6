"""Profiles of simulated people against their truth: ``python -m benchmarks.control_profiles``.

Two tables: how often the intervals of stiffness, damping and equilibrium hold the truth
(``nominal``), and the error of the torque along strides that the profile has not seen (``clean``).
"""

import argparse
import json
import tempfile
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

import jointz
from jointz.control.impedance_profile import GRID_PCT, ImpedanceProfile, mean_velocity
from jointz.core.errors import JointzError
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import QUICK_GRID, WalkPlan, walk_directly
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import preset as preset_named
from jointz.rig.sim.rig import SimulatedRig
from jointz.rig.sim.walking.path import path

QUANTITIES = ("stiffness", "damping", "equilibrium")
_CURVES = ("stiffness", "damping", "moment")
_STRIDES = 60
_WARM_UP = 10


@dataclass(frozen=True, slots=True)
class Person:
    """A person's profile, rig and truth; what was refused in place of the profile."""

    profile: ImpedanceProfile | None
    rig: SimulatedRig
    truth: tuple[np.ndarray, ...]  # stiffness, damping, equilibrium at the profile's phases
    refused: str = ""


def people(preset: str, count: int, *, per_point: int, seed: int) -> list[Person]:
    """Simulate people, analyse them and make their profiles."""
    with tempfile.TemporaryDirectory() as folder:
        study = simulate_study(
            Path(folder) / "study",
            preset=preset,
            participants=count,
            plan=WalkPlan(per_point=per_point),
            unperturbed_strides=_STRIDES,
            seed=seed,
        )
        analysis = jointz.analyze(study)
        truth = json.loads((study / "ground_truth.json").read_text())["participants"]
    found = []
    for number in range(count):
        rig = SimulatedRig(draw_person(number, seed=seed), preset_named(preset), grid=QUICK_GRID)
        curves = truth[rig.person.id]["unperturbed"]["curves"]
        true = _truth(rig, {name: np.array(curves[name][:-1]) for name in _CURVES})
        try:
            found.append(Person(jointz.impedance_profile(analysis, rig.person.id), rig, true))
        except JointzError as exc:
            found.append(Person(None, rig, true, str(exc)))
    return found


def _truth(rig: SimulatedRig, curves: dict[str, np.ndarray]) -> tuple[np.ndarray, ...]:
    """Return stiffness, damping and equilibrium along the true mean stride without pulses."""
    motion, angles, durations = rig.motion("unperturbed", 0), [], []
    for _ in range(_STRIDES + _WARM_UP):
        stride = motion.next()
        times = stride.start_s + stride.duration_s * np.linspace(0.0, 1.0, 501)
        angle = [path(stride.row, float(time))[0] for time in times]
        angles.append(np.interp(GRID_PCT / 100.0, stride.cycles(times), angle))
        durations.append(stride.duration_s)
    angle = np.mean(angles[_WARM_UP:], axis=0)
    velocity = mean_velocity(angle, float(np.mean(durations)))
    stiffness, damping = curves["stiffness"], curves["damping"]
    lever = (curves["moment"] + damping * velocity) / stiffness
    return stiffness, damping, angle + lever


def coverage(found: list[Person]) -> dict[str, tuple[float, float]]:
    """Return quantity -> share of all phases, and of the timing points, whose interval holds it."""
    shares = {}
    for k, name in enumerate(QUANTITIES):
        held, at = [], []
        for one in found:
            if one.profile is None:
                continue
            low, high = (getattr(one.profile, f"{name}{end}") for end in ("_low", "_high"))
            inside = (low <= one.truth[k]) & (one.truth[k] <= high)
            held.append(inside.mean())
            at.append(inside[[round(p.stiffness_pct) % 100 for p in one.profile.knots]].mean())
        shares[name] = (float(np.mean(held)), float(np.mean(at)))
    return shares


def torque_errors(one: Person) -> tuple[float, float]:
    """Return RMS error of the torque along unseen strides, and their SD of the moment, N*m."""
    if one.profile is None:
        return np.nan, np.nan
    walk = walk_directly(one.rig, "unseen", plan=WalkPlan(per_point=0, warm_up_strides=30))
    time, contact, moment = walk.time_s, walk.channels["contact"], walk.channels["joint_moment"]
    strikes = time[1:][(contact[1:] > 0.5) & (contact[:-1] <= 0.5)]
    strikes = strikes[np.append(True, np.diff(strikes) > 0.5)]
    velocity = np.gradient(walk.channels["angle"], time)
    errors, curves = [], []
    for start, end in pairwise(strikes[2:-1]):
        own = (time >= start) & (time < end)
        phase = 100.0 * (time[own] - start) / (end - start)
        torque = one.profile.torque(phase, walk.channels["angle"][own], velocity[own])
        errors.append(torque - moment[own])
        curves.append(np.interp(GRID_PCT, phase, moment[own]))
    between = np.sqrt(np.mean(np.var(curves, axis=0, ddof=1)))
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2))), float(between)


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--people", type=int, default=20)
    parser.add_argument("--per-point", type=int, default=40)
    parser.add_argument("--seed", type=int, default=5)
    chosen = parser.parse_args()
    nominal = people("nominal", chosen.people, per_point=chosen.per_point, seed=chosen.seed)
    refused = [one.refused for one in nominal if one.profile is None]
    print(f"nominal, {chosen.people} people, {len(refused)} refused")
    for name, (everywhere, at) in coverage(nominal).items():
        print(f"  {name:<12} {everywhere:.3f} of all phases, {at:.3f} of the timing points")
    clean = people("clean", min(chosen.people, 10), per_point=20, seed=chosen.seed)
    for one in clean:
        rms, between = torque_errors(one)
        print(f"clean {one.rig.person.id}: RMS {rms:.2f} N*m, SD between strides {between:.2f} N*m")
    for text in [*refused, *(one.refused for one in clean if one.profile is None)]:
        print(text)


if __name__ == "__main__":
    main()
