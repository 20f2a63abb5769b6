"""Third set: folders with recordings of two people each."""

import json
from pathlib import Path

import numpy as np
from benchmarks.awkward_files.second_folders import (
    _onsets,
    _pulse_rows,
    _recording,
    _signals,
    _stretch,
    _without_command,
)
from benchmarks.awkward_files.text_tables import numbers, volts, write_table
from benchmarks.awkward_files.third_instruments import plate, with_force
from benchmarks.awkward_files.truth import (
    DEG,
    FileTruth,
    FolderTruth,
    People,
    Truth,
    Walk,
    part,
)

Rng = np.random.Generator
Recordings = dict[str, FileTruth]
BOTH = ("unperturbed", "perturbed")


def two_encodings(people: People, folder: Path, rng: Rng) -> FolderTruth:
    names = ["Tiempo (s)", "Ángulo rodilla, flexión + (°)", "Par motor sobre la pierna (N·m)"]
    names += ["Par deseado (N·m)", "Fuerza vertical derecha (N)"]
    recordings: Recordings = {}
    words = {"unperturbed": "sin_perturbacion", "perturbed": "perturbado"}
    for person, encoding, newline in ((1, "cp1252", "\r\n"), (2, "mac_roman", "\r")):
        for condition in BOTH:
            walk = _stretch(people, person, condition, 250.0)
            force = plate(walk, rng, 1)
            columns = [*_signals(walk, ",")[:4], numbers(force, 1, ",")]
            file = f"sujeto{person:02d}_{words[condition]}.csv"
            header = ";".join(names).replace("·", "." if encoding == "mac_roman" else "·")
            above = ["Sesión: caminata con exoesqueleto", header]
            write_table(folder / file, columns, above=above, encoding=encoding, newline=newline)
            truth = Truth((with_force(walk, force, 0.1),), f"sujeto{person:02d}", condition)
            recordings[file] = FileTruth(truth)
    return FolderTruth(recordings, open=("encoding", "@channels.angle.unit", "@files.encoding"))


def two_delimiters(people: People, folder: Path, rng: Rng) -> FolderTruth:
    header = ["Time (s)", "Knee flexion (deg)", "Torque on leg (Nm)", "Heel switch (V)"]
    recordings: Recordings = {}
    for person, delimiter, decimal in ((1, ";", ","), (2, "\t", ".")):
        walk = _stretch(people, person, "perturbed", 500.0)
        columns = [
            *_signals(walk, decimal)[:3], numbers(volts(walk.contact, rng), 3, decimal),
        ]  # fmt: skip
        file = f"P{person:02d}_perturbed.csv"
        write_table(folder / file, columns, above=[delimiter.join(header)], delimiter=delimiter)
        recordings[file] = _recording(walk, f"P{person:02d}", "perturbed", pulses=True)
        rows = [
            [str(i), f"{onset:.3f}".replace(".", decimal), "250", "17"]
            for i, onset in enumerate(_onsets(walk), 1)
        ]
        cells = ["No.", "Onset (s)", "Duration (ms)", "Torque (Nm)"]
        path = folder / f"P{person:02d}_pulses.csv"
        _pulse_rows(path, delimiter.join(cells), rows, delimiter=delimiter)
    asked = ("pulse", "onset", "delimiter", "decimal")
    return FolderTruth(recordings, open=asked)


def _time_of_day(seconds: float) -> str:
    milli = round(1e3 * seconds)
    hour, minute = milli // 3_600_000, milli // 60_000 % 60
    return f"{hour:02d}:{minute:02d}:{milli // 1000 % 60:02d},{milli % 1000:03d}"


def all_by_the_clock(people: People, folder: Path, _rng: Rng) -> FolderTruth:
    names = "Uhrzeit;Knieflexion [Grad];Moment am Bein [Nm];Fersenkontakt"
    recordings: Recordings = {}
    rows = []
    for person, start in ((1, 36_077.25), (2, 39_581.5)):  # the second passes 11:00
        walk = _stretch(people, person, "perturbed", 250.0)
        columns = _without_command(_signals(walk, ","))
        columns[0] = [_time_of_day(start + t) for t in walk.clock]
        file = f"VP{person:02d}_gestoert.csv"
        write_table(folder / file, columns, above=[names])
        recordings[file] = _recording(walk, f"VP{person:02d}", "perturbed", pulses=True)
        rows += [
            [f"VP{person:02d}", _time_of_day(start + onset), "250", "17,0"]
            for onset in _onsets(walk)
        ]
    _pulse_rows(folder / "Stoerimpulse.csv", "VP;Uhrzeit;Dauer [ms];Moment [Nm]", rows)
    asked = ("pulse", "onset", "@channels.time", "stoerimpulse", "@recordings.perturbations")
    return FolderTruth(recordings, open=asked)


def _bids_sidecars(folder: Path, stem: str, walk: Walk, condition: str) -> None:
    channels = [["name", "component", "type", "tracked_point", "units", "sampling_frequency"]]
    channels += [
        [name, "n/a", kind, point, unit, "250"]
        for name, kind, point, unit in (
            ("knee_flexion", "JNTANG", "right_knee", "deg"),
            ("exo_torque_on_leg", "MISC", "right_knee", "N*m"),
            ("heel_contact", "MISC", "right_heel", "n/a"),
        )
    ]
    table = "\n".join("\t".join(row) for row in channels)
    folder.joinpath(f"{stem}_tracksys-exo_channels.tsv").write_text(table + "\n", "utf-8")
    about = {"SamplingFrequency": 250, "TaskName": "walking", "TrackingSystemName": "exo",
             "MotionChannelCount": 3, "RecordingDuration": round(walk.clock[-1], 3)}  # fmt: skip
    text = json.dumps(about, indent=2)
    folder.joinpath(f"{stem}_tracksys-exo_motion.json").write_text(text + "\n", "utf-8")
    if condition == "perturbed":
        events = ["onset\tduration\ttrial_type\ttorque_nm"]
        events += [f"{onset:.3f}\t0.250\tpulse\t17.0" for onset in _onsets(walk)]
        folder.joinpath(f"{stem}_events.tsv").write_text("\n".join(events) + "\n", "utf-8")


def bids_motion(people: People, folder: Path, _rng: Rng) -> FolderTruth:
    recordings: Recordings = {}
    for person in (1, 2):
        own = folder / f"sub-{person:02d}" / "motion"
        own.mkdir(parents=True)
        for condition in BOTH:
            walk = _stretch(people, person, condition, 250.0)
            stem = f"sub-{person:02d}_task-walking_acq-{condition}"
            columns = _without_command(_signals(walk))[1:]
            file = f"{stem}_tracksys-exo_motion.tsv"
            write_table(own / file, columns, delimiter="\t", newline="\n")
            _bids_sidecars(own, stem, walk, condition)
            recordings[file] = _recording(walk, f"{person:02d}", condition, pulses=True)
    description = {"Name": "Knee pulses in walking", "BIDSVersion": "1.9.0"}
    folder.joinpath("dataset_description.json").write_text(json.dumps(description), "utf-8")
    asked = ("columns&no names", "@channels.angle.column", "sampling rate",
             "@sample_rate_hz", "subfolder")  # fmt: skip
    return FolderTruth(recordings, open=asked)


def units_in_a_note(people: People, folder: Path, _rng: Rng) -> FolderTruth:
    recordings: Recordings = {}
    for person, per_rad, per_nm, digits in ((1, 1 / DEG, 1.0, (2, 3)), (2, 1.0, 1e3, (5, 0))):
        walk = _stretch(people, person, "perturbed", 500.0)
        columns = [
            numbers(1e3 * walk.clock, 0), numbers(per_rad * walk.angle, digits[0], ","),
            numbers(-per_nm * walk.torque, digits[1], ","),
            numbers(per_nm * walk.command, 0), numbers(walk.contact, 0),
        ]  # fmt: skip
        file = f"VP{person}_gestoert.txt"
        names = "zeit_ms;kniebeugung;moment_bein_auf_geraet;sollmoment;fersenkontakt"
        write_table(folder / file, columns, above=[names], encoding="cp1252")
        recordings[file] = FileTruth(Truth((part(walk),), f"VP{person}", "perturbed"))
    notes = [
        "Messung vom 12.03.2024, Gehen mit Störmomenten",
        "",
        "VP1: Winkel in Grad, Momente in Nm",
        "VP2: neue Firmware, Winkel in rad, Momente in mNm",
        "Der Messflansch zeigt das Moment des Beins auf das Gerät.",
    ]
    (folder / "LIESMICH.txt").write_text("\r\n".join(notes), "cp1252", newline="")
    asked = ("@channels.torque.unit", "@channels.angle.unit", "torque&unit", "angle&unit")
    return FolderTruth(recordings, open=asked)


def spanish_two_sides(people: People, folder: Path, _rng: Rng) -> FolderTruth:
    recordings: Recordings = {}
    for person, spanish, side in ((1, "derecha", "right"), (2, "izquierda", "left")):
        names = f"Tiempo (s);Flexión de rodilla {spanish} (grados);"
        names += "Par sobre la pierna (N·m);Contacto del talón"
        for condition, word in (("unperturbed", "sin_pulsos"), ("perturbed", "con_pulsos")):
            walk = _stretch(people, person, condition, 200.0)
            file = f"sujeto{person}_{word}.csv"
            write_table(folder / file, _without_command(_signals(walk, ",")), above=[names])
            recordings[file] = _recording(
                walk, f"sujeto{person}", condition, pulses=True, side=side
            )
            if condition == "perturbed":
                rows = [[f"{t:.3f}".replace(".", ","), "0,250", "17,0"] for t in _onsets(walk)]
                header = "Inicio (s);Duración (s);Par (N·m)"
                _pulse_rows(folder / f"sujeto{person}_tabla_de_pulsos.csv", header, rows)
    asked = ("pulse", "onset", "@recordings.perturbations", "pulsos&condition")
    return FolderTruth(recordings, open=asked)


def _italian(walk: Walk) -> list[list[str]]:
    samples = [str(i) for i in range(1, walk.time.size + 1)]
    return [samples, *_signals(walk, ",")[1:]]


def rates_in_a_note(people: People, folder: Path, _rng: Rng) -> FolderTruth:
    names = "campione\tflessione ginocchio [gradi]\tcoppia sulla gamba [Nm]\t"
    names += "coppia richiesta [Nm]\tappoggio tallone"
    recordings: Recordings = {}
    for person, rate_hz in ((1, 500.0), (2, 250.0)):
        for condition, word in (("unperturbed", "non_perturbato"), ("perturbed", "perturbato")):
            walk = _stretch(people, person, condition, rate_hz)
            file = f"soggetto{person}_{word}.txt"
            write_table(folder / file, _italian(walk), above=[names], delimiter="\t")
            recordings[file] = FileTruth(Truth((part(walk),), f"soggetto{person}", condition))
    notes = [
        "Prove di cammino, 12/03/2024",
        "soggetto 1: frequenza di campionamento 500 Hz",
        "soggetto 2: frequenza di campionamento 250 Hz (memoria quasi piena)",
    ]
    (folder / "protocollo.txt").write_text("\r\n".join(notes), "utf-8", newline="")
    asked = ("@sample_rate_hz", "sample_rate", "sampling rate", "at what rate")
    return FolderTruth(recordings, open=asked)


def per_mass_without_masses(people: People, folder: Path, _rng: Rng) -> FolderTruth:
    names = "Time (s),Knee flexion (deg),Knee exo moment on leg (Nm/kg),Heel contact"
    recordings: Recordings = {}
    for person, mass_kg in ((1, 61.4), (2, 83.9)):  # stand in no file
        for condition in BOTH:
            walk = _stretch(people, person, condition, 200.0)
            columns = _without_command(_signals(walk))
            columns[2] = numbers(walk.torque / mass_kg, 5)
            file = f"S{person:02d}_{condition}.csv"
            write_table(folder / file, columns, above=[names], delimiter=",")
            true = part(walk, omit=("torque", "command"))
            truth = Truth((true,), f"S{person:02d}", condition)
            recordings[file] = FileTruth(truth, no_onsets=True)
    asked = ("nm/kg", "n*m/kg", "per body mass", "torque&mass", "@channels.torque.unit")
    return FolderTruth(recordings, open=asked, answerable=False, hopeless=True)
