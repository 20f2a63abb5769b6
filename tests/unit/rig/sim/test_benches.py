"""What both simulated benches do: one bench for all its loads, presets, rates, calibration."""

import pytest

from jointz.core.errors import DataError
from jointz.core.protocols.protocol_models import LoadSpec
from jointz.rig.sim.benches.bench_load import BenchLoad
from jointz.rig.sim.benches.bench_rig import simulated_bench
from jointz.rig.sim.benches.qdd_bench import pack_qdd, qdd_preset
from jointz.rig.sim.benches.qdd_bench_rig import QddBench
from jointz.rig.sim.benches.sea import sea_preset
from jointz.rig.sim.benches.sea_plant import pack_sea

LOADS = [
    LoadSpec.model_validate({"name": name, "stiffness": {"value": value, "sd": 5.0}})
    for name, value in (("soft", 168.0), ("stiff", 273.0))
]
SPRING = BenchLoad("springs", stiffness=146.39)
BENCHES = {"series-elastic": "torque_gain", "quasi-direct-drive": "sensor_gain"}


@pytest.mark.parametrize(("bench", "gain"), BENCHES.items())
def test_all_loads_hang_on_one_bench_with_one_gain(bench, gain):
    rigs = [simulated_bench(bench, load, seed=3, sample_rate_hz=500.0) for load in LOADS]
    gains = [rig.bench_truth()[gain] for rig in rigs]
    assert gains[0] == gains[1] != 1.0
    assert [rig.wearer.id for rig in rigs] == ["soft", "stiff"]
    assert all(rig.notes()["bench"] == bench for rig in rigs)


@pytest.mark.parametrize("bench", BENCHES)
def test_a_clean_bench_holds_the_load_as_stated(bench):
    rig = simulated_bench(bench, LOADS[0], preset="clean", seed=3, sample_rate_hz=500.0)
    assert rig.bench_truth()["load"]["stiffness"] == 168.0


def test_an_unknown_bench_is_refused():
    with pytest.raises(DataError, match="'x'"):
        simulated_bench("x", LOADS[0], sample_rate_hz=500.0)


@pytest.mark.parametrize("preset", [sea_preset, qdd_preset])
def test_an_unknown_preset_is_refused_with_those_known(preset):
    with pytest.raises(DataError, match="'easy'"):
        preset("easy")


@pytest.mark.parametrize(("pack", "preset"), [(pack_sea, sea_preset), (pack_qdd, qdd_preset)])
@pytest.mark.parametrize("rate_hz", [99.0, 20_001.0, float("nan")])
def test_a_rate_out_of_range_is_refused(pack, preset, rate_hz):
    with pytest.raises(DataError, match="sample_rate_hz"):
        pack(preset("clean"), SPRING, sample_rate_hz=rate_hz)


@pytest.mark.parametrize(("preset", "sd"), [("clean", None), ("nominal", 0.005), ("hard", 0.051)])
def test_the_torque_model_has_the_gain_sd_of_what_it_was_fitted_to(preset, sd):
    bench = QddBench(qdd_preset(preset), SPRING, seed=0, sample_rate_hz=500.0)
    gain = bench.calibration.torque_gain
    assert gain is None if sd is None else gain.value == 1.0
    assert sd is None or gain.sd == pytest.approx(sd, rel=0.01)
