"""Calibration studies from file to entries: a lab's own csv, known loads, files written."""

import json

import numpy as np
import pandas as pd
import pytest

from jointz.core.errors import DataError, StudyError
from jointz.io.calibration_file import read_calibration
from jointz.io.study_reader import open_study
from jointz.rig.calibration.calibrate import calibrate
from jointz.rig.session.run import run

RATE_HZ = 400.0
LAG_S, GAIN, ZERO_RAD = 0.0071, 1.023, -0.12
CHANNELS = {"time": "s", "angle": "deg", "motor_angle": "rad", "current": "A", "command": "N*m"}
MODEL = "[torque_model]\ngear_ratio = 9.0\ntorque_constant = 0.1\ncoulomb_friction = 0.3\n"
HANGING = """
jointz_protocol = 1
name = "ours"
title = "A spring of our own"
kind = "calibration"
calibration = "spring"
joint = "knee"
[[loads]]
name = "spring"
stiffness = { value = 45.0, sd = 0.9 }
[[conditions]]
name = "spring"
condition = "perturbed"
prompt = "Hook it in."
duration_s = 60.0
torque_nm = { kind = "sine", amplitude = 15.0, frequency_hz = 0.1 }
"""


def write_study(
    folder, records, *, calibration="", model=MODEL, columns=CHANNELS, condition="unperturbed"
):
    """Write a lab's own study: columns in its own units, a recording a (person, session)."""
    folder.mkdir()
    lines = ['jointz = 1\njoint = "knee"\nkind = "bench"', calibration, model]
    for name, unit in columns.items():
        lines.append(f'[channels.{name}]\ncolumn = "{name}"\nunit = "{unit}"')
        lines += ['kind = "voltage"'] if unit == "V" else []
    people = dict.fromkeys(person for person, _ in records)
    lines += [f'[[participants]]\nid = "{person}"' for person in people]
    for (person, session), table in records.items():
        file = f"{person}_{session}.csv"
        table[list(columns)].to_csv(folder / file, index=False)
        lines.append(
            f'[[recordings]]\nparticipant = "{person}"\ncondition = "{condition}"\n'
            f'session = "{session}"\nfile = "{file}"'
        )
    (folder / "study.toml").write_text("\n".join(lines) + "\n")
    return folder


def table(time, angle, encoder, current=0.0):
    columns = {"time": time, "angle": np.degrees(angle), "motor_angle": encoder}
    return pd.DataFrame({**columns, "current": current, "command": 0.0})


def swung(seed, *, lag_s=LAG_S):
    """A hinge swung by hand, as its encoder and a late goniometer show it."""
    rng = np.random.default_rng(seed)
    time = np.arange(int(40 * RATE_HZ)) / RATE_HZ

    def hinge(t):
        terms = [(0.3, 0.7, 0.1), (0.2, 1.3, 1.0), (0.15, 2.1, 2.0), (0.05, 3.0, 3.0)]
        return sum(a * np.sin(2 * np.pi * f * t + p + seed) for a, f, p in terms)

    shown = GAIN * hinge(time - lag_s) + ZERO_RAD + 1e-3 * rng.standard_normal(time.size)
    return table(time, shown, hinge(time))


def still(seed):
    rng = np.random.default_rng(seed)
    time = np.arange(int(20 * RATE_HZ)) / RATE_HZ
    return table(time, ZERO_RAD + 1e-3 * rng.standard_normal(time.size), 0.0 * time)


def pulled(seed, *, stiffness, torque_gain, friction_nm=0.3):
    """An actuator against a spring, slowly: torque per ampere 0.9 stated, friction as stated."""
    rng = np.random.default_rng(seed)
    time = np.arange(int(60 * RATE_HZ)) / RATE_HZ
    current = 15.0 / 0.9 * np.sin(2 * np.pi * 0.1 * time)
    drive = 0.9 * current / torque_gain
    angle = np.zeros(time.size)
    for i in range(1, time.size):  # follows the torque, held by friction
        low, high = (drive[i] - friction_nm) / stiffness, (drive[i] + friction_nm) / stiffness
        angle[i] = min(max(angle[i - 1], low), high)
    angle += 1e-4 * rng.standard_normal(time.size)
    return table(time, angle, angle, current + 0.02 * rng.standard_normal(time.size))


@pytest.fixture(scope="module")
def hinge_study(tmp_path_factory):
    records = {("S01", "swing"): swung(1), ("S02", "swing"): swung(2)}
    return write_study(tmp_path_factory.mktemp("own") / "hinge", records)


def test_a_labs_own_csv_gives_lag_and_gain_of_everybody(hinge_study):
    found = calibrate(hinge_study, step="hinge")

    assert list(found.fits) == ["S01", "S02"]
    for fit in found.fits.values():
        for name, true in (("angle_lag_s", LAG_S), ("angle_gain", GAIN)):
            entry = fit.entry(name)
            assert entry.available
            assert abs(entry.value - true) < 4.0 * entry.sd
    assert found.standing == 4
    assert found.to_frame().query("used")["participant"].tolist() == ["S01"] * 2 + ["S02"] * 2
    assert found.written == ()


def test_entries_of_several_steps_meet_in_one_file(hinge_study, tmp_path):
    out = tmp_path / "calibration.toml"
    zero = write_study(tmp_path / "zero", {("S01", "straight"): still(0)})
    first = calibrate(hinge_study, step="hinge", out=out)
    second = calibrate(zero, step="zero", out=out)

    read = read_calibration(out)
    assert read.of("S01").model_fields_set == {"angle_lag_s", "angle_gain", "angle_zero_rad"}
    assert read.of("S02").model_fields_set == {"angle_lag_s", "angle_gain"}
    assert first.written == second.written == (str(out),)
    found = first.fits["S02"].entry("angle_gain")
    kept = read.of("S02").angle_gain
    assert kept.value == pytest.approx(found.value, abs=1e-3 * found.sd)
    assert kept.sd == pytest.approx(found.sd, rel=1e-3)
    digits = f"{kept.sd:.12e}".split("e")[0].replace(".", "").rstrip("0")
    assert len(digits) <= 4


def test_entries_go_into_a_study_and_what_they_do_not_reach_is_told(hinge_study, tmp_path):
    own = "calibration = { angle_gain = { value = 1.0, sd = 0.1 } }\n"
    records = {(p, "straight"): still(0) for p in ("S03", "S02")}
    target = write_study(tmp_path / "walking", records, calibration="# ours\n")
    file = target / "study.toml"
    file.write_text(file.read_text() + own)  # of the last recording: S02's
    before = file.read_text()

    found = calibrate(hinge_study, step="hinge", into=target)

    people = {p.id: p.calibration for p in open_study(target).spec.participants}
    assert people["S02"].angle_lag_s.value == pytest.approx(LAG_S, abs=5e-4)
    assert people["S03"] is None
    assert (target / "study.toml.before-calibration").read_text() == before
    assert any("S01" in note for note in found.notes)
    assert any("S02_straight.csv" in note and "angle_gain" in note for note in found.notes)
    assert "# ours" in file.read_text()


def test_nothing_is_written_where_nobody_is_there_or_nothing_stands(hinge_study, tmp_path):
    target = write_study(tmp_path / "walking", {("S09", "straight"): still(0)})
    before = (target / "study.toml").read_bytes()
    with pytest.raises(StudyError, match="S01, S02"):
        calibrate(hinge_study, step="hinge", into=target, out=tmp_path / "c.toml")
    assert (target / "study.toml").read_bytes() == before
    assert not (tmp_path / "c.toml").exists()

    hardly = swung(1)
    hardly[["angle", "motor_angle"]] *= 1e-3
    slow = write_study(tmp_path / "slow", {("S01", "swing"): hardly})
    found = calibrate(slow, step="hinge", out=tmp_path / "c.toml")
    assert found.standing == 0
    assert not (tmp_path / "c.toml").exists()


def test_the_known_spring_is_that_of_the_protocol(tmp_path):
    records = {("S01", "spring"): pulled(3, stiffness=45.0, torque_gain=1.04)}
    folder = write_study(tmp_path / "spring", records)
    with pytest.raises(StudyError, match="'spring'"):
        calibrate(folder, step="spring")

    protocol = tmp_path / "ours.toml"
    protocol.write_text(HANGING)
    told = calibrate(folder, step="spring", protocol=protocol).fits["S01"]
    gain = told.entry("torque_gain")
    assert abs(gain.value - 1.04) < 3.0 * gain.sd
    assert 0.9 * 0.02 < gain.sd < 0.05  # not better than the spring is known

    # What a run writes down counts the same, and a spring twice as stiff gives half the gain.
    session = folder / "sessions" / "S01"
    session.mkdir(parents=True)
    spring = {"name": "spring", "stiffness": {"value": 90.0, "sd": 1.8}, "damping": None}
    run = {"protocol": {"loads": [{**spring, "locked": False}]}}
    (session / "session.json").write_text(json.dumps(run))
    again = calibrate(folder, step="spring").fits["S01"].entry("torque_gain")
    assert again.status != "ok" or again.value == pytest.approx(gain.value / 2.0, rel=0.02)
    (session / "session.json").write_text('{"protocol": {"loads": [5]}}')
    with pytest.raises(DataError, match="its loads cannot be read"):
        calibrate(folder, step="spring")


@pytest.mark.parametrize(("step", "missing"), [("zero", "straight"), ("leg", "weighted")])
def test_what_is_missing_is_told_for_everybody_at_once(hinge_study, step, missing):
    with pytest.raises(StudyError, match=missing) as caught:
        calibrate(hinge_study, step=step)
    assert {problem[:3] for problem in caught.value.problems} == {"S01", "S02"}


def test_a_missing_channel_and_an_unknown_step_are_told(tmp_path):
    columns = {name: CHANNELS[name] for name in ("time", "angle")}
    folder = write_study(tmp_path / "a", {("S01", "swing"): swung(0)}, columns=columns)
    with pytest.raises(StudyError, match="motor_angle"):
        calibrate(folder, step="hinge")
    columns = {name: CHANNELS[name] for name in ("time", "angle", "motor_angle", "current")}
    records = {("S01", "spring"): still(0)}
    folder = write_study(tmp_path / "b", records, model="", columns=columns)
    with pytest.raises(StudyError, match="torque_model"):
        calibrate(folder, step="spring", protocol="calibration-spring")
    with pytest.raises(StudyError, match="no pulses"):
        calibrate(
            write_study(tmp_path / "c", {("S01", "pulses"): still(0)}, columns=columns),
            step="frame",
        )
    with pytest.raises(DataError, match="knee"):
        calibrate(folder, step="knee")


def test_what_the_study_knows_already_is_used(tmp_path):
    """A torque twice as large as it is said to be shows half the angle per N*m."""
    rng = np.random.default_rng(0)
    time = np.arange(int(40 * RATE_HZ)) / RATE_HZ
    current = 15.0 / 0.9 * np.sin(2 * np.pi * 0.1 * time)
    shown = 6e-4 * 0.9 * current + 1e-4 * rng.standard_normal(time.size)
    records = {("S01", "locked"): table(time, shown, 0.0 * time, current)}
    found = []
    for k, gain in enumerate((1.0, 2.0)):
        told = f"[calibration]\ntorque_gain = {{ value = {gain}, sd = 0.0 }}\n"
        folder = write_study(tmp_path / str(k), records, calibration=told)
        found.append(calibrate(folder, step="torsion").fits["S01"].entry("angle_per_torque"))
    assert abs(found[0].value - 6e-4) < 4.0 * found[0].sd
    assert found[1].value == pytest.approx(2.0 * found[0].value, rel=1e-6)


def test_only_what_was_asked_for_is_written_and_a_worse_value_is_told(hinge_study, tmp_path):
    out = tmp_path / "c.toml"
    out.write_text(
        '[[participants]]\nid = "S01"\ncalibration = { angle_gain = { value = 1.02, sd = 1e-9 } }\n'
    )
    found = calibrate(hinge_study, step="hinge", entries=["angle_gain"], out=out)

    assert read_calibration(out).of("S02").model_fields_set == {"angle_gain"}
    (note,) = found.notes
    assert "S01's angle_gain" in note
    with pytest.raises(DataError, match="angle_gian"):
        calibrate(hinge_study, step="hinge", entries=["angle_gian"])


def switched(seed):
    """A switch under the heel, in volts, for 60 s of walking."""
    rng = np.random.default_rng(seed)
    time = np.arange(int(60 * RATE_HZ)) / RATE_HZ
    strikes = np.cumsum(1.1 + 0.02 * rng.standard_normal(60))
    since = time - strikes[np.searchsorted(strikes, time, side="right").clip(1) - 1]
    volts = 0.3 + 2.2 * ((since >= 0.0) & (since < 0.68)) + 0.03 * rng.standard_normal(time.size)
    return still(0).reindex(range(time.size)).assign(time=time, angle=0.0, contact=volts)


def test_levels_of_a_switch_are_written_together(tmp_path):
    columns = {"time": "s", "angle": "deg", "contact": "V"}
    folder = write_study(tmp_path / "a", {("S01", "walking"): switched(4)}, columns=columns)
    out = tmp_path / "c.toml"
    calibrate(folder, step="footswitch", entries=["contact_release_v"], out=out)
    without_volts = write_study(
        tmp_path / "b", {("S01", "walking"): switched(4)}, columns={**columns, "contact": "1"}
    )
    with pytest.raises(StudyError, match='kind = "voltage"'):
        calibrate(without_volts, step="footswitch")
    low, high = read_calibration(out).of("S01").contact_levels_v
    assert 0.5 < low < high < 2.3


@pytest.mark.slow
@pytest.mark.parametrize("step", ["zero", "footswitch", "hinge", "torsion", "spring", "leg"])
def test_the_simulated_rig_gives_back_what_was_planted(step, tmp_path):
    folder = tmp_path / step
    run(f"calibration-{step}", out=folder, participants=2, seed=21)
    planted = json.loads((folder / "ground_truth.json").read_text())["participants"]

    found = calibrate(folder, step=step, out=tmp_path / "c.toml")

    assert read_calibration(tmp_path / "c.toml").participants.keys() == found.fits.keys()
    for person, fit in found.fits.items():
        for entry in fit.entries:
            if entry.name in planted[person]["entries"]:
                true = planted[person]["entries"][entry.name]
                # Of a dozen errors none is beyond 4 sd in 999 of 1000.
                assert entry.available
                assert abs(entry.value - true) < 4.0 * entry.sd
        contact = planted[person]["contact"]
        if step == "footswitch":
            low, high = fit.specification().contact_levels_v
            assert contact["open_level_v"] + 0.2 < low < high < contact["contact_level_v"] - 0.2
