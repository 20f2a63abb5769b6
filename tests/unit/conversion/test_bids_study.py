"""Studies as Motion-BIDS folders and back."""

import json
import os
import shutil
import subprocess
import sys
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
[channels.time]
column = "t"
[channels.angle]
column = "knee_deg"
unit = "deg"
positive = "extension"
[channels.torque]
column = "tq"
unit = "mNm"
[channels.command]
column = "cmd"
[channels.contact]
column = "foot"
"""


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


@pytest.fixture
def study(tmp_path: Path) -> Path:
    root = tmp_path / "study"
    root.mkdir()
    toml = HEAD + person("S_01", mass_kg=70.5) + person("S-02", height_m=1.8)
    for k, (name, condition) in enumerate(
        [("S_01", "unperturbed"), ("S_01", "perturbed"), ("S-02", "perturbed")]
    ):
        table(k, step_s=0.005 if k else 0.0050001).to_csv(root / f"{k}.csv", index=False)
        side = "left" if name == "S_01" else "right"
        toml += entry(participant=name, condition=condition, file=f"{k}.csv", side=side)
    (root / "study.toml").write_text(toml)
    return root


def test_a_study_comes_back_bit_for_bit_in_si_and_its_direction(study, tmp_path):
    written = write_bids(study, tmp_path / "bids")

    found = read_bids(tmp_path / "bids")
    opened = open_study(study)
    assert set(found) == set(written.recordings)
    for spec, name in zip(opened.spec.recordings, written.recordings, strict=True):
        (recording,) = read_recording(opened, spec)
        (group,) = found[name].groups
        np.testing.assert_array_equal(group.times_s(), recording["time"].to_numpy())
        assert [s.name for s in group.signals] == [str(n) for n in recording.data_vars]
        for signal in group.signals:
            np.testing.assert_array_equal(signal.values, recording[signal.name].to_numpy())
            assert signal.unit == recording[signal.name].attrs["units"]
        told = found[name].metadata
        assert (told["positive"], told["torque_acts_on"]) == ("flexion", "joint")
        assert (told["condition"], told["side"]) == (spec.condition, spec.side)


def test_types_units_and_directions_stand_beside_the_samples(study, tmp_path):
    write_bids(study, tmp_path / "bids")

    stem = "sub-S01_task-walking_tracksys-kneeLeft_acq-perturbed"
    folder = tmp_path / "bids" / "sub-S01" / "motion"
    channels = pd.read_csv(
        folder / f"{stem}_channels.tsv", sep="\t", index_col="name", keep_default_na=False
    )
    assert channels["type"].to_dict()["angle"] == "JNTANG"
    assert channels["type"].to_dict()["torque"] == "MISC"
    assert channels["units"].to_dict()["torque"] == "N.m"
    assert channels["positive_direction"].to_dict()["angle"] == "flexion"
    sidecar = json.loads((folder / f"{stem}_motion.json").read_text())
    assert "no channel type for torques" in sidecar["TaskDescription"]
    assert sidecar["JNTANGChannelCount"] == 1
    assert sidecar["MotionChannelCount"] == len(channels)


def test_pulses_are_events_on_the_clock_of_the_file(study, tmp_path):
    written = write_bids(study, tmp_path / "bids")

    content = read_bids(tmp_path / "bids")[written.recordings[1]]

    assert [e.time_s for e in content.events] == pytest.approx([4.005, 6.005], abs=0.006)
    assert {e.label for e in content.events} == {"pulse amplitude=-17.0"}
    assert written.n_events == 6
    assert "3 recording(s) of 2 participant(s), 6 pulse(s)" in written.summary()
    assert json.loads(json.dumps(written.to_dict()))["n_events"] == 6


def test_participants_keep_what_is_known_of_them(study, tmp_path):
    write_bids(study, tmp_path / "bids")

    people = (tmp_path / "bids" / "participants.tsv").read_text().splitlines()
    about = json.loads((tmp_path / "bids" / "participants.json").read_text())

    assert people == [
        "participant_id\tstudy_id\tmass_kg\theight_m",
        "sub-S01\tS_01\t70.5\tn/a",
        "sub-S02\tS-02\tn/a\t1.8",
    ]
    assert about["mass_kg"]["Units"] == "kg"


def test_parts_of_a_file_become_runs(study, tmp_path):
    parts = [table(k).assign(trial=k, phase="ENP" if k < 2 else "EWP") for k in range(3)]
    pd.concat(parts).to_csv(study / "all.csv", index=False)
    toml = HEAD + '[channels.trial]\ncolumn = "trial"\n[channels.condition]\ncolumn = "phase"\n'
    toml += person("S01") + entry(participant="S01", file="all.csv", session="day 1")
    (study / "study.toml").write_text(toml)

    written = write_bids(study, tmp_path / "bids")

    stem = "sub-S01_ses-day1_task-walking_tracksys-knee_acq-"
    assert [name.removeprefix(stem) for name in written.recordings] == [
        "unperturbed_run-1",
        "unperturbed_run-2",
        "perturbed_run-1",
    ]
    found = read_bids(tmp_path / "bids")
    assert [found[name].metadata["trial"] for name in written.recordings] == ["0", "1", "2"]


def test_a_table_of_pulses_gives_events_with_their_timing_points(study, tmp_path):
    pulses = "onset_s,duration_s,amplitude_nm,timing_point\n3.0,0.2,7,LRE\n4.0,0.2,-7,MST\n"
    (study / "pulses.csv").write_text(pulses)
    toml = HEAD + person("S01")
    toml += entry(
        participant="S01", file="0.csv", condition="perturbed", perturbations="pulses.csv"
    )
    (study / "study.toml").write_text(toml)

    written = write_bids(study, tmp_path / "bids")

    (content,) = read_bids(tmp_path / "bids").values()
    assert written.n_events == 2
    assert [e.label for e in content.events] == [
        "pulse amplitude=7.0 timing_point=LRE",
        "pulse amplitude=-7.0 timing_point=MST",
    ]


@pytest.mark.parametrize("other", ["S01", "s_01"])
def test_ids_that_lose_their_difference_are_refused(other, study, tmp_path):
    toml = (study / "study.toml").read_text().replace("S-02", other)
    (study / "study.toml").write_text(toml)

    with pytest.raises(DataError, match=rf"participants: .* 'S_01', '{other}' have no unique name"):
        write_bids(study, tmp_path / "bids")

    assert not (tmp_path / "bids").exists()


def test_somebody_without_a_recording_is_not_among_the_participants(study, tmp_path):
    (study / "study.toml").write_text((study / "study.toml").read_text() + person("S_03"))

    written = write_bids(study, tmp_path / "bids")

    assert written.participants == ("sub-S01", "sub-S02")
    assert "S03" not in (tmp_path / "bids" / "participants.tsv").read_text()
    assert written.notes == ("without a recording, and so not in participants.tsv: S_03.",)


TRIALS = '[channels.trial]\ncolumn = "trial"\n[channels.condition]\ncolumn = "phase"\n' + person(
    "S01"
)


def in_trials(study: Path, *, restarts: bool, onsets: list[float]) -> Path:
    """One file: an unperturbed trial and two perturbed ones of 4.5 s, and a table of pulses."""
    parts = [
        table(k, start_s=0.0 if restarts else 4.5 * k).assign(trial=k, phase=phase)
        for k, phase in enumerate(["ENP", "EWP", "EWP"])
    ]
    pd.concat(parts).drop(columns="cmd").to_csv(study / "all.csv", index=False)
    pd.DataFrame({"onset_s": onsets}).to_csv(study / "pulses.csv", index=False)
    head = HEAD.replace('[channels.command]\ncolumn = "cmd"\n', "")
    toml = head + TRIALS + entry(participant="S01", file="all.csv", perturbations="pulses.csv")
    (study / "study.toml").write_text(toml)
    return study


def test_every_part_of_a_file_has_its_own_pulses_of_the_table(study, tmp_path):
    in_trials(study, restarts=False, onsets=[1.0, 5.0, 6.0, 10.0])

    written = write_bids(study, tmp_path / "bids")

    found = read_bids(tmp_path / "bids")
    events = [[e.time_s for e in found[name].events] for name in written.recordings]
    assert [len(found[name].groups) for name in written.recordings] == [1, 1, 1]
    np.testing.assert_allclose(events[1], [5.0, 6.0])
    np.testing.assert_allclose(events[2], [10.0])
    assert events[0] == []
    assert written.notes == (
        "all.csv: 1 pulse(s) of its table are outside its perturbed samples and are excluded: "
        "onset 1 s.",
    )


@pytest.mark.parametrize(
    ("restarts", "onsets", "said"),
    [
        (True, [1.0, 2.0], "time starts again in its perturbed trials"),
        (False, [50.0, 60.0], "all 2 onsets of its pulse table lie outside"),
    ],
)
def test_a_table_that_could_mean_any_part_or_none_is_refused(
    restarts, onsets, said, study, tmp_path
):
    in_trials(study, restarts=restarts, onsets=onsets)

    with pytest.raises(DataError, match=said):
        write_bids(study, tmp_path / "bids")

    assert not (tmp_path / "bids").exists()


def test_steps_of_the_angle_have_their_amplitude_in_rad(study, tmp_path):
    s = np.arange(3000) / 500.0
    steps = sum(0.1 * (s >= at) for at in (1.0, 2.0, 3.0, 4.0))
    frame = pd.DataFrame({"t": s, "knee_deg": np.rad2deg(steps), "tq": 0 * s, "foot": 0})
    frame.to_csv(study / "a.csv", index=False)
    head = HEAD.replace('[channels.command]\ncolumn = "cmd"\n', "").replace("walking", "bench")
    toml = head + person("S01") + entry(participant="S01", file="a.csv", condition="perturbed")
    toml += '[perturbations]\nsource = "angle"\n'
    (study / "study.toml").write_text(toml)

    written = write_bids(study, tmp_path / "bids")

    assert written.n_events == 4
    about = json.loads(next((tmp_path / "bids").rglob("*_events.json")).read_text())
    assert about["amplitude"]["Units"] == "rad"
    (content,) = read_bids(tmp_path / "bids").values()
    assert np.isnan([e.duration_s for e in content.events]).all()
    sizes = [float(e.label.split("=")[1]) for e in content.events]
    np.testing.assert_allclose(sizes, -0.1, rtol=1e-3)  # recorded positive in extension


def test_a_study_with_a_current_and_a_table_of_pulses_is_written(study, tmp_path):
    (study / "pulses.csv").write_text("onset_s,amplitude_nm\n3.0,7\n4.0,\n")
    head = HEAD.replace('[channels.torque]\ncolumn = "tq"\nunit = "mNm"', "")
    head = head.replace('[channels.command]\ncolumn = "cmd"', '[channels.current]\ncolumn = "cmd"')
    toml = head + "[torque_model]\ngear_ratio = 9.0\ntorque_constant = 0.1\n" + person("S01")
    toml += entry(participant="S01", file="0.csv", condition="perturbed",
                  perturbations="pulses.csv")  # fmt: skip
    (study / "study.toml").write_text(toml)

    write_bids(study, tmp_path / "bids")

    (content,) = read_bids(tmp_path / "bids").values()
    assert [e.label for e in content.events] == ["pulse amplitude=7.0", "pulse"]


def test_a_channel_of_ones_own_called_latency_keeps_its_name(study, tmp_path):
    toml = HEAD + '[channels.latency]\ncolumn = "tq"\n' + person("S01")
    toml = toml.replace('[channels.torque]\ncolumn = "tq"', '[channels.torque]\ncolumn = "foot"')
    toml += entry(participant="S01", file="0.csv", condition="perturbed")
    (study / "study.toml").write_text(toml)

    write_bids(study, tmp_path / "bids")

    (content,) = read_bids(tmp_path / "bids").values()
    assert "latency" in [s.name for s in content.groups[0].signals]
    names = next((tmp_path / "bids").rglob("*_channels.tsv")).read_text()
    assert "\nlatency_2\t" in names


def test_a_folder_that_was_edited_is_kept(study, tmp_path):
    out = tmp_path / "bids"
    write_bids(study, out)
    edited = (out / "dataset_description.json").read_text().replace('"Name"', '"Authors"')
    (out / "dataset_description.json").write_text(edited)

    with pytest.raises(OutputError, match=r"changed since .*: dataset_description\.json\. Move"):
        write_bids(study, out, overwrite=True)

    assert (out / "dataset_description.json").read_text() == edited
    assert [p.name for p in tmp_path.iterdir() if p.name.startswith(".")] == []


def test_only_a_folder_of_jointz_is_replaced(study, tmp_path):
    out = tmp_path / "bids"
    write_bids(study, out)

    with pytest.raises(OutputError, match="exists and is kept"):
        write_bids(study, out)
    write_bids(study, out, overwrite=True)
    (out / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match="did not write"):
        write_bids(study, out, overwrite=True)
    assert (out / MARKER).is_file()


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
def test_the_official_validator_finds_no_error(study, tmp_path):
    write_bids(study, tmp_path / "bids")

    assert validated(tmp_path / "bids") == []


@pytest.mark.slow
def test_the_validator_looks_at_the_rules_of_motion(study, tmp_path):
    written = write_bids(study, tmp_path / "bids")
    folder = tmp_path / "bids" / "sub-S01" / "motion"
    sidecar = folder / f"{written.recordings[0]}_motion.json"
    content = json.loads(sidecar.read_text())
    del content["SamplingFrequency"]
    sidecar.write_text(json.dumps(content))
    channels = folder / f"{written.recordings[1]}_channels.tsv"
    channels.write_text(channels.read_text().replace("component", "part", 1))

    found = set(validated(tmp_path / "bids"))

    assert found & {"SIDECAR_KEY_REQUIRED", "JSON_SCHEMA_VALIDATION_ERROR"}
    assert found & {"TSV_COLUMN_MISSING", "MOTION_COMPONENT_IN_WRONG_COLUMN"}


def test_writing_bids_loads_no_figures():
    code = "import sys, jointz.conversion.bids_study; sys.exit('matplotlib.pyplot' in sys.modules)"

    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
