"""Stationary records of a human ankle under position perturbations (REKLAB)."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from jointz import identify_joint
from jointz.core.errors import EstimationError
from jointz.results.series.joint_fit import JointFit
from jointz.results.series.reflex_fit import ReflexFit

pytestmark = pytest.mark.real_data


Records = Callable[[str], pd.DataFrame]


@pytest.fixture(scope="module")
def record(real_data: Path) -> Records:
    """How a record is read, with the names that jointz knows."""

    def read(name: str) -> pd.DataFrame:
        columns = {"time_s": "time", "position_rad": "angle", "torque_Nm": "torque"}
        return pd.read_csv(real_data / "reklab_ankle" / f"{name}.csv.gz").rename(columns=columns)

    return read


def fit(record: pd.DataFrame) -> JointFit:
    return identify_joint(record, input="angle", torque_acts_on="device")


def reflex(record: pd.DataFrame) -> ReflexFit:
    return identify_joint(record, model="reflex", input="angle", torque_acts_on="device")


@pytest.mark.parametrize(
    ("name", "stiffness", "vaf_pct"),
    [("z_df", 104.0, 83.0), ("z_pf", 107.0, None), ("z_df3", 158.0, None)],
)
def test_the_ankle_has_the_known_second_order_stiffness_but_its_reflex_refuses_it(
    record: Records, name: str, stiffness: float, vaf_pct: float | None
) -> None:
    found = fit(record(name))
    assert (found.status, found.check.finding) == ("undecided", "reflex")
    assert found.parameter("stiffness").value is None
    assert found.parameter("stiffness").unbounded == pytest.approx(stiffness, abs=1.0)
    assert 0.010 < found.parameter("inertia").unbounded < 0.025  # foot and pedal
    if vaf_pct is not None:
        assert found.vaf_pct == pytest.approx(vaf_pct, abs=1.5)


def test_the_torque_of_the_device_has_the_other_sign(record: Records) -> None:
    given = record("z_df")
    with pytest.raises(EstimationError, match="torque"):
        identify_joint(angle=given["angle"], torque=given["torque"], rate_hz=1000.0, input="angle")


def test_the_ankle_in_dorsiflexion_has_an_intrinsic_and_a_reflex_path(record: Records) -> None:
    found = reflex(record("z_df"))
    stiffness, gain = found.parameter("stiffness"), found.parameter("reflex_gain")
    assert found.vaf_pct >= 94.7
    assert 65.0 <= stiffness.value <= 85.0
    assert gain.status == "ok"
    assert gain.ci_low > 0.0
    assert found.path.stretch == "positive"  # dorsiflexion stretches the calf


@pytest.mark.parametrize(
    ("name", "more_vaf_pct", "depends_on_band"), [("z_pf", 25.0, False), ("z_df3", 5.0, True)]
)
def test_a_reflex_path_explains_clearly_more_than_the_linear_model(
    record: Records, name: str, more_vaf_pct: float, depends_on_band: bool
) -> None:
    found = reflex(record(name))
    assert any("inertia depends" in told for told in found.warnings) is depends_on_band
    assert found.vaf_pct > found.linear_vaf_pct + more_vaf_pct
    assert found.vaf_pct > fit(record(name)).vaf_pct + more_vaf_pct
    assert found.parameter("stiffness").ci_high < found.linear_stiffness
    delay = found.parameter("reflex_delay")
    assert 0.03 < delay.ci_low < delay.value < delay.ci_high < 0.06


@pytest.mark.parametrize("model", ["kbj", "irf"])
def test_what_a_reflex_biases_is_shown_as_doubtful_with_the_command_that_decides(
    jointz: Callable[..., Any], real_data: Path, model: str
) -> None:
    file = real_data / "reklab_ankle" / "z_df.csv.gz"
    columns = ("--angle", "position_rad", "--torque", "torque_Nm", "--time", "time_s")
    given = (file, *columns, "--input", "angle", "--torque-acts-on", "device", "--model", model)
    told = jointz("identify", "joint", *given)
    shown = next(line.split("\t") for line in told.out.splitlines() if line.startswith("stiff"))
    assert told.code == 1
    assert float(shown[1]) == pytest.approx(105.0, abs=2.0)
    assert shown[2:] == ["-", "N*m/rad", "doubtful"]
    assert told.out.count("--model reflex") == 1
    assert told.out.splitlines()[-1].endswith("exit status 1.")
    found = jointz("identify", "joint", *given, "--json").json
    assert found["status"] == found["parameters"]["damping"]["status"] == "doubtful"
    assert found["parameters"]["damping"]["ci"] == [None, None]
