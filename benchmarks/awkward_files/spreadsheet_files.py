"""Files of labs that export tables: encodings, delimiters, languages, signs and clocks."""

from pathlib import Path

import numpy as np
from benchmarks.awkward_files.text_tables import numbers, volts, write_table
from benchmarks.awkward_files.truth import DEG, Part, Truth, Walk, part

Rng = np.random.Generator


def _comma(walk: Walk, *, time_scale: float = 1.0, digits: int = 3) -> list[list[str]]:
    """Time, angle in degrees, torque, command and contact with decimal commas."""
    return [
        numbers(walk.clock * time_scale, digits, ","),
        numbers(walk.angle / DEG, 2, ","),
        numbers(walk.torque, 3, ","),
        numbers(walk.command, 2, ","),
        numbers(walk.contact, 0, ","),
    ]


def german_cp1252(walk: Walk, path: Path, _rng: Rng) -> Truth:
    names = "Zeit [ms];Kniewinkel [°];Drehmoment [Nm];Sollmoment [Nm];Fußschalter"
    above = ["Messung: Gehen mit Störung", "Prüfer: Müller", "Datum: 12.03.2024", "", names]
    write_table(path, _comma(walk, time_scale=1e3, digits=0), above=above, encoding="cp1252")
    return Truth((part(walk),), "VP01")


def french_latin1(walk: Walk, path: Path, _rng: Rng) -> Truth:
    names = ["Temps (s)", "Angle genou (degrés)", "Couple mesuré (N.m)", "Couple consigne (N.m)"]
    header = "\t".join([*names, "Contact talon"])
    write_table(path, _comma(walk), above=[header], delimiter="\t", encoding="latin-1")
    return Truth((part(walk),), "Sujet2")


def spanish_bom(walk: Walk, path: Path, rng: Rng) -> Truth:
    names = ["Tiempo (s)", "Ángulo rodilla (grados)", "Par medido (N·m)", "Par consigna (N·m)"]
    header = ";".join([*names, "Contacto talón (V)"]) + ";;;"
    columns = [*_comma(walk)[:-1], numbers(volts(walk.contact, rng), 3, ",")]
    write_table(path, columns, above=[header], encoding="utf-8-sig", end=";;;")
    return Truth((part(walk),), "Sujeto03")


def italian_utf16_le(walk: Walk, path: Path, _rng: Rng) -> Truth:
    names = ["Tempo [s]", "Angolo ginocchio [gradi]", "Coppia misurata [Nm]", "Coppia rif. [Nm]"]
    header = "\t".join([*names, "Appoggio tallone"])
    write_table(path, _comma(walk), above=[header], delimiter="\t", encoding="utf-16-le")
    return Truth((part(walk),), "S04")


def _clock_text(seconds: float, decimal: str = ",") -> str:
    whole, milli = divmod(round(seconds * 1000), 1000)
    minutes, second = divmod(whole, 60)
    hour, minute = divmod(minutes, 60)
    return f"{hour:02d}:{minute:02d}:{second:02d}{decimal}{milli:03d}"


def dutch_utf16_be(walk: Walk, path: Path, _rng: Rng) -> Truth:
    names = "Tijd;Kniehoek (graden);Koppel (Nm);Gewenst koppel (Nm);Hielcontact"
    start = 13 * 3600 + 59 * 60 + 41.25  # so that the hour changes
    columns = [[_clock_text(start + t) for t in walk.clock], *_comma(walk)[1:]]
    write_table(path, columns, above=[names], encoding="utf-16-be")
    return Truth((part(walk, time=1e-3),), "pp05", open=("@channels.time", "clock", "hh:mm"))


def mac_excel_days(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(100.0)
    names = ["Datum/Uhrzeit", "Kniewinkel (°)", "Moment gemessen (Nm)", "Moment Vorgabe (Nm)"]
    header = "\t".join([*names, "Fußkontakt"])
    days = numbers(45237.4012 + slow.clock / 86400, 10, ",")
    write_table(
        path, [days, *_comma(slow)[1:]], above=[header], delimiter="\t", encoding="mac_roman",
        newline="\r",
    )  # fmt: skip
    asked = ("@channels.time", "days", "sample_rate", "clock")
    return Truth((part(slow, time=2e-5),), "Proband06", open=asked)


def quoted_decimals(walk: Walk, path: Path, _rng: Rng) -> Truth:
    columns = [[f'"{cell}"' if "," in cell else cell for cell in c] for c in _comma(walk)]
    header = "t [s],ang_kn [deg],trq [Nm],trq_cmd [Nm],FS"
    write_table(path, columns, above=[header], delimiter=",")
    return Truth((part(walk),), "S07")


def aligned_blanks(walk: Walk, path: Path, _rng: Rng) -> Truth:
    above = [
        "% exported by exo_log2txt.m",
        "% subject 08, perturbed walking 1.2 m/s, fs = 500 Hz",
        "% 1: time (s)  2: knee flexion (deg)  3: torque (Nm)  4: torque command (Nm)  5: heel",
    ]
    columns = [
        numbers(walk.clock, 3), numbers(walk.angle / DEG, 2), numbers(walk.torque, 3),
        numbers(walk.command, 2), numbers(walk.contact, 0),
    ]  # fmt: skip
    padded = [[f"{cell:>11}" for cell in column] for column in columns]
    write_table(path, padded, above=above, delimiter="", newline="\n")
    asked = ("@files.header", "columns&no names", "@channels.torque", "@channels.angle.column")
    return Truth((part(walk),), "", open=asked)


def bars_extension(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(200.0)
    above = ["time|knee_ext(+)|torque|torque_cmd|heel|", "s|deg|Nm|Nm|-|"]
    columns = [
        numbers(slow.clock, 3), numbers(-slow.angle / DEG, 2), numbers(slow.torque, 3),
        numbers(slow.command, 2), numbers(slow.contact, 0),
    ]  # fmt: skip
    write_table(path, columns, above=above, delimiter="|", newline="\n", end="|")
    return Truth((part(slow),), "P09", open=("@channels.angle.positive", "extension"))


def included_angle(walk: Walk, path: Path, _rng: Rng) -> Truth:
    names = "Zeit (s);Kniewinkel (°, gestreckt = 180°);Moment (Nm);Moment soll (Nm);Ferse"
    columns = _comma(walk)
    columns[1] = numbers(180.0 - walk.angle / DEG, 2, ",")
    write_table(path, columns, above=[names], encoding="cp1252")
    asked = (
        "angle&180",
        "angle_zero",
        "@channels.angle",
        "@calibration.angle_zero",
        "straight",
        "included",
    )
    return Truth((part(walk),), "CP18", open=asked)


def per_mass(walk: Walk, path: Path, _rng: Rng) -> Truth:
    mass_kg = 73.0
    names = ["Temps (ms)", "Flexion genou (°)", "Vitesse genou (°/s)", "Couple exo (Nm/kg)"]
    header = ";".join([*names, "Consigne (Nm/kg)", "Contact talon"])
    above = ["Sujet : 19", "Masse : 73,0 kg", "Taille : 1,76 m", "Condition : perturbé", header]
    speed = np.gradient(walk.angle, walk.time)
    columns = [
        numbers(walk.clock * 1e3, 0, ","), numbers(walk.angle / DEG, 2, ","),
        numbers(speed / DEG, 1, ","), numbers(walk.torque / mass_kg, 5, ","),
        numbers(walk.command / mass_kg, 5, ","), numbers(walk.contact, 0, ","),
    ]  # fmt: skip
    write_table(path, columns, above=above)
    asked = ("nm/kg", "n*m/kg", "per kg", "torque&mass", "torque&unit")
    rounding = 1e-5 * mass_kg
    return Truth((part(walk, torque=rounding, command=rounding),), "Sujet19", open=asked)


def dates_without_milliseconds(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(100.0)
    names = "Zeitstempel;Kniewinkel [°];Drehmoment [Nm];Sollmoment [Nm];Fußkontakt"
    start = 9 * 3600 + 41 * 60 + 12.37
    dates = [f"27.11.2023 {_clock_text(start + t)[:8]}" for t in slow.clock]
    write_table(path, [dates, *_comma(slow)[1:]], above=[names], encoding="cp1252")
    asked = ("@channels.time", "sample_rate", "sampling rate", "clock", "time stamp")
    return Truth((part(slow),), "VP29", open=asked, hopeless=True)


def moment_without_unit(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(100.0)
    columns = [
        numbers(slow.clock, 2), numbers(slow.angle / DEG, 2), numbers(slow.torque / 73.0, 4),
        numbers(slow.contact, 0),
    ]  # fmt: skip
    write_table(path, columns, above=["Time,KneeAngle,Moment,FootSwitch"], delimiter=",")
    asked = ("@channels.torque.unit", "torque&unit", "moment&unit", "nm/kg", "n*m/kg", "per kg")
    true = part(slow, omit=("torque", "command"))
    return Truth((true,), "Subject28", open=asked, answerable=False, hopeless=True)


def two_torques_without_names(walk: Walk, path: Path, _rng: Rng) -> Truth:
    # The motor's torque before the gear's friction; behind it the cuff's load cell.
    motor = 1.12 * np.interp(walk.time - 0.004, walk.time, walk.torque) + 0.3
    columns = [
        numbers(walk.clock, 3), numbers(walk.angle / DEG, 2), numbers(motor, 3),
        numbers(walk.torque, 3), numbers(walk.contact, 0),
    ]  # fmt: skip
    write_table(path, columns, delimiter="\t", newline="\n")
    asked = ("@channels.torque", "torque&which column", "torque&two columns", "columns&no names")
    true = part(walk, omit=("command",))
    return Truth((true,), "S30", open=asked, hopeless=True)


def restarted_clock(walk: Walk, path: Path, _rng: Rng) -> Truth:
    halves = [walk.at(500.0, 0.0, 18.0), walk.at(500.0, 20.0, 18.0)]
    names = "Time (s),Knee flexion (deg),Torque (Nm),Torque command (Nm),Heel contact"
    columns = [
        [numbers(half.clock, 3) for half in halves],
        [numbers(half.angle / DEG, 2) for half in halves],
        [numbers(half.torque, 3) for half in halves],
        [numbers(half.command, 2) for half in halves],
        [numbers(half.contact, 0) for half in halves],
    ]
    write_table(path, [a + b for a, b in columns], above=[names], delimiter=",")
    asked = (
        "restart",
        "starts again",
        "channels.trial",
        "@channels.time",
        "goes back",
        "time&increase",
    )
    return Truth(tuple(part(h) for h in halves), "S17", open=asked, all_parts=True)


def slow_angle_with_gaps(walk: Walk, path: Path, _rng: Rng) -> Truth:
    fast = walk.at(1000.0, 0.0, 25.0)
    angle = np.where(np.arange(fast.time.size) % 10 == 0, fast.angle, np.nan)
    names = "Time (s),Knee flexion (deg),Torque (Nm),Torque command (Nm),Heel contact"
    columns = [
        numbers(fast.clock, 3), numbers(angle / DEG, 2), numbers(fast.torque, 3),
        numbers(fast.command, 2), numbers(fast.contact, 0),
    ]  # fmt: skip
    write_table(path, columns, above=[names], delimiter=",")
    true = part(fast)
    asked = ("angle&slow", "angle&missing", "angle&rate", "angle&empty")
    return Truth((Part(true.values | {"angle": angle}, true.step),), "S21", "", open=asked)
