"""MATLAB files of others: groups, clocks, and what is refused."""

import numpy as np
import pytest
import scipy.io

from jointz.core.errors import DataError
from jointz.io.formats.registry import read_acquisition


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
