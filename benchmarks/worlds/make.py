"""Studies of simulated people: `python -m benchmarks.worlds.make OUT --protocol hold`."""

import argparse
import json
import time
from pathlib import Path

import numpy as np
import pandas as pd

from . import gait, protocols, sensors, truth
from . import leg as lg
from .person import Person, draw_person

_HEAD = """jointz = 1
joint = "knee"
kind = "walking"
positive = "flexion"
torque_acts_on = "joint"
coupling = "strap"

[channels]
time = { column = "time_s", unit = "s" }
angle = { column = "knee_angle_deg", unit = "deg" }
torque = { column = "torque_nm", unit = "N*m" }
command = { column = "command_nm", unit = "N*m" }
contact = { column = "footswitch", kind = "contact" }
joint_encoder = { column = "encoder_deg", unit = "deg" }
shank_velocity = { column = "shank_gyro_deg_s", unit = "deg/s" }
thigh_velocity = { column = "thigh_gyro_deg_s", unit = "deg/s" }
"""


def _run(leg: lg.Leg, inputs: tuple, start: int, stop: int) -> np.ndarray:
    return leg.run(tuple(a[start:stop] for a in inputs), dec=sensors.DEC)


def _walk(
    person: Person, strikes: np.ndarray, rng: np.random.Generator, pulses: list, window: float
):
    """Return the run, the command, onsets and true values of all pulses."""
    table, start = gait.build_table(person)
    leg, inputs = lg.Leg(person, table, start), gait.make_inputs(person, strikes, rng)
    onsets = [protocols.onset_step(p, strikes) // 4 * 4 for p in pulses]
    for pulse, i in zip(pulses, onsets, strict=True):
        samples = pulse.samples()
        inputs[4][i : i + len(samples)] = samples
    parts, values, done = [], [], 0
    for pulse, i in zip(pulses, onsets, strict=True):
        parts.append(_run(leg, inputs, done, i))
        values.append(truth.pulse_truth(leg, inputs, i, pulse, window))
        done = i
    parts.append(_run(leg, inputs, done, len(inputs[0])))
    return np.concatenate(parts), inputs[4], onsets, values


def _knee_figures(out: np.ndarray, strikes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and SD over strides of the knee angle in degrees, at each % of the cycle."""
    at = np.arange(len(out)) * lg.DT * sensors.DEC
    grid = np.linspace(strikes[5:-2], strikes[6:-1], 100, axis=1)
    cycles = np.interp(grid, at, np.degrees(out[:, lg.O_KNEE]))
    return cycles.mean(axis=0), cycles.std(axis=0)


def make_person(
    folder: Path, person: Person, protocol: str, seed: list[int], per_point: int, minutes: float
) -> tuple[str, dict]:
    """Write the recordings of one person; return their part of the study file and the truth."""
    rng = np.random.default_rng([*seed, list(protocols.KINDS).index(protocol)])
    quiet = gait.make_strides(person, int(minutes * 60 / person.stride_s), rng)
    out, command, _, _ = _walk(person, quiet, rng, [], 0.0)
    sensors.record(person, out, command, quiet, rng).to_csv(
        folder / f"{person.name}_unperturbed.csv", index=False
    )
    mean, sd = _knee_figures(out, quiet)
    pulses = protocols.plan_pulses(protocol, per_point, rng)
    strikes = gait.make_strides(person, pulses[-1].stride + 6, rng)
    window = protocols.WINDOW_S[protocol]
    out, command, onsets, values = _walk(person, strikes, rng, pulses, window)
    sensors.record(person, out, command, strikes, rng).to_csv(
        folder / f"{person.name}_perturbed.csv", index=False
    )
    pd.DataFrame({
        "onset_s": [round(i * lg.DT, 4) for i in onsets],
        "duration_s": [round(p.duration_s, 4) for p in pulses],
        "amplitude_nm": [p.amplitude for p in pulses],
        "timing_point": [p.timing_point for p in pulses],
    }).to_csv(folder / f"{person.name}_pulses.csv", index=False)  # fmt: skip
    points = {
        name: truth.average(
            [v for v, p in zip(values, pulses, strict=True) if p.timing_point == name]
        )
        for name in protocols.TIMING_POINTS
    }
    print(
        f"  knee by 10 %: {mean[::10].round(1)} deg; SD {sd[::10].round(1)}, mean {sd.mean():.1f}"
    )
    for name, v in points.items():
        print(
            f"  {name}: K {v['stiffness']:6.1f} B {v['damping']:5.2f} J {v['inertia']:.3f} "
            f"onset K {v['stiffness_onset']:6.1f} B {v['damping_onset']:5.2f}, chain K "
            f"{v['chain_stiffness']:6.1f} B {v['chain_damping']:5.2f} J {v['chain_inertia']:.3f}, "
            f"moves {v['displacement_deg']:.1f} deg"
        )
    return _describe(person, sensors.calibration(person, rng)), points


def _describe(person: Person, calibration: dict[str, tuple[float, float]]) -> str:
    lines = [
        "", "[[participants]]", f'id = "{person.name}"', f"mass_kg = {person.mass:.1f}",
        f"height_m = {person.height:.2f}", "[participants.calibration]",
    ]  # fmt: skip
    lines += [f"{k} = {{ value = {v:.6g}, sd = {sd:.4g} }}" for k, (v, sd) in calibration.items()]
    for condition in ("unperturbed", "perturbed"):
        lines += ["[[recordings]]", f'participant = "{person.name}"', f'condition = "{condition}"']
        lines += [f'file = "{person.name}_{condition}.csv"']
    return "\n".join([*lines, f'perturbations = "{person.name}_pulses.csv"', ""])


def make_study(
    folder: Path, people: int, protocol: str, seed: int, *, per_point: int | None = None,
    minutes: float = 4.0,
) -> None:  # fmt: skip
    """Write a study folder of simulated people, and `truth.json`."""
    folder.mkdir(parents=True, exist_ok=True)
    per_point = per_point or (50 if protocol == "hold" else 48)
    parts, values = [], {}
    for number in range(people):
        began = time.monotonic()
        person = draw_person(seed, number)
        print(f"{person.name}: {person.mass:.1f} kg, {person.height:.2f} m")
        part, values[person.name] = make_person(
            folder, person, protocol, [seed, number], per_point, minutes
        )
        parts.append(part)
        print(f"  {time.monotonic() - began:.1f} s")
    mass, centre, _ = person.device
    window = protocols.WINDOW_S[protocol]
    settings = f'\n[perturbations]\nsource = "table"\nwindow_s = {window}\n'
    device = f"\n[device]\nmass_kg = {mass:.2f}\ncentre_m = {centre:.3f}\n"
    (folder / "study.toml").write_text(_HEAD + settings + device + "".join(parts))
    content = {
        "world": "muscled leg", "protocol": protocol, "seed": seed, "window_s": window,
        "definitions": truth.DEFINITIONS, "participants": values,
    }  # fmt: skip
    (folder / "truth.json").write_text(json.dumps(content, indent=1))


def main() -> None:
    """Read the command line and write the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--people", type=int, default=20)
    parser.add_argument("--protocol", choices=list(protocols.KINDS), default="hold")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--per-point", type=int, help="pulses per timing point (50; doublets 48)")
    parser.add_argument("--minutes", type=float, default=4.0, help="unperturbed walking")
    chosen = parser.parse_args()
    make_study(
        chosen.out, chosen.people, chosen.protocol, chosen.seed,
        per_point=chosen.per_point, minutes=chosen.minutes,
    )  # fmt: skip


if __name__ == "__main__":
    main()
