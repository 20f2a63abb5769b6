"""Second set: tables of spreadsheets, statistics programs and scripts."""

from pathlib import Path

import numpy as np
from benchmarks.awkward_files.text_tables import numbers, volts, write_table
from benchmarks.awkward_files.truth import DEG, Array, Part, Truth, Walk, part

Rng = np.random.Generator
LBF_IN = 0.1129848290276167  # N*m


def _scientific(values: Array) -> list[str]:
    return [f"{value:.9e}" for value in values]


def no_header(walk: Walk, path: Path, rng: Rng) -> Truth:
    columns = [
        numbers(walk.clock, 6, ","), numbers(walk.angle / DEG, 6, ","),
        numbers(walk.torque, 6, ","), numbers(walk.command, 6, ","),
        numbers(volts(walk.contact, rng), 6, ","),
    ]  # fmt: skip
    write_table(path, columns, delimiter="\t")
    asked = ("columns&no names", "@channels.torque", "@channels.angle.column", "@files.header")
    return Truth((part(walk),), "S07", open=asked)


def _thousands(values: Array, digits: int) -> list[str]:
    texts = (f"{value:,.{digits}f}" for value in values)
    return [text.translate(str.maketrans(",.", ".,")) for text in texts]


def excel_thousands(walk: Walk, path: Path, rng: Rng) -> Truth:
    slow = walk.at(250.0)
    missing = rng.random(slow.time.size) < 0.005
    angle = numbers(slow.angle / DEG, 2, ",")
    columns = [
        _thousands(slow.clock * 1e3, 1),
        ["#NV" if m else text for m, text in zip(missing, angle, strict=True)],
        _thousands(slow.torque * 1e3, 0), _thousands(slow.command * 1e3, 0),
        numbers(slow.contact, 0), [""] * slow.time.size,
    ]  # fmt: skip
    columns[5][2500] = "Proband stolpert leicht"
    means = ["Mittelwert", "24,31", "1.204", "1.062", "-", ""]
    names = "Zeit (ms);Kniewinkel (°);Drehmoment (mNm);Sollmoment (mNm);Fersenkontakt;Bemerkung"
    for column, mean in zip(columns, means, strict=True):
        column += ["", mean]
    write_table(path, columns, above=[names], encoding="cp1252")
    true = part(slow, torque=1e-3, command=1e-3)
    values = true.values | {"angle": np.where(missing, np.nan, slow.angle)}
    asked = ("thousand", "@channels.time", "@files.decimal", "1.000")
    return Truth((Part(values, true.step),), "P10", open=asked)


def r_write_table(walk: Walk, path: Path, rng: Rng) -> Truth:
    slow = walk.at(200.0)
    missing = rng.random(slow.time.size) < 0.01
    angle = [
        "NA" if m else text for m, text in zip(missing, numbers(slow.angle / DEG, 3), strict=True)
    ]
    names = "temps_s genou_flexion_deg couple_jambe_sur_exo_Nm consigne_Nm contact_talon"
    columns = [
        [f'"{i}"' for i in range(1, slow.time.size + 1)], numbers(slow.clock, 3), angle,
        numbers(-slow.torque, 4), numbers(slow.command, 1), numbers(slow.contact, 0),
    ]  # fmt: skip
    header = " ".join(f'"{name}"' for name in names.split())
    write_table(path, columns, above=[header], delimiter=" ", newline="\n")
    true = part(slow)
    values = true.values | {"angle": np.where(missing, np.nan, slow.angle)}
    asked = ("@torque_acts_on", "@channels.torque", "row name", "sur_exo")
    return Truth((Part(values, true.step),), "sujet11", open=asked)


def pandas_dates(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(250.0)
    start = np.datetime64("2024-03-12T10:59:41.250000")
    stamps = start + np.round(slow.clock * 1e6).astype("timedelta64[us]")
    columns = [
        [f"{str(s).replace('T', ' ')}+01:00" for s in stamps],
        [repr(float(v)) for v in slow.angle], [repr(float(v)) for v in slow.torque],
        [repr(float(v)) for v in slow.command], ["True" if c else "False" for c in slow.contact],
    ]  # fmt: skip
    names = ",knee_angle_rad,exo_torque_nm,exo_torque_setpoint_nm,heel_on_ground"
    write_table(path, columns, above=[names], delimiter=",", newline="\n")
    return Truth((part(slow, time=1e-6),), "sub-12", open=("@channels.time", "time stamp", "clock"))


def numpy_savetxt(walk: Walk, path: Path, _rng: Rng) -> Truth:
    names = "# t[s] q_knee_flex[rad] tau_exo[lbf-in] tau_des[lbf-in] heel_contact"
    columns = [
        _scientific(walk.clock), _scientific(walk.angle), _scientific(walk.torque / LBF_IN),
        _scientific(walk.command / LBF_IN), _scientific(walk.contact),
    ]  # fmt: skip
    write_table(path, columns, above=[names], delimiter=" ", newline="\n")
    asked = ("lbf", "@channels.torque.unit", "torque&unit")
    return Truth((part(walk),), "", open=asked)


def matlab_writetable(walk: Walk, path: Path, rng: Rng) -> Truth:
    n = walk.time.size
    missing = np.convolve(rng.random(n) < 0.0003, np.ones(25))[:n] > 0
    angle = np.where(missing, 9999.0, np.round(walk.angle / DEG, 2))
    columns = [
        numbers(walk.clock * 1e3 - 500.0, 0), numbers(angle, 2), numbers(walk.torque, 3),
        numbers(walk.command, 0), numbers(1.0 - walk.contact, 0),
    ]  # fmt: skip
    names = "Time_ms,KneeFlexion_deg,ExoTorque_Nm,TorqueRef_Nm,HeelSwitch_0ground_1air"
    write_table(path, columns, above=[names], delimiter=",", newline="\n")
    true = part(walk)
    values = true.values | {"angle": np.where(missing, np.nan, walk.angle)}
    asked = ("9999", "switch&ground", "@channels.contact", "@channels.angle.missing")
    return Truth((Part(values, true.step),), "S14", open=asked)


def percent_of_weight(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(100.0)
    columns = [
        numbers(slow.clock, 2, ","), numbers(slow.angle / DEG, 2, ","),
        numbers(100 * slow.torque / (716.0 * 0.92), 4, ","), numbers(slow.contact, 0),
    ]  # fmt: skip
    names = "Zeit [s];Kniebeugung [Grad];Moment am Knie [%KG*BL];Fersenkontakt"
    write_table(path, columns, above=[names], encoding="cp1252")
    asked = ("@channels.torque.unit", "%kg", "torque&unit", "body weight", "body mass")
    true = part(slow, omit=("torque", "command"))
    return Truth((true,), "VP20", open=asked, answerable=False, hopeless=True)


def goniometer_in_volts(walk: Walk, path: Path, rng: Rng) -> Truth:
    slow = walk.at(200.0)
    columns = [
        numbers(slow.clock, 3), numbers(1.873 - 0.0141 * slow.angle / DEG, 4),
        numbers(slow.torque, 3), numbers(slow.command, 2),
        numbers(volts(slow.contact, rng), 3),
    ]  # fmt: skip
    names = "Time [s]\tGoniometer knee [V]\tTorque [Nm]\tTorque demand [Nm]\tFSR heel [V]"
    write_table(path, columns, above=[names], delimiter="\t")
    asked = ("angle&volt", "angle&unit", "goniometer", "@channels.angle", "angle&[v]")
    true = part(slow, omit=("angle",))
    return Truth((true,), "S21", open=asked, answerable=False, hopeless=True)


def samples_without_rate(walk: Walk, path: Path, _rng: Rng) -> Truth:
    columns = [
        [str(i) for i in range(1, walk.time.size + 1)], numbers(walk.angle / DEG, 2),
        numbers(walk.torque, 3), numbers(walk.command, 2), numbers(walk.contact, 0),
    ]  # fmt: skip
    names = "Sample,Knee flexion (deg),Torque (Nm),Torque command (Nm),Heel contact"
    write_table(path, columns, above=[names], delimiter=",")
    asked = ("@sample_rate", "sample_rate", "sampling rate", "sample&rate", "no time")
    return Truth((part(walk),), "S22", open=asked, hopeless=True)
