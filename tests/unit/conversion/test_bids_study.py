"""Studies as Motion-BIDS folders and back."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from jointz.conversion.bids_study import MARKER, write_bids
from jointz.core.errors import DataError, OutputError
from jointz.io.bids.bids_read import read_bids
from jointz.io.recordings import read_recording
from jointz.io.study_reader import open_study

HEAD = """\
jointz = 1
joint = "knee"
kind = "walking"
positive = "flexion"
torque_acts_on = "device"
[channels]
time.column = "t"
angle = { column = "knee_deg", unit = "deg", positive = "extension" }
torque = { column = "tq", unit = "mNm" }
command.column = "cmd"
contact.column = "foot"
"""
COMMAND = 'command.column = "cmd"\n'


def table(seed: int, *, n: int = 900, step_s: float = 0.005, start_s: float = 2.5) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    s = np.arange(n) * step_s
    frame = {
        "t": s + start_s,
        "knee_deg": 30 * np.sin(s) + rng.standard_normal(n),
        "tq": 1000 * rng.standard_normal(n),
        "cmd": -17.0 * ((s % 2 > 1.5) & (s % 2 < 1.7)),
        "foot": (s % 1 < 0.6).astype(int),
    }
    found = pd.DataFrame(frame)
    found.loc[20:25, "tq"] = np.nan
    return found


def person(name: str, **more: float) -> str:
    lines = [f'id = "{name}"', *(f"{key} = {value}" for key, value in more.items())]
    return "[[participants]]\n" + "\n".join(lines) + "\n"


def entry(**keys: str) -> str:
    return "[[recordings]]\n" + "".join(f'{k} = "{v}"\n' for k, v in keys.items())


def write_study(root: Path, recordings: str, head: str = HEAD) -> Path:
    """Write a study of one participant."""
    (root / "study.toml").write_text(head + person("S01") + recordings)
    return root


def content_of(folder: Path):
    """The one recording of a BIDS folder."""
    (content,) = read_bids(folder).values()
    return content


def make_study(root: Path) -> Path:
    toml = HEAD + person("S_01", mass_kg=70.5) + person("S-02", height_m=1.8) + person("S_03")
    for k, (name, condition) in enumerate(
        [("S_01", "unperturbed"), ("S_01", "perturbed"), ("S-02", "perturbed")]
    ):
        table(k, step_s=0.005 if k else 0.0050001).to_csv(root / f"{k}.csv", index=False)
        side = "left" if name == "S_01" else "right"
        toml += entry(participant=name, condition=condition, file=f"{k}.csv", side=side)
    (root / "study.toml").write_text(toml)
    return root


@pytest.fixture
def study(tmp_path: Path) -> Path:
    (tmp_path / "study").mkdir()
    return make_study(tmp_path / "study")


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory):
    """The study, its BIDS folder, and what its writer returned."""
    root, out = make_study(tmp_path_factory.mktemp("study")), tmp_path_factory.mktemp("out") / "b"
    return root, out, write_bids(root, out)


def test_a_study_comes_back_bit_for_bit_in_si_and_its_direction(written):
    root, out, made = written
    found = read_bids(out)
    opened = open_study(root)
    assert set(found) == set(made.recordings)
    for spec, name in zip(opened.spec.recordings, made.recordings, strict=True):
        (recording,) = read_recording(opened, spec)
        (group,) = found[name].groups
        np.testing.assert_array_equal(group.times_s(), recording["time"].to_numpy())
        assert [s.name for s in group.signals] == [str(n) for n in recording.data_vars]
        for signal in group.signals:
            np.testing.assert_array_equal(signal.values, recording[signal.name].to_numpy())
            assert signal.unit == recording[signal.name].attrs["units"]
        metadata = found[name].metadata
        assert (metadata["positive"], metadata["torque_acts_on"]) == ("flexion", "joint")
        assert (metadata["condition"], metadata["side"]) == (spec.condition, spec.side)


def test_types_units_and_directions_stand_beside_the_samples(written):
    stem = "sub-S01_task-walking_tracksys-kneeLeft_acq-perturbed"
    folder = written[1] / "sub-S01" / "motion"
    file = folder / f"{stem}_channels.tsv"
    channels = pd.read_csv(file, sep="\t", index_col="name", keep_default_na=False)
    assert channels["type"]["angle"] == "JNTANG"
    assert channels["type"]["torque"] == "MISC"
    assert channels["units"]["torque"] == "N.m"
    assert channels["positive_direction"]["angle"] == "flexion"
    sidecar = json.loads((folder / f"{stem}_motion.json").read_text())
    assert sidecar["JNTANGChannelCount"] == 1
    assert sidecar["MotionChannelCount"] == len(channels)


def test_pulses_are_events_on_the_clock_of_the_file(written):
    _, out, made = written
    content = read_bids(out)[made.recordings[1]]

    assert [e.time_s for e in content.events] == pytest.approx([4.005, 6.005], abs=0.006)
    assert {e.label for e in content.events} == {"pulse amplitude=-17.0"}
    assert made.n_events == 6


def test_participants_keep_what_is_known_of_them_if_they_have_a_recording(written):
    _, out, made = written
    assert made.participants == ("sub-S01", "sub-S02")
    (note,) = made.notes
    assert "S_03" in note
    assert (out / "participants.tsv").read_text().splitlines() == [
        "participant_id\tstudy_id\tmass_kg\theight_m",
        "sub-S01\tS_01\t70.5\tn/a",
        "sub-S02\tS-02\tn/a\t1.8",
    ]
    about = json.loads((out / "participants.json").read_text())
    assert about["mass_kg"]["Units"] == "kg"


@pytest.mark.parametrize("other", ["S01", "s_01"])
def test_ids_that_lose_their_difference_are_refused(other, study, tmp_path):
    toml = (study / "study.toml").read_text().replace("S-02", other)
    (study / "study.toml").write_text(toml)

    with pytest.raises(DataError, match=f"'S_01', '{other}'"):
        write_bids(study, tmp_path / "bids")

    assert not (tmp_path / "bids").exists()


def test_a_table_of_pulses_gives_events_with_their_timing_points(study, tmp_path):
    pulses = "onset_s,duration_s,amplitude_nm,timing_point\n3.0,0.2,7,LRE\n4.0,0.2,-7,\n5,,,\n"
    (study / "pulses.csv").write_text(pulses)
    own = entry(participant="S01", file="0.csv", condition="perturbed", perturbations="pulses.csv")
    current = 'current.column = "cmd"\n[torque_model]\ngear_ratio = 9.0\ntorque_constant = 0.1\n'
    head = HEAD.replace('torque = { column = "tq", unit = "mNm" }\n', "")
    write_study(study, own, head.replace(COMMAND, "") + current)

    written = write_bids(study, tmp_path / "bids")

    labels = [e.label for e in content_of(tmp_path / "bids").events]
    assert written.n_events == 3
    assert labels == ["pulse amplitude=7.0 timing_point=LRE", "pulse amplitude=-7.0", "pulse"]


TRIALS = 'trial.column = "trial"\ncondition.column = "phase"\n'


def in_trials(study: Path, *, restarts: bool, onsets: list[float]) -> Path:
    """One file: an unperturbed trial and two perturbed ones of 4.5 s, and a table of pulses."""
    parts = [
        table(k, start_s=0.0 if restarts else 4.5 * k).assign(trial=k, phase=phase)
        for k, phase in enumerate(["ENP", "EWP", "EWP"])
    ]
    pd.concat(parts).drop(columns="cmd").to_csv(study / "all.csv", index=False)
    pd.DataFrame({"onset_s": onsets}).to_csv(study / "pulses.csv", index=False)
    own = entry(participant="S01", file="all.csv", session="day 1", perturbations="pulses.csv")
    return write_study(study, own, HEAD.replace(COMMAND, "") + TRIALS)


def test_every_part_of_a_file_is_a_run_with_its_own_pulses_of_the_table(study, tmp_path):
    in_trials(study, restarts=False, onsets=[1.0, 5.0, 6.0, 10.0])

    written = write_bids(study, tmp_path / "bids")

    stem = "sub-S01_ses-day1_task-walking_tracksys-knee_acq-"
    runs = ["unperturbed_run-1", "perturbed_run-1", "perturbed_run-2"]
    assert [name.removeprefix(stem) for name in written.recordings] == runs
    found = read_bids(tmp_path / "bids")
    events = [[e.time_s for e in found[name].events] for name in written.recordings]
    assert [found[name].metadata["trial"] for name in written.recordings] == ["0", "1", "2"]
    np.testing.assert_allclose(events[1], [5.0, 6.0])
    np.testing.assert_allclose(events[2], [10.0])
    assert events[0] == []
    (note,) = written.notes
    assert note.startswith("all.csv: 1 pulse(s)")


@pytest.mark.parametrize(("restarts", "onsets"), [(True, [1.0, 2.0]), (False, [50.0, 60.0])])
def test_a_table_that_could_mean_any_part_or_none_is_refused(restarts, onsets, study, tmp_path):
    in_trials(study, restarts=restarts, onsets=onsets)

    with pytest.raises(DataError, match=r"all\.csv"):
        write_bids(study, tmp_path / "bids")

    assert not (tmp_path / "bids").exists()


def test_steps_of_the_angle_have_their_amplitude_in_rad(study, tmp_path):
    s = np.arange(3000) / 500.0
    steps = sum(0.1 * (s >= at) for at in (1.0, 2.0, 3.0, 4.0))
    frame = pd.DataFrame({"t": s, "knee_deg": np.rad2deg(steps), "tq": 0 * s, "foot": 0})
    frame.to_csv(study / "a.csv", index=False)
    own = entry(participant="S01", file="a.csv", condition="perturbed")
    own += '[perturbations]\nsource = "angle"\n'
    write_study(study, own, HEAD.replace(COMMAND, "").replace("walking", "bench"))

    assert write_bids(study, tmp_path / "bids").n_events == 4

    about = json.loads(next((tmp_path / "bids").rglob("*_events.json")).read_text())
    assert about["amplitude"]["Units"] == "rad"
    events = content_of(tmp_path / "bids").events
    assert np.isnan([e.duration_s for e in events]).all()
    sizes = [float(e.label.split("=")[1]) for e in events]
    np.testing.assert_allclose(sizes, -0.1, rtol=1e-3)  # recorded positive in extension


def test_a_channel_of_ones_own_called_latency_keeps_its_name(study, tmp_path):
    own = entry(participant="S01", file="0.csv", condition="perturbed")
    write_study(study, own, HEAD + 'latency.column = "foot"\n')

    write_bids(study, tmp_path / "bids")

    names = [s.name for s in content_of(tmp_path / "bids").groups[0].signals]
    assert "latency" in names
    assert "\nlatency_2\t" in next((tmp_path / "bids").rglob("*_channels.tsv")).read_text()


def test_only_a_folder_of_jointz_that_nobody_edited_is_replaced(study, tmp_path):
    out = tmp_path / "bids"
    write_bids(study, out)
    with pytest.raises(OutputError, match="exists and is kept"):
        write_bids(study, out)
    write_bids(study, out, overwrite=True)
    (out / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match="did not write"):
        write_bids(study, out, overwrite=True)
    assert (out / MARKER).is_file()

    (out / "mine.txt").unlink()
    edited = (out / "dataset_description.json").read_text().replace('"Name"', '"Authors"')
    (out / "dataset_description.json").write_text(edited)
    with pytest.raises(OutputError, match=r"dataset_description\.json"):
        write_bids(study, out, overwrite=True)
    assert (out / "dataset_description.json").read_text() == edited
    assert [p.name for p in tmp_path.iterdir() if p.name.startswith(".")] == []


# --- the official validator ---------------------------------------------------------------------


def validator() -> list[str]:
    """The command of the validator that JOINTZ_BIDS_VALIDATOR names; skips without one."""
    named = os.environ.get("JOINTZ_BIDS_VALIDATOR", "")
    if not named or not Path(named).exists():
        pytest.skip("set JOINTZ_BIDS_VALIDATOR to the bids-validator of npm, or of PyPI")
    if Path(named).resolve().read_bytes()[:64].startswith(b"#!") and shutil.which(named):
        return [named]
    if shutil.which("node") is None:
        pytest.skip("bids-validator of npm needs node, which is absent")
    return ["node", named]


def validated(folder: Path) -> list[str]:
    """Return the codes of the errors that the validator finds."""
    command = [*validator(), str(folder), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=240)
    assert done.stdout, done.stderr
    issues = json.loads(done.stdout)["issues"]
    found = issues.get("issues")
    if found is None:  # the older of the two
        return [issue["key"] for issue in issues["errors"]]
    return [issue["code"] for issue in found if issue["severity"] == "error"]


@pytest.mark.slow
def test_the_official_validator_finds_no_error(written):
    assert validated(written[1]) == []
