"""The second set of thirty: other programs, and folders; written without a look at the reader."""

import functools
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from benchmarks.awkward_files import second_containers as container
from benchmarks.awkward_files import second_folders as folders
from benchmarks.awkward_files import second_instruments as instrument
from benchmarks.awkward_files import second_tables as table
from benchmarks.awkward_files.make import LENGTH_S, simulate, walk_of
from benchmarks.awkward_files.truth import (
    AwkwardFile,
    AwkwardFolder,
    FolderTruth,
    People,
    Truth,
)

PROTOCOL = Path(__file__).with_name("protocol_second.toml")
SEED = 11

_FILES = (
    ("P01_EWP_perturbed.csv", "EMG sensors: a time column per channel, EMG at 1926 Hz first",
     instrument.emg_sensors),
    ("Subject02_perturbed_a.tsv", "QTM analog: no time, names and rate in lines above",
     instrument.qualisys_analog),
    ("S03_perturbed.csv", "Nexus: devices at 1 kHz, angle at 100 Hz in a second section",
     instrument.nexus_sections),
    ("subject04_perturbed.sto", "OpenSim storage: angle and torques positive in extension",
     instrument.opensim_storage),
    ("VP05_gestoert.csv", "ControlDesk: names are model paths, mrad, a column of labels",
     instrument.dspace),
    ("Sub06_EWP.mat", "Simulink structure with time, names in signals(i).label",
     container.structure_with_time),
    ("S07_stoerung.txt", "LabVIEW text without header, decimal comma", table.no_header),
    ("Proband08_gestoert.csv", "TwinCAT Scope: header turned, time column per channel",
     instrument.twincat_scope),
    ("S09_pert.log", "serial monitor: time of day and arrow in each line, N*cm",
     instrument.serial_log),
    ("P10_gestoert.csv", "thousands separators, #NV, remarks, mean under the table",
     table.excel_thousands),
    ("sujet11_perturbe.txt", "R: row names without a header, NA, torque of the leg on the device",
     table.r_write_table),
    ("sub-12_perturbed.csv", "pandas: dates as an index without a name, True and False",
     table.pandas_dates),
    ("pert_13.dat", "numpy savetxt: names after #, exponents, lbf-in", table.numpy_savetxt),
    ("S14_perturbed.csv", "time from -500 ms, 9999 for missing, switch 0 on the ground",
     table.matlab_writetable),
    ("sub15_perturbed.parquet", "parquet: time differences as index, empty events",
     container.parquet),
    ("S16_perturbed.nc", "NetCDF: flexion negative, EMG with a time of its own", container.netcdf),
    ("Subject17_perturbed.c3d", "C3D analog: two plates with negative forces, Nmm",
     instrument.c3d_analog),
    ("S18_perturbed.mat", "Octave text", container.octave_text),
    ("Sujeto19_perturbado.xlsx", "Spanish, mean, min and max below, pulses in ms on a sheet",
     container.workbook_summary),
    ("VP20_gestoert.csv", "hopeless: moment in % of weight times leg length",
     table.percent_of_weight),
    ("S21_perturbed.txt", "hopeless: goniometer in volts", table.goniometer_in_volts),
    ("S22_perturbed.csv", "hopeless: number of the sample, no rate", table.samples_without_rate),
)  # fmt: skip
_FOLDERS = (
    ("folder_23", "hopeless: pulses by time of day, recording from 0 s",
     folders.pulses_by_time_of_day),
    ("folder_24", "German in ASCII, table of pulses in ms", folders.german_ascii),
    ("folder_25", "two people, notes, mean, min and max below", folders.two_people),
    ("folder_26", "BIDS names: two sessions, n/a", folders.bids_sessions),
    ("folder_27", "left and right leg, left with extension positive", folders.left_mirrored),
    ("folder_28", "French, time mm:ss.sss, pulses by number of the sample",
     folders.pulses_in_samples),
    ("folder_29", "Italian, one table of pulses for two people",
     folders.one_table_for_two_people),
    ("folder_30", "Dutch workbooks, unix time, downward force negative, notes as text",
     folders.workbooks_and_notes),
)  # fmt: skip
ITEMS: dict[str, AwkwardFile | AwkwardFolder] = {
    **{name: AwkwardFile(name, awkward, write) for name, awkward, write in _FILES},
    **{name: AwkwardFolder(name, awkward, write) for name, awkward, write in _FOLDERS},
}


@functools.cache
def recorded_people(seed: int = SEED) -> People:
    """Return walks of two people with and without pulses, at 500 Hz."""
    with tempfile.TemporaryDirectory() as scratch:
        recordings = simulate(PROTOCOL, Path(scratch) / "study", 2, seed)
        numbers = {"S01": 1, "S02": 2}
        return {(numbers[r.spec.participant], r.spec.condition): walk_of(r) for r in recordings}


def make(
    folder: Path, names: Iterable[str] = (), *, seed: int = SEED
) -> dict[str, Truth | FolderTruth]:
    """Write files and folders, each into a folder of its own, and return their truths by name."""
    return write_items(ITEMS, recorded_people(seed), folder, names, seeds=(seed, 2))


def write_items(
    items: Mapping[str, AwkwardFile | AwkwardFolder],
    people: People,
    folder: Path,
    names: Iterable[str],
    *,
    seeds: tuple[int, int],
    n_walkers: int = 1,
) -> dict[str, Truth | FolderTruth]:
    """Write items of a set; its single files take the walks of so many people in turn."""
    truths: dict[str, Truth | FolderTruth] = {}
    for name in list(names) or list(items):
        item, number = items[name], list(items).index(name)
        own = folder / name.replace(".", "_")
        own.mkdir(parents=True)
        rng = np.random.default_rng([*seeds, number])
        if isinstance(item, AwkwardFolder):
            truths[name] = item.write(people, own, rng)
        else:
            walk = people[1 + number % n_walkers, "perturbed"].at(500.0, 2.0, LENGTH_S)
            truths[name] = item.write(walk, own / name, rng)
    return truths
