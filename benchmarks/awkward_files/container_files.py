"""MATLAB files and workbooks."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import openpyxl
import scipy.io
from benchmarks.awkward_files.truth import DEG, Array, Truth, Walk, part

Rng = np.random.Generator


def _column(values: Array, digits: int) -> Array:
    return np.round(values, digits)[:, None]


def save_mat(path: Path, variables: dict[str, Any]) -> None:
    scipy.io.savemat(path, variables)
    text = b"MATLAB 5.0 MAT-file, Platform: PCWIN64, Created on: Tue Mar 12 10:21:33 2024"
    with path.open("r+b") as file:
        file.write(text.ljust(116))


def _trials(walk: Walk) -> list[Walk]:
    return [walk.at(500.0, 0.0, 19.0), walk.at(500.0, 20.0, 19.0)]


def struct_array(walk: Walk, path: Path, _rng: Rng) -> Truth:
    trials = _trials(walk)
    names = ["name", "t", "knee_flex_deg", "torque_Nm", "torque_cmd_Nm", "heel"]
    data = np.empty((1, len(trials)), dtype=[(name, object) for name in names])
    for i, trial in enumerate(trials):
        data[0, i] = (
            f"EWP_{i + 1}", _column(trial.clock, 3), _column(trial.angle / DEG, 2),
            _column(trial.torque, 3), _column(trial.command, 2), _column(trial.contact, 0),
        )  # fmt: skip
    save_mat(path, {"data": data})
    asked = ("trials", "data.2", "data(2", "elements", "struct array")
    return Truth(tuple(part(t) for t in trials), "S22", open=asked)


def nested_struct(walk: Walk, path: Path, _rng: Rng) -> Truth:
    trials = _trials(walk)
    tree: dict[str, Any] = {"info": {"mass_kg": 73.0, "fs_Hz": 500.0, "leg": "right"}}
    tree["perturbed"] = {
        f"trial{i:02d}": {
            "time_s": _column(trial.clock, 3),
            "knee": {"flexion_deg": _column(trial.angle / DEG, 2)},
            "exo": {
                "torque_Nm": _column(trial.torque, 3), "torque_cmd_Nm": _column(trial.command, 2)
            },
            "foot": {"heel_contact": _column(trial.contact, 0)},
        }
        for i, trial in enumerate(trials, 1)
    }  # fmt: skip
    save_mat(path, {"sub23": tree})
    asked = ("trial01", "trial02", "trials")
    return Truth(tuple(part(t) for t in trials), "sub23", open=asked)


def hdf5_mat(walk: Walk, path: Path, _rng: Rng) -> Truth:
    signals = {
        "t": np.round(walk.clock, 3), "kneeFlexion_deg": np.round(walk.angle / DEG, 2),
        "torque_Nm": np.round(walk.torque, 3), "torqueCmd_Nm": walk.command,
        "footswitch": walk.contact,
    }  # fmt: skip
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in signals.items():  # MATLAB writes a column as one row
            file.create_dataset(name, data=values[None, :], track_times=False)
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
    text = b"MATLAB 7.3 MAT-file, Platform: PCWIN64, Created on: Tue Mar 12 10:21:33 2024 HDF5"
    head = (text + b" schema 1.00 .").ljust(124) + b"\x00\x02IM"
    with path.open("r+b") as file_bytes:
        file_bytes.write(head)
    return Truth((part(walk),), "Subj24")


def _save(book: openpyxl.Workbook, path: Path) -> None:
    book.properties.creator = "lab"
    book.save(path)


def _rows(sheet: Any, columns: list[Array]) -> None:
    for row in zip(*(c.tolist() for c in columns), strict=True):
        sheet.append(row)


def workbook_units(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(200.0)
    book = openpyxl.Workbook()
    notes = book.active
    notes.title = "Protokoll"
    for row in (["Proband", "VP25"], ["Bedingung", "gestört"], ["Masse", 73, "kg"]):
        notes.append(row)
    sheet = book.create_sheet("Messung")
    sheet.append(["Gehen mit Störung, 1,2 m/s"])
    sheet.append([])
    sheet.append(["Zeit", "Kniewinkel", "Drehmoment", "Sollmoment", "Fußkontakt"])
    sheet.append(["ms", "°", "Nm", "Nm", "-"])
    _rows(sheet, [
        np.round(1e3 * slow.clock), np.round(slow.angle / DEG, 2), np.round(slow.torque, 3),
        slow.command, slow.contact,
    ])  # fmt: skip
    _save(book, path)
    return Truth((part(slow),), "VP25", open=("torque&sheet", "names of the columns"))


def workbook_pulses(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(200.0)
    rises = np.flatnonzero(np.diff(walk.command) > 0.0) + 1
    onsets = np.round(walk.clock[rises], 3)
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.title = "Data"
    sheet.append(["Time (s)", "Knee flexion (deg)", "Torque (Nm)", "Heel contact"])
    _rows(sheet, [
        np.round(slow.clock, 3), np.round(slow.angle / DEG, 2), np.round(slow.torque, 3),
        slow.contact,
    ])  # fmt: skip
    pulses = book.create_sheet("Pulses")
    pulses.append(["No.", "Onset (s)", "Duration (ms)", "Torque (Nm)"])
    for i, onset in enumerate(onsets.tolist(), 1):
        pulses.append([i, onset, 250, 17])
    _save(book, path)
    return Truth(
        (part(slow, omit=("command",)),), "S26", open=("pulse", "perturbations"),
        onsets_s=tuple(onsets.tolist()),
    )  # fmt: skip
