"""Two hundred damaged files a format: an error that names file and cause, or a sound reading."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.core.errors import DataError
from jointz.io.formats import read_acquisition, write_acquisition

KINDS = ["csv", "csv.gz", "sto", "parquet", "nc", "mat", "xlsx"]
N_FILES = 200
N_SAMPLES = 24


def content(kind: str) -> Acquisition:
    label = np.array(["stance", "swing"] * (N_SAMPLES // 2), dtype=object)
    signals = [
        Signal("knee_angle_r [deg]", np.linspace(-5.0, 60.0, N_SAMPLES) / 3.0, "deg"),
        Signal("torque [N*m]", np.cos(np.arange(N_SAMPLES)), "N*m"),
    ]
    if kind != "sto":
        signals.append(Signal("phase", label))
    group = SignalGroup("", tuple(signals), time_s=np.arange(N_SAMPLES) / 100.0)
    if kind.startswith("csv"):
        return Acquisition((group,))
    return Acquisition((group,), (Event(0.05, "heel strike"),), {"subject": "S01"})


def spoiled(data: bytes, rng: np.random.Generator) -> bytes:
    """Return the bytes cut off, with bytes changed, blocks of zeros, or a piece put in."""
    kind, at = rng.integers(4), int(rng.integers(len(data)))
    if kind == 0:
        return data[:at]
    if kind == 1:
        changed = bytearray(data)
        for k in rng.integers(len(data), size=int(rng.integers(1, 8))):
            changed[k] ^= 1 << int(rng.integers(8))
        return bytes(changed)
    if kind == 2:
        return data[:at] + bytes(min(64, len(data) - at)) + data[at + 64 :]
    piece = [b"\n", b"\r", b",", b'"', b"\t", b"\x00", b"1e999", b"\xff"][int(rng.integers(8))]
    return data[:at] + piece + data[at:]


@pytest.mark.parametrize("kind", KINDS)
def test_damage_ends_in_an_error_or_in_a_sound_reading(tmp_path: Path, kind: str) -> None:
    whole = tmp_path / f"whole.{kind}"
    write_acquisition(content(kind), whole)
    assert read_acquisition(whole).equals(content(kind))
    data, rng = whole.read_bytes(), np.random.default_rng(9)
    path = tmp_path / f"a.{kind}"
    messages = []
    for _ in range(N_FILES):
        path.write_bytes(spoiled(data, rng))
        messages += refusal_or_sound(path)

    assert len(messages) >= N_FILES // 4
    assert all(path.name in message for message in messages)
    assert min(map(len, messages)) > len(path.name) + 20  # a cause, and what to do


def refusal_or_sound(path: Path) -> list[str]:
    """Read a file; return the message of its refusal, or look at what was read."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            found = read_acquisition(path)
        except DataError as exc:
            return [str(exc)]
    for group in found.groups:
        assert {len(signal.values) for signal in group.signals} <= {group.n_samples}
    return []


@pytest.mark.parametrize("kind", KINDS)
def test_an_empty_file_is_refused(tmp_path: Path, kind: str) -> None:
    (tmp_path / f"a.{kind}").write_bytes(b"")

    with pytest.raises(DataError, match=rf"a\.{kind}"):
        read_acquisition(tmp_path / f"a.{kind}")


def test_a_netcdf_file_that_another_program_changed_is_read(tmp_path: Path) -> None:
    import h5py

    path = tmp_path / "a.nc"
    write_acquisition(content("nc"), path)
    with h5py.File(path, "r+") as file:
        file["g1"]["s2"][0] = 99.0

    (group,) = read_acquisition(path).groups

    assert group.signals[1].values[0] == 99.0
