"""One unit of a column, whichever way its file is read: by command, function, study, conversion."""

import struct
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import jointz
from jointz.conversion.convert import convert
from jointz.core.acquisition import Acquisition, Signal, SignalGroup
from jointz.core.errors import UnitError
from jointz.core.study import FilesSpec
from jointz.identification.identify_file import identify_file
from jointz.inspection.inspect_file import inspect_file
from jointz.io.formats.registry import list_columns, write_acquisition
from jointz.io.recordings import read_recording
from jointz.io.study_reader import open_study

from .c3d_files import theirs
from .foreign_files import write_file
from .test_xdf_format import header, samples, xdf

TIME = np.arange(50) / 100.0
ANGLE, TORQUE = 1.5 * np.sin(9.0 * TIME), 3e3 * np.cos(7.0 * TIME)  # deg, N*mm
COLUMNS = {"angle": "ankle_angle_r", "torque": "moment"}
GROUP = SignalGroup(
    "", (Signal("ankle_angle_r", ANGLE, "deg"), Signal("moment", TORQUE, "N*mm")), time_s=TIME
)


def write_sheet(path: Path) -> None:
    book = pytest.importorskip("openpyxl").Workbook()
    for row in (["time", *COLUMNS.values()], ["s", "deg", "N*mm"]):
        book.active.append(row)
    for row in zip(TIME.tolist(), ANGLE.tolist(), TORQUE.tolist(), strict=True):
        book.active.append(row)
    book.save(path)


def write_netcdf(path: Path) -> None:
    columns = {"time": (TIME, "s"), "ankle_angle_r": (ANGLE, "deg"), "moment": (TORQUE, "N*mm")}
    variables = {name: ("n", values, {"units": unit}) for name, (values, unit) in columns.items()}
    xr.Dataset(variables).to_netcdf(path)


def write_text(path: Path) -> None:
    write_acquisition(Acquisition((GROUP,)), path, lossy=True)


def write_parquet(path: Path) -> None:
    write_file(path, GROUP)


def write_opensim(path: Path, statement: str = "inDegrees=yes") -> None:
    rows = "\n".join(
        f"{t!r}\t{a!r}\t{m!r}"
        for t, a, m in zip(TIME.tolist(), ANGLE.tolist(), TORQUE.tolist(), strict=True)
    )
    path.write_text(f"walk\n{statement}\nendheader\ntime\tankle_angle_r\tmoment\n{rows}\n")


def write_sentence(path: Path) -> None:
    write_opensim(path, "Angles are in degrees.")


def write_channels(path: Path) -> None:
    point = {"p": np.zeros((3, TIME.size))}
    file = theirs(point, np.stack([ANGLE, TORQUE]), list(COLUMNS.values()))
    file["parameters"]["ANALOG"]["UNITS"]["value"] = ["deg", "Nmm"]
    file.write(str(path))


def write_points(path: Path) -> None:
    points = {
        name: np.stack([values, 0 * values, 0 * values])
        for name, values in (("ankle_angle_r", ANGLE), ("moment", TORQUE))
    }
    file = theirs(points, np.zeros((0, TIME.size)), [])
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    for kind, point, unit in (("ANGLE", "ankle_angle_r", "deg"), ("MOMENT", "moment", "Nmm")):
        file.add_parameter("POINT", f"{kind}S", [point])
        file.add_parameter("POINT", f"{kind}_UNITS", [unit])
    file.write(str(path))


def write_stream(path: Path) -> None:
    labels = "".join(
        f"<channel><label>{label}</label><unit>{unit}</unit></channel>"
        for label, unit in (("ankle_angle_r", "deg"), ("moment", "N*mm"))
    )
    more = f"<type>Motor</type><desc><channels>{labels}</channels></desc>"
    rows = [
        (float(t), struct.pack("<2d", a, m)) for t, a, m in zip(TIME, ANGLE, TORQUE, strict=True)
    ]
    path.write_bytes(
        xdf(header(1, "double64", rate="100", more=more, channels=2), samples(1, rows))
    )


FILES: Mapping[str, tuple[str, Callable[[Path], None]]] = {
    "text": (".csv", write_text),
    "netcdf": (".nc", write_netcdf),
    "parquet": (".parquet", write_parquet),
    "sheet": (".xlsx", write_sheet),
    "opensim": (".sto", write_opensim),
    "opensim sentence": (".mot", write_sentence),
    "c3d analog": (".c3d", write_channels),
    "c3d points": (".c3d", write_points),
    "xdf": (".xdf", write_stream),
}


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> Callable[[str], Path]:
    """Files of all formats, each written once."""
    folder, written = tmp_path_factory.mktemp("files"), {}

    def file(kind: str) -> Path:
        if kind not in written:
            suffix, write = FILES[kind]
            path = folder / f"{kind.replace(' ', '_')}{suffix}"
            write(path)
            written[kind] = path
        return written[kind]

    return file


def columns_of(path: Path) -> dict[str, str]:
    names = list_columns(path, FilesSpec()) or []
    found = {
        channel: next(n for n in names if n.rpartition("/")[2].startswith(column))
        for channel, column in COLUMNS.items()
    }
    group = "".join(found["angle"].rpartition("/")[:2])
    clocks = [f"{group}{name}" for name in ("time", "time [s]", "clock")]
    return {"time": next(n for n in names if n in clocks), **found}


def arguments(path: Path, given: Mapping[str, str]) -> dict[str, str]:
    units = {channel: f":{unit}" if unit else "" for channel, unit in given.items()}
    return {c: f"{column}{units.get(c, '')}" for c, column in columns_of(path).items()}


def identified(path: Path, given: Mapping[str, str], folder: Path) -> Any:
    del folder
    return identify_file(lambda record, **_: record, path, arguments(path, given))[0]


def read(path: Path, given: Mapping[str, str], folder: Path) -> Any:
    del folder
    return jointz.read(path, **arguments(path, given))


def converted(path: Path, given: Mapping[str, str], folder: Path) -> Any:
    # A text table has one group; the channels of a C3D file are the second.
    target = folder / f"converted{'.nc' if 'analog' in path.name else '.csv'}"
    convert(path, target, lossy=True, overwrite=True)
    return read(target, given, folder)


STUDY = """jointz = 1
joint = "ankle"
kind = "bench"
positive = "dorsiflexion"
torque_acts_on = "joint"
channels.time = {{ column = "{time}" }}
channels.angle = {angle}
channels.torque = {torque}
participants = [{{ id = "S01" }}]
perturbations.source = "angle"

[[recordings]]
participant = "S01"
condition = "perturbed"
file = "{file}"
"""


def channel(column: str, unit: str) -> str:
    factor, _, of_factor = unit.partition("*")
    scaled = factor == "2"
    stated = f', unit = "{of_factor if scaled else unit}"' if unit else ""
    return f'{{ column = "{column}"{stated}{", scale = 2" if scaled else ""} }}'


def opened(text: str, folder: Path) -> Any:
    (folder / "study.toml").write_text(text)
    study = open_study(folder)
    return read_recording(study, study.spec.recordings[0])[0]


def studied(path: Path, given: Mapping[str, str], folder: Path) -> Any:
    columns = columns_of(path)
    entries = {c: channel(columns[c], given.get(c, "")) for c in COLUMNS}
    return opened(STUDY.format(time=columns["time"], file=path, **entries), folder)


def joined(path: Path, given: Mapping[str, str], folder: Path) -> Any:
    np.savetxt(
        folder / "main.csv",
        np.stack([TIME, 0.1 * TIME, TIME], axis=1),
        delimiter=",",
        header="t,q,tau",
        comments="",
    )
    columns = columns_of(path)
    own = {c: channel(n, "") for c, n in (("angle", "q"), ("torque", "tau"))}
    text = STUDY.format(time="t", file="main.csv", **own)
    entries = "\n".join(
        f"channels.{name} = {channel(columns[c], given.get(c, ''))}"
        for name, c in (("joint_encoder", "angle"), ("sensor_torque", "torque"))
    )
    recording = opened(
        f'{text}\n[[recordings.joined]]\nfile = "{path}"\noffset_s = 0\n'
        f'channels.time = {{ column = "{columns["time"]}" }}\n{entries}\n',
        folder,
    )
    return {"angle": recording["joint_encoder"], "torque": recording["sensor_torque"]}


#: Units given for both columns: none, the file's, the file's spelled otherwise, others, a scale.
GIVEN = {
    "none": ("", ""),
    "same": ("deg", "N*mm"),
    "other spelling": ("degrees", "mN*m"),
    "contradicting angle": ("rad", ""),
    "contradicting torque": ("", "lbf*in"),
    "scale": ("2*rad", "2*N*m"),
}
WAYS = (identified, read, converted, studied, joined)


@pytest.mark.parametrize("given", GIVEN)
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", FILES)
def test_values_are_equal_or_a_contradiction_is_refused(files, tmp_path, kind, way, given):
    angle_unit, torque_unit = GIVEN[given]
    path = files(kind)
    states_torque = path.suffix not in (".sto", ".mot")
    if given == "contradicting angle" or (given == "contradicting torque" and states_torque):
        with pytest.raises(UnitError) as refusal:
            way(path, {"angle": angle_unit, "torque": torque_unit}, tmp_path)
        assert f"'{angle_unit or torque_unit}'" in str(refusal.value)
        assert any(f"'{unit}'" in str(refusal.value) for unit in ("deg", "N*mm", "Nmm"))
        return
    recording = way(path, {"angle": angle_unit, "torque": torque_unit}, tmp_path)
    scaled = given == "scale"
    si_per_torque = {"": 1e-3 if states_torque else 1.0, "lbf*in": 0.1129848290276167}
    torque = TORQUE * (2.0 if scaled else si_per_torque.get(torque_unit, 1e-3))
    angle = 2.0 * ANGLE if scaled else np.deg2rad(ANGLE)
    single = {"rtol": 2e-6 if path.suffix == ".c3d" else 1e-9, "atol": 1e-9}
    np.testing.assert_allclose(recording["angle"], angle, **single)
    np.testing.assert_allclose(recording["torque"], torque, **single)


@pytest.mark.parametrize("way", WAYS)
def test_a_header_of_two_units_is_a_question_that_a_unit_answers(tmp_path, way):
    path = tmp_path / "both.sto"
    write_opensim(path, "inDegrees=no\nAngles are in degrees.")
    with pytest.raises(UnitError, match=r"states two units, .* Which is right\? Give "):
        way(path, {}, tmp_path)
    recording = way(path, {"angle": "deg"}, tmp_path)
    np.testing.assert_allclose(recording["angle"], np.deg2rad(ANGLE), rtol=1e-9)


def test_a_unit_of_another_quantity_needs_a_factor(tmp_path):
    path = tmp_path / "bench.csv"
    path.write_text("load cell [V]\n1\n2\n")
    with pytest.raises(UnitError, match="'V' measures voltage"):
        jointz.read(path, torque="load cell [V]")
    with pytest.raises(UnitError, match=r"'V'.*'N\*m'.*1\*N\*m"):
        jointz.read(path, torque="load cell [V]:N*m")
    recording = jointz.read(path, torque="load cell [V]:12.5*N*m")
    assert recording["torque"].values.tolist() == [12.5, 25.0]


NAMES_WITH_UNITS = {
    "torque_lbf_in": ("torque", 0.1129848),
    "TORQUE (FT-LBS)": ("torque", 1.3558179),
    "torque_ft_lbs": ("torque", 1.3558179),
    "torque_Nm": ("torque", 1.0),
    "jointTorqueNm": ("torque", 1.0),
    "POSITION (DEGREES)": ("angle", np.pi / 180.0),
    "kneeAngleDeg": ("angle", np.pi / 180.0),
    "VELOCITY (DEG/SEC)": ("velocity", np.pi / 180.0),
    "gyro_shank_dps": ("shank_velocity", np.pi / 180.0),
    "motor_current_mA": ("current", 1e-3),
}


@pytest.mark.parametrize("name", NAMES_WITH_UNITS)
def test_a_name_says_its_unit_to_readers_and_to_inspect_alike(tmp_path, name):
    channel, factor = NAMES_WITH_UNITS[name]
    path = tmp_path / "a.csv"
    path.write_text(f"time_s,{name}\n" + "".join(f"{k / 100},{k % 7}\n" for k in range(100)))

    found = jointz.read(path, **{channel: name})[channel]

    np.testing.assert_allclose(found, factor * (np.arange(100) % 7), rtol=1e-6)
    seen = inspect_file(path).channel(channel)
    assert (seen.column, seen.unit_is) == (name, "stated")


def test_a_torque_per_mass_by_its_name_is_no_torque(tmp_path):
    (tmp_path / "a.csv").write_text("torque_Nm_kg\n1\n2\n")
    with pytest.raises(UnitError, match="per body mass"):
        jointz.read(tmp_path / "a.csv", torque="torque_Nm_kg")


def test_a_given_unit_is_stronger_than_the_end_of_a_name(tmp_path):
    (tmp_path / "a.csv").write_text("torque_nm\n1\n2\n")
    read = jointz.read(tmp_path / "a.csv", torque="torque_nm:mN*m")
    np.testing.assert_allclose(read["torque"], [1e-3, 2e-3])


@pytest.mark.parametrize("name", ["motorCurrent", "mot_cur"])
def test_a_motors_current_is_known_by_its_name(tmp_path, name):
    path = tmp_path / "a.csv"
    path.write_text(f"time_s,{name}\n" + "".join(f"{k / 100},{k % 7}\n" for k in range(100)))
    assert inspect_file(path).channel("current").column == name


def test_a_unit_may_be_a_part_of_another(tmp_path):
    (tmp_path / "a.csv").write_text("ticks\n0\n4096\n")
    read = jointz.read(tmp_path / "a.csv", angle="ticks:turn/16384")
    np.testing.assert_allclose(read["angle"], [0.0, np.pi / 2.0])
