"""The struct that jointz writes for MATLAB, and files of others."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.core.errors import DataError
from jointz.io.formats.matlab_format import LONGEST_NAME, field_names
from jointz.io.formats.registry import read_acquisition, write_acquisition


def content() -> Acquisition:
    angle = Signal("knee angle [deg]", np.array([1.5, np.nan, 3.25]), "deg", "left knee")
    phase = np.array(["stance", "", "swing"], dtype=object)
    return Acquisition(
        (
            SignalGroup("points", (angle, Signal("phase", phase)), 100.0, 2.0),
            SignalGroup("", (Signal("Fz", np.array([1.0, 2.0]), "N"),)),
        ),
        (Event(2.01, "heel strike"), Event(2.02, "pulse", 0.1)),
        {"subject.name": "S01", "positive": "flexion", "positive.Fz": "up"},
    )


def test_the_layout_is_the_one_described(tmp_path):
    write_acquisition(content(), tmp_path / "a.mat")

    found = scipy.io.loadmat(tmp_path / "a.mat", simplify_cells=True)["jointz"]

    points = found["groups"]["points"]
    assert (points["rate_hz"], points["start_s"], points["n"]) == (100.0, 2.0, 3)
    np.testing.assert_allclose(points["time"], [2.0, 2.01, 2.02])
    angle = points["signals"]["knee_angle__deg_"]
    assert (angle["name"], angle["unit"]) == ("knee angle [deg]", "deg")
    assert angle["positive"] == "flexion"
    np.testing.assert_array_equal(angle["values"], [1.5, np.nan, 3.25])
    assert found["groups"]["data"]["signals"]["Fz"]["positive"] == "up"
    assert list(found["events"]["label"]) == ["heel strike", "pulse"]
    np.testing.assert_array_equal(found["events"]["duration_s"], [0.0, 0.1])


def test_fields_are_names_that_matlab_takes_and_differ():
    odd = ["end", "a b", "a-b", "1st", "", "ü", "x" * 200, "x" * 199 + "y"]

    found = field_names(odd)

    assert len(set(found)) == len(odd)
    assert all(name.isidentifier() and name.isascii() for name in found)
    assert all(len(name) <= LONGEST_NAME and name[0].isalpha() for name in found)


def octave(tmp_path: Path, script: str) -> list[str]:
    """Run a script in GNU Octave, and return the lines that it prints."""
    program = shutil.which("octave-cli")
    if program is None:
        pytest.skip("GNU Octave is not installed: octave-cli stands in for MATLAB")
    (tmp_path / "look.m").write_text(script)
    command = [program, "--no-gui", "--norc", "--quiet", "look.m"]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.stdout, done.stderr  # Octave may complain while it exits
    return done.stdout.splitlines()


def test_octave_sees_the_same_numbers_and_words(tmp_path):
    write_acquisition(content(), tmp_path / "a.mat")

    lines = octave(
        tmp_path,
        """\
        s = load("a.mat"); j = s.jointz; p = j.groups.points;
        printf("%s %g %g %d\\n", p.name, p.rate_hz, p.start_s, p.n);
        printf("%.17g ", p.time); printf("\\n");
        a = p.signals.knee_angle__deg_;
        printf("%s|%s|%s|%s\\n", a.name, a.unit, a.positive, a.description);
        printf("%.17g ", a.values); printf("\\n");
        printf("[%s]", p.signals.phase.values{:}); printf("\\n");
        printf("%d %d %d\\n", size(a.values), isempty(j.groups.data.rate_hz));
        printf("%s=%s ", [j.metadata.key'; j.metadata.value']{:}); printf("\\n");
        printf("%g %g %s\\n", j.events.time_s(2), j.events.duration_s(2), j.events.label{2});
        """,
    )

    assert lines[0] == "points 100 2 3"
    assert [float(word) for word in lines[1].split()] == [2.0, 2.01, 2.02]
    assert lines[2] == "knee angle [deg]|deg|flexion|left knee"
    assert lines[3].split() == ["1.5", "NaN", "3.25"]
    assert lines[4] == "[stance][][swing]"
    assert lines[5] == "3 1 1"
    assert lines[6].split() == ["subject.name=S01", "positive=flexion", "positive.Fz=up"]
    assert lines[7] == "2.02 0.1 pulse"


def test_series_of_one_length_make_a_group(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"time_s": np.arange(4.0), "x": np.ones(4), "y": [1, 2]})

    content = read_acquisition(tmp_path / "a.mat")

    assert [(g.name, g.n_samples) for g in content.groups] == [("n4", 4), ("n2", 2)]
    np.testing.assert_array_equal(content.groups[0].time_s, np.arange(4.0))


def test_the_time_of_a_struct_is_its_clock(tmp_path):
    data = {"time": np.arange(4.0) / 100, "knee": {"angle": np.ones(4)}}
    scipy.io.savemat(tmp_path / "a.mat", {"data": data, "events": {"time": [0.01, 0.02]}})

    group, events = read_acquisition(tmp_path / "a.mat").groups

    np.testing.assert_array_equal(group.time_s, data["time"])
    assert group.time_column == "data.time"
    assert [signal.name for signal in group.signals] == ["data.knee.angle"]
    assert [signal.name for signal in events.signals] == ["events.time"]


def test_times_of_several_structs_are_no_clock_and_told(tmp_path):
    side = {"time": np.arange(4.0), "knee": np.ones(4)}
    scipy.io.savemat(tmp_path / "a.mat", {"left": side, "right": side})

    content = read_acquisition(tmp_path / "a.mat")

    assert content.groups[0].time_s is None
    assert "left.time, right.time" in content.metadata["reading.clock."]


def test_a_file_without_series_is_refused(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"note": "nothing here"})

    with pytest.raises(DataError, match=r"a\.mat: "):
        read_acquisition(tmp_path / "a.mat")
