"""Exports of the recorders that laboratories have: what they state is read."""

import numpy as np
import pytest
from scipy.io import savemat
from tests.unit.inspection.answers import answered

import jointz
from jointz.core.errors import DataError
from jointz.inspection.inspect_file import inspect_file
from jointz.io.study_reader import open_study

N, RATE_HZ = 400, 1000.0
TIME_S = np.arange(N) / RATE_HZ
ANGLE = np.round(10.0 + 5.0 * np.sin(2.0 * np.pi * 3.0 * TIME_S), 5)
TORQUE = np.round(3.0 * np.cos(2.0 * np.pi * 3.0 * TIME_S), 5)


def rows(*columns, delimiter="\t", decimal=".", end=""):
    lines = zip(*columns, strict=True)
    return [
        delimiter.join(f"{value:.5f}".replace(".", decimal) for value in line) + end
        for line in lines
    ]


def labview(decimal=".", *, delta_x="0.001", x=TIME_S, restarts=False):
    """Two segments, each below its header."""
    text = ["LabVIEW Measurement\t", "Separator\tTab", f"Decimal_Separator\t{decimal}"]
    text += ["X_Columns\tOne", "Date\t2026/01/02", "***End_of_Header***\t", "\t"]
    for part in (slice(0, N // 2), slice(N // 2, N)):
        step = delta_x.replace(".", decimal)
        text += ["Channels\t2\t", "Y_Unit_Label\tdeg\tlbf*in\t", "X0\t0\t0\t"]
        text += [f"Delta_X\t{step}\t{step}\t", "***End_of_Header***\t\t"]
        text += ["X_Value\tKnee\tTorque\tComment"]
        own = x[part] - (x[part][0] if restarts else 0.0)
        text += rows(own, ANGLE[part], TORQUE[part], decimal=decimal, end="\t")
        text += [""]
    return text


def labchart(decimal=".", unit_names=True):
    text = [f"Interval=\t0{decimal}001 s", "ExcelDateTime=\t4.6E4\t02.01.2026"]
    text += ["ChannelTitle=\tKnee\tTorque", "Range=\t10 deg\t10 lbf*in"]
    text += ["UnitName=\tdeg\tlbf*in"] if unit_names else []
    lines = rows(TIME_S, ANGLE, TORQUE, decimal=decimal)
    return [*text, lines[0] + "\t#* start, on", *lines[1:9], lines[9] + "\t#* pulse", *lines[10:]]


def spike2():
    text = ['"INFORMATION"', '"a.smr"', '""', '"SUMMARY"']
    signals = {"Knee": ("deg", ANGLE), "Torque": ("lbf*in", TORQUE)}
    for k, (name, (unit, _)) in enumerate(signals.items(), start=1):
        text += [f'"{k}"\t"Waveform"\t"{name}"\t"{unit}"\t1000\t{RATE_HZ}\t1\t0']
    text += ['"31"\t"Marker"\t"Keyboard"', ""]
    for k, (name, (unit, values)) in enumerate(signals.items(), start=1):
        text += [f'"CHANNEL"\t"{k}"', '"Waveform"', '"No comment"', f'"{name}"']
        # The interval is printed to few digits; the summary has the rate.
        text += [f'"{unit}"\t1000', '"START"\t0.00000\t0.0010', *rows(values), ""]
    return [*text, '"CHANNEL"\t"31"', '"Marker"', '"No comment"', '"Keyboard"', '0.123\t"A"']


def emgworks():
    names = "X[s],Knee [deg],X[s],Torque [lbf*in],X[s],EMG [V]"
    lines = rows(TIME_S, ANGLE, TIME_S, TORQUE, delimiter=",")
    slow = rows(TIME_S[:100] * 4.0, TORQUE[:100], delimiter=",") + [","] * (N - 100)
    return [names, *(f"{a},{b}" for a, b in zip(lines, slow, strict=True))]


def nexus():
    text = ["Devices", "1000", ",,Load cell,", "Frame,Sub Frame,Torque", ",,lbf*in"]
    text += [f"{k // 10 + 1},{k % 10},{TORQUE[k]}" for k in range(N)]
    text += ["", "Model Outputs", "100", ",,S01:LKneeAngles,,", "Frame,Sub Frame,X,Y,Z"]
    text += [",,deg,deg,deg"]
    return text + [f"{k + 1},0,{ANGLE[10 * k]},0,0" for k in range(N // 10)]


NEXUS_STUDY = """jointz = 1
joint = "knee"
kind = "bench"
positive = "flexion"
sample_rate_hz = 1000.0
[channels.angle]
column = "S01:LKneeAngles.X"
[channels.torque]
column = "Load cell.Torque"
[[participants]]
id = "S01"
[[recordings]]
participant = "S01"
condition = "unperturbed"
file = "a.csv"
"""
ONE_CLOCK = {
    "a.lvm": labview(),
    "comma.lvm": labview(","),
    "a.txt": labchart(),
    "comma.txt": labchart(","),
    "range.txt": labchart(unit_names=False),
    "spike2.txt": spike2(),
}


def write(path, lines):
    path.write_text("\n".join(lines) + "\n", encoding="cp1252")
    return path


@pytest.mark.parametrize("name", ONE_CLOCK)
class TestOneClock:
    def test_names_units_and_rate_are_read(self, tmp_path, name):
        recording = jointz.read(write(tmp_path / name, ONE_CLOCK[name]))
        assert {n: s.attrs["units"] for n, s in recording.items()} == {
            "Knee": "deg",
            "Torque": "lbf*in",
        }
        np.testing.assert_allclose(recording["Torque"], TORQUE)
        np.testing.assert_allclose(recording["time"], TIME_S, atol=1e-9)

    def test_the_proposed_study_reads_it(self, tmp_path, name):
        inspection = inspect_file(write(tmp_path / name, ONE_CLOCK[name]))
        seen = {c.channel: c for c in inspection.channels}
        assert seen["angle"].unit_is == seen["torque"].unit_is == "stated"
        assert inspection.clocks[0].rate_hz == pytest.approx(RATE_HZ)
        assert not inspection.obstacles
        (tmp_path / "study.toml").write_text(answered(inspection.toml))
        ((recording,),) = [r.read() for r in open_study(tmp_path).recordings]
        assert recording["torque"].max() == pytest.approx(3.0 * 0.112985, rel=1e-4)
        assert recording.sizes["time"] == N


class TestLabview:
    def test_segments_that_begin_again_are_apart(self, tmp_path):
        path = write(tmp_path / "a.lvm", labview(restarts=True))
        assert len(inspect_file(path).clocks) == 1  # the same stamps twice
        names = set(jointz.read(path).data_vars)
        assert names == {"Knee", "Torque", "Knee_2", "Torque_2"}

    def test_default_of_one_second_is_no_rate(self, tmp_path):
        path = write(tmp_path / "a.lvm", labview(delta_x="1.0", x=np.arange(float(N))))
        assert "time" not in jointz.read(path).coords
        assert inspect_file(path).clocks[0].rate_hz is None

    def test_a_stated_layout_is_followed(self, tmp_path):
        path = write(tmp_path / "a.lvm", [*labview()[:13], *rows(TIME_S, ANGLE, TORQUE, end="\t")])
        files = {"skip_rows": 12, "delimiter": "\t"}
        assert list(jointz.read(path, files=files, angle="Knee:deg")) == ["angle"]


class TestSeveralClocks:
    def test_nexus_blocks_are_groups(self, tmp_path):
        path = write(tmp_path / "a.csv", nexus())
        torque = jointz.read(path, group="Devices")["Load cell.Torque"]
        angle = jointz.read(path, group="Model Outputs")["S01:LKneeAngles.X"]
        assert (torque.attrs["units"], angle.attrs["units"]) == ("lbf*in", "deg")
        np.testing.assert_allclose(torque, TORQUE)
        np.testing.assert_allclose(angle["time"], TIME_S[::10])
        assert [c.rate_hz for c in inspect_file(path).clocks] == [1000.0, 100.0]

    def test_a_study_joins_the_blocks_of_nexus(self, tmp_path):
        write(tmp_path / "a.csv", nexus())
        (tmp_path / "study.toml").write_text(NEXUS_STUDY)
        ((recording,),) = [r.read() for r in open_study(tmp_path).recordings]
        inside = slice(20, N - 20)
        angle = np.rad2deg(recording["angle"].to_numpy())
        np.testing.assert_allclose(angle[inside], ANGLE[inside], atol=0.05)
        assert recording["torque"].max() == pytest.approx(3.0 * 0.112985, rel=1e-4)

    def test_emgworks_channels_share_a_clock_where_they_may(self, tmp_path):
        path = write(tmp_path / "a.csv", emgworks())
        joint, emg = inspect_file(path).clocks
        assert (joint.rate_hz, joint.n) == (pytest.approx(1000.0), N)
        assert (emg.rate_hz, emg.n) == (pytest.approx(250.0), 100)
        read = jointz.read(path, angle="Knee [deg]", torque="Torque [lbf*in]")
        np.testing.assert_allclose(read["angle"], np.deg2rad(ANGLE))


class TestDamage:
    @pytest.mark.parametrize("name", ONE_CLOCK)
    def test_a_row_that_is_cut_off_is_refused(self, tmp_path, name):
        if name == "spike2.txt":
            pytest.skip("one number a row")
        lines = [line for line in ONE_CLOCK[name] if line]
        with pytest.raises(DataError, match="cut off"):
            jointz.read(write(tmp_path / name, [*lines[:-1], lines[-1].split("\t")[0]]))

    @pytest.mark.parametrize("text", ["LabVIEW Measurement", "Interval=\t1", "X[s],a"])
    def test_a_header_alone_is_refused(self, tmp_path, text):
        with pytest.raises(DataError):
            jointz.read(write(tmp_path / "a.txt", [text]))


class TestMatlab:
    def cells(self, *texts):
        return np.array(texts, dtype=object).reshape(1, -1)

    def test_cell_arrays_name_the_columns_of_a_matrix(self, tmp_path):
        path = tmp_path / "a.mat"
        names, units = self.cells("knee_angle", "knee_torque"), self.cells("deg", "lbf*in")
        data = np.column_stack([ANGLE, TORQUE])
        savemat(path, {"data": data, "names": names, "units": units, "fs": RATE_HZ})
        recording = jointz.read(path)
        assert recording["knee_torque"].attrs["units"] == "lbf*in"
        np.testing.assert_allclose(recording["time"], TIME_S)
        np.testing.assert_allclose(jointz.read(path, angle="data.1")["angle"], np.deg2rad(ANGLE))
        inspection = inspect_file(path)
        torque = inspection.channel("torque")
        assert (torque.column, torque.unit, torque.unit_is) == ("data.2", "lbf*in", "stated")
        assert "sample_rate_hz = 1000.0" in inspection.toml

    def test_a_column_called_time_is_the_clock(self, tmp_path):
        path = tmp_path / "a.mat"
        data = np.column_stack([TIME_S, ANGLE, TORQUE])
        struct = {"data": data, "labels": self.cells("time", "knee angle", "torque")}
        savemat(path, {"S": struct, "onsets": TIME_S[::50]})
        recording = jointz.read(path, group=f"n{N}")
        assert set(recording.data_vars) == {"knee angle", "torque"}
        np.testing.assert_allclose(recording["time"], TIME_S)

    @pytest.mark.parametrize(("key", "value"), [("SampleRate", 1000), ("dt", 0.001)])
    def test_a_number_beside_the_longest_series_is_their_rate(self, tmp_path, key, value):
        savemat(tmp_path / "a.mat", {"q": ANGLE, "onsets": TIME_S[::50], key: value})
        clocks = inspect_file(tmp_path / "a.mat").clocks
        assert [clock.rate_hz for clock in clocks] == [1000.0, None]
