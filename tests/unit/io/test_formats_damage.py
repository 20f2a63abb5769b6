"""Two hundred damaged files a format: an error that names file and cause, or a sound reading."""

import contextlib
from pathlib import Path

import numpy as np
import pytest
from tests.unit.io.foreign_files import write_file

from jointz.core.acquisition import Acquisition, Signal, SignalGroup
from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.formats.registry import list_columns, read_acquisition, read_table

KINDS = ["csv", "csv.gz", "sto", "parquet", "nc", "mat", "xlsx"]
#: What has no checksum: a digit that was changed is a digit, a byte of a number one too.
UNCHECKED = ("csv", "sto", "parquet")
N_FILES = 200
N_SAMPLES = 24


def groups(kind: str) -> tuple[SignalGroup, ...]:
    label = np.array(["stance", "swing"] * (N_SAMPLES // 2), dtype=object)
    angle, torque = np.linspace(-5.0, 60.0, N_SAMPLES) / 3.0, np.cos(np.arange(N_SAMPLES))
    signals = [
        Signal("knee_angle_r [deg]", angle, "deg"),
        Signal("torque [N*m]", torque, "N*m"),
        Signal("phase", label),
    ]
    if kind == "sto":
        signals = [Signal("knee_angle_r", angle, "deg"), Signal("torque", torque)]
    return (SignalGroup("", tuple(signals), time_s=np.arange(N_SAMPLES) / 100.0),)


def spoiled(data: bytes, rng: np.random.Generator) -> bytes:
    """Return other bytes: some changed, a block of zeros, or a piece put in."""
    found = data
    while found == data:  # zeros among zeros
        found = changed_once(data, rng)
    return found


def changed_once(data: bytes, rng: np.random.Generator) -> bytes:
    kind, at = rng.integers(3), int(rng.integers(len(data)))
    if kind == 0:
        changed = bytearray(data)
        for k in rng.integers(len(data), size=int(rng.integers(1, 8))):
            changed[k] ^= 1 << int(rng.integers(8))
        return bytes(changed)
    if kind == 1:
        return data[:at] + bytes(min(64, len(data) - at)) + data[at + 64 :]
    piece = [b"\n", b"\r", b",", b'"', b"\t", b"\x00", b"1e999", b"\xff"][int(rng.integers(8))]
    return data[:at] + piece + data[at:]


def table(found: Acquisition) -> list[list[str]]:
    """The samples of all groups, times first: rows of cells as texts."""
    rows = []
    for group in found.groups:
        times = group.times_s()
        columns = [] if times is None else [times.tolist()]
        columns += [signal.values.tolist() for signal in group.signals]
        rows += [[str(cell) for cell in row] for row in zip(*columns, strict=True)]
    return rows


def is_noted(found: Acquisition) -> bool:
    return any(key.startswith("reading.") for key in found.metadata)


@pytest.mark.parametrize("kind", KINDS)
def test_damage_ends_in_an_error_or_in_a_sound_reading(outcome, tmp_path: Path, kind: str) -> None:
    whole = tmp_path / f"whole.{kind}"
    write_file(whole, *groups(kind))
    data, rng = whole.read_bytes(), np.random.default_rng(9)
    path, messages = tmp_path / f"a.{kind}", []
    for _ in range(N_FILES * 3 // 4):
        path.write_bytes(spoiled(data, rng))
        found = outcome(path)
        with contextlib.suppress(DataError):
            list_columns(path, FilesSpec())
            read_table(path, numeric=["torque [N*m]"], files=FilesSpec())
        if isinstance(found, str):
            messages.append(found)
        elif kind not in UNCHECKED and not is_noted(found):
            assert table(found) == table(Acquisition(groups(kind)))

    assert len(messages) >= N_FILES // 5
    assert all(path.name in message for message in messages)
    assert min(map(len, messages)) > len(path.name) + 20  # a cause, and what to do


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_that_is_cut_off_is_refused_or_its_beginning(
    outcome, tmp_path: Path, kind: str
) -> None:
    whole = tmp_path / f"whole.{kind}"
    write_file(whole, *groups(kind))
    data, rng = whole.read_bytes(), np.random.default_rng(10)
    expected, path = table(Acquisition(groups(kind))), tmp_path / f"a.{kind}"
    for at in rng.integers(len(data), size=N_FILES // 4).tolist():
        path.write_bytes(data[:at])
        found = outcome(path)
        if isinstance(found, str) or is_noted(found):
            continue
        rows = table(found)
        whole_rows = rows if data[at - 1 : at] == b"\n" else rows[:-1]
        assert kind == "csv" or rows == expected  # only text has no length of its own
        assert whole_rows == expected[: len(whole_rows)]  # but for a last cell that is cut


@pytest.mark.parametrize("kind", KINDS)
def test_an_empty_file_is_refused(tmp_path: Path, kind: str) -> None:
    (tmp_path / f"a.{kind}").write_bytes(b"")

    with pytest.raises(DataError, match=rf"a\.{kind}"):
        read_acquisition(tmp_path / f"a.{kind}")


def test_a_netcdf_file_that_another_program_changed_is_read(tmp_path: Path) -> None:
    import h5py

    path = tmp_path / "a.nc"
    write_file(path, *groups("nc"))
    with h5py.File(path, "r+") as file:
        file["g1"]["s2"][0] = 99.0

    (group,) = read_acquisition(path).groups

    assert group.signals[1].values[0] == 99.0
