"""Second set: files in the style of acquisition, motion-capture and control programs."""

from pathlib import Path

import ezc3d  # type: ignore[import-untyped]
import numpy as np
from benchmarks.awkward_files.instrument_files import ground_reaction, other_leg
from benchmarks.awkward_files.text_tables import numbers, volts, write_table
from benchmarks.awkward_files.truth import DEG, Array, Part, Truth, Walk, part

Rng = np.random.Generator


def emg_sensors(walk: Walk, path: Path, rng: Rng) -> Truth:
    own = walk.at(500.0, 0.0, 15.0)
    n = round(15.0 * 1925.926)
    emg = [numbers(np.arange(n) / 1925.926, 6), numbers(5e-5 * rng.standard_normal(n), 8)]
    channels = (
        ("Adapter 5: Knee flexion (deg)", numbers(own.angle / DEG, 3)),
        ("Adapter 5: Exo torque (Nm)", numbers(own.torque, 4)),
        ("Adapter 5: Exo torque command (Nm)", numbers(own.command, 3)),
        ("FSR 6: Right heel (V)", numbers(volts(own.contact, rng), 3)),
    )
    names, columns = ["X[s]", "R VASTUS LATERALIS: EMG 1 (V)"], emg
    for name, values in channels:
        names += ["X[s]", name]
        short = [numbers(own.clock, 6), values]
        columns += [column + [""] * (n - own.time.size) for column in short]
    header = ",".join(f'"{name}"' for name in names)
    write_table(path, columns, above=[header], delimiter=",")
    return Truth((part(own),), "P01", open=("@channels.time", "x[s]", "clock", "rates"))


def qualisys_analog(walk: Walk, path: Path, rng: Rng) -> Truth:
    above = [
        f"NO_OF_SAMPLES\t{walk.time.size}", "TOT_NO_OF_CHAN\t4", "FREQUENCY\t500",
        "TIME_STAMP\t2024-03-12, 10:21:33.451\t9120.88231", "FIRST_SAMPLE\t1",
        "CHANNEL_NAMES\tKneeFlexion_deg\tExoTorque_Nm\tExoTorqueRef_Nm\tHeelSwitch_V",
        "CHANNEL_GAIN\t1\t1\t1\t1",
    ]  # fmt: skip
    columns = [
        numbers(walk.angle / DEG, 3), numbers(walk.torque, 4), numbers(walk.command, 3),
        numbers(volts(walk.contact, rng), 3),
    ]  # fmt: skip
    write_table(path, columns, above=above, delimiter="\t")
    asked = ("@sample_rate_hz", "sample_rate_hz", "columns&no names", "channel_names")
    return Truth((part(walk),), "Subject02", open=asked)


def nexus_sections(walk: Walk, path: Path, _rng: Rng) -> Truth:
    fast = walk.at(1000.0, 0.0, 15.0)
    n = fast.time.size
    frames = [[str(1 + i // 10), str(i % 10)] for i in range(n)]
    devices = zip(
        frames, numbers(1e3 * fast.torque, 0), numbers(1e3 * fast.command, 0),
        numbers(4.8 * fast.contact, 2), strict=True,
    )  # fmt: skip
    lines = ["Devices", "1000", ",,Exo - Knee,,Footswitch - Heel"]
    lines += ["Frame,Sub Frame,Torque,Torque command,Voltage", ",,N.mm,N.mm,V"]
    lines += [",".join([*frame, *cells]) for frame, *cells in devices]
    lines += ["", "Model Outputs", "100", ",,S03:RKneeAngles,,", "Frame,Sub Frame,X,Y,Z"]
    lines.append(",,deg,deg,deg")
    angle = numbers(fast.angle[::10] / DEG, 3)
    lines += [f"{i},0,{value},2.31,-4.08" for i, value in enumerate(angle, 1)]
    path.write_text("\r\n".join([*lines, ""]), "utf-8", newline="")
    true = part(fast)
    fresh = np.where(np.arange(n) % 10 == 0, fast.angle, np.nan)
    asked = ("section", "second table", "model outputs", "rkneeangles")
    values = true.values | {"angle": fresh}
    return Truth((Part(values, true.step),), "S03", open=asked)


def opensim_storage(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(200.0)
    names = ["time", "knee_angle_r", "exo_knee_torque_r", "exo_knee_torque_command_r"]
    above = [
        "subject04 perturbed walking", "version=1", f"nRows={slow.time.size}", "nColumns=5",
        "inDegrees=yes", "", "Units are S.I. units (second, meters, Newtons, ...)",
        "If the header above contains a line with 'inDegrees', this indicates whether rotational "
        "values are in degrees (yes) or radians (no).",
        "gait2392: knee_angle_r and knee torques are positive in extension", "endheader",
        "\t".join([*names, "heel_contact_r"]),
    ]  # fmt: skip
    columns = [
        numbers(slow.clock, 8), numbers(-slow.angle / DEG, 8), numbers(-slow.torque, 8),
        numbers(-slow.command, 8), numbers(slow.contact, 8),
    ]  # fmt: skip
    write_table(path, columns, above=above, delimiter="\t", newline="\n")
    asked = ("@channels.angle.positive", "@positive", "extension")
    return Truth((part(slow),), "subject04", open=asked)


def dspace(walk: Walk, path: Path, _rng: Rng) -> Truth:
    root = "Platform()://ExoKnee/Model Root"
    paths = [f"{root}/{name}" for name in ("q_knie", "M_ist", "M_soll", "Ferse_am_Boden")]
    above = [
        '"format";"ControlDesk NG csv 1.1"', '"name";"VP05 Gehen gestoert"',
        '"date";"2024-03-12 10:21:33"', '"raster";"0.002"',
        ";".join(['"path"', '"Zeit"', *(f'"{p}"' for p in paths)]),
        '"description";"";"Kniewinkel, Beugung positiv";"Drehmoment auf das Bein";"Sollmoment";""',
        '"unit";"s";"mrad";"Nm";"Nm";"-"',
    ]  # fmt: skip
    label = ['"trace_values"', *['""'] * (walk.time.size - 1)]
    columns = [
        label, numbers(walk.clock, 3), numbers(1e3 * walk.angle, 1), numbers(walk.torque, 4),
        numbers(walk.command, 2), numbers(walk.contact, 0),
    ]  # fmt: skip
    write_table(path, columns, above=above)
    asked = ("@channels.angle.unit", "@channels.angle", "mrad")
    return Truth((part(walk, angle=1e-4),), "VP05", open=asked)


def twincat_scope(walk: Walk, path: Path, rng: Rng) -> Truth:
    channels = (
        ("GVL.fKniewinkel", "°", numbers(walk.angle / DEG, 3, ",")),
        ("GVL.fMomentIst", "Nm", numbers(walk.torque, 4, ",")),
        ("GVL.fMomentSoll", "Nm", numbers(walk.command, 2, ",")),
        ("GVL.bFersenschalter", "", numbers(walk.contact, 0)),
        ("GVL.fStrom", "A", numbers(walk.torque / 2.3 + 0.1 * rng.standard_normal(walk.time.size),
                                    3, ",")),
    )  # fmt: skip
    rows = {
        "Name": [c[0] for c in channels], "SymbolComment": [""] * len(channels),
        "Data-Type": ["LREAL"] * 3 + ["BOOL", "LREAL"], "SampleTime[ms]": ["2"] * len(channels),
        "Unit": [c[1] for c in channels],
    }  # fmt: skip
    above = ["Name;ScopeProject Exo", "File;C:\\Scope\\Proband08.svdx", "Start;12.03.2024 10:21:33"]
    above.append("")
    above += [";".join(f"{key};{value}" for value in values) for key, values in rows.items()]
    above.append("")
    milli = numbers(walk.clock * 1e3, 1, ",")
    columns = [column for channel in channels for column in (milli, channel[2])]
    write_table(path, columns, above=above, encoding="cp1252")
    asked = ("@channels.time", "time&column", "no names", "@channels.angle")
    return Truth((part(walk),), "Proband08", open=asked)


def serial_log(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(100.0)
    start = 10 * 3600 + 21 * 60 + 33.451
    cells = zip(
        _times_of_day(start + slow.clock), numbers(1e3 * slow.clock + 1203, 0),
        numbers(slow.angle / DEG, 1), numbers(100 * slow.torque, 1),
        numbers(100 * slow.command, 0), numbers(slow.contact, 0), strict=True,
    )  # fmt: skip
    lines = ["10:21:33.102 -> exo knee v0.9 ready", "10:21:33.105 -> subject 9 perturbed"]
    lines.append("10:21:33.108 -> millis,knee_flex_deg,tau_Ncm,tau_ref_Ncm,heel")
    lines += [f"{clock} -> {','.join(rest)}" for clock, *rest in cells]
    path.write_text("\r\n".join([*lines, ""]), "utf-8", newline="")
    asked = ("->", "@channels.time", "ncm", "n*cm")
    true = part(slow, angle=0.1 * DEG, torque=1e-3)
    return Truth((true,), "S09", open=asked)


def _times_of_day(seconds: Array) -> list[str]:
    milli = [round(1e3 * s) for s in seconds]
    return [
        f"{m // 3_600_000:02d}:{m // 60_000 % 60:02d}:{m // 1000 % 60:02d}.{m % 1000:03d}"
        for m in milli
    ]


def c3d_analog(walk: Walk, path: Path, rng: Rng) -> Truth:
    fast = walk.at(1000.0, 0.0, 15.0)
    n = fast.time.size
    right = ground_reaction(fast)
    channels = {
        "Fz1_right": ("N", -right), "Fz2_left": ("N", -other_leg(fast, right)),
        "Knee_flexion_right": ("deg", fast.angle / DEG),
        "Exo_torque_right": ("Nmm", 1e3 * fast.torque),
        "Exo_torque_command_right": ("Nmm", 1e3 * fast.command),
    }  # fmt: skip
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    file["parameters"]["POINT"]["LABELS"]["value"] = ("RKNE",)
    file["data"]["points"] = np.ones((4, 1, n // 10)) + 0.01 * rng.standard_normal((4, 1, n // 10))
    file["parameters"]["ANALOG"]["RATE"]["value"] = [1000.0]
    file["parameters"]["ANALOG"]["LABELS"]["value"] = tuple(channels)
    file["parameters"]["ANALOG"]["UNITS"]["value"] = tuple(unit for unit, _ in channels.values())
    file["data"]["analogs"] = np.array([[values for _, values in channels.values()]])
    file.write(str(path))
    true = part(fast, omit=("contact",))
    values = true.values | {"ground_reaction_force": right}
    step = true.step | {"ground_reaction_force": 0.01}
    asked = ("@channels.ground_reaction_force", "force&negative", "plate", "c3d&export")
    return Truth((Part(values, step),), "Subject17", open=asked)
