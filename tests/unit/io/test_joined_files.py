"""A file of another device with its own clock, joined to a recording of a study."""

from pathlib import Path

import numpy as np
import pytest

import jointz
from jointz.core.errors import DataError, StudyError

STUDY = """jointz = 1
joint = "knee"
kind = "bench"
positive = "flexion"
torque_acts_on = "joint"
channels.time = { column = "time", unit = "s" }
channels.angle = { column = "angle", unit = "rad" }
channels.torque = { column = "torque", unit = "N*m" }
channels.command = { column = "command", unit = "N*m" }

[[participants]]
id = "S01"

[[recordings]]
participant = "S01"
condition = "perturbed"
file = "bench.csv"

[[recordings.joined]]
file = "inertial.csv"
%s

[recordings.joined.channels]
time = { column = "ms", unit = "ms" }
shank_velocity = { column = "gyro", unit = "deg/s", positive = "extension" }
"""
AHEAD_S, RATE = 7.25, 1.0 + 40e-6  # recording = AHEAD_S + RATE * own


def shank(time_s):
    return np.sin(2.0 * time_s)


def written(folder: Path, when: str, *, hole=(None, None), text=STUDY) -> Path:
    time = np.arange(0.0, 20.0, 0.002)
    command = (time % 2.0 < 0.1).astype(float)
    rows = np.column_stack([time, 0.1 * np.sin(time), command, command])
    np.savetxt(
        folder / "bench.csv", rows, delimiter=",", header="time,angle,torque,command", comments=""
    )
    own = np.arange(-5.0, 10.0, 0.005)
    if hole[0] is not None:
        own = own[(own < hole[0]) | (own > hole[1])]
    gyro = -np.rad2deg(shank(AHEAD_S + RATE * own))
    table = np.column_stack([1e3 * own, gyro])
    np.savetxt(
        folder / "inertial.csv", table, fmt="%.9g", delimiter=",", header="ms,gyro", comments=""
    )
    (folder / "study.toml").write_text(text % when)
    return folder


def joined(folder: Path):
    (recording,) = jointz.open_study(folder).recordings[0].read()
    return recording["time"].to_numpy(), recording["shank_velocity"]


class TestClock:
    def test_two_events_give_offset_and_rate(self, tmp_path):
        events = [[AHEAD_S + RATE * own, own] for own in (-4.0, 9.0)]
        time, values = joined(written(tmp_path, f"events_s = {events}"))
        inside = (time > AHEAD_S - 5.0 + 0.01) & (time < AHEAD_S + 10.0 - 0.01)
        assert values.attrs["units"] == "rad/s"
        np.testing.assert_allclose(values[inside], shank(time[inside]), rtol=0, atol=2e-5)
        assert np.isnan(values[~inside][:-10]).mean() > 0.9

    @pytest.mark.parametrize(
        "when", [f"offset_s = {AHEAD_S}", f"events_s = [[{AHEAD_S + 1.0}, 1.0]]"]
    )
    def test_an_offset_or_one_event_leaves_the_rate_as_it_is(self, tmp_path, when):
        time, values = joined(written(tmp_path, when))
        inside = (time > 3.0) & (time < 17.0)
        np.testing.assert_allclose(values[inside], shank(time[inside]), rtol=0, atol=1e-3)

    def test_holes_stay_nan(self, tmp_path):
        time, values = joined(written(tmp_path, f"offset_s = {AHEAD_S}", hole=(1.0, 1.5)))
        inside = (time > AHEAD_S + 1.0) & (time < AHEAD_S + 1.5)
        assert np.isnan(values[inside]).all()
        around = ((time < AHEAD_S + 0.99) | (time > AHEAD_S + 1.51)) & (time > 3.0) & (time < 17.0)
        assert np.isfinite(values[around]).all()


class TestRefusals:
    @pytest.mark.parametrize(
        ("when", "told"),
        [
            ("", "either offset_s or events_s"),
            ("offset_s = 1.0\nevents_s = [[1.0, 2.0]]", "either offset_s or events_s"),
            ("events_s = [[1.0, 2.0], [3.0, 2.0]]", "different times"),
        ],
    )
    def test_the_clock_is_stated_once(self, tmp_path, when, told):
        with pytest.raises(StudyError, match=told):
            jointz.open_study(written(tmp_path, when))

    def test_a_missing_file_column_or_unit_is_told_on_opening(self, tmp_path):
        text = STUDY.replace('"gyro"', '"gyroscope"').replace('"deg/s"', '"deg/hour2"')
        folder = written(tmp_path, "offset_s = 1.0", text=text)
        with pytest.raises(StudyError) as caught:
            jointz.open_study(folder)
        assert "inertial.csv has no column 'gyroscope'" in str(caught.value)
        assert "joined[1].channels.shank_velocity.unit" in str(caught.value)
        (folder / "inertial.csv").unlink()
        with pytest.raises(StudyError, match=r"joined\[1\].file: file .* does not exist"):
            jointz.open_study(folder)

    def test_events_of_clocks_that_differ_by_per_cents_are_a_mistake(self, tmp_path):
        folder = written(tmp_path, "events_s = [[3.0, 1.0], [13.0, 10.0]]")
        with pytest.raises(DataError, match=r"runs \+11 % off"):
            joined(folder)

    @pytest.mark.parametrize(
        ("when", "told"),
        [
            ("events_s = [[3.0, 1.0], [8.1, 6.0], [13.0, 11.0]]", "do not fit together"),
            ("offset_s = 1e6", "do not overlap"),
        ],
    )
    def test_an_event_that_is_wrong_and_clocks_apart_are_mistakes(self, tmp_path, when, told):
        with pytest.raises(DataError, match=told):
            joined(written(tmp_path, when))

    def test_a_channel_that_is_there_twice_is_refused(self, tmp_path):
        text = STUDY.replace("shank_velocity", "angle").replace('"deg/s"', '"deg"')
        with pytest.raises(DataError, match=r"angle: .* has the channel too"):
            joined(written(tmp_path, "offset_s = 1.0", text=text))
