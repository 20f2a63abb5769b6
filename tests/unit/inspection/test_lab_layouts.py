"""Layouts of labs: clocks apart, files of a trial, triggers, heel strikes as times, people."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.core.errors import DataError
from jointz.inspection.inspect_file import inspect_file
from jointz.io.formats.registry import write_acquisition
from jointz.io.study_reader import open_study

from .answers import answered, open_keys
from .test_inspect_folder import ONSETS_S, RATE_HZ, STRIDE_S, walk

CONSTANT = 5.0  # N*m/A
STRIKES_S = np.arange(STRIDE_S, 39.0, STRIDE_S)


def trial(
    *, pulses: bool = True, current: float = 1.0, noise_a: float = 0.01
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the tables of a camera at 100 Hz and of a card at 200 Hz."""
    whole = walk(pulses=pulses)
    s = whole["time"].to_numpy()
    in_pulse = (((s[:, None] - ONSETS_S) % 1e9) < 0.1).any(axis=1) & pulses
    noise = np.random.default_rng(3).standard_normal((2, s.size))
    amperes = current * 15.0 / CONSTANT * in_pulse + noise_a * noise[0]
    volts = 5.0 * in_pulse + 0.02 * noise[1]
    camera = pd.DataFrame({"time": s, "kneeAngle": whole["angle"]})[::2]
    return camera, pd.DataFrame({"time": s, "motorCurrent": amperes, "trigger": volts})


def struct(table: pd.DataFrame) -> dict[str, np.ndarray]:
    return {str(name): values.to_numpy()[:, None] for name, values in table.items()}


def element(name: str, camera: pd.DataFrame, card: pd.DataFrame) -> dict[str, object]:
    """Return an element of the struct array of a lab's MATLAB script."""
    events = {"heelStrike": STRIKES_S[:, None]}
    return {"name": name, "mocap": struct(camera), "daq": struct(card), "events": events}


def write_csv(folder: Path, person: str, number: int, *, shift_s: float = 0.0, **how) -> None:
    """Write a trial as a file of each device."""
    camera, card = trial(**how)
    camera = camera.assign(time=camera["time"] + shift_s)
    camera.round(5).to_csv(folder / f"{person}_{number}_mocap.csv", index=False)
    card.round(5).to_csv(folder / f"{person}_{number}_daq.csv", index=False)
    strikes = pd.DataFrame({"heel_strike_s": STRIKES_S})
    strikes.to_csv(folder / f"{person}_{number}_strikes.csv", index=False)


def drafted(folder: Path, **answers: object):
    """Inspect a folder, answer what is asked, and open the study."""
    found = inspect_file(folder)
    motor = {"gear_ratio": 1.0, "torque_constant": CONSTANT}
    (folder / "study.toml").write_text(answered(found.toml, **motor, **answers), encoding="utf-8")
    return found, open_study(folder)


def assert_read(recording) -> None:
    """Assert that a recording has angle, torque and heel strikes on the clock of the card."""
    (read,) = recording.read()
    times = read["time"].to_numpy()
    assert times.size == round(40.0 * RATE_HZ)
    inside = (times > 0.2) & (times < 39.8)
    true_deg = walk(pulses=recording.spec.condition == "perturbed")["angle"].to_numpy()
    error = np.rad2deg(read["angle"].to_numpy()) - true_deg
    assert np.sqrt(np.mean(error[inside] ** 2)) < 0.2
    first = np.flatnonzero(np.diff(read["heel_strikes"], prepend=0.0))
    np.testing.assert_allclose(times[first], STRIKES_S, atol=1.0 / RATE_HZ)


def test_structs_with_two_clocks_are_trials_of_a_person(tmp_path):
    # The current rests at exactly 0 where the motor is off.
    trials = [
        element("noPulses", *trial(pulses=False, noise_a=0.0)),
        element("withPulses", *trial()),
    ]
    subject = {"id": "P1", "mass": 71.5, "height": 182.0, "leg": "left"}
    savemat(tmp_path / "P1.mat", {"subject": subject, "trial": trials})

    found, study = drafted(tmp_path)

    assert open_keys(found.toml) == ["gear_ratio", "torque_constant"]
    assert found.channel("trigger").column == "trial.{part}.daq.trigger"
    assert [(r.part, r.condition, r.rate_hz) for r in found.recordings] == [
        ("1", "unperturbed", 200.0),
        ("2", "perturbed", 200.0),
    ]
    (person,) = study.spec.participants
    assert (person.mass_kg, person.height_m) == (71.5, 1.82)
    assert {r.spec.side for r in study.recordings} == {"left"}
    for recording in study.recordings:
        assert_read(recording)


def test_files_of_a_trial_are_joined_and_its_heel_strikes_are_taken(tmp_path):
    write_csv(tmp_path, "P1", 1, pulses=False)
    write_csv(tmp_path, "P1", 2)
    write_csv(tmp_path, "P2", 1)

    found, study = drafted(tmp_path)

    assert open_keys(found.toml) == ["gear_ratio", "torque_constant"]
    assert [(r.file, r.condition) for r in found.recordings] == [
        ("P1_1_daq.csv", "unperturbed"),
        ("P1_2_daq.csv", "perturbed"),
        ("P2_1_daq.csv", "perturbed"),
    ]
    for recording in study.recordings:
        assert_read(recording)


def test_a_file_of_another_person_is_not_joined(tmp_path):
    write_csv(tmp_path, "P1", 1)
    (tmp_path / "P1_1_mocap.csv").rename(tmp_path / "P2_1_mocap.csv")

    found = inspect_file(tmp_path)

    assert "joined" not in found.toml


def test_the_offset_of_clocks_that_do_not_agree_is_asked(tmp_path):
    write_csv(tmp_path, "P1", 1, shift_s=3.0)

    found = inspect_file(tmp_path)

    assert "offset_s" in open_keys(found.toml)
    (tmp_path / "study.toml").write_text(found.toml, encoding="utf-8")
    with pytest.raises(DataError, match="offset_s: open"):
        open_study(tmp_path)
    _, study = drafted(tmp_path, offset_s=-3.0)
    assert_read(study.recordings[0])


def test_a_trigger_decides_the_condition(tmp_path):
    write_csv(tmp_path, "P1", 1, pulses=False)
    alone = inspect_file(tmp_path)
    assert [r.condition for r in alone.recordings] == ["?"]  # it may be the wrong channel

    write_csv(tmp_path, "P1", 2)
    both = inspect_file(tmp_path)
    assert {r.file: r.condition for r in both.recordings} == {
        "P1_1_daq.csv": "unperturbed", "P1_2_daq.csv": "perturbed"
    }  # fmt: skip
    for file in tmp_path.glob("P1_2*"):
        file.unlink()

    _, card = trial()
    card.assign(trigger=5.0 - card["trigger"]).to_csv(tmp_path / "P1_1_daq.csv", index=False)
    found = inspect_file(tmp_path)

    assert [r.condition for r in found.recordings] == ["perturbed"]
    assert f'source = "trigger"  # guess: the trigger starts {ONSETS_S.size} time(s)' in found.toml


@pytest.mark.parametrize(("current", "positive"), [(1.0, "flexion"), (-1.0, "extension")])
def test_pulses_show_the_direction_of_the_current(tmp_path, current, positive):
    write_csv(tmp_path, "P1", 1, current=current)

    found, study = drafted(tmp_path)

    assert "positive" not in open_keys(found.toml)
    assert (study.spec.channels["current"].positive or "flexion") == positive


def test_without_pulses_the_direction_of_the_current_is_asked(tmp_path):
    write_csv(tmp_path, "P1", 1, pulses=False)

    found = inspect_file(tmp_path)

    assert "channels.current.positive" in {q.about for q in found.questions if not q.drafted}


def test_people_have_what_a_table_states(tmp_path):
    write_csv(tmp_path, "P1", 1)
    write_csv(tmp_path, "P2", 1)
    table = pd.DataFrame(
        {
            "participant_id": ["sub-01", "sub-02"],
            "weight": [61.5, 82.0],
            "height_cm": [165, 188],
            "tested_leg": ["R", "L"],
        }
    )
    table.to_csv(tmp_path / "participants.tsv", sep="\t", index=False)

    _, study = drafted(tmp_path)

    people = [(p.id, p.mass_kg, p.height_m) for p in study.spec.participants]
    assert people == [("P1", 61.5, 1.65), ("P2", 82.0, 1.88)]
    assert [r.spec.side for r in study.recordings] == ["right", "left"]


@pytest.mark.parametrize("has_stamps", [False, True])
def test_groups_with_events_are_one_recording(tmp_path, has_stamps):
    camera, card = trial()
    axes = [
        Signal("KneeAngle.x", camera["kneeAngle"].to_numpy(), "deg"),
        Signal("KneeAngle.y", 0.5 * np.sin(np.arange(len(camera))), "deg"),
        Signal("KneeAngle.z", np.zeros(len(camera)), "deg"),
    ]
    channels = [
        Signal("current", card["motorCurrent"].to_numpy(), "A"),
        Signal("trigger", card["trigger"].to_numpy(), "V"),
    ]
    clocks = [{"rate_hz": RATE_HZ / 2}, {"rate_hz": RATE_HZ}]
    if has_stamps:
        clocks = [{"time_s": table["time"].to_numpy()} for table in (camera, card)]
    groups = (
        SignalGroup("points", tuple(axes), **clocks[0]),
        SignalGroup("analogs", tuple(channels), **clocks[1]),
    )
    strikes = tuple(Event(time_s, "Right Foot Strike") for time_s in STRIKES_S.tolist())
    write_acquisition(Acquisition(groups, strikes), tmp_path / "P1.nc")

    found, study = drafted(tmp_path)

    assert found.channel("angle").title == "KneeAngle.x"
    assert study.spec.channels["heel_strikes"].column == "Right Foot Strike"
    assert_read(study.recordings[0])
