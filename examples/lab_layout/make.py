"""Make a motion lab's folder: two simulated people with a motor at the knee, on two clocks.

    python examples/lab_layout/make.py FOLDER [--form mat|csv]

Motion capture at 240 Hz has the knee's angle, extension positive; a card at 1 kHz has current and
trigger of the motor. Heel strikes are times. ``docs/lab-layout.md`` leads from here to a report.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.io import savemat

from jointz.rig.sim.direct_walk import WALKING_PULSE, WalkPlan, walk_directly
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import preset
from jointz.rig.sim.rig import SimulatedRig
from jointz.rig.sim.walking.plant_build import Grid

SEED, CAMERA_HZ, CARD_HZ = 8, 240.0, 1000.0
TIMING_POINTS = {"stance": 21.5, "push_off": 56.0, "swing": 81.0}
PULSE = WALKING_PULSE.model_copy(update={"direction": "both"})
PLANS = {
    "normal": WalkPlan(per_point=0, warm_up_strides=20),
    "pulses": WalkPlan(10, PULSE, timing_points=TIMING_POINTS, gap_strides=(2, 3)),
}
NO_FRICTION = dict.fromkeys(
    ("coulomb_friction", "gear_friction", "rotor_inertia", "friction_error_sd"), 0.0
)
TRIGGER_V, TRIGGER_NOISE_V = 5.0, 0.02


def trial(rig: SimulatedRig, name: str) -> dict[str, dict[str, np.ndarray]]:
    """Return the tables of a trial, by the device that wrote them."""
    walk = walk_directly(rig, name, plan=PLANS[name])
    noise = np.random.default_rng([SEED, rig.person.number]).standard_normal(walk.time_s.size)
    camera_s = np.arange(0.0, walk.end_s, 1 / CAMERA_HZ)
    angle = np.interp(camera_s, walk.time_s, -np.degrees(walk.channels["angle"]))
    volts = TRIGGER_V * (walk.channels["command"] != 0.0) + TRIGGER_NOISE_V * noise
    motion = rig.motion(name, 0)
    strikes = [motion.next().start_s for _ in range(int(walk.end_s))]
    card = {"time": walk.time_s, "motorCurrent": -walk.channels["current"], "trigger": volts}
    events = {"heelStrike": np.array([s for s in strikes if 0.0 < s < walk.end_s])}
    return {"mocap": {"time": camera_s, "kneeAngle": angle}, "daq": card, "events": events}


def make(folder: Path, form: str) -> None:
    """Write the folder: a ``.mat`` a person, or a csv file a device and a table of people."""
    folder.mkdir(parents=True)
    lab = preset("nominal")
    lab = replace(lab, actuator=replace(lab.actuator, **NO_FRICTION))
    people = {}
    for number in (0, 1):
        rig = SimulatedRig(draw_person(number, seed=SEED), lab, grid=Grid(CARD_HZ))
        name, trials = f"P{number + 1:02d}", {each: trial(rig, each) for each in PLANS}
        people[name] = round(rig.person.mass_kg, 1)
        if form == "mat":
            rows = [{"name": each, **tables} for each, tables in trials.items()]
            subject = {"id": name, "mass": people[name]}
            savemat(folder / f"{name}.mat", {"subject": subject, "trial": rows})
        else:
            tables = {f"{name}_{each}_{k}": t for each, ts in trials.items() for k, t in ts.items()}
            for file, table in tables.items():
                pd.DataFrame(table).round(5).to_csv(folder / f"{file}.csv", index=False)
    if form == "csv":
        table = pd.Series(people, name="mass_kg").rename_axis("participant_id")
        table.to_csv(folder / "participants.tsv", sep="\t")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Write a lab's folder, as .mat or csv files.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--form", choices=("mat", "csv"), default="mat")
    make(**vars(parser.parse_args()))
