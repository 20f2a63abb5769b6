"""Settings of the series-elastic bench."""

import pytest

from jointz.core.errors import DataError
from jointz.rig.sim.benches.bench_load import BenchLoad
from jointz.rig.sim.benches.sea import SeaErrors, sea_preset
from jointz.rig.sim.benches.sea_plant import SeaParam, pack_sea


@pytest.mark.parametrize(
    ("setting", "value"), [("torque_lag_s", -1e-3), ("torque_lag_s", 0.05), ("clock_stretch", 0.0)]
)
def test_impossible_error_is_refused(setting, value):
    with pytest.raises(DataError, match=f"expected {setting} in"):
        SeaErrors(**{setting: value})


@pytest.mark.parametrize("rate_hz", [100.0, 900.0, 20000.0])
def test_physics_runs_at_6_khz_or_more(rate_hz):
    p = pack_sea(sea_preset("clean"), BenchLoad("free"), sample_rate_hz=rate_hz)
    assert p[SeaParam.SUBSTEPS] / p[SeaParam.PERIOD_S] >= 6000.0
    assert float(p[SeaParam.SUBSTEPS]).is_integer()


def test_load_adds_to_the_intrinsic_impedance():
    load = BenchLoad("damper", stiffness=168.0, damping=0.5, inertia=0.0364)
    p = pack_sea(sea_preset("nominal"), load, sample_rate_hz=900.0)
    assert p[SeaParam.STIFFNESS] == pytest.approx(168.388)
    assert p[SeaParam.DAMPING] == pytest.approx(0.663)
    assert 1.0 / p[SeaParam.MOBILITY] == pytest.approx(0.0374)
    assert p[SeaParam.FRICTION] == 0.03
