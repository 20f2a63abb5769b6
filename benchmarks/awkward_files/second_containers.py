"""Second set: MATLAB, Octave, parquet, NetCDF and workbook files."""

from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd
import xarray as xr
from benchmarks.awkward_files.container_files import save_mat
from benchmarks.awkward_files.truth import DEG, Array, Truth, Walk, part

Rng = np.random.Generator


def structure_with_time(walk: Walk, path: Path, _rng: Rng) -> Truth:
    signals = (
        ("q_knee_flexion [rad]", walk.angle), ("tau_exo [Nm]", walk.torque),
        ("tau_command [Nm]", walk.command), ("heel_contact", walk.contact),
    )  # fmt: skip
    kinds = [("values", object), ("dimensions", object), ("label", object), ("title", object)]
    array = np.empty((1, len(signals)), dtype=[*kinds, ("blockName", object)])
    for i, (label, values) in enumerate(signals):
        array[0, i] = (values[:, None], 1.0, label, "", "exo_rt/Host Scope")
    save_mat(path, {"ScopeData": {
        "time": walk.clock[:, None], "signals": array, "blockName": "exo_rt/Host Scope",
    }})  # fmt: skip
    asked = ("signals", "struct", "label")
    return Truth((part(walk),), "Sub06", open=asked)


def octave_text(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(200.0)
    signals = {
        "t_s": slow.clock, "knee_flexion_deg": slow.angle / DEG, "torque_Nm": slow.torque,
        "torque_command_Nm": slow.command, "heel_contact": slow.contact,
    }  # fmt: skip
    lines = ["# Created by Octave 6.4.0, Tue Mar 12 10:21:33 2024 CET <lab@exo>"]
    for name, values in signals.items():
        lines += [f"# name: {name}", "# type: matrix", f"# rows: {values.size}", "# columns: 1"]
        lines += [f" {value:.12g}" for value in values.tolist()] + ["", ""]
    path.write_text("\n".join(lines), "utf-8")
    asked = ("octave", "save&-v7", "text&mat")
    return Truth((part(slow),), "S18", open=asked)


def parquet(walk: Walk, path: Path, _rng: Rng) -> Truth:
    frame = pd.DataFrame(
        {
            "knee_flexion_deg": walk.angle / DEG, "exo_torque_Nm": walk.torque,
            "exo_torque_cmd_Nm": walk.command, "heel_contact": walk.contact > 0.5,
            "event": ["" for _ in walk.time],
        },
        index=pd.to_timedelta(np.round(walk.clock * 1e9).astype("int64"), unit="ns"),
    )  # fmt: skip
    frame.index.name = "time"
    frame.to_parquet(path)
    return Truth((part(walk),), "sub15", open=("parquet&csv", "@channels.time", "time&unit"))


def netcdf(walk: Walk, path: Path, rng: Rng) -> Truth:
    slow = walk.at(200.0)
    time = ("time", slow.clock, {"units": "s"})
    signals = {
        "knee_angle": (slow.angle / DEG, "degree", "right knee angle, flexion negative", -1.0),
        "exo_torque": (slow.torque, "N m", "torque on the leg, flexion negative", -1.0),
        "exo_torque_reference": (slow.command, "N m", "reference, flexion negative", -1.0),
        "heel": (slow.contact, "1", "1: heel on the ground", 1.0),
    }
    data = xr.Dataset(coords={"time": time})
    for name, (values, unit, text, sign) in signals.items():
        data[name] = ("time", sign * values, {"units": unit, "long_name": text})
    emg = ("emg_time", np.arange(80_000) / 2000.0, {"units": "s"})
    data = data.assign_coords(emg_time=emg)
    data["emg"] = ("emg_time", 1e-5 * rng.standard_normal(80_000), {"units": "V"})
    data.attrs = {"subject": "S16", "condition": "perturbed", "leg": "right"}
    data.to_netcdf(path, engine="h5netcdf")
    asked = ("@channels.angle.positive", "@positive", "flexion negative", "extension")
    return Truth((part(slow),), "S16", open=asked)


def _append(sheet: openpyxl.worksheet.worksheet.Worksheet, columns: list[Array]) -> None:
    for row in zip(*(column.tolist() for column in columns), strict=True):
        sheet.append(row)


def workbook_summary(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(200.0)
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.title = "Registro"
    sheet.append(["Tiempo (ms)", "Ángulo rodilla (°)", "Par exo (N·m)", "Contacto talón", "Notas"])
    columns = [
        np.round(1e3 * slow.clock), np.round(slow.angle / DEG, 2), np.round(slow.torque, 3),
        slow.contact,
    ]  # fmt: skip
    _append(sheet, columns)
    sheet.append([])
    for name, value in (("Promedio", np.mean), ("Mínimo", np.min), ("Máximo", np.max)):
        sheet.append([name, *(round(float(value(column)), 3) for column in columns[1:])])
    onsets = walk.clock[np.flatnonzero(np.diff(walk.command) > 0.0) + 1]
    pulses = book.create_sheet("Perturbaciones")
    pulses.append(["N.º", "Inicio (ms)", "Duración (ms)", "Par (N·m)"])
    for i, onset in enumerate(onsets.tolist(), 1):
        pulses.append([i, round(1e3 * onset), 250, 17])
    book.properties.creator = "lab"
    book.save(path)
    true = part(slow, omit=("command",))
    asked = ("pulse", "perturbations", "promedio", "perturbaciones")
    return Truth((true,), "Sujeto19", open=asked, onsets_s=tuple(onsets.tolist()))
