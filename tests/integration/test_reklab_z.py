"""Stationary records of a human ankle under position perturbations (REKLAB)."""

import os
from pathlib import Path

import pandas as pd
import pytest

from jointz import identify_joint
from jointz.core.joint_fit import JointFit

_DEFAULT = Path(__file__).resolve().parents[3] / "shared" / "data"
FOLDER = Path(os.environ.get("JOINTZ_DATA", _DEFAULT)) / "reklab_ankle"

pytestmark = [
    pytest.mark.real_data,
    pytest.mark.skipif(
        not FOLDER.is_dir(), reason="the recordings reklab_ankle are not here: set JOINTZ_DATA"
    ),
]


def fit(name: str) -> JointFit:
    columns = {"time_s": "time", "position_rad": "angle", "torque_Nm": "torque"}
    record = pd.read_csv(FOLDER / f"{name}.csv.gz").rename(columns=columns)
    return identify_joint(record, input="angle", torque_acts_on="device")


@pytest.mark.parametrize(
    ("name", "stiffness", "vaf_pct"),
    [("z_df", 104.0, 83.0), ("z_pf", 107.0, None), ("z_df3", 158.0, None)],
)
def test_the_ankle_has_the_known_second_order_stiffness(
    name: str, stiffness: float, vaf_pct: float | None
) -> None:
    found = fit(name)
    estimate = found.parameter("stiffness")
    assert found.status == "ok"
    assert estimate.value == pytest.approx(stiffness, abs=1.0)
    assert estimate.ci_low < stiffness < estimate.ci_high
    assert 0.010 < found.parameter("inertia").value < 0.025  # foot and pedal
    if vaf_pct is not None:
        assert found.vaf_pct == pytest.approx(vaf_pct, abs=1.5)


def test_the_torque_of_the_device_has_the_other_sign() -> None:
    record = pd.read_csv(FOLDER / "z_df.csv.gz")
    found = identify_joint(
        angle=record["position_rad"], torque=record["torque_Nm"], rate_hz=1000.0, input="angle"
    )
    assert found.parameter("stiffness").value == pytest.approx(-104.0, abs=1.0)
    assert "negative" in " ".join(found.warnings)
