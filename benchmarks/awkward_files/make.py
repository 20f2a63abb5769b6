"""The thirty files, and the simulated walk that all of them hold."""

import functools
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.awkward_files import container_files as container
from benchmarks.awkward_files import instrument_files as instrument
from benchmarks.awkward_files import spreadsheet_files as spreadsheet
from benchmarks.awkward_files.truth import AwkwardFile, Truth, Walk

import jointz

PROTOCOL = Path(__file__).with_name("protocol.toml")
SEED = 7
LENGTH_S = 40.0

_ROWS = (
    ("VP01_gestoert.csv", "cp1252, semicolon, decimal comma, ms, German",
     spreadsheet.german_cp1252),
    ("Sujet2_perturbe.txt", "latin-1, tab, decimal comma, French", spreadsheet.french_latin1),
    ("Sujeto03_perturbado.csv", "UTF-8 with BOM, switch in V, empty columns at the end, Spanish",
     spreadsheet.spanish_bom),
    ("S04_perturbato.txt", "UTF-16 LE, tab, Italian", spreadsheet.italian_utf16_le),
    ("pp05_verstoord.csv", "UTF-16 BE, clock hh:mm:ss,mmm, Dutch", spreadsheet.dutch_utf16_be),
    ("Proband06_gestoert.txt", "Mac Roman, lines end in CR, time in days of Excel",
     spreadsheet.mac_excel_days),
    ("S07_EWP.csv", "comma between columns and in quoted decimals, short names",
     spreadsheet.quoted_decimals),
    ("walk08_pert.dat", "aligned by blanks, names in a comment only", spreadsheet.aligned_blanks),
    ("P09_pert.txt", "bars, row of units, bar at the end, extension positive",
     spreadsheet.bars_extension),
    ("P10_perturbed.csv", "20 lines above, two legs, header of two rows, names twice",
     instrument.two_legs),
    ("Walk11_perturbed.csv", "motion capture: frames, rate above, two force plates, N.mm",
     instrument.motion_capture),
    ("subj12_pert.txt", "no time, interval above, names in a list above, CH1 to CH40",
     instrument.interval_above),
    ("P13_perturbed.lvm", "LabVIEW: two headers, row of units above, gap of 1.8 s",
     instrument.labview_gap),
    ("VP14_Stoerung.txt", "catman: torque on the device, Grad, 1/min", instrument.torque_on_device),
    ("subject_15_perturbed.csv", "ROS: unix time in ns twice, no units, a column of text",
     instrument.robot_log),
    ("S16_pert.csv", "microcontroller: microseconds with jitter, mNm, mV, comments with #",
     instrument.microcontroller),
    ("S17_perturbed.csv", "time starts again in the middle", spreadsheet.restarted_clock),
    ("CP18_gestoert.csv", "included angle, 180 degrees is straight", spreadsheet.included_angle),
    ("Sujet19_perturbe.csv", "Nm/kg, mass above, velocity in deg/s", spreadsheet.per_mass),
    ("S20_perturbed_10kHz.csv", "10 kHz, angle of 100 Hz repeated", instrument.repeated_angle),
    ("S21_walk.csv", "1 kHz, angle of 100 Hz with empty cells between",
     spreadsheet.slow_angle_with_gaps),
    ("S22_EWP.mat", "struct array of two trials", container.struct_array),
    ("sub23.mat", "nested structs with two trials", container.nested_struct),
    ("Subj24_pert.mat", "MATLAB 7.3", container.hdf5_mat),
    ("VP25_gestoert.xlsx", "title, row of units, second sheet", container.workbook_units),
    ("S26_EWP.xlsx", "pulses on a second sheet, no command", container.workbook_pulses),
    ("S27_perturbed_raw.csv", "hopeless: torque in counts", instrument.torque_in_counts),
    ("Subject28_pert.txt", "hopeless: moment without its unit, in fact Nm/kg",
     spreadsheet.moment_without_unit),
    ("VP29_gestoert.csv", "hopeless: dates without milliseconds",
     spreadsheet.dates_without_milliseconds),
    ("S30_ewp.txt", "hopeless: no names, two columns may be the torque",
     spreadsheet.two_torques_without_names),
)  # fmt: skip
FILES = {name: AwkwardFile(name, awkward, write) for name, awkward, write in _ROWS}


def simulate(protocol: Path, folder: Path, participants: int, seed: int) -> list[Any]:
    """Return the recordings of a simulated study."""
    arguments = ["run", str(protocol), "--out", str(folder), "--participants", str(participants)]
    arguments += ["--seed", str(seed), "--workers", "1", "--quiet"]
    subprocess.run([sys.executable, "-m", "jointz", *arguments], check=True)
    return list(jointz.open_study(folder).recordings)


def walk_of(recording: Any) -> Walk:
    """Return the channels of a recording that the files hold."""
    signals = recording.read()[0]
    names = ("angle", "applied_torque", "command", "contact")
    time = signals["time"].to_numpy()
    return Walk(time, *(signals[name].to_numpy().astype(float) for name in names))


@functools.cache
def recorded_walk(seed: int = SEED) -> Walk:
    """Return 40 s of a simulated walk with pulses, at 500 Hz."""
    with tempfile.TemporaryDirectory() as scratch:
        recordings = simulate(PROTOCOL, Path(scratch) / "study", 1, seed)
        walk = walk_of(next(r for r in recordings if r.spec.condition == "perturbed"))
    return walk.at(500.0, 2.0, LENGTH_S)


def make(folder: Path, names: Iterable[str] = (), *, seed: int = SEED) -> dict[str, Truth]:
    """Write files, each into a folder of its own, and return their truths by name."""
    walk = recorded_walk(seed)
    truths = {}
    for name in list(names) or list(FILES):
        own = folder / name.replace(".", "_")
        own.mkdir(parents=True)
        rng = np.random.default_rng([seed, list(FILES).index(name)])
        truths[name] = FILES[name].write(walk, own / name, rng)
    return truths
