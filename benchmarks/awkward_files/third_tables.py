"""Third set: tables of spreadsheets and scripts; encodings, delimiters, units and languages."""

from pathlib import Path

import numpy as np
import openpyxl
from benchmarks.awkward_files.instrument_files import other_leg
from benchmarks.awkward_files.text_tables import numbers, volts, write_table
from benchmarks.awkward_files.truth import DEG, Array, Truth, Walk, part

Rng = np.random.Generator
KGF_CM = 0.0980665  # N*m
LEVER_M = 0.24


def _comma(walk: Walk) -> list[list[str]]:
    """Time, angle in degrees, torque, command and contact with decimal commas."""
    return [
        numbers(walk.clock, 3, ","), numbers(walk.angle / DEG, 2, ","),
        numbers(walk.torque, 3, ","), numbers(walk.command, 2, ","), numbers(walk.contact, 0),
    ]  # fmt: skip


def _left_contact(walk: Walk) -> Array:
    return (other_leg(walk, walk.contact) > 0.5).astype(np.float64)


def dos_german(walk: Walk, path: Path, _rng: Rng) -> Truth:
    above = ["Messung: Gehen mit Störung", "Prüfer: Krüger", ""]
    above.append("Zeit [s];Kniebeugung [°];Moment auf Bein [Nm];Sollmoment [Nm];Fußkontakt Ferse")
    write_table(path, _comma(walk), above=above, encoding="cp850")
    path.write_bytes(path.read_bytes() + b"\x1a")  # the end of a file in DOS
    return Truth((part(walk),), "Proband01", open=("encoding", "@files.encoding", "0x1a"))


def french_encoded_twice(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(250.0)
    above = ["Essai : marche perturbée", "Côté équipé : droit"]
    above.append("Temps écoulé (ms)\tAngle genou, flexion + (°)\tCouple appliqué à la jambe (N·m)"
                 "\tCouple de consigne (N·m)\tContact talon")  # fmt: skip
    garbled = [line.encode("utf-8").decode("cp1252") for line in above]
    columns = [numbers(1e3 * slow.clock, 0), *_comma(slow)[1:]]
    write_table(path, columns, above=garbled, delimiter="\t")
    asked = ("encoding", "@channels.angle.unit", "@channels.torque.unit", "twice")
    return Truth((part(slow),), "Sujet02", open=asked)


def utf16_without_bom(walk: Walk, path: Path, _rng: Rng) -> Truth:
    names = "Elapsed (s)\tKnee flexion (°)\tExo torque (N·m)\tDesired torque (N·m)\tHeel strike FSR"
    columns = [
        numbers(walk.clock, 3), numbers(walk.angle / DEG, 2), numbers(walk.torque, 3),
        numbers(walk.command, 1), numbers(walk.contact, 0),
    ]  # fmt: skip
    lines = [names, *("\t".join(row) for row in zip(*columns, strict=True)), ""]
    path.write_bytes("\r\n".join(lines).encode("utf-16-le"))
    return Truth((part(walk),), "P03", open=("utf-16", "encoding", "@files.encoding"))


def quoted_with_sep_line(walk: Walk, path: Path, rng: Rng) -> Truth:
    names = ["t [s]", "Knieflexion [Grad]", "Drehmoment Exo [Nm]", "Vorgabe Drehmoment [Nm]"]
    names.append("Fersenschalter [V]")
    columns = [*_comma(walk)[:4], numbers(volts(walk.contact, rng), 3, ",")]
    quoted = [[f'"{cell}"' for cell in column] for column in columns]
    above = ["sep=;", '"Proband";"VP05"', '"Bedingung";"gestört"', ""]
    above.append(";".join(f'"{name}"' for name in names) + ";")
    write_table(path, quoted, above=above, end=";")
    asked = ("sep=", "delimiter", "@files.delimiter", "@files.decimal")
    return Truth((part(walk),), "VP05", open=asked)


def names_with_blanks(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(200.0)
    names = ("time", "knee flexion R", "knee flexion L", "exo torque R", "torque command R",
             "heel switch R", "heel switch L")  # fmt: skip
    units = ("(s)", "(deg)", "(deg)", "(N m)", "(N m)", "(0/1)", "(0/1)")
    columns = [
        numbers(slow.clock, 3), numbers(slow.angle / DEG, 2),
        numbers(other_leg(slow, slow.angle) / DEG, 2), numbers(slow.torque, 3),
        numbers(slow.command, 2), numbers(slow.contact, 0), numbers(_left_contact(slow), 0),
    ]  # fmt: skip
    above = ["Trial: walk06, perturbed, exo on the right leg", ""]
    above += ["".join(f"{text:>18}" for text in texts) for texts in (names, units)]
    above.append("  " + "  ".join(["-" * 16] * len(names)))
    padded = [[f"{cell:>18}" for cell in column] for column in columns]
    write_table(path, padded, above=above, delimiter="", newline="\n")
    asked = ("blank&names", "names&columns", "@channels.angle.column", "@files.header")
    return Truth((part(slow),), "walk06", open=asked)


def comma_twice(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(250.0)
    names = "Zeit(s),Kniewinkel Flexion(Grad),Drehmoment(Nm),Sollmoment(Nm),Fersenkontakt"
    write_table(path, _comma(slow), above=[names], delimiter=",")
    asked = ("decimal", "@files.decimal", "@files.delimiter", "cells&header")
    return Truth((part(slow),), "Proband07", open=asked)


def merged_header(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(200.0)
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.title = "Gehen gestört"
    sheet["B2"] = "VP14, Gehen mit Störmomenten, Exo am rechten Knie"
    header: dict[int, list[str | None]] = {
        4: ["Zeit", "rechts", None, None, None, "links", None],
        5: [None, "Kniebeugung", "Moment aufs Bein", "Sollmoment", "Fersenkontakt",
            "Kniebeugung", "Fersenkontakt"],
        6: ["ms", "°", "Nm", "Nm", "0/1", "°", "0/1"],
    }  # fmt: skip
    for row, texts in header.items():
        for column, text in enumerate(texts, 2):
            sheet.cell(row, column, text)
    for cells in ("B4:B5", "C4:F4", "G4:H4"):
        sheet.merge_cells(cells)
    columns = [
        np.round(1e3 * slow.clock), np.round(slow.angle / DEG, 2), np.round(slow.torque, 3),
        slow.command, slow.contact, np.round(other_leg(slow, slow.angle) / DEG, 2),
        _left_contact(slow),
    ]  # fmt: skip
    for values in zip(*(column.tolist() for column in columns), strict=True):
        sheet.append([None, *values])
    book.properties.creator = "lab"
    book.save(path)
    asked = ("merged", "two legs", "which leg", "angle&leg", "@side")
    return Truth((part(slow),), "VP14", open=asked)


def force_on_the_cuff(walk: Walk, path: Path, _rng: Rng) -> Truth:
    above = [
        "Subject,S17", "Condition,perturbed", "Knee axis to centre of cuff (m),0.240",
        "Sample rate (Hz),500", "",
        "Time (s),Knee flexion (deg),"
        "Cuff force on shank (N; flexion +),Torque command (Nm; flexion +),Heel contact",
    ]  # fmt: skip
    columns = [
        numbers(walk.clock, 3), numbers(walk.angle / DEG, 2), numbers(walk.torque / LEVER_M, 2),
        numbers(walk.command, 2), numbers(walk.contact, 0),
    ]  # fmt: skip
    write_table(path, columns, above=above, delimiter=",")
    asked = ("lever", "force&torque", "cuff force", "@channels.torque.unit")
    return Truth((part(walk, torque=0.01 * LEVER_M),), "S17", open=asked)


def kilogram_force(walk: Walk, path: Path, _rng: Rng) -> Truth:
    names = ["Tiempo [s]", "Flexión rodilla [°]", "Par sobre la pierna [kgf·cm]"]
    names += ["Par de referencia [kgf·cm]", "Interruptor talón [0/1]"]
    columns = [
        numbers(walk.clock, 3, ","), numbers(walk.angle / DEG, 2, ","),
        numbers(walk.torque / KGF_CM, 2, ","), numbers(walk.command / KGF_CM, 2, ","),
        numbers(walk.contact, 0),
    ]  # fmt: skip
    write_table(path, columns, above=[";".join(names)], encoding="cp1252")
    asked = ("kgf", "@channels.torque.unit", "torque&unit")
    return Truth((part(walk),), "Sujeto18", open=asked)


def italian_extension(walk: Walk, path: Path, rng: Rng) -> Truth:
    slow = walk.at(200.0)
    names = ["t [ms]", "Ang. ginocchio dx [°] (estensione +)", "Coppia mis. [N·m] (estensione +)"]
    names += ["Coppia comandata [N·m] (estensione +)", "Interr. tallone dx [V]"]
    columns = [
        numbers(1e3 * slow.clock, 0), numbers(-slow.angle / DEG, 2, ","),
        numbers(-slow.torque, 3, ","), numbers(-slow.command, 2, ","),
        numbers(volts(slow.contact, rng), 2, ","),
    ]  # fmt: skip
    above = ["Prova: cammino perturbato", "Soggetto: 21", ";".join(names)]
    write_table(path, columns, above=above, encoding="utf-8-sig")
    asked = ("@channels.angle.positive", "@positive", "extension", "estensione")
    return Truth((part(slow),), "Soggetto21", open=asked)


def dutch_text(walk: Walk, path: Path, _rng: Rng) -> Truth:
    above = ["Proefpersoon: 22", "Conditie: verstoord lopen", "Meetfrequentie: 500 Hz", ""]
    above.append("tijd[s] kniebuiging[graden] moment_op_been[Nm] gewenst_moment[Nm] hiel_op_grond")
    columns = [column if i != 4 else ["ja" if c else "nee" for c in walk.contact]
               for i, column in enumerate(_comma(walk))]  # fmt: skip
    write_table(path, columns, above=above, delimiter=" ")
    return Truth((part(walk),), "pp22", open=("@channels.contact", "ja&nee", "hiel_op_grond"))


def french_left_leg(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(250.0)
    names = ["Temps (s)", "Flexion genou droit (°)", "Flexion genou gauche (°)"]
    names += ["Couple de la jambe sur l'exo (N·m)", "Couple exo demandé (N·m)"]
    names += ["Talon droit au sol", "Talon gauche au sol"]
    own = _comma(slow)
    words = [["VRAI" if c else "FAUX" for c in contact]
             for contact in (_left_contact(slow), slow.contact)]  # fmt: skip
    columns = [
        own[0], numbers(other_leg(slow, slow.angle) / DEG, 2, ","), own[1],
        numbers(-slow.torque, 3, ","), own[3], *words,
    ]  # fmt: skip
    above = ["Sujet n° 23 \u2013 condition perturbée", "Exosquelette monté sur la jambe gauche", ""]
    above.append(";".join(names))
    write_table(path, columns, above=above, encoding="cp1252")
    asked = ("two legs", "which leg", "@side", "angle&leg", "@torque_acts_on", "gauche")
    return Truth((part(slow),), "sujet23", open=asked)


def long_table(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(200.0, 0.0, 20.0)
    signals = {
        "knee_flexion_deg": numbers(slow.angle / DEG, 2), "exo_torque_nm": numbers(slow.torque, 3),
        "exo_torque_command_nm": numbers(slow.command, 2), "heel_contact": numbers(slow.contact, 0),
    }  # fmt: skip
    time = numbers(slow.clock, 3)
    rows = [(t, name, values[i]) for i, t in enumerate(time) for name, values in signals.items()]
    write_table(path, list(zip(*rows, strict=True)), above=["time_s,signal,value"], delimiter=",",
                newline="\n")  # fmt: skip
    asked = ("long&format", "one row per", "signal&value", "column 'signal'", "stamps&repeat")
    return Truth((part(slow),), "sub26", open=asked)


def percent_of_mvc(walk: Walk, path: Path, _rng: Rng) -> Truth:
    slow = walk.at(200.0)
    columns = [
        numbers(slow.clock, 3), numbers(slow.angle / DEG, 2), numbers(100 * slow.torque / 83.0, 3),
        numbers(slow.contact, 0),
    ]  # fmt: skip
    names = "time (s),knee flexion (deg),knee torque (% MVC),heel contact"
    write_table(path, columns, above=[names], delimiter=",")
    asked = ("mvc", "torque&unit", "@channels.torque.unit", "torque&percent", "torque&%")
    true = part(slow, omit=("torque", "command"))
    return Truth((true,), "Subject29", open=asked, answerable=False, hopeless=True)
