"""Settings of the series-elastic bench."""

from dataclasses import asdict, fields

import numpy as np
import pytest

from jointz.core.errors import DataError
from jointz.sim.benches.bench_load import BenchLoad
from jointz.sim.benches.sea import SeaErrors, sea_preset
from jointz.sim.benches.sea_pack import SeaParam, pack_sea

BENDS = {"friction_velocity_rad_s"}  # shapes of a mechanism, not mechanisms


def test_clean_bench_has_no_error_at_all():
    assert sea_preset("clean").errors == SeaErrors()
    off = {"clock_stretch": 1.0, "true_stamps": True}
    for name, value in asdict(SeaErrors()).items():
        assert name in BENDS or value == off.get(name, 0.0)


def test_hard_bench_is_nowhere_better_than_the_nominal_one():
    def badness(name):
        errors = asdict(sea_preset(name).errors)
        errors["clock_stretch"] -= 1.0
        errors["true_stamps"] = not errors["true_stamps"]
        # A lower corner is worse.
        hz = errors.pop("torque_filter_hz")
        errors["torque_filter_s"] = 1.0 / hz if hz else 0.0
        return {key: abs(value) for key, value in errors.items()}

    clean, nominal, hard = (badness(name) for name in ("clean", "nominal", "hard"))
    assert all(clean[key] <= nominal[key] <= hard[key] for key in clean)
    assert nominal != clean
    assert hard != nominal


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


def test_a_mechanism_changes_few_constants():
    clean = sea_preset("clean")
    load = BenchLoad("1", stiffness=168.0, inertia=0.0364)
    hard = {f.name: getattr(sea_preset("hard").errors, f.name) for f in fields(SeaErrors)}
    base = pack_sea(clean, load, sample_rate_hz=900.0)
    for name, value in hard.items():
        alone = type(clean)("alone", errors=SeaErrors(**{name: value}))
        changed = np.count_nonzero(pack_sea(alone, load, sample_rate_hz=900.0) != base)
        # The gain of one bench is drawn apart; the shape of friction is the same everywhere.
        assert changed == (0 if name in BENDS | {"torque_gain_sd"} else 1), name
