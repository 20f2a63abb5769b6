"""Stationary records of a human ankle under position perturbations (REKLAB)."""

import os
import time
from pathlib import Path

import pandas as pd
import pytest

from jointz import identify_joint
from jointz.core.joint_fit import JointFit
from jointz.core.reflex_fit import ReflexFit

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


def reflex(name: str) -> ReflexFit:
    columns = {"time_s": "time", "position_rad": "angle", "torque_Nm": "torque"}
    record = pd.read_csv(FOLDER / f"{name}.csv.gz").rename(columns=columns)
    return identify_joint(record, model="reflex", input="angle", torque_acts_on="device")


def test_the_ankle_in_dorsiflexion_has_an_intrinsic_and_a_reflex_path() -> None:
    found = reflex("z_df")
    stiffness, gain = found.parameter("stiffness"), found.parameter("reflex_gain")
    assert found.vaf_pct >= 94.7
    assert 65.0 <= stiffness.value <= 85.0
    assert gain.status == "ok"
    assert gain.ci_low > 0.0
    assert found.path.stretch == "positive"  # dorsiflexion stretches the calf


@pytest.mark.parametrize(("name", "more_vaf_pct"), [("z_pf", 25.0), ("z_df3", 5.0)])
def test_a_reflex_path_explains_clearly_more_than_the_linear_model(
    name: str, more_vaf_pct: float
) -> None:
    found = reflex(name)
    assert found.vaf_pct > found.linear_vaf_pct + more_vaf_pct
    assert found.vaf_pct > fit(name).vaf_pct + more_vaf_pct
    assert found.parameter("stiffness").ci_high < found.linear_stiffness
    delay = found.parameter("reflex_delay")
    assert 0.03 < delay.ci_low < delay.value < delay.ci_high < 0.06


@pytest.mark.parametrize(("name", "depends"), [("z_pf", False), ("z_df3", True)])
def test_an_inertia_that_depends_on_the_band_is_told(name: str, depends: bool) -> None:
    assert ("inertia depends on the band" in " ".join(reflex(name).warnings)) is depends


def test_the_reflex_of_a_minute_is_found_in_less_than_a_second() -> None:
    columns = {"time_s": "time", "position_rad": "angle", "torque_Nm": "torque"}
    record = pd.read_csv(FOLDER / "z_df.csv.gz").rename(columns=columns)
    settings = {"model": "reflex", "input": "angle", "torque_acts_on": "device"}
    identify_joint(record, **settings)
    best = min(_seconds(record, settings) for _ in range(3))
    assert best < 1.0


def _seconds(record: pd.DataFrame, settings: dict[str, str]) -> float:
    start = time.perf_counter()
    identify_joint(record, **settings)
    return time.perf_counter() - start
