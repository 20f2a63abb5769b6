"""What the lab knows of the quasi-direct drive."""

import pytest

from jointz.sim.benches.bench_load import BenchLoad
from jointz.sim.benches.qdd_bench import qdd_preset
from jointz.sim.benches.qdd_bench_rig import QddBench


@pytest.mark.parametrize(("preset", "gain_sd"), [("nominal", 0.005), ("hard", 0.051)])
def test_the_torque_model_has_the_gain_sd_of_what_it_was_fitted_to(preset, gain_sd):
    load = BenchLoad("springs", 146.39, 0.0, 0.0)

    gain = QddBench(qdd_preset(preset), load, seed=0, sample_rate_hz=500.0).calibration.torque_gain

    assert gain.value == 1.0
    assert gain.sd == pytest.approx(gain_sd, rel=0.01)


def test_a_clean_bench_has_nothing_to_calibrate():
    load = BenchLoad("springs", 146.39, 0.0, 0.0)

    bench = QddBench(qdd_preset("clean"), load, seed=0, sample_rate_hz=500.0)

    assert bench.calibration.torque_gain is None
