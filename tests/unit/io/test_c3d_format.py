"""C3D files of another writer, ezc3d; and C3D is not written."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.unit.io.same_content import is_same_group

from jointz.core.acquisition import Acquisition, Signal, SignalGroup
from jointz.core.errors import DataError
from jointz.io.formats.registry import read_acquisition, write_acquisition
from jointz.io.text.column_names import distinct_names, unique_names

from .c3d_files import theirs


def read(file: Any, tmp_path: Path) -> Acquisition:
    file.write(str(tmp_path / "theirs.c3d"))
    return read_acquisition(tmp_path / "theirs.c3d")


def test_points_channels_and_rotations_are_read(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    seen = rng.normal(size=(2, 3, 5)).astype(np.float32).astype(float)
    sent = rng.normal(size=(1, 15)).astype(np.float32).astype(float)
    turned = rng.normal(size=(4, 4, 1, 10)).astype(np.float32).astype(float)
    other = theirs(dict(zip("AB", seen, strict=True)), sent, ["c"])
    other.add_parameter("ROTATION", "LABELS", ["thigh"])
    other.add_parameter("ROTATION", "USED", [1])
    other.add_parameter("ROTATION", "DATA_START", [0])
    other["parameters"]["ROTATION"]["DATA_START"]["type"] = 2  # which its door makes a float
    other["parameters"]["ROTATION"]["DATA_START"]["value"] = np.array([0])
    other["data"]["rotations"] = turned
    found = {group.name: group for group in read(other, tmp_path).groups}
    cells = np.stack([s.values for s in found["points"].signals]).reshape(2, 3, 5)
    assert np.array_equal(cells, seen)
    assert np.array_equal(found["analogs"].signals[0].values, sent[0])
    matrix = {s.name: s.values for s in found["rotations"].signals}
    assert np.array_equal(matrix["thigh.r12"], turned[0, 1, 0])
    assert [g.rate_hz for g in found.values()] == [100.0, 300.0, 200.0]


def test_a_label_that_stands_twice_has_the_unit_of_its_kind_twice(tmp_path: Path) -> None:
    labels = ["LKNE", "KneeAngles", "KneeAnglez"]
    file = theirs({label: np.zeros((3, 2)) for label in labels}, np.zeros((0, 2)), [])
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file.add_parameter("POINT", "ANGLES", labels[1:])
    file.add_parameter("POINT", "ANGLE_UNITS", ["deg"])
    read(file, tmp_path)
    path = tmp_path / "theirs.c3d"
    path.write_bytes(path.read_bytes().replace(b"KneeAnglez", b"KneeAngles"))
    signals = read_acquisition(path).groups[0].signals[::3]
    names = ("LKNE.x", "KneeAngles.x", "KneeAngles#2.x")
    assert [(s.name, s.unit) for s in signals] == [*zip(names, ("mm", "deg", "deg"), strict=True)]


def test_labels_go_on_in_further_lists_and_scales_must(tmp_path: Path) -> None:
    names = [f"ch{i}" for i in range(600)]
    found = read(theirs({"p": np.zeros((3, 2))}, np.ones((600, 2)), names), tmp_path)
    assert [s.name for s in found.groups[1].signals] == names
    path = tmp_path / "theirs.c3d"
    path.write_bytes(path.read_bytes().replace(b"SCALE2", b"SCALE9"))
    with pytest.raises(DataError, match="ANALOG:SCALE holds 255 scales for 600 channels"):
        read_acquisition(path)


def test_a_header_that_counts_channels_for_values_is_told_by_the_length(tmp_path: Path) -> None:
    sent = np.arange(4000.0)[np.newaxis]
    whole = read(theirs({"p": np.zeros((3, 1000))}, sent, ["a"]), tmp_path)
    path = tmp_path / "theirs.c3d"
    raw = path.read_bytes()
    path.write_bytes(raw[:4] + b"\1\0" + raw[6:])
    found = read_acquisition(path)
    assert found.metadata["reading.layout"].startswith("The header counts 1 analog values, not 4")
    assert is_same_group(found.groups[1], whole.groups[1])
    assert np.array_equal(found.groups[1].signals[0].values, sent[0])


def test_many_channels_of_one_name_take_no_long_time() -> None:
    names = distinct_names(["Fx"] * 60_000, 60_000, "analog")
    assert (names[1], names[-1]) == ("Fx#2", "Fx#60000")
    assert unique_names(["a"] * 60_000)[-1] == "a_60000"


READ_ONLY = (".c3d", ".mat", ".mot", ".parquet", ".sto", ".xdf", ".xlsx")


@pytest.mark.parametrize("suffix", READ_ONLY)
def test_what_is_only_read_is_not_written(suffix: str, tmp_path: Path, jointz) -> None:
    group = SignalGroup("analogs", (Signal("x", np.zeros(2)),), 10.0)
    path = tmp_path / f"a{suffix}"
    with pytest.raises(DataError, match=rf"a\{suffix}: .* read only.*\.txt or \.nc .*bids"):
        write_acquisition(Acquisition((group,)), path, lossy=True)
    (tmp_path / "a.csv").write_text("time,x\n0,1\n1,2\n")
    refused = jointz("convert", tmp_path / "a.csv", path, "--lossy")
    assert (refused.code, f"a{suffix}" in refused.err) == (2, True)
    assert [file.name for file in tmp_path.iterdir()] == ["a.csv"]
