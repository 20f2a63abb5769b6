"""`jointz run` of the steps of a calibration, and runs that are given what one found."""

import json

import numpy as np
import pytest

import jointz
from jointz.core.errors import DataError, SafetyStop
from jointz.core.protocols.protocol import Protocol
from jointz.io.protocols import load_protocol
from jointz.io.recordings import read_recording
from jointz.rig.session.run import run

STEPS = {
    "zero": ("straight",),
    "footswitch": ("walking",),
    "hinge": ("swing",),
    "frame": ("pulses",),
    "leg": ("bare", "weighted"),
    "torsion": ("locked",),
    "spring": ("spring",),
}
CHANNELS = {"angle", "motor_angle", "motor_velocity", "current", "command", "reference"}
SECONDS = {"footswitch": 20.0}
SEED = 3
PULSES = 6


def shortened(step, *, seconds=2.0, **changes):
    """Return a built-in protocol with a few pulses or seconds only."""
    written = load_protocol(f"calibration-{step}").model_dump(exclude_none=True)
    for condition in written["conditions"]:
        condition["duration_s"] = seconds
        if "perturbations" in condition:
            condition["perturbations"]["count"] = PULSES
            condition["duration_s"] = 3.0 * PULSES + 3.0
    return Protocol.model_validate(written | changes)


def recordings(study):
    opened = jointz.open_study(study)
    return {
        (entry.participant, entry.session): (entry, read_recording(opened, entry)[0])
        for entry in opened.spec.recordings
    }


def pulses(entry):
    return np.genfromtxt(entry.perturbations, delimiter=",", names=True, encoding="utf-8")


@pytest.fixture(scope="module")
def studies(tmp_path_factory):
    root = tmp_path_factory.mktemp("calibration")
    return {
        step: run(
            shortened(step, seconds=SECONDS.get(step, 4.0)),
            out=root / step,
            seed=SEED,
            preset="anthropometric",
            participants=1,
        ).study
        for step in STEPS
    }


@pytest.mark.parametrize("step", STEPS)
class TestEveryStep:
    def test_writes_one_recording_a_condition_with_all_channels(self, studies, step):
        made = recordings(studies[step])
        assert tuple(session for _, session in made) == STEPS[step]
        for _, recording in made.values():
            wanted = CHANNELS | ({"contact"} if step == "footswitch" else set())
            assert set(recording.data_vars) == wanted
            duration = 3.0 * PULSES + 3.0 if step in ("frame", "leg") else SECONDS.get(step, 4.0)
            assert recording["time"][-1] == pytest.approx(duration, abs=0.1)
            assert all(np.isfinite(recording[name]).all() for name in wanted)
        assert jointz.open_study(studies[step]).spec.torque_model.gear_ratio == 9.0

    def test_pulses_stand_in_a_table_where_there_are_some(self, studies, step, monkeypatch):
        for (_, session), (entry, recording) in recordings(studies[step]).items():
            if step not in ("frame", "leg"):
                assert entry.perturbations is None
                continue
            monkeypatch.chdir(studies[step])
            table = pulses(entry)
            pulse = load_protocol(f"calibration-{step}").pulse
            assert table.size == PULSES, session
            assert sorted(set(table["amplitude_nm"])) == [-pulse.amplitude_nm, pulse.amplitude_nm]
            assert table["amplitude_nm"].sum() == 0.0
            assert table["duration_s"] == pytest.approx(pulse.duration_s, abs=2e-6)
            time, command = recording["time"].to_numpy(), recording["command"].to_numpy()
            at = np.searchsorted(time, table["onset_s"] - 1e-6)
            assert command[at] == pytest.approx(table["amplitude_nm"], rel=1e-6)
            assert (command[at - 1] == 0.0).all()


def kick(made, session):
    """Return how far the device is 0.15 s after the onset of a pulse, along it, rad."""
    entry, recording = made["S01", session]
    table = pulses(entry)
    time, angle = recording["time"].to_numpy(), recording["motor_angle"].to_numpy()
    before, after = (
        angle[np.searchsorted(time, table["onset_s"] + later)] for later in (0.0, 0.15)
    )
    return float(np.mean(np.sign(table["amplitude_nm"]) * (after - before)))


def test_pulses_move_the_leg_along_and_the_weight_makes_it_slower(studies, monkeypatch):
    monkeypatch.chdir(studies["leg"])
    made = recordings(studies["leg"])
    truth = json.loads((studies["leg"] / "ground_truth.json").read_text())["participants"]["S01"]
    bare = truth["device"]["limb_and_device_inertia"]
    assert kick(made, "bare") > 0.01
    # A pulse is short: how far it goes, goes with 1 / J, but for what springs hold back.
    expected = bare / (bare + truth["loads"]["weighted"]["inertia"])
    assert kick(made, "weighted") / kick(made, "bare") == pytest.approx(expected, abs=0.1)


def test_footswitch_volts_have_two_levels(studies):
    _, recording = recordings(studies["footswitch"])["S01", "walking"]
    truth = json.loads((studies["footswitch"] / "ground_truth.json").read_text())
    levels = truth["participants"]["S01"]["contact"]
    volts = recording["contact"].to_numpy()
    middle = 0.5 * sum(levels.values())
    strikes = np.flatnonzero((volts[:-1] < middle) & (volts[1:] > middle)).size
    assert 15 <= strikes <= 80  # 20 s of strides of 1.0 to 1.2 s; contacts bounce
    assert np.median(volts[volts > middle]) == pytest.approx(levels["contact_level_v"], rel=0.1)


class Leaves:
    """An operator who goes home at the second prompt."""

    def __init__(self):
        self.prompts = []

    def prompt(self, text):
        self.prompts.append(text)
        if len(self.prompts) == 2:
            raise KeyboardInterrupt


def test_an_interrupted_leg_goes_on_where_it_was(tmp_path):
    protocol, operator = shortened("leg"), Leaves()
    with pytest.raises(KeyboardInterrupt):
        run(protocol, out=tmp_path / "broken", participants=1, operator=operator)
    assert not (tmp_path / "broken" / "study.toml").exists()
    run(protocol, out=tmp_path / "broken", participants=1, resume=True)
    run(protocol, out=tmp_path / "whole", participants=1)
    for name in ("S01_bare.nc", "S01_weighted.nc"):
        one, two = (recordings(tmp_path / study) for study in ("broken", "whole"))
        for key in one:
            assert one[key][1].drop_attrs().equals(two[key][1].drop_attrs()), name


@pytest.mark.slow
@pytest.mark.alone
def test_it_runs_in_real_time_too(tmp_path):
    study = run(shortened("footswitch"), out=tmp_path / "study", participants=1, clock="real").study
    _, recording = recordings(study)["S01", "walking"]
    assert recording["time"][-1] == pytest.approx(2.0, abs=0.1)


def test_the_safety_gate_watches_as_in_every_run(tmp_path):
    tight = shortened("leg", safety={"velocity_rad_s": 0.5})
    with pytest.raises(SafetyStop, match="velocity"):
        run(tight, out=tmp_path / "study", participants=1, preset="clean")


def test_a_device_without_a_frame_has_none_to_calibrate(tmp_path):
    with pytest.raises(DataError, match="anthropometric"):
        run("calibration-frame", out=tmp_path / "study", participants=1, preset="hard")
    assert not (tmp_path / "study").exists()


class TestWithACalibration:
    TEXT = """
[calibration]
torque_gain = { value = 1.01, sd = 0.003 }

[[participants]]
id = "S02"
[participants.calibration]
angle_lag_s = { value = 0.0065, sd = 0.0005 }
torque_gain = { value = 0.99, sd = 0.002 }
"""

    def file(self, folder, text=TEXT):
        path = folder / "calibration.toml"
        path.write_text(text)
        return path

    def test_its_entries_stand_over_the_rigs_own_and_recordings_stay_as_they_are(self, tmp_path):
        file = self.file(tmp_path)
        study = run(
            shortened("zero"), out=tmp_path / "study", participants=2, calibration=file
        ).study
        first, second = (p.calibration for p in jointz.open_study(study).spec.participants)
        assert (first.torque_gain.value, first.torque_gain.sd) == (1.01, 0.003)
        assert first.angle_lag_s is None
        assert (second.torque_gain.value, second.angle_lag_s.value) == (0.99, 0.0065)
        assert (first.angle_gain.value, first.angle_gain.sd) == (1.0, 0.02)  # the rig's own
        plain = run(shortened("zero"), out=tmp_path / "plain", participants=2).study
        one, two = (recordings(study)["S01", "straight"][1] for study in (plain, study))
        assert one.drop_attrs().equals(two.drop_attrs())

    def test_one_that_names_nobody_here_is_refused(self, tmp_path):
        file = self.file(tmp_path, self.TEXT[self.TEXT.index("[[") :])
        with pytest.raises(DataError, match="S02"):
            run(shortened("zero"), out=tmp_path / "study", participants=1, calibration=file)

    def test_resume_wants_the_same_one(self, tmp_path):
        file = self.file(tmp_path)
        protocol, options = shortened("leg"), {"out": tmp_path / "study", "participants": 1}
        with pytest.raises(KeyboardInterrupt):
            run(protocol, **options, calibration=file, operator=Leaves())
        with pytest.raises(DataError, match="calibration_sha256"):
            run(protocol, **options, resume=True)
        # Of S01: the file says nothing of S01 alone.
        self.file(tmp_path, self.TEXT.replace("1.01", "1.05"))
        with pytest.raises(DataError, match="calibration_sha256"):
            run(protocol, **options, calibration=file, resume=True)
        self.file(tmp_path)
        run(protocol, **options, calibration=file, resume=True)
