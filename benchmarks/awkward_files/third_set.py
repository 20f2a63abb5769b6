"""The third set of thirty, by what an acceptance test looks at; written without a look."""

from collections.abc import Iterable
from pathlib import Path

from benchmarks.awkward_files import third_folders as folders
from benchmarks.awkward_files import third_instruments as instrument
from benchmarks.awkward_files import third_tables as table
from benchmarks.awkward_files.second_set import recorded_people, write_items
from benchmarks.awkward_files.truth import AwkwardFile, AwkwardFolder, FolderTruth, Truth

SEED = 13

_FILES = (
    ("Proband01_gestoert.csv", "encoding: DOS code page 850, end mark 0x1A, German",
     table.dos_german),
    ("Sujet02_perturbe.csv", "encoding: UTF-8 encoded twice, tab, ms, French",
     table.french_encoded_twice),
    ("P03_perturbed.txt", "encoding: UTF-16 without a mark", table.utf16_without_bom),
    ("VP05_gestoert.csv", "delimiter: sep=; above, all cells quoted, decimal comma, V",
     table.quoted_with_sep_line),
    ("walk06_perturbed.txt", "delimiter: aligned, names with blanks, units, dashes, two legs",
     table.names_with_blanks),
    ("Proband07_gestoert.csv", "delimiter: comma between columns and as decimal, unquoted",
     table.comma_twice),
    ("S09_pert.csv", "clock: hour, minute, second and ms in four columns",
     instrument.clock_in_four_columns),
    ("Subj10_perturbed.txt", "clock: 16-bit counter of 0.1 ms that wraps",
     instrument.wrapped_counter),
    ("S11_perturbed.csv", "clock: 12:59 PM is followed by 1:00 PM, force plate",
     instrument.twelve_hours),
    ("S13_pert.mat", "header: matrix, names and units in cell arrays, extension positive",
     instrument.names_in_a_cell),
    ("VP14_gestoert.xlsx", "header: merged cells over two legs, title, empty first column",
     table.merged_header),
    ("Subject15_perturbed.txt", "header: Visual3D, five rows, no units, flexion negative",
     instrument.visual3d),
    ("S17_perturbed.csv", "unit: force on the cuff, lever arm above", table.force_on_the_cuff),
    ("Sujeto18_perturbado.csv", "unit: kgf·cm, Spanish", table.kilogram_force),
    ("P19_pert.csv", "unit: whole numbers of 0.1 deg and 0.01 Nm, microseconds",
     instrument.can_integers),
    ("Soggetto21_perturbato.csv", "language: Italian abbreviations, extension positive, V",
     table.italian_extension),
    ("pp22_verstoord.txt", "language: Dutch, ja and nee for the heel", table.dutch_text),
    ("sujet23_perturbe.csv", "language: French, exo on the left, VRAI, leg on device",
     table.french_left_leg),
    ("S25_perturbed.csv", "sampling: 1 kHz with times in 10 ms", instrument.rounded_time),
    ("sub26_perturbed.csv", "sampling: long table, one row per signal and time",
     table.long_table),
    ("S27_perturbed.csv", "sampling: lost packets, counter of 0 to 255",
     instrument.lost_packets),
    ("Subject29_perturbed.csv", "hopeless: torque in % MVC", table.percent_of_mvc),
)  # fmt: skip
_FOLDERS = (
    ("folder_04", "encoding: Windows and Mac, Spanish, force plate", folders.two_encodings),
    ("folder_08", "delimiter: another one for each person and pulse table",
     folders.two_delimiters),
    ("folder_12", "clock: recordings and pulses by time of day, German",
     folders.all_by_the_clock),
    ("folder_16", "header: BIDS motion, names in channels.tsv, pulses in events.tsv",
     folders.bids_motion),
    ("folder_20", "unit: deg and Nm, rad and mNm, told in a note, torque on the device",
     folders.units_in_a_note),
    ("folder_24", "language: Spanish, right and left, tables of pulses",
     folders.spanish_two_sides),
    ("folder_28", "sampling: no time, a rate for each person in a note, Italian",
     folders.rates_in_a_note),
    ("folder_30", "hopeless: Nm/kg without the masses of two people",
     folders.per_mass_without_masses),
)  # fmt: skip
ITEMS: dict[str, AwkwardFile | AwkwardFolder] = {
    **{name: AwkwardFile(name, awkward, write) for name, awkward, write in _FILES},
    **{name: AwkwardFolder(name, awkward, write) for name, awkward, write in _FOLDERS},
}


def make(
    folder: Path, names: Iterable[str] = (), *, seed: int = SEED
) -> dict[str, Truth | FolderTruth]:
    """Write files and folders, each into a folder of its own, and return their truths by name."""
    people = recorded_people(seed)
    return write_items(ITEMS, people, folder, names, seeds=(seed, 3), n_walkers=2)
