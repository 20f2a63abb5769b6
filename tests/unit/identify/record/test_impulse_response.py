from functools import partial

import numpy as np
import pytest
from tests.unit.identify.record.steady_joint import KBJ, RATE, make_record

from jointz.identify.record.joint import identify_joint

identify_irf = partial(identify_joint, model="irf")
QUIET = (1e-4, 0.05)


def true_admittance(t: np.ndarray, kbj: np.ndarray) -> np.ndarray:
    """Inverse Laplace transform of 1/(J s^2 + B s + K) by its poles."""
    a, b = np.roots(kbj[::-1]).astype(complex)
    return np.real((np.exp(a * t) - np.exp(b * t)) / (a - b)) / kbj[2]


@pytest.mark.parametrize("kbj", [KBJ, np.array([80.0, 6.0, 0.03])], ids=["under", "over"])
def test_the_admittance_is_the_joint_s_seen_through_its_directions(kbj):
    fit = identify_irf(**make_record(kbj=kbj, noise=QUIET), rate_hz=RATE)

    table = fit.curve.table()
    true = true_admittance(table["lag_s"].to_numpy(), kbj)
    size = np.abs(true).max()
    assert fit.response_of == "admittance"
    assert table["lag_s"][0] == 0.0
    # Seen in a band a kink is round: lag zero is not compared.
    assert table["fitted"][1:].to_numpy() == pytest.approx(true[1:], abs=0.1 * size)
    assert table["response"].to_numpy() == pytest.approx(table["fitted"], abs=0.05 * size)
    assert fit.vaf_pct > 99.9
    assert [p.value for p in fit.parameters] == pytest.approx(kbj, rel=0.01)
    assert fit.warnings == ()


def test_the_impedance_is_two_sided_and_sums_to_the_stiffness():
    fit = identify_irf(**make_record("angle", noise=QUIET), rate_hz=RATE, input="angle")

    lags = np.array(fit.curve.lag_s)
    assert fit.response_of == "impedance"
    assert lags[0] == -lags[-1]
    assert lags[-1] == pytest.approx(0.04, abs=fit.step_s)
    assert sum(fit.curve.response) * fit.step_s == pytest.approx(80.0, rel=0.03)
    assert fit.vaf_pct > 99.0
    assert [p.value for p in fit.parameters] == pytest.approx(KBJ, rel=0.01)


@pytest.mark.parametrize(("perturbed", "noise"), [("torque", (1e-3, 0.2)), ("angle", (1e-5, 0.5))])
def test_the_bounds_hold_the_joint_s_response_along_the_same_directions(perturbed, noise):
    held = []
    for seed in range(20):
        record = make_record(perturbed, seed=seed, noise=noise)
        curve = identify_irf(**record, rate_hz=RATE, input=perturbed, cutoff_hz=30.0).curve
        low, high = np.array(curve.low), np.array(curve.high)
        held.append(np.mean((low < curve.fitted) & (curve.fitted < high)))
        assert np.all(low < high)

    assert np.mean(held) > 0.88
