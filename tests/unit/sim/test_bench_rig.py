"""The front door of the simulated benches: one bench for all its loads."""

import pytest

from jointz.core.errors import DataError
from jointz.core.protocols.protocol import LoadSpec
from jointz.sim.benches.bench_rig import simulated_bench

LOADS = [
    LoadSpec.model_validate({"name": name, "stiffness": {"value": value, "sd": 5.0}})
    for name, value in (("soft", 168.0), ("stiff", 273.0))
]
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
    with pytest.raises(DataError, match="expected series-elastic or quasi-direct-drive; got 'x'"):
        simulated_bench("x", LOADS[0], sample_rate_hz=500.0)
