"""One file with one time series: columns, units, refusals."""

import numpy as np
import pandas as pd
import pytest

from jointz.core.errors import DataError, UnitError
from jointz.workflows.identification import Column, identify_joint_file, parse_column


@pytest.mark.parametrize(
    ("text", "channel", "expected"),
    [
        ("knee", "angle", Column("knee", "rad")),
        ("knee:deg", "angle", Column("knee", "deg")),
        ("a:b:Nm", "torque", Column("a:b", "Nm")),
        ("t", "time", Column("t", "s")),
    ],
)
def test_a_column_is_a_name_and_perhaps_a_unit(text, channel, expected):
    assert parse_column(text, channel) == expected


def test_a_column_whose_name_holds_a_colon_is_understood():
    assert parse_column("knee:deg", "angle", ["knee:deg"]) == Column("knee:deg", "rad")


@pytest.mark.parametrize("unit", ["N*m", "furlong_x", ""])
def test_a_unit_of_something_else_is_refused_with_the_option(unit):
    with pytest.raises(UnitError, match="--angle knee:"):
        parse_column(f"knee:{unit}", "angle")


@pytest.fixture
def file(tmp_path):
    t = np.arange(8000) / 500.0
    w = 2 * np.pi * np.linspace(0.3, 9.0, 20)[:, None]
    phase = np.random.default_rng(1).uniform(0, 6.28, 20)[:, None]
    s, c = np.sin(w * t + phase), np.cos(w * t + phase)
    angle = 0.01 * s.sum(axis=0)
    torque = 0.01 * ((80.0 - 0.02 * w**2) * s + 1.2 * w * c).sum(axis=0)
    path = tmp_path / "r.csv"
    pd.DataFrame({"ms": 1e3 * t, "deg": np.rad2deg(angle), "mNm": 1e3 * torque}).to_csv(
        path, index=False
    )
    return path


def test_units_of_the_file_are_converted(file):
    columns = {"angle": "deg:deg", "torque": "mNm:mN*m", "time": "ms:ms"}
    fit, echoed = identify_joint_file(file, columns, input="angle")

    found = [fit.parameter(n).value for n in ("stiffness", "damping", "inertia")]
    np.testing.assert_allclose(found, (80.0, 1.2, 0.02), rtol=1e-3)
    assert echoed["angle"] == Column("deg", "deg")

    del columns["time"]
    by_rate, _ = identify_joint_file(file, columns, rate_hz=500.0, input="angle")
    assert by_rate.parameter("stiffness").value == pytest.approx(80.0, rel=1e-3)


@pytest.mark.parametrize(("time", "rate_hz"), [({}, None), ({"time": "ms:ms"}, 500.0)])
def test_time_or_rate_is_given_and_not_both(file, time, rate_hz):
    columns = {"angle": "deg:deg", "torque": "mNm:mN*m", **time}
    with pytest.raises(DataError, match=r"--time COL.* or --rate HZ, one of them"):
        identify_joint_file(file, columns, rate_hz=rate_hz)


def test_a_file_that_is_not_there_is_refused(tmp_path):
    columns = {"angle": "a", "torque": "b"}
    with pytest.raises(DataError, match="no such file"):
        identify_joint_file(tmp_path / "x.csv", columns, rate_hz=100.0)
