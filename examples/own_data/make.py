"""Make the files of this folder: two simulated people walk with a device at the knee.

    python examples/own_data/make.py [FOLDER]

The same files come out every time, bit for bit. They are laid out as a lab's own logger might
have: six lines of prose, semicolons, a comma as decimal sign, degrees, milliseconds, volts.
``docs/own-data.md`` is the way from them to a report. What was put into the simulation is in
``truth.csv``, which no analysis reads.
"""

import argparse
import csv
from dataclasses import replace
from pathlib import Path

import numpy as np

from jointz.rig.devices.interface import Stretch
from jointz.rig.sim.direct_walk import WALKING_PULSE, Walk, WalkPlan, walk_directly
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import Preset, preset
from jointz.rig.sim.rig import SimulatedRig
from jointz.rig.sim.walking.plant_build import Grid

SEED = 8
RATE_HZ = 500.0
TIMING_POINTS = {"stance": 21.5, "push_off": 56.0, "swing": 81.0}
PULSES_A_POINT = 10
UNPERTURBED_STRIDES = 14
# The pulse of the second person, counted from 0, in which a hand hit the goniometer.
KNOCKED, KNOCK_DEG, KNOCK_S = 19, 14.0, 0.2
# How well the delay of the goniometer was measured after the session, s.
LAG_SD_S = 0.0005
# Of the amplifier of the footswitch, V.
OFF_V, ON_V, SWITCH_NOISE_V = 0.31, 4.62, 0.02
TORQUE_NOISE_NM = 0.05
# The logger starts to count when it is switched on.
STARTED_MS = (1120, 648)

PROSE = (
    "Gait lab, treadmill 2 (1.2 m/s), logger v3, export for spreadsheet",
    "Participant: {person}   Trial: {trial}",
    "Knee: electrogoniometer on the right leg, degrees, extension positive, 0 = standing",
    "M_sensor: torque cell at the strap, what the leg does to the device, flexion positive",
    "M_cmd: torque asked of the device, on the leg, flexion positive, 0 when it only follows",
    "Heel: pressure switch under the right heel, high on the ground",
)
COLUMNS = ("t_ms", "Knee_deg", "M_sensor_Nm", "M_cmd_Nm", "Heel_V")


def lab() -> Preset:
    """Return a lab whose device has a torque cell: no friction is in what it shows."""
    usual = preset("nominal")
    cell = replace(
        usual.actuator,
        coulomb_friction=0.0,
        gear_friction=0.0,
        rotor_inertia=0.0,
        friction_error_sd=0.0,
    )
    return replace(usual, name="torque cell", actuator=cell)


def make(folder: Path) -> None:
    """Write the recordings, the lab book and the truth.

    Parameters
    ----------
    folder : pathlib.Path
        Where to.
    """
    truth, told = [], []
    for number, started_ms in enumerate(STARTED_MS):
        rig = SimulatedRig(draw_person(number, seed=SEED), lab(), grid=Grid(RATE_HZ))
        person = f"P{number + 1:02d}"
        normal = walk_directly(
            rig, "unperturbed", plan=WalkPlan(per_point=0, warm_up_strides=UNPERTURBED_STRIDES)
        )
        pulses = walk_directly(rig, "perturbed", plan=plan())
        angles = {trial: np.degrees(w.channels["angle"]) for trial, w in both(normal, pulses)}
        if number == 1:
            angles["pulses"] += knock(pulses)
            knocked_ms = 1e3 * pulses.pulses["onset_s"].iloc[KNOCKED] + started_ms
        for trial, walk in both(normal, pulses):
            rows = table(walk, angles[trial], started_ms, noise(number, trial))
            head = [line.format(person=person, trial=trial) for line in PROSE]
            text = "\n".join([*head, ";".join(COLUMNS), *rows]) + "\n"
            (folder / f"{person}_{trial}.csv").write_text(text, encoding="utf-8", newline="\n")
        truth += true_rows(rig, pulses, person)
        told.append(said(rig, person, number))
    write_truth(folder / "truth.csv", truth)
    (folder / "labbook.txt").write_text(labbook(told, knocked_ms), encoding="utf-8", newline="\n")


def plan() -> WalkPlan:
    """Return where the pulses go: every second or third stride, the points in random order."""
    return WalkPlan(
        per_point=PULSES_A_POINT,
        timing_points=TIMING_POINTS,
        gap_strides=(2, 3),
        warm_up_strides=5,
        tail_strides=3,
    )


def both(normal: Walk, pulses: Walk) -> tuple[tuple[str, Walk], ...]:
    """Return the walks by the names that the files have."""
    return ("normal", normal), ("pulses", pulses)


def noise(number: int, trial: str) -> np.random.Generator:
    """Return the generator of the noise of a file's torque cell and footswitch."""
    return np.random.default_rng([SEED, number, len(trial), ord(trial[0])])


def knock(walk: Walk) -> np.ndarray:
    """Return what a hand on the goniometer adds to its angle, degrees."""
    since = walk.time_s - walk.pulses["onset_s"].iloc[KNOCKED]
    inside = (since >= 0.0) & (since < KNOCK_S)
    return np.where(inside, KNOCK_DEG * np.sin(np.pi * since / KNOCK_S), 0.0)


def table(
    walk: Walk, flexion_deg: np.ndarray, started_ms: int, rng: np.random.Generator
) -> list[str]:
    """Return the rows of a file as the logger writes them."""
    actuator = preset("nominal").actuator
    on_leg = actuator.gear_ratio * actuator.torque_constant * walk.channels["current"]
    contact = walk.channels["contact"]
    drift = 0.08 * np.sin(2 * np.pi * walk.time_s / 70.0)
    volts = OFF_V + (ON_V - OFF_V) * contact + drift
    volts = volts + SWITCH_NOISE_V * rng.standard_normal(contact.size)
    torque_nm = TORQUE_NOISE_NM * rng.standard_normal(contact.size) - on_leg
    columns = zip(
        np.rint(1e3 * walk.time_s).astype(int) + started_ms,
        -flexion_deg,
        torque_nm,
        walk.channels["command"],
        volts,
        strict=True,
    )
    return [
        f"{ms};{angle:.1f};{torque:.2f};{command:.0f};{volt:.1f}".replace(".", ",")
        for ms, angle, torque, command, volt in columns
    ]


def true_rows(rig: SimulatedRig, walk: Walk, person: str) -> list[tuple[str, ...]]:
    """Return what was put in: means over the pulses of a timing point and their windows."""
    found = rig.truth(
        "perturbed",
        worn=True,
        stretches=[Stretch(0, 0.0, walk.end_s)],
        pulses=walk.pulses,
        shapes={"": WALKING_PULSE},
    )["timing_points"]
    names = ("stiffness", "damping", "inertia")
    return [
        (person, point, *(f"{found[point][name]:.4g}" for name in names)) for point in TIMING_POINTS
    ]


def write_truth(file: Path, rows: list[tuple[str, ...]]) -> None:
    """Write the truth as a plain table, SI."""
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(("participant", "timing_point", "stiffness", "damping", "inertia"))
        writer.writerows(rows)


def said(rig: SimulatedRig, person: str, number: int) -> str:
    """Return what was measured of a person: mass, and the delay of the goniometer."""
    lag_s = rig.build(worn=True).instruments.angle_lag_s
    measured = lag_s + LAG_SD_S * noise(number, "delay").standard_normal()
    return (
        f"{person}: {rig.person.mass_kg:.1f} kg. Delay of the goniometer behind the torque cell, "
        f"measured afterwards: {1e3 * measured:.1f} ms, +- {1e3 * LAG_SD_S:.1f} ms.\n"
    )


def labbook(told: list[str], knocked_ms: float) -> str:
    """Return what was written down beside the treadmill."""
    return (
        "Pulses: 17 Nm for 250 ms towards flexion, at 21.5, 56 and 81 % of the gait cycle.\n"
        f"{''.join(told)}"
        "P02: a hand hit the goniometer during the pulse at "
        f"t = {knocked_ms:.0f} ms.\n"
        "All of it is simulated: see make.py.\n"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Write the files of examples/own_data.")
    parser.add_argument("folder", nargs="?", type=Path, default=Path(__file__).parent)
    make(parser.parse_args().folder)
