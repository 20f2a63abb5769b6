"""Folders as labs have them: who, which condition, which pulses, and what must be asked."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from jointz.core.errors import DataError
from jointz.inspection.file_labels import labels_of
from jointz.inspection.inspect_file import inspect_file
from jointz.inspection.names import words_of
from jointz.io.study_reader import open_study

from .answers import answered

RATE_HZ = 200.0
STRIDE_S = 1.1
ONSETS_S = np.arange(4.37, 38.0, 2.63)


def walk(*, pulses: bool = True, side: float = 1.0, straight: float = 0.0) -> pd.DataFrame:
    """A knee that walks for 40 s; pulses of 15 N*m for 100 ms bend it."""
    s = np.arange(0.0, 40.0, 1 / RATE_HZ)
    cycle = 2 * np.pi * s / STRIDE_S
    bend = 30.0 - 25.0 * np.cos(cycle - 0.6) + 4.0 * np.cos(2 * cycle)
    bend += np.random.default_rng(1).normal(0.0, 0.02, s.size)
    torque = np.random.default_rng(2).normal(0.0, 0.05, s.size)
    for onset in ONSETS_S if pulses else ():
        after = np.clip(s - onset, 0.0, 0.1)
        bend += np.where(s > onset, 500.0 * after**2, 0.0) * np.exp(
            -np.clip(s - onset - 0.1, 0, 9) * 9
        )
        torque += np.where((s >= onset) & (s < onset + 0.1), 15.0, 0.0)
    return pd.DataFrame(
        {
            "time": s,
            "angle": straight + bend if not straight else straight - bend,
            "torque": side * torque,
            "heel": (np.mod(s, STRIDE_S) < 0.6 * STRIDE_S).astype(int),
        }
    )


def write(path: Path, frame: pd.DataFrame, names: list[str], **layout) -> None:
    text = frame.round(6).set_axis(names, axis=1).to_csv(index=False, **layout)
    path.write_bytes(text.encode("cp1252"))


GERMAN = ["Zeit [s]", "Kniewinkel [°]", "Drehmoment [Nm]", "Fußkontakt"]


def german_folder(folder: Path, *, units: str = "Sample") -> None:
    scale, start = {"Sample": (RATE_HZ, 1), "ms": (1e3, 0), "s": (1.0, 0)}[units]
    for person in ("VP03", "VP04"):
        layout = {"sep": ";", "decimal": ","}
        write(folder / f"{person}_gestört.csv", walk(), GERMAN, **layout)
        write(folder / f"{person}_normal.csv", walk(pulses=False), GERMAN, **layout)
        onsets = np.round(ONSETS_S * RATE_HZ) / RATE_HZ
        table = pd.DataFrame({"Nr": range(1, 14), f"Beginn [{units}]": onsets * scale + start})
        table.to_csv(folder / f"{person}_Pulse.csv", index=False, sep=";", decimal=",")


def drafted(folder: Path, **answers: str):
    """Inspect a folder, answer what is asked, and open the study."""
    found = inspect_file(folder)
    (folder / "study.toml").write_text(answered(found.toml, **answers), encoding="utf-8")
    return found, open_study(folder)


def must_be_asked(found) -> list[str]:
    """Return what the proposed study has no answer to."""
    return [question.about for question in found.questions if not question.drafted]


def test_a_german_folder_is_a_study_with_one_answer(tmp_path):
    german_folder(tmp_path)

    found, study = drafted(tmp_path, first_sample=1)

    assert [(r.file, r.participant, r.condition, r.perturbations) for r in found.recordings] == [
        ("VP03_gestört.csv", "VP03", "perturbed", "VP03_Pulse.csv"),
        ("VP03_normal.csv", "VP03", "unperturbed", ""),
        ("VP04_gestört.csv", "VP04", "perturbed", "VP04_Pulse.csv"),
        ("VP04_normal.csv", "VP04", "unperturbed", ""),
    ]
    assert must_be_asked(found) == ["perturbations.first_sample"]
    assert {"perturbations.timing_points", "recordings.side", "coupling"} <= {
        q.about for q in found.questions
    }
    assert study.spec.torque_acts_on == "joint"
    assert study.spec.files.encoding == "cp1252"
    pulses = study.recordings[0].read_pulses()
    np.testing.assert_allclose(pulses["onset_s"], np.round(ONSETS_S * RATE_HZ) / RATE_HZ)
    (recording,) = study.recordings[0].read()
    np.testing.assert_allclose(recording["angle"], np.deg2rad(walk()["angle"]), atol=1e-7)


@pytest.mark.parametrize("units", ["ms", "s"])
def test_onsets_in_time_need_no_answer(tmp_path, units):
    german_folder(tmp_path, units=units)

    found, study = drafted(tmp_path)

    assert must_be_asked(found) == []
    pulses = study.recordings[0].read_pulses()
    np.testing.assert_allclose(pulses["onset_s"], np.round(ONSETS_S * RATE_HZ) / RATE_HZ)


def test_an_angle_of_180_and_a_torque_on_the_device_are_turned(tmp_path):
    write(
        tmp_path / "S01_pert.csv",
        walk(side=-1.0, straight=180.0),
        ["t_s", "knee_deg", "trq_Nm", "fs"],
    )
    pd.DataFrame({"onset_s": ONSETS_S}).to_csv(tmp_path / "S01_onsets.csv", index=False)

    found, study = drafted(tmp_path)

    assert must_be_asked(found) == []
    assert study.spec.torque_acts_on == "device"
    zero = study.spec.calibration.angle_zero_rad.value
    (recording,) = study.recordings[0].read()
    bend = np.deg2rad(walk()["angle"])
    np.testing.assert_allclose(recording["angle"] - zero, bend, atol=1e-5)
    np.testing.assert_allclose(recording["torque"], walk()["torque"], atol=1e-5)


def test_a_switch_low_on_the_ground_is_inverted(tmp_path):
    frame = walk()
    frame["heel"] = 1 - (np.mod(frame["time"], STRIDE_S) < 0.6 * STRIDE_S).astype(int)

    write(tmp_path / "S01.csv", frame, ["time (s)", "knee (deg)", "torque (Nm)", "switch"])

    assert "invert = true" in inspect_file(tmp_path / "S01.csv").toml
    write(tmp_path / "S01.csv", walk(), ["time (s)", "knee (deg)", "torque (Nm)", "switch"])
    assert "invert =" not in inspect_file(tmp_path / "S01.csv").toml


def test_elements_of_a_struct_array_are_recordings_with_their_people_and_pulses(tmp_path):
    conditions = ("ENP", "EWP")
    fields = ("subject", "mass", "condition", "time", "knee_deg", "torque_Nm", "heel", "onset")
    array = np.empty((1, 4), dtype=[(name, object) for name in fields])
    for k in range(4):
        frame = walk(pulses=k % 2 == 1)
        onsets = ONSETS_S if k % 2 else np.zeros(0)
        values = [f"S0{k // 2 + 1}", 60.0 + k // 2, conditions[k % 2], *frame.to_numpy().T, onsets]
        for name, value in zip(fields, values, strict=True):
            array[0, k][name] = value
    savemat(tmp_path / "all.mat", {"data": array})

    found, study = drafted(tmp_path)

    assert [(r.part, r.participant, r.condition) for r in found.recordings] == [
        ("1", "S01", "unperturbed"),
        ("2", "S01", "perturbed"),
        ("3", "S02", "unperturbed"),
        ("4", "S02", "perturbed"),
    ]
    assert [p.mass_kg for p in study.spec.participants] == [60.0, 61.0]
    assert study.recordings[1].read_pulses()["onset_s"].tolist() == pytest.approx(list(ONSETS_S))
    (recording,) = study.recordings[3].read()
    np.testing.assert_allclose(recording["torque"], walk()["torque"])
    assert recording.attrs["file"] == "all.mat#4"


def test_what_other_recordings_have_differently_stands_with_them(tmp_path):
    write(tmp_path / "S01_pert.csv", walk(), ["time_s", "knee_deg", "torque_Nm", "heel"])
    write(tmp_path / "S01_normal.csv", walk(pulses=False), GERMAN, sep=";", decimal=",")
    pd.DataFrame({"onset_s": ONSETS_S}).to_csv(tmp_path / "S01_onsets.csv", index=False)

    _, study = drafted(tmp_path)

    normal = next(r for r in study.recordings if r.spec.condition == "unperturbed")
    assert normal.spec.files.delimiter == ";"
    (recording,) = normal.read()
    expected = np.deg2rad(walk(pulses=False)["angle"])
    np.testing.assert_allclose(recording["angle"], expected, atol=1e-7)


def test_a_folder_without_a_recording_says_why(tmp_path):
    (tmp_path / "notes.txt").write_text("nothing here\n")

    with pytest.raises(DataError, match=r"no recording found\. no table: notes\.txt"):
        inspect_file(tmp_path)


def test_a_folder_of_a_suffix_that_is_not_read_says_which_are(tmp_path):
    (tmp_path / "S01.abf").write_bytes(b"ABF2")

    with pytest.raises(DataError, match=r"S01\.abf: no format .* \.csv, .*Save it as csv"):
        inspect_file(tmp_path)


def test_a_random_torque_without_pulses_is_pointed_to_identify(tmp_path):
    table = walk()
    table["command"] = np.random.default_rng(0).standard_normal(len(table))
    write(tmp_path / "S01.csv", table, ["time_s", "knee_deg", "torque_Nm", "heel", "command_Nm"])

    assert "jointz identify time-varying" in inspect_file(tmp_path).advice[0]


def test_decimal_commas_of_a_format_of_its_own_are_read_and_drafted(tmp_path):
    t = np.arange(500) / 100.0
    rows = np.column_stack([t, 30 * np.sin(t), 5 * np.cos(t)])
    table = pd.DataFrame(rows, columns=["time", "knee_angle_r", "knee_moment_Nm"])
    head = f"Coordinates\nnRows={len(t)}\nnColumns=3\ninDegrees=yes\nendheader\n"
    text = table.to_csv(sep="\t", decimal=",", index=False)
    (tmp_path / "S01.mot").write_text(head + text)
    with pytest.raises(DataError, match="give --decimal ,"):
        inspect_file(tmp_path)

    found = inspect_file(tmp_path, layout={"decimal": ","})
    assert 'decimal = ","' in found.toml
    assert "S01.mot --decimal , " in found.advice[0]


def test_a_torque_in_counts_is_asked_for(tmp_path):
    frame = walk().assign(torque=lambda t: np.round(2048 + 10 * t["torque"]))
    write(tmp_path / "S01.csv", frame, ["time_s", "knee_deg", "loadcell_raw", "heel"])

    first = inspect_file(tmp_path / "S01.csv").questions[0]

    assert first.about == "channels.torque.column"
    assert first.answers[0].value == "loadcell_raw"
    assert "scale" in first.text


@pytest.mark.parametrize(
    ("name", "word"),
    [
        *(("Kniewinkel", "angle"), ("Angle genou", "knee"), ("Ángulo rodilla", "angle")),
        *(("Angolo ginocchio", "angle"), ("Kniehoek", "knee"), ("Drehmoment", "torque")),
        *(("Couple mesuré", "torque"), ("Par medido", "measured"), ("Coppia", "torque")),
        *(("Koppel", "torque"), ("Sollmoment", "command"), ("Fußschalter", "contact")),
        *(("Tiempo", "time"), ("Tijd", "time"), ("Temps", "time"), ("Zeit", "time")),
        *(("Störung", "perturbed"), ("ungestört", "unperturbed"), ("Hielcontact", "contact")),
    ],
)
def test_words_of_six_languages_are_known(name, word):
    assert word in words_of(name).found


@pytest.mark.parametrize(
    ("file", "participant", "session"),
    [
        ("P01/day1/walk.csv", "P01", "day1"),
        ("S01/APC1.csv", "S01", ""),
        ("S01/pert1.csv", "S01", ""),
        ("S1_P01.csv", "P01", ""),
        ("data1.csv", "", ""),
        ("Left1.csv", "", ""),
        ("VP03_Sitzung 2.csv", "VP03", "Sitzung 2"),
        ("Sujeto 4 perturbado.csv", "Sujeto4", ""),
    ],
)
def test_people_are_no_conditions_legs_or_days(file, participant, session):
    *folders, name = file.split("/")
    labels = labels_of(name, folders=folders[::-1])

    assert (labels.participant, labels.session) == (participant, session)


@pytest.mark.parametrize(
    ("name", "condition"),
    [
        *(("S01_non_perturbato", "unperturbed"), ("S01_ungestoert", "unperturbed")),
        *(("S01_sans perturbation", "unperturbed"), ("VP1_Störung", "perturbed")),
        *(("walk_1", ""), ("S02_EWP", "perturbed"), ("S02_marche libre", "unperturbed")),
    ],
)
def test_conditions_stand_in_names(name, condition):
    assert labels_of(f"{name}.csv").condition == condition


def test_each_trial_has_the_table_of_its_own_name(tmp_path):
    for trial in (1, 2):
        names = ["time_s", "knee_deg", "torque_Nm", "heel"]
        write(tmp_path / f"S01_trial{trial}.csv", walk(), names)
        table = pd.DataFrame({"onset_s": ONSETS_S[trial:]})
        table.to_csv(tmp_path / f"S01_trial{trial}_pulses.csv", index=False)

    found = inspect_file(tmp_path)

    assert [r.perturbations for r in found.recordings] == [
        "S01_trial1_pulses.csv",
        "S01_trial2_pulses.csv",
    ]


@pytest.mark.parametrize(
    ("straight", "direction"), [(0.0, "flexion"), (180.0, "extension"), (150.0, "extension")]
)
def test_a_bent_knee_is_told_from_an_included_angle(tmp_path, straight, direction):
    frame = walk(straight=straight)
    write(tmp_path / "S01.csv", frame, ["time_s", "knee_deg", "torque_Nm", "heel"])

    text = inspect_file(tmp_path / "S01.csv").toml

    assert ('positive = "extension"  # guess' in text) == (direction == "extension")


def test_numbers_that_stand_for_missing_samples_are_told(tmp_path):
    frame = walk()
    frame.loc[100:120, "angle"] = 9999.0
    write(tmp_path / "S01.csv", frame, ["time_s", "knee_deg", "torque_Nm", "heel"])

    (reason,) = inspect_file(tmp_path / "S01.csv").obstacles

    assert 'give [files] missing = ["9999"]' in reason


def test_a_table_of_times_and_durations_is_one_of_pulses(tmp_path):
    for person in ("sujeto1", "sujeto2"):
        for word, pulses in (("con", True), ("sin", False)):
            names = ["Tiempo (s)", "Flexión de rodilla (grados)", "Par (N·m)", "Contacto del talón"]
            write(tmp_path / f"{person}_{word}_pulsos.csv", walk(pulses=pulses), names, sep=";")
        table = pd.DataFrame({"Tiempo (s)": ONSETS_S, "Duración (s)": 0.1})
        path = tmp_path / f"{person}_tabla_de_pulsos.csv"
        table.to_csv(path, index=False, sep=";", encoding="cp1252")

    found, study = drafted(tmp_path)

    assert [(r.condition, r.perturbations) for r in found.recordings] == [
        ("perturbed", "sujeto1_tabla_de_pulsos.csv"),
        ("unperturbed", ""),
        ("perturbed", "sujeto2_tabla_de_pulsos.csv"),
        ("unperturbed", ""),
    ]
    assert study.recordings[0].read_pulses()["onset_s"].tolist() == pytest.approx(list(ONSETS_S))


def test_a_torque_of_another_size_is_asked_for(tmp_path):
    names = ["time_s", "knee_deg", "torque", "heel"]
    write(tmp_path / "S01_walk.csv", walk(), names)
    write(tmp_path / "S02_walk.csv", walk(side=1000.0), names)

    asked = {question.about: question.text for question in inspect_file(tmp_path).questions}

    assert "In what unit is the torque of S0" in asked["recordings.channels.torque.unit"]
