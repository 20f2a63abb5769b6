"""What would give wrong numbers, or another person's, is asked or left alone."""

import tomllib

import pandas as pd
import pytest
from scipy.io import savemat

from jointz.inspection.inspect_file import inspect_file

from .answers import open_keys
from .test_decided_or_asked import RATE_HZ, TIME_S, draft, gait, moved, noise, pulses
from .test_lab_layouts import write_csv


def recording(**changes) -> pd.DataFrame:
    """A walking knee with pulses, its names and units stated."""
    command = pulses()
    columns = {"time_s": TIME_S, "knee_deg": gait() + moved(command) + noise(0.02)}
    columns |= {"torque_Nm": command + noise(0.1), "command_Nm": command}
    columns["heel"] = (TIME_S % 1.1 < 0.6).astype(int)
    return pd.DataFrame(columns | changes).round(5)


def people(folder, table: str, *files: str) -> dict[str, float | None]:
    """Return the mass that each drafted person has."""
    for file in files:
        recording().to_csv(folder / file, index=False)
    (folder / "participants.csv").write_text(table)
    drafted = tomllib.loads(inspect_file(folder).toml)["participants"]
    return {person["id"]: person.get("mass_kg") for person in drafted}


def test_recordings_of_several_rates_without_time_are_asked_for_them(tmp_path):
    for name, rate in (("S01_pulses.csv", 1000), ("S02_pulses.csv", 500)):
        text = recording().drop(columns="time_s").to_csv(index=False)
        (tmp_path / name).write_text(f"Sampling rate: {rate} Hz\n{text}")
    assert "sample_rate_hz" in open_keys(inspect_file(tmp_path).toml)


def test_counts_of_an_encoder_are_no_degrees(tmp_path):
    counts = (2000 + 4096 / 360 * moved(pulses())).round()
    assert "channels.angle.unit" in draft(tmp_path, knee_angle=counts, torque_Nm=pulses())[1]


def test_stamps_far_apart_are_no_bug(tmp_path):
    found = inspect_file_of(tmp_path, recording(time_s=1e3 * TIME_S))
    assert found.clocks[0].rate_hz == pytest.approx(RATE_HZ / 1e3)


def inspect_file_of(folder, frame):
    frame.to_csv(folder / "S01.csv", index=False)
    return inspect_file(folder / "S01.csv")


def test_a_part_has_its_own_mass_and_a_device_none(tmp_path):
    fields = {name: values.to_numpy()[:, None] for name, values in recording().items()}
    person = {"mass": 100.0, **fields}
    content = {"all": {"S1": person, "S2": {**fields, "mass": 60.0}, "exo": {"mass": 24.0}}}
    savemat(tmp_path / "all.mat", content)
    toml = inspect_file(tmp_path / "all.mat").toml
    assert [line for line in toml.splitlines() if line.startswith("mass_kg")] == [
        "mass_kg = 100.0  # guess: the file states it",
        "mass_kg = 60.0  # guess: the file states it",
    ]


@pytest.mark.parametrize(
    ("table", "masses"),
    [
        ("id,weight_lb\nS01,170\n", {"S01": 77.111}),
        ("id,sex,leg,mass_kg\nS01,f,right,60\n", {"S01": 60.0}),
        ("id,mass_kg,note\nsub-01,n/a,left early\n", {"S01": None}),
        ("participant_id,mass_kg\nsub-01,61.5\n", {"S01": 61.5}),
    ],
)
def test_a_table_of_people_is_read_with_its_units(tmp_path, table, masses):
    assert people(tmp_path, table, "S01_pulses.csv") == masses


def test_a_mass_passes_to_nobody_of_the_same_number(tmp_path):
    table = "id,mass_kg\nP01,70.5\n"
    files = ("C01_pulses.csv", "P01_pulses.csv")
    assert people(tmp_path, table, *files) == {"C01": None, "P01": 70.5}


@pytest.mark.parametrize(
    ("angle", "torque"),
    [
        ("P01_trial2_ik", "P01_trial3_exo"),
        ("anna_ik", "ben_exo"),
        ("P01_normal_ik", "P01_pulse_exo"),
    ],
)
def test_files_of_other_trials_people_and_conditions_are_not_joined(tmp_path, angle, torque):
    whole = recording()
    whole[["time_s", "knee_deg"]].to_csv(tmp_path / f"{angle}.csv", index=False)
    whole.drop(columns="knee_deg").to_csv(tmp_path / f"{torque}.csv", index=False)
    assert "[[recordings.joined]]" not in inspect_file(tmp_path).toml


def test_a_joined_angle_has_the_direction_of_its_own_range(tmp_path):
    for person, sign in (("P1", 1.0), ("P2", -1.0)):
        whole = recording()
        angle = whole[["time_s"]].assign(knee_deg=sign * whole["knee_deg"])
        angle.to_csv(tmp_path / f"{person}_gonio.csv", index=False)
        whole.drop(columns="knee_deg").to_csv(tmp_path / f"{person}_exo.csv", index=False)
    found = inspect_file(tmp_path)
    lines = [line for line in found.toml.splitlines() if line.startswith("channels.angle")]
    assert ['positive = "extension"' in line for line in lines] == [False, True]


def test_a_leg_that_a_table_contradicts_is_asked(tmp_path):
    both = {"knee_left_deg": gait() + noise(0.02), "knee_deg": gait() + moved(pulses())}
    frame = recording(**both).rename(columns={"knee_deg": "knee_right_deg"})
    frame.to_csv(tmp_path / "P02.csv", index=False)
    (tmp_path / "participants.csv").write_text("id,leg,mass_kg\nP02,left,70\n")
    assert "side" in open_keys(inspect_file(tmp_path).toml)


def test_a_trigger_of_a_recording_without_pulses_by_its_name_is_asked(tmp_path):
    write_csv(tmp_path, "P1", 1)
    for file in tmp_path.glob("P1_1_*"):
        file.rename(tmp_path / file.name.replace("P1_1", "P1_normal"))
    found = inspect_file(tmp_path)
    assert [r.condition for r in found.recordings] == ["?"]


def test_a_pulse_table_with_a_column_of_its_own_is_drafted_with_its_names(tmp_path):
    frame = recording().drop(columns="command_Nm")
    frame.to_csv(tmp_path / "P01_pulses.csv", index=False)
    table = pd.DataFrame({"onset_s": [4.6, 6.9, 9.2], "stride": [4, 6, 8]})
    table.to_csv(tmp_path / "P01_onsets.csv", index=False)
    study = tomllib.loads(inspect_file(tmp_path).toml)
    assert study["perturbations"]["columns"] == {"onset": {"column": "onset_s", "unit": "s"}}
