"""Channels of a recording with clocks of their own, and heel strikes as times."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

import jointz
from jointz.core.errors import DataError, StudyError

from .c3d_files import theirs

HEAD = """jointz = 1
joint = "knee"
kind = "walking"
positive = "flexion"
[perturbations]
first_sample = 1
[[participants]]
id = "S01"
"""
RECORDING = """[[recordings]]
participant = "S01"
condition = "unperturbed"
file = "{file}"
{more}
"""
STRIKES_S = np.arange(0.55, 19.0, 1.1)


def knee(time_s):
    """An angle with harmonics up to 8 Hz, deg; it flexes most at 72 % of a stride of 1.1 s."""
    phase = 2.0 * np.pi * ((time_s - STRIKES_S[0]) / 1.1 - 0.72)
    return 25.0 * np.cos(phase) + 3.0 * np.cos(9.0 * phase)


def daq_time():
    return np.arange(0.0, 20.0, 1e-3)


def mocap_time(rate_hz=240.0):
    return 0.1 + np.arange(0.0, 19.5, 1.0 / rate_hz)


def write_study(folder: Path, channels: str, file: str, more: str = "") -> Path:
    (folder / "study.toml").write_text(HEAD + channels + RECORDING.format(file=file, more=more))
    return folder


def read(folder: Path):
    (recording,) = jointz.open_study(folder).recordings[0].read()
    return recording


def write_mat(folder: Path, *, rate_hz=240.0, strikes=STRIKES_S, mocap_s=None) -> Path:
    mocap_s = mocap_time(rate_hz) if mocap_s is None else mocap_s
    mocap = {"time": mocap_s, "knee": knee(mocap_s)}
    daq = {"time": daq_time(), "torque": np.sin(daq_time())}
    savemat(folder / "S01.mat", {"mocap": mocap, "daq": daq, "strikes": strikes})
    return folder


MAT = """[channels.time]
column = "daq.time"
[channels.torque]
column = "daq.torque"
[channels.angle]
column = "mocap.knee"
unit = "deg"
{time}
[channels.heel_strikes]
column = "strikes"
unit = "{unit}"
"""
CLOCKS = {
    "stamps": 'time = { column = "mocap.time", unit = "s" }',
    "rate": "time = { rate_hz = 240, start_s = 0.1 }",
    "known by the file": "",
}


class TestClocks:
    @pytest.mark.parametrize("clock", CLOCKS)
    def test_the_angle_is_brought_to_the_clock_of_the_torque(self, tmp_path, clock):
        write_mat(tmp_path)
        recording = read(write_study(tmp_path, MAT.format(time=CLOCKS[clock], unit="s"), "S01.mat"))
        angle, time = recording["angle"].to_numpy(), recording["time"].to_numpy()
        np.testing.assert_array_equal(recording["torque"], np.sin(daq_time()))
        inside = (time >= 0.1) & (time <= mocap_time()[-1])
        assert np.isnan(angle[~inside]).all()
        np.testing.assert_allclose(angle[inside], np.deg2rad(knee(time[inside])), atol=1e-5)

    def test_printed_stamps_are_even_and_holes_stay(self, tmp_path):
        stamps = np.round(mocap_time(), 3)
        stamps = stamps[(stamps < 5.0) | (stamps > 5.2)]
        write_mat(tmp_path, mocap_s=stamps)
        recording = read(
            write_study(tmp_path, MAT.format(time=CLOCKS["stamps"], unit="s"), "S01.mat")
        )
        angle, time = recording["angle"].to_numpy(), recording["time"].to_numpy()
        assert np.isnan(angle[(time > 5.0) & (time < 5.2)]).all()
        assert np.isfinite(angle[(time > 0.2) & (time < 4.99)]).all()

    def test_torque_and_angle_may_come_from_other_files(self, tmp_path):
        time, mocap_s = daq_time(), mocap_time()
        for name, columns in (("daq", (time, np.sin(time))), ("mocap", (mocap_s, knee(mocap_s)))):
            head = "time,value"
            np.savetxt(
                tmp_path / f"{name}.csv", np.c_[columns], header=head, comments="", delimiter=","
            )
        angle = 'angle = {{ column = "value", unit = "deg" }}'
        torque = 'torque = {{ column = "value", unit = "N*m" }}'
        join = (
            "[[recordings.joined]]\nfile = '{}.csv'\noffset_s = 0\n"
            'channels.time = {{ column = "time", unit = "s" }}\nchannels.'
        )
        recordings = []
        for main, own, other, joined in (
            ("daq", torque, "mocap", angle),
            ("mocap", angle, "daq", torque),
        ):
            channels = f'[channels]\ntime = {{ column = "time" }}\n{own.format()}\n'
            more = join.format(other) + joined.format()
            recordings.append(read(write_study(tmp_path, channels, f"{main}.csv", more)))
        for recording in recordings:
            assert recording.sizes["time"] == time.size
        np.testing.assert_array_equal(recordings[0]["angle"], recordings[1]["angle"])

    def test_a_clock_is_stated_by_stamps_or_a_rate(self, tmp_path):
        write_mat(tmp_path)
        for clock in ('time = { unit = "s" }', 'time = { column = "mocap.time", rate_hz = 240 }'):
            study = write_study(tmp_path, MAT.format(time=clock, unit="s"), "S01.mat")
            with pytest.raises(StudyError, match="either column, with time stamps, or rate_hz"):
                jointz.open_study(study)

    def test_clocks_that_do_not_overlap_are_refused(self, tmp_path):
        write_mat(tmp_path)
        clock = 'time = { column = "mocap.time", unit = "min" }'
        study = write_study(tmp_path, MAT.format(time=clock, unit="s"), "S01.mat")
        (tmp_path / "S01.mat").unlink()
        write_mat(tmp_path, mocap_s=mocap_time() + 100.0)
        with pytest.raises(DataError, match="do not overlap"):
            read(study)

    @pytest.mark.parametrize("time", ["", MAT[: MAT.index("[channels.torque]")]])
    def test_a_rate_of_the_study_is_not_that_of_other_clocks_in_a_file(self, tmp_path, time):
        write_mat(tmp_path)
        channels = MAT.format(time="", unit="s")
        channels = time + channels[channels.index("[channels.torque]") :]
        study = write_study(tmp_path, channels, "S01.mat")
        text = (study / "study.toml").read_text()
        (study / "study.toml").write_text(text.replace("[pert", "sample_rate_hz = 1000\n[pert", 1))
        recording = read(study)
        angle, at = recording["angle"].to_numpy(), recording["time"].to_numpy()
        inside = (at >= 0.1) & (at <= mocap_time()[-1])
        np.testing.assert_allclose(angle[inside], np.deg2rad(knee(at[inside])), atol=1e-5)

    def test_a_rate_that_contradicts_the_clock_of_the_file_is_refused(self, tmp_path):
        points = np.stack([knee(np.arange(0.0, 20.0, 0.01))] * 3)
        file = theirs({"Knee": points}, np.sin(daq_time())[np.newaxis], ["torque"])
        file.write(str(tmp_path / "S01.c3d"))
        channels = (
            '[channels]\ntorque = { column = "torque", unit = "N*m" }\n'
            'angle = { column = "Knee.x", unit = "deg", time = { rate_hz = 240 } }\n'
        )
        with pytest.raises(DataError, match="by its own clock it runs at 100 Hz"):
            read(write_study(tmp_path, channels, "S01.c3d"))

    @pytest.mark.parametrize("clock", [CLOCKS["stamps"], CLOCKS["known by the file"]])
    def test_stamps_in_another_unit_are_refused(self, tmp_path, clock):
        mocap_s, daq_s = np.arange(0.0, 19.5, 1.0 / 240.0), daq_time()
        mocap = {"time": 1e3 * mocap_s, "knee": knee(mocap_s)}
        content = {"mocap": mocap, "daq": {"time": daq_s, "torque": daq_s}, "strikes": STRIKES_S}
        savemat(tmp_path / "S01.mat", content)
        study = write_study(tmp_path, MAT.format(time=clock, unit="s"), "S01.mat")
        with pytest.raises(DataError, match=r"sampled at 0\.24 Hz"):
            read(study)

    @pytest.mark.parametrize("clock", [CLOCKS["stamps"], CLOCKS["known by the file"]])
    def test_stamps_of_another_number_are_refused(self, tmp_path, clock):
        mocap = {"time": mocap_time()[:-3], "knee": knee(mocap_time())}
        daq = {"time": daq_time(), "torque": np.sin(daq_time())}
        savemat(tmp_path / "S01.mat", {"mocap": mocap, "daq": daq, "strikes": STRIKES_S})
        study = write_study(tmp_path, MAT.format(time=clock, unit="s"), "S01.mat")
        with pytest.raises(DataError, match="one time stamp for each sample"):
            read(study)

    def test_labels_without_a_clock_are_refused(self, tmp_path):
        mocap = {"time": mocap_time(), "knee": knee(mocap_time())}
        daq = {"time": daq_time(), "torque": np.sin(daq_time())}
        labels = np.array(["a"] * 20_000, dtype=object)
        content = {"mocap": mocap, "daq": daq, "trial": labels, "strikes": STRIKES_S}
        savemat(tmp_path / "S01.mat", content)
        channels = MAT.format(time="", unit="s") + '[channels.trial]\ncolumn = "trial"\n'
        with pytest.raises(DataError, match="trial: expected one time stamp"):
            read(write_study(tmp_path, channels, "S01.mat"))

    def test_columns_of_a_slower_clock_may_be_padded(self, tmp_path):
        rows = np.full((daq_time().size, 4), np.nan)
        rows[:, :2] = np.c_[daq_time(), np.sin(daq_time())]
        rows[: mocap_time().size, 2:] = np.c_[mocap_time(), knee(mocap_time())]
        lines = [",".join("" if np.isnan(v) else repr(float(v)) for v in row) for row in rows]
        (tmp_path / "S01.csv").write_text("\n".join(["t,tau,t_mocap,knee", *lines]) + "\n")
        channels = (
            '[channels]\ntime = { column = "t" }\ntorque = { column = "tau" }\n'
            'angle = { column = "knee", unit = "deg", time = { column = "t_mocap" } }\n'
        )
        recording = read(write_study(tmp_path, channels, "S01.csv"))
        angle, at = recording["angle"].to_numpy(), recording["time"].to_numpy()
        inside = (at >= 0.1) & (at <= mocap_time()[-1])
        np.testing.assert_allclose(angle[inside], np.deg2rad(knee(at[inside])), atol=1e-5)


class TestHeelStrikes:
    def test_times_are_not_scaled(self, tmp_path):
        write_mat(tmp_path)
        for key in ("scale = 1000", "invert = true"):
            channels = MAT.format(time="", unit="s") + f"{key}\n"
            study = write_study(tmp_path, channels, "S01.mat")
            with pytest.raises(StudyError, match="times have no scale and no sign"):
                jointz.open_study(study)

    @pytest.mark.parametrize(
        ("unit", "factor", "first"), [("s", 1.0, 0.0), ("ms", 1e3, 0.0), ("sample", 1e3, 1.0)]
    )
    def test_times_in_a_unit_and_padded(self, tmp_path, unit, factor, first):
        listed = np.append(factor * STRIKES_S + first, np.nan)
        write_mat(tmp_path, strikes=listed)
        recording = read(write_study(tmp_path, MAT.format(time="", unit=unit), "S01.mat"))
        at = np.flatnonzero(np.diff(recording["heel_strikes"])) + 1
        np.testing.assert_allclose(recording["time"][at], STRIKES_S, atol=1.1e-3)

    def test_a_file_of_its_own(self, tmp_path):
        write_mat(tmp_path)
        np.savetxt(tmp_path / "strikes.csv", STRIKES_S, header="heel_strike_s", comments="")
        channels = MAT.format(time="", unit="s").partition("[channels.heel_strikes]")[0]
        more = 'heel_strikes = "strikes.csv"'
        recording = read(write_study(tmp_path, channels, "S01.mat", more))
        assert recording["heel_strikes"][-1] == STRIKES_S.size

    def test_strikes_beside_the_recording_are_refused(self, tmp_path):
        write_mat(tmp_path, strikes=1e3 * STRIKES_S)
        study = write_study(tmp_path, MAT.format(time="", unit="s"), "S01.mat")
        with pytest.raises(DataError, match=r"found from 550 to .* Correct their unit"):
            read(study)

    def test_a_unit_that_the_file_contradicts_is_refused(self, tmp_path):
        write_mat(tmp_path)
        np.savetxt(tmp_path / "strikes.csv", STRIKES_S, header="heel_strike_s", comments="")
        more = 'heel_strikes = "strikes.csv"'
        channels = MAT.format(time="", unit="ms").replace('"strikes"', '"heel_strike_s"')
        with pytest.raises(DataError, match=r"says 's', its name or study\.toml says 'ms'"):
            read(write_study(tmp_path, channels, "S01.mat", more))
