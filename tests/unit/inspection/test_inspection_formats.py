"""What jointz inspect proposes for a file of any format, a study reads as it stands."""

import shutil
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.io
import xarray as xr
from tests.unit.io.foreign_files import write_file

from jointz.core.acquisition import Signal, SignalGroup
from jointz.inspection.inspect_file import inspect_file
from jointz.io.formats.registry import BUILT_IN, read_acquisition
from jointz.io.recordings import read_recording
from jointz.io.study_reader import open_study

from .answers import answered

N, RATE_HZ = 400, 200.0
S = np.arange(N) / RATE_HZ
ANGLE_DEG = 30 * np.sin(2 * np.pi * S)
TORQUE = np.cos(2 * np.pi * S)


def group(name: str = "") -> SignalGroup:
    signals = (Signal("knee angle", ANGLE_DEG, "deg"), Signal("knee torque", TORQUE, "N*m"))
    return SignalGroup(name, signals, RATE_HZ)


def stamped(name: str = "") -> SignalGroup:
    return replace(group(name), rate_hz=None, time_s=S + 1e-5 * np.sin(np.arange(N)))


def apart(name: str) -> SignalGroup:
    """Other signals, sampled apart, some under the same name."""
    return SignalGroup(name, (Signal("knee angle raw", np.arange(50.0), "V"),), 50.0)


def assert_is_read(file: Path) -> xr.Dataset:
    """Inspect a file, and read it by the study that was proposed."""
    found = inspect_file(file)
    assert found.obstacles == ()
    (file.parent / "study.toml").write_text(answered(found.toml), encoding="utf-8")
    study = open_study(file.parent)
    (recording,) = read_recording(study, study.spec.recordings[0])
    np.testing.assert_allclose(recording["angle"], np.deg2rad(ANGLE_DEG), atol=1e-6)
    np.testing.assert_allclose(recording["torque"], TORQUE, atol=1e-6)
    np.testing.assert_allclose(np.diff(recording["time"]), 1 / RATE_HZ, atol=5e-5)
    return recording


def write(file: Path, group: SignalGroup) -> None:
    """Write a group; what jointz only reads, by other means."""
    others = {".c3d": write_c3d, ".xdf": write_xdf}
    if file.suffix in others:
        others[file.suffix](file, group)
    else:
        write_file(file, group)


def columns(group: SignalGroup) -> np.ndarray:
    return np.column_stack([s.values for s in group.signals])  # noqa: PD011 - of a signal


def write_c3d(file: Path, group: SignalGroup) -> None:
    ezc3d = pytest.importorskip("ezc3d", reason="the other writer is not installed")
    if group.rate_hz is None:
        pytest.skip("C3D has rates, no stamps")
    made = ezc3d.c3d()
    made["parameters"]["POINT"]["RATE"]["value"] = [group.rate_hz]
    made["header"]["points"]["first_frame"] = round(group.start_s * group.rate_hz)
    made["parameters"]["ANALOG"]["RATE"]["value"] = [group.rate_hz]
    made["parameters"]["ANALOG"]["LABELS"]["value"] = [s.name for s in group.signals]
    made["parameters"]["ANALOG"]["UNITS"]["value"] = [s.unit for s in group.signals]
    made["data"]["points"] = np.ones((4, 0, group.n_samples))
    made["data"]["analogs"] = columns(group).T[np.newaxis]
    made.write(str(file))


def write_xdf(file: Path, group: SignalGroup) -> None:
    def chunk(tag: int, body: bytes) -> bytes:
        return struct.pack("<BIH", 4, len(body) + 2, tag) + body

    channels = "".join(
        f"<channel><label>{s.name}</label><unit>{s.unit}</unit></channel>" for s in group.signals
    )
    header = (
        f"<info><name>{group.name}</name><channel_count>{len(group.signals)}</channel_count>"
        f"<nominal_srate>{group.rate_hz or 0}</nominal_srate><channel_format>double64"
        f"</channel_format><desc><channels>{channels}</channels></desc></info>"
    )
    rows = []
    for k, row in enumerate(np.column_stack([group.times_s(), columns(group)])):
        bare = group.rate_hz is not None and k > 0  # its stamp follows from the rate
        rows.append(b"\0" + struct.pack("<2d", *row[1:]) if bare else struct.pack("<B3d", 8, *row))
    one = struct.pack("<I", 1)
    samples = one + struct.pack("<BI", 4, len(rows)) + b"".join(rows)
    first = chunk(1, b"<info><version>1.0</version></info>")
    file.write_bytes(b"XDF:" + first + chunk(2, one + header.encode()) + chunk(3, samples))


@pytest.mark.parametrize("made", [group, stamped])
@pytest.mark.parametrize("suffix", sorted(BUILT_IN))
def test_a_file_of_every_format_is_read_as_it_was_proposed(tmp_path, suffix, made):
    file = tmp_path / f"S01{suffix}"
    write(file, made("data"))

    assert_is_read(file)


@pytest.mark.parametrize("suffix", [".nc", ".mat", ".xlsx"])
def test_one_of_several_groups_is_read_as_it_was_proposed(tmp_path, suffix):
    file = tmp_path / f"S01{suffix}"
    write_file(file, apart("slow"), stamped("fast"), apart("other"))

    assert_is_read(file)


@pytest.mark.parametrize("suffix", [".c3d", ".nc", ".xdf"])
def test_a_rate_that_does_not_start_at_0_keeps_its_start(tmp_path, suffix):
    file = tmp_path / f"S01{suffix}"
    write(file, replace(group("data"), start_s=5.0))

    found = inspect_file(file)

    (clock,) = found.clocks
    assert (clock.source, clock.rate_hz, clock.start_s) == ("rate", RATE_HZ, 5.0)
    assert clock.end_s == pytest.approx(5.0 + S[-1])
    assert "sample_rate_hz" not in found.toml
    assert float(assert_is_read(file)["time"][0]) == 5.0


WRITERS = {
    ".csv": lambda table, file: pd.DataFrame(table).to_csv(file, index=False),
    ".mat": lambda table, file: scipy.io.savemat(file, table),
    ".nc": lambda table, file: xr.Dataset({k: ("t", v) for k, v in table.items()}).to_netcdf(
        file, engine="h5netcdf"
    ),
    ".parquet": lambda table, file: pd.DataFrame(table).to_parquet(file),
    ".xlsx": lambda table, file: pd.DataFrame(table).to_excel(file, index=False),
}


@pytest.mark.parametrize("suffix", WRITERS)
def test_a_unit_of_time_that_no_file_states_is_told_by_the_stamps(tmp_path, suffix):
    file = tmp_path / f"S01{suffix}"
    WRITERS[suffix]({"time": 1e3 * S, "knee_angle_deg": ANGLE_DEG, "knee_torque": TORQUE}, file)

    found = inspect_file(file)

    time = found.channel("time")
    assert (time.column, time.unit, time.unit_is) == ("time", "ms", "guessed")
    assert found.clocks[0].rate_hz == pytest.approx(RATE_HZ)
    assert not any("taken for seconds" in note for note in found.notes)
    assert_is_read(file)


def test_foreign_netcdf_in_groups_and_matrices(tmp_path):
    file = tmp_path / "S01.nc"
    both = np.column_stack([np.deg2rad(ANGLE_DEG), 0 * S])
    xr.Dataset({"start": ("one", [3.0])}).to_netcdf(file, engine="h5netcdf")
    lab = xr.Dataset(
        {
            "time": ("t", S, {"units": "s"}),
            "knee_angle": (("t", "axis"), both, {"units": "rad"}),
            "knee_torque": ("t", TORQUE, {"units": "N*m"}),
        }
    )
    lab.to_netcdf(file, mode="a", group="lab/leg", engine="h5netcdf")

    assert_is_read(file)
    assert 'column = "lab/leg/knee_angle.1"' in inspect_file(file).toml


def test_a_matrix_with_samples_along_its_rows_is_left_out_not_taken_apart(tmp_path):
    file = tmp_path / "S01.mat"
    scipy.io.savemat(file, {"wide": np.zeros((3, 100_000)), "knee_angle": ANGLE_DEG})

    content = read_acquisition(file)

    assert [s.name for g in content.groups for s in g.signals] == ["knee_angle"]
    assert content.metadata["reading.left_out"] == "no series of samples: wide"
    assert any("wide" in note for note in inspect_file(file).notes)


def test_the_struct_of_a_study_that_an_earlier_version_wrote_is_read_as_it_was_proposed(tmp_path):
    earlier = Path(__file__).parents[1] / "io" / "earlier" / "two_people.mat"
    file = Path(shutil.copy(earlier, tmp_path))

    (tmp_path / "study.toml").write_text(answered(inspect_file(file).toml))

    study = open_study(tmp_path)
    (recording,) = read_recording(study, study.spec.recordings[0])
    np.testing.assert_array_equal(recording["time"], S + 3.0)
    np.testing.assert_allclose(recording["angle"], 0.5 * np.sin(2 * np.pi * S), atol=1e-3)
