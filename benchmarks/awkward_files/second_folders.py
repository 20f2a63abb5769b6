"""Second set: folders with recordings of one or two people, some with a table of pulses."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import openpyxl
from benchmarks.awkward_files.instrument_files import ground_reaction
from benchmarks.awkward_files.text_tables import numbers, volts, write_table
from benchmarks.awkward_files.truth import (
    DEG,
    Array,
    FileTruth,
    FolderTruth,
    Part,
    People,
    Truth,
    Walk,
    part,
)

Rng = np.random.Generator
LENGTHS_S = {"perturbed": 31.0, "unperturbed": 20.0}


def _stretch(people: People, person: int, condition: str, rate_hz: float) -> Walk:
    """Return a stretch that begins in walking, before the first pulse."""
    return people[person, condition].at(rate_hz, 4.0, LENGTHS_S[condition])


def _onsets(walk: Walk) -> tuple[float, ...]:
    """Return the onsets of the pulses, in seconds since the first sample."""
    return tuple(walk.clock[np.flatnonzero(np.diff(walk.command) > 0.0) + 1].tolist())


def _signals(walk: Walk, decimal: str = ".") -> list[list[str]]:
    """Time, angle in degrees, torque, command and contact."""
    return [
        numbers(walk.clock, 3, decimal), numbers(walk.angle / DEG, 2, decimal),
        numbers(walk.torque, 3, decimal), numbers(walk.command, 2, decimal),
        numbers(walk.contact, 0),
    ]  # fmt: skip


def _without_command(columns: list[list[str]]) -> list[list[str]]:
    return [*columns[:3], *columns[4:]]


def _pulse_rows(
    path: Path, header: str, rows: Sequence[Sequence[str]], delimiter: str = ";"
) -> None:
    columns = list(zip(*rows, strict=True))
    write_table(path, columns, above=[header], delimiter=delimiter)


def _recording(
    walk: Walk, participant: str, condition: str, *, pulses: bool = False, **labels: str
) -> FileTruth:
    """Return the truth of a recording; with `pulses`, the onsets come from a table."""
    omit = ("command",) if pulses or condition == "unperturbed" else ()
    onsets = _onsets(walk) if pulses and condition == "perturbed" else ()
    truth = Truth((part(walk, omit=omit),), participant, condition, onsets_s=onsets)
    return FileTruth(truth, **labels)  # type: ignore[arg-type]


def pulses_by_time_of_day(people: People, folder: Path, _rng: Rng) -> FolderTruth:
    walk = _stretch(people, 1, "perturbed", 250.0)
    names = "Time (s),Knee flexion (deg),Torque (Nm),Heel contact"
    write_table(
        folder / "S23_perturbed.csv", _without_command(_signals(walk)), above=[names],
        delimiter=",",
    )  # fmt: skip
    start = 10 * 3600 + 21 * 60 + 17.31  # stands in no file
    rows = []
    for i, onset in enumerate(_onsets(walk), 1):
        minute, second = divmod(start + onset - 10 * 3600, 60)
        rows.append([str(i), f"10:{minute:02.0f}:{second:06.3f}", "17"])
    _pulse_rows(folder / "S23_pulses.csv", "No.,Time of day,Torque (Nm)", rows, delimiter=",")
    truth = Truth((part(walk, omit=("command",)),), "S23", "perturbed")
    asked = (
        *("pulse&clock", "onset&clock", "pulse&time of day", "onset&time of day"),
        *("@recordings.perturbations", "@recordings[0].perturbations", "@pulses"),
    )
    recordings = {"S23_perturbed.csv": FileTruth(truth, no_onsets=True)}
    return FolderTruth(recordings, open=asked, answerable=False, hopeless=True)


def german_ascii(people: People, folder: Path, _rng: Rng) -> FolderTruth:
    names = "Zeit [s];Kniebeugung [Grad];Drehmoment [Nm];Fusskontakt"
    recordings = {}
    for condition, word in (("unperturbed", "ungestoert"), ("perturbed", "gestoert")):
        walk = _stretch(people, 1, condition, 500.0)
        file = f"P24_{word}.csv"
        write_table(folder / file, _without_command(_signals(walk, ",")), above=[names])
        recordings[file] = _recording(walk, "P24", condition, pulses=True)
    rows = [
        [str(i), f"{1e3 * onset:.0f}", "250", "17,0"] for i, onset in enumerate(_onsets(walk), 1)
    ]
    header = "Nr;Beginn [ms];Dauer [ms];Hoehe [Nm]"
    _pulse_rows(folder / "P24_Stoerungen.csv", header, rows)
    return FolderTruth(recordings, open=("pulse", "onset", "p24_stoerungen", "beginn"))


def two_people(people: People, folder: Path, _rng: Rng) -> FolderTruth:
    names = "Time (s)\tKnee flexion (deg)\tExo torque (Nm)\tExo torque command (Nm)\tHeel\tNotes"
    recordings = {}
    for person in (1, 2):
        for condition, word in (("unperturbed", "baseline"), ("perturbed", "pulses")):
            walk = _stretch(people, person, condition, 200.0)
            columns = [*_signals(walk), [""] * walk.time.size]
            columns[-1][777] = "belt speed 1.2 m/s, subject looks down"
            for name, function in (("Mean", np.mean), ("Min", np.min), ("Max", np.max)):
                values = (walk.angle / DEG, walk.torque, walk.command, walk.contact)
                texts = [name, *(f"{function(v):.3f}" for v in values), ""]
                for column, text in zip(columns, texts, strict=True):
                    column.append(text)
            file = f"subj{person:02d}_{word}.txt"
            write_table(folder / file, columns, above=[names], delimiter="\t", newline="\n")
            truth = Truth((part(walk),), f"subj{person:02d}", condition)
            recordings[file] = FileTruth(truth)
    return FolderTruth(recordings, open=("mean&row", "summary", "pulses&condition"))


def bids_sessions(people: People, folder: Path, rng: Rng) -> FolderTruth:
    names = "time_s\tknee_flexion_deg\texo_torque_nm\texo_torque_command_nm\theel_contact"
    recordings = {}
    for session, person in (("01", 1), ("02", 2)):  # another walk of the same participant
        for condition in ("unperturbed", "perturbed"):
            walk = _stretch(people, person, condition, 250.0)
            missing = rng.random(walk.time.size) < 0.004
            columns = _signals(walk)
            columns[1] = ["n/a" if m else c for m, c in zip(missing, columns[1], strict=True)]
            file = f"sub-26_ses-{session}_task-walk_acq-{condition}_motion.tsv"
            write_table(folder / file, columns, above=[names], delimiter="\t", newline="\n")
            true = part(walk)
            angle = np.where(missing, np.nan, walk.angle)
            with_gaps = Part(true.values | {"angle": angle}, true.step)
            truth = Truth((with_gaps,), "26", condition)
            recordings[file] = FileTruth(truth, session=session)
    return FolderTruth(recordings, open=("session",))


def left_mirrored(people: People, folder: Path, _rng: Rng) -> FolderTruth:
    recordings = {}
    for side, word, person, condition, german in (
        ("left", "links", 2, "perturbed", "gestört"),
        ("right", "rechts", 1, "perturbed", "gestört"),
        ("right", "rechts", 1, "unperturbed", "ungestört"),
    ):
        walk = _stretch(people, person, condition, 250.0)
        sign, positive = (-1.0, "Streckung") if side == "left" else (1.0, "Beugung")
        names = ["Zeit [ms]", f"Kniewinkel {word} [°] ({positive} positiv)"]
        names += [f"Moment {word} [Nm] ({positive} positiv)"]
        names += [f"Sollmoment {word} [Nm] ({positive} positiv)", f"Fersenkontakt {word}"]
        columns = [
            numbers(walk.clock * 1e3, 0), numbers(sign * walk.angle / DEG, 2, ","),
            numbers(sign * walk.torque, 3, ","), numbers(sign * walk.command, 2, ","),
            numbers(walk.contact, 0),
        ]  # fmt: skip
        file = f"P27_{word}_{german}.csv"
        write_table(folder / file, columns, above=[";".join(names)], encoding="utf-8-sig")
        recordings[file] = FileTruth(Truth((part(walk),), "P27", condition), side=side)
    return FolderTruth(recordings, open=("positive", "side", "streckung", "leg"))


def pulses_in_samples(people: People, folder: Path, _rng: Rng) -> FolderTruth:
    names = "temps (mm:ss.sss);flexion genou (°);couple exo (N.m);contact talon"
    recordings = {}
    for condition, word in (("unperturbed", "marche_libre"), ("perturbed", "perturbe")):
        walk = _stretch(people, 1, condition, 500.0)
        columns = _without_command(_signals(walk, ","))
        start = 47.0 if condition == "perturbed" else 0.0  # the minute changes
        milli = np.round(1e3 * (walk.clock + start)).astype(int).tolist()
        columns[0] = [f"{m // 60_000:02d}:{m // 1000 % 60:02d}.{m % 1000:03d}" for m in milli]
        file = f"sujet28_{word}.csv"
        write_table(folder / file, columns, above=[names])
        recordings[file] = _recording(walk, "sujet28", condition, pulses=True)
    rows = [["28", f"{1 + round(500 * onset)}", "250", "17,0"] for onset in _onsets(walk)]
    header = "sujet;début (échantillon);durée (ms);couple (N.m)"
    _pulse_rows(folder / "impulsions.csv", header, rows)
    return FolderTruth(recordings, open=("pulse", "onset", "sample&impulsions", "échantillon"))


def one_table_for_two_people(people: People, folder: Path, _rng: Rng) -> FolderTruth:
    names = "Tempo [s]\tFlessione ginocchio [gradi]\tCoppia [Nm]\tAppoggio tallone"
    recordings, rows = {}, []
    for person, condition, word in (
        (1, "unperturbed", "non_perturbato"),
        (1, "perturbed", "perturbato"),
        (2, "perturbed", "perturbato"),
    ):
        walk = _stretch(people, person, condition, 200.0)
        file = f"S{person:02d}_{word}.txt"
        columns = _without_command(_signals(walk, ","))
        write_table(folder / file, columns, above=[names], delimiter="\t", encoding="cp1252")
        recordings[file] = _recording(walk, f"S{person:02d}", condition, pulses=True)
        texts = [f"{onset:.3f}".replace(".", ",") for onset in _onsets(walk)]
        rows += [[f"S{person:02d}", text, "0,250", "17,0"] for text in texts]
    _pulse_rows(folder / "impulsi.csv", "Soggetto;Inizio [s];Durata [s];Coppia [Nm]", rows)
    return FolderTruth(recordings, open=("pulse", "onset", "impulsi", "soggetto"))


def workbooks_and_notes(people: People, folder: Path, rng: Rng) -> FolderTruth:
    recordings = {}
    for condition, word in (("unperturbed", "onverstoord"), ("perturbed", "verstoord")):
        walk = _stretch(people, 2, condition, 200.0)
        force = np.round(ground_reaction(walk) + rng.standard_normal(walk.time.size), 1)
        _workbook(folder / f"pp30_{word}.xlsx", walk, force, 1_710_235_293.25)
        true = part(walk, omit=("contact",), time=1e-5)
        values = true.values | {"ground_reaction_force": force}
        step = true.step | {"ground_reaction_force": 0.1}
        truth = Truth((Part(values, step),), "pp30", condition)
        recordings[f"pp30_{word}.xlsx"] = FileTruth(truth)
    notes = ["pp30: 24 jaar, 73 kg, 1,76 m", "band 1,2 m/s, exo rechts", "kracht naar beneden: -"]
    notes.append(f"stijfheid manchet onbekend; {volts(np.zeros(1), rng)[0]} V offset voetzool")
    (folder / "notities.txt").write_text("\r\n".join(notes), "utf-8", newline="")
    asked = ("@channels.ground_reaction_force", "force&negative", "force&sign", "force&downward")
    return FolderTruth(recordings, open=asked)


def _workbook(path: Path, walk: Walk, force: Array, start: float) -> None:
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.title = "Meting"
    names = ["Tijd (unix, s)", "Kniehoek (graden)", "Koppel (Nm)", "Gewenst koppel (Nm)"]
    sheet.append([*names, "Fz rechts (N)"])
    columns = [
        np.round(start + walk.clock, 4), np.round(walk.angle / DEG, 2), np.round(walk.torque, 3),
        walk.command, -force,
    ]  # fmt: skip
    for row in zip(*(column.tolist() for column in columns), strict=True):
        sheet.append(row)
    book.properties.creator = "lab"
    book.save(path)
