"""Pulse tables as labs write them: signs, names, units, samples, several recordings in one."""

import numpy as np
import pytest
from scipy.io import savemat
from tests.unit.io.foreign_files import write_file

from jointz.core.acquisition import Signal, SignalGroup
from jointz.core.errors import DataError
from jointz.io.recordings import read_pulse_table

TABLE = "[perturbations]                              # optional\n"


def read(study, content, *, settings="", encoding="utf-8", name="S01_pulses.csv"):
    """Read the pulse table of the second recording."""
    study.edit(TABLE, f"{TABLE}{settings}\n").edit('"S01_pulses.csv"', f'"{name}"')
    (study.root / name).write_bytes(content.encode(encoding))
    opened = study.open()
    return read_pulse_table(opened, opened.spec.recordings[1])


@pytest.mark.parametrize(
    "content",
    [
        "onset_s;duration_s\n0,021;0,009\n",
        "onset_s;duration_s\n0.021;0.009\n",
        "onset_s\tduration_s\n0,021\t0,009\n",
        'onset_s,duration_s\n"0,021","0,009"\n',
        "Messung 3; Müller\n\nonset_s;duration_s\n0,021;0,009\n",
        "onset_ms;duration_ms\n21;9\n",
    ],
)
def test_signs_and_lines_above_are_found_by_the_names_of_the_columns(study, content):
    table = read(study, content)

    np.testing.assert_allclose(table[["onset_s", "duration_s"]], [[0.021, 0.009]], rtol=1e-12)


def test_an_encoding_of_the_study_holds_for_its_pulse_tables_too(study):
    study.edit("[files]", '[files]\nencoding = "cp1252"')
    table = read(study, "onset_s;timing_point\n0,021;Stoß\n", encoding="cp1252")

    assert table["timing_point"].tolist() == ["Stoß"]


def test_columns_by_names_of_their_own_leave_others_out(study):
    settings = (
        'columns = { onset = "Beginn [ms]", timing_point = "Phase", '
        'amplitude = { column = "M", unit = "mNm" } }'
    )
    content = "Nr;Beginn [ms];M;Phase;Bemerkung\n1;21;5000;LRE;gut\n"

    table = read(study, content, settings=settings)

    assert table.to_numpy().tolist()[0][0] == pytest.approx(0.021)
    assert table["amplitude_nm"].tolist() == [5.0]
    assert table["timing_point"].tolist() == ["LRE"]


@pytest.mark.parametrize(("first", "onset_s"), [(0, 0.021), (1, 0.020)])
def test_onsets_in_samples_need_the_number_of_the_first(study, first, onset_s):
    table = read(study, "onset_sample;duration_samples\n21;9\n", settings=f"first_sample = {first}")

    np.testing.assert_allclose(table[["onset_s", "duration_s"]], [[onset_s, 0.009]], atol=1e-12)


def test_onsets_in_samples_count_on_the_clock_of_the_file(study):
    study.table("S01_ewp.csv", lambda t: t.assign(time_s=t["time_s"] + 100.0))

    table = read(study, "onset_sample\n21\n", settings="first_sample = 0")

    assert table["onset_s"].tolist() == pytest.approx([100.021])


def test_without_the_number_of_the_first_sample_a_study_is_refused(study):
    (study.root / "S01_pulses.csv").write_text("onset_sample\n21\n")

    assert "first_sample: the number of the recording's first sample" in study.sole_problem()


def test_a_sample_beyond_the_recording_is_refused_by_its_row(study):
    with pytest.raises(DataError, match="row 3, column 'onset_sample': there is no sample 51"):
        read(study, "onset_sample\n21\n51\n", settings="first_sample = 1")


@pytest.mark.parametrize("name", ["S01_ewp.csv", "S01_ewp"])
def test_one_table_serves_several_recordings(study, name):
    content = f"recording,onset_s\n{name},0.021\nS01_enp.csv,0.5\n"
    study.edit('file = "S01_enp.csv"', 'file = "S01_enp.csv"\nperturbations = "S01_pulses.csv"')

    assert read(study, content)["onset_s"].tolist() == [0.021]


def test_rows_of_people_whom_a_study_leaves_out_are_not_read(study):
    table = read(study, "participant,onset_s\nS01,0.021\nS02,0.5\n")

    assert table["onset_s"].tolist() == [0.021]


def test_rows_that_belong_to_no_recording_are_refused(study):
    (study.root / "S01_pulses.csv").write_text("recording,onset_s\nS01_ewp,0.02\nS01_epw,0.03\n")

    assert study.sole_problem().startswith("S01_pulses.csv, row 3: belongs to no recording")
    (study.root / "S01_pulses.csv").write_text("recording,onset_s\nS01_epw,0.03\n")
    assert "found recording: S01_epw" in study.sole_problem()


@pytest.mark.parametrize("name", ["pulses.mat", "pulses.xlsx", "pulses.parquet"])
def test_a_pulse_table_of_another_format(study, tmp_path, name):
    pytest.importorskip("openpyxl")
    pytest.importorskip("pyarrow")
    columns = {"onset_s": [0.021, 0.03], "amplitude_nm": [5.0, 6.0]}
    signals = tuple(Signal(name, np.array(values)) for name, values in columns.items())
    write_file(tmp_path / name, SignalGroup("table", signals))
    study.edit('"S01_pulses.csv"', f'"{name}"')
    if name.endswith(".mat"):
        columns = ", ".join(
            f'{k} = "table.{c}"'
            for k, c in {"onset": "onset_s", "amplitude": "amplitude_nm"}.items()
        )
        study.edit(TABLE, f"{TABLE}columns = {{ {columns} }}\n")
    opened = study.open()

    table = read_pulse_table(opened, opened.spec.recordings[1])

    assert table["onset_s"].tolist() == [0.021, 0.03]
    assert table["amplitude_nm"].tolist() == [5.0, 6.0]


def test_problems_of_study_tables_and_recordings_come_in_one_round(study):
    (study.root / "S01_pulses.csv").write_text("onset_s\nearly\n")
    study.table("S01_enp.csv", lambda t: t.assign(torque_nm="weak"))
    study.edit(
        "[perturbations] ",
        '[[recordings]]\nparticipant = "S01"\nsession = "2"\n'
        'condition = "perturbed"\nfile = "missing.csv"\n[perturbations] ',
    )

    problems = study.refused().problems

    assert [any(word in p for p in problems) for word in ("early", "weak", "missing.csv")] == [
        True
    ] * 3


def test_a_column_by_number_is_refused(study):
    study.edit(TABLE, f"{TABLE}columns = {{ onset = 1 }}\n")

    assert study.sole_problem().startswith("perturbations.columns.onset")


def test_rows_of_several_sessions_need_the_session_of_the_recording(study):
    content = "participant,session,onset_s\nS01,1,0.021\nS01,2,0.03\n"
    (study.root / "S01_pulses.csv").write_text(content)

    assert "has rows of session 1, 2, and S01_ewp.csv does not say" in study.sole_problem()
    for file, session in (("S01_enp.csv", "1"), ("S01_ewp.csv", "2")):
        study.edit(f'file = "{file}"', f'file = "{file}"\nsession = "{session}"')
    enp = 'file = "S01_enp.csv"'
    study.edit(enp, f'{enp}\nperturbations = "S01_pulses.csv"')
    opened = study.open()
    assert read_pulse_table(opened, opened.spec.recordings[1])["onset_s"].tolist() == [0.03]


def test_what_may_be_thousands_is_refused(study):
    content = 'onset_ms\n"1,250"\n"12,500"\n"25,125"\n'

    with pytest.raises(DataError, match="may be thousands, or have three decimals"):
        read(study, content)


def test_sheets_of_people_need_the_name_of_the_sheet(study, tmp_path):
    pytest.importorskip("openpyxl")
    groups = tuple(
        SignalGroup(name, (Signal("onset_s", np.array([0.01, 0.02])),)) for name in ("S01", "S02")
    )
    write_file(tmp_path / "pulses.xlsx", *groups)
    study.edit('"S01_pulses.csv"', '"pulses.xlsx"')

    assert "has no column for onset" in study.sole_problem()


def test_onsets_by_the_time_of_day_stand_on_a_clock_of_the_day(study):
    clock = [f"10:00:00,{k:03d}" for k in range(50)]
    study.tables(lambda t: t.assign(time_s=clock))
    study.edit('column = "time_s"\nunit = "s"', 'column = "time_s"\nunit = "hh:mm:ss"')
    settings = 'columns = { onset = { column = "Uhrzeit", unit = "hh:mm:ss" } }'

    table = read(study, "Uhrzeit;Dauer\n10:00:00,021;9\n", settings=settings)

    assert table["onset_s"].tolist() == pytest.approx([36000.021])
    (study.root / "S01_pulses.csv").write_text("Uhrzeit\nten\n")
    assert "expected a time of day, found 'ten'" in study.sole_problem()


@pytest.mark.parametrize(("name", "unit"), [("Beginn [ms]", "s"), ("onset_sample", "ms")])
def test_a_unit_that_the_name_contradicts_is_refused(study, name, unit):
    settings = f'columns = {{ onset = {{ column = "{name}", unit = "{unit}" }} }}'
    study.edit(TABLE, f"{TABLE}{settings}\n")
    (study.root / "S01_pulses.csv").write_text(f"{name}\n21\n")

    assert f"column '{name}': its name or unit says" in study.sole_problem()


def test_variables_of_usual_names_are_found_in_a_matlab_file(study, tmp_path):
    savemat(tmp_path / "pulses.mat", {"onset_s": [0.021, 0.03], "subject": "S01"})
    study.edit('"S01_pulses.csv"', '"pulses.mat"')
    opened = study.open()

    table = read_pulse_table(opened, opened.spec.recordings[1])

    assert table["onset_s"].tolist() == [0.021, 0.03]


def test_the_unit_that_a_file_states_for_its_onsets_holds(study, tmp_path):
    onset = Signal("Beginn", np.array([21.0, 30.0]), "ms")
    write_file(tmp_path / "pulses.parquet", SignalGroup("", (onset,)))
    (study.root / "pulses.parquet").write_bytes((tmp_path / "pulses.parquet").read_bytes())
    study.edit(TABLE, f'{TABLE}columns = {{ onset = "Beginn" }}\n')
    study.edit('"S01_pulses.csv"', '"pulses.parquet"')
    opened = study.open()
    table = read_pulse_table(opened, opened.spec.recordings[1])
    assert table["onset_s"].tolist() == pytest.approx([0.021, 0.03])

    study.edit('onset = "Beginn"', 'onset = { column = "Beginn", unit = "s" }')
    assert "says 'ms', its name or study.toml says 's'" in study.sole_problem()
