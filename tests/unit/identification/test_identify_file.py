"""One file with one time series: columns, units, refusals."""

from functools import partial

import numpy as np
import pandas as pd
import pytest

import jointz
from jointz.core.errors import DataError, UnitError
from jointz.identification.identify_file import identify_file
from jointz.identify.actuators.actuator import identify_actuator
from jointz.identify.record.joint import identify_joint
from jointz.io.text.column_arguments import Column, parse_column, parse_quantity


@pytest.mark.parametrize(
    ("text", "channel", "expected"),
    [
        ("knee:deg", "angle", Column("knee", "deg")),
        ("a:b:Nm", "torque", Column("a:b", "Nm")),
        ("t", "time", Column("t")),
        ("load cell:12.5*N*m", "torque", Column("load cell", "N*m", 12.5)),
    ],
)
def test_a_column_is_a_name_and_perhaps_a_unit(text, channel, expected):
    assert parse_column(text, channel) == expected


def test_a_column_whose_name_holds_a_colon_is_understood():
    assert parse_column("knee:deg", "angle", ["knee:deg"]) == Column("knee:deg")


@pytest.mark.parametrize("unit", ["N*m", ""])
def test_a_unit_of_something_else_is_refused_with_the_option(unit):
    with pytest.raises(UnitError, match="angle knee:"):
        parse_column(f"knee:{unit}", "angle")


@pytest.fixture
def file(tmp_path, knee_table):
    path = tmp_path / "r.csv"
    columns = {"ms": 1e3 * knee_table["t"], "deg": np.rad2deg(knee_table["angle"])}
    pd.DataFrame(columns | {"mNm": 1e3 * knee_table["torque"]}).to_csv(path, index=False)
    return path


def test_units_of_the_file_are_converted(file):
    columns = {"angle": "deg:deg", "torque": "mNm:mN*m", "time": "ms:ms"}
    fit, echoed = identify_file(identify_joint, file, columns, input="angle")

    found = [fit.parameter(n).value for n in ("stiffness", "damping", "inertia")]
    np.testing.assert_allclose(found, (80.0, 1.2, 0.02), rtol=1e-3)
    assert echoed["angle"] == Column("deg", "deg")

    del columns["time"]
    by_rate, _ = identify_file(identify_joint, file, columns, rate_hz=500.0, input="angle")
    assert by_rate.parameter("stiffness").value == pytest.approx(80.0, rel=1e-3)


@pytest.mark.parametrize(("time", "rate_hz"), [({}, None), ({"time": "ms:ms"}, 500.0)])
def test_time_or_rate_is_given_and_not_both(file, time, rate_hz):
    columns = {"angle": "deg:deg", "torque": "mNm:mN*m", **time}
    with pytest.raises(DataError, match=r"--time.*--rate"):
        identify_file(identify_joint, file, columns, rate_hz=rate_hz)


def test_a_column_by_number_may_be_written_with_a_zero_before_it(file):
    pd.read_csv(file).to_csv(file, index=False, header=False)
    columns = {"time": "01:ms", "angle": "02:deg", "torque": "03:mN*m"}
    fit, _ = identify_file(identify_joint, file, columns, input="angle", files={"header": False})

    assert fit.parameter("stiffness").value == pytest.approx(80.0, rel=1e-3)


# --- actuators and bandwidths ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "quantity", "value"),
    [("92:kg*cm^2", "rotor-inertia", 0.0092), ("30:deg/s", "smooth-velocity", np.deg2rad(30))],
)
def test_a_quantity_is_a_number_and_perhaps_a_unit(text, quantity, value):
    assert parse_quantity(text, quantity) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [("much", "--rotor-inertia much"), ("1:Nm", "--rotor-inertia 1:Nm: ")],
)
def test_a_quantity_that_cannot_be_read_is_refused_with_the_option(text, message):
    with pytest.raises(DataError, match=message):
        parse_quantity(text, "rotor-inertia")


@pytest.fixture
def bench_file(tmp_path, actuator_table):
    table = actuator_table
    columns = {
        "t": table["t"],
        "mA": 1e3 * table["i"],
        "rpm": table["w"] * 30 / np.pi,
        "deg_s2": np.rad2deg(table["a"]),
        "tau": 0.0092 * table["a"] - table["torque"],
    }
    path = tmp_path / "bench.csv"
    pd.DataFrame(columns).to_csv(path, index=False)
    return path


identify_bench = partial(identify_file, identify_actuator, needs_clock=False, gear_ratio=9)
BENCH = {"current": "mA:mA", "velocity": "rpm:rpm", "torque": "tau:Nm"}


def test_units_of_a_bench_file_are_converted(bench_file):
    columns = BENCH | {"acceleration": "deg_s2:deg/s^2"}
    fit, echoed = identify_bench(bench_file, columns, torque_sign=-1)

    expected = {
        "bias": 0.2,
        "torque_constant": 0.1,
        "coulomb_friction": 0.38,
        "gear_friction": 0.09,
        "rotor_inertia": 0.0092,
    }
    assert {p.name: p.value for p in fit.parameters} == pytest.approx(expected, abs=1e-6)
    assert echoed["velocity"] == Column("rpm", "rpm")
    assert len(fit.settings["sha256"]) == 64


def test_a_bench_file_needs_neither_time_nor_rate_and_takes_not_both(bench_file):
    fit, _ = identify_bench(bench_file, BENCH, torque_sign=-1)
    assert fit.rate_hz is None
    by_time, _ = identify_bench(bench_file, BENCH | {"time": "t"}, torque_sign=-1)
    assert by_time.parameter("rotor_inertia").value == pytest.approx(0.0092, rel=0.01)
    with pytest.raises(DataError, match="rate"):
        identify_bench(bench_file, BENCH | {"time": "t"}, rate_hz=500.0)


def test_an_overflow_is_refused_with_file_row_and_column(bench_file):
    table = pd.read_csv(bench_file)
    table.loc[98, "mA"] = -53823e3
    table.to_csv(bench_file, index=False)
    with pytest.raises(DataError, match=r"bench\.csv, column 'mA': row 100") as caught:
        identify_bench(bench_file, BENCH)
    assert (caught.value.channel, caught.value.row) == ("mA", 100)


def test_a_row_of_a_joint_file_counts_header_and_skipped_rows(file):
    table = pd.read_csv(file)
    table.loc[10, "deg"] = np.nan
    file.write_text("a title\n" + table.to_csv(index=False))
    columns = {"angle": "deg:deg", "torque": "mNm:mN*m"}
    with pytest.raises(DataError, match=r"r\.csv: .*'angle' has 1 sample.*row 13"):
        identify_file(identify_joint, file, columns, rate_hz=500.0, files={"skip_rows": 1})


@pytest.mark.parametrize("name", ["knee [deg]", "knee (deg)"])
def test_the_unit_in_a_columns_name_holds(tmp_path, knee_table, name):
    path = tmp_path / "r.csv"
    table = {"t": knee_table["t"], name: np.rad2deg(knee_table["angle"])}
    pd.DataFrame(table | {"tau": knee_table["torque"]}).to_csv(path, index=False)

    found = jointz.read(path, time="t", angle=name, torque="tau")

    np.testing.assert_allclose(found["angle"], knee_table["angle"], rtol=1e-9)
    with pytest.raises(UnitError, match="rad"):
        jointz.read(path, time="t", angle=f"{name}:rad", torque="tau")


def test_one_column_for_two_channels_is_refused(file):
    with pytest.raises(DataError, match="column 'deg'"):
        jointz.read(file, angle="deg:deg", torque="deg:N*m")


def test_stamps_that_repeat_are_told_and_the_rate_replaces_them(tmp_path):
    rng, n, path = np.random.default_rng(0), 4000, tmp_path / "joint.csv"
    angle = 0.05 * np.convolve(rng.standard_normal(n), np.hanning(40), "same")
    velocity = np.gradient(angle) * 500.0
    torque = 20.0 * angle + 0.5 * velocity + 0.02 * np.gradient(velocity) * 500.0
    table = pd.DataFrame({"t": np.arange(n) / 500.0, "q": angle, "tau": torque})
    table.round({"t": 2}).to_csv(path, index=False)
    columns = {"angle": "q", "torque": "tau"}
    with pytest.raises(DataError, match=r"it repeats in \d+ rows.*--rate HZ"):
        identify_file(identify_joint, path, {"time": "t", **columns}, input="angle")

    fit, _ = identify_file(identify_joint, path, columns, rate_hz=500.0, input="angle")
    assert fit.stiffness.value == pytest.approx(20.0, rel=0.05)
