from functools import partial

import numpy as np
import pytest

from jointz.identify.series.joint import identify_joint

identify_irf = partial(identify_joint, model="irf")
RATE = 500.0
KBJ = np.array([80.0, 1.2, 0.03])


def make_record(
    perturbed: str = "torque",
    *,
    kbj: np.ndarray = KBJ,
    seed: int = 0,
    n: int = 15_000,
    noise: tuple[float, float] = (1e-4, 0.05),
) -> dict[str, np.ndarray]:
    """Exact steady motion of a joint under a flat spectrum to 20 Hz, and sensor noise.

    ``noise`` is of angle (rad) and torque (N*m).
    """
    rng = np.random.default_rng(seed)
    s = 2j * np.pi * np.fft.rfftfreq(n, 1.0 / RATE)
    joint = kbj @ np.stack([np.ones_like(s), s, s**2])
    drive = np.fft.rfft(rng.standard_normal(n)) * (np.abs(s) < 2 * np.pi * 20.0)
    angle, torque = (drive / joint, drive) if perturbed == "torque" else (drive, drive * joint)
    size = np.fft.irfft(angle, n).std() / 0.04
    cut = slice(n // 10, -n // 10)
    angle, torque = (np.fft.irfft(z, n)[cut] / size for z in (angle, torque))
    return {
        "angle": angle + noise[0] * rng.standard_normal(angle.size),
        "torque": torque + noise[1] * rng.standard_normal(angle.size),
    }


def true_admittance(t: np.ndarray, kbj: np.ndarray) -> np.ndarray:
    """Inverse Laplace transform of 1/(J s^2 + B s + K) by its poles."""
    a, b = np.roots(kbj[::-1]).astype(complex)
    return np.real((np.exp(a * t) - np.exp(b * t)) / (a - b)) / kbj[2]


@pytest.mark.parametrize("kbj", [KBJ, np.array([80.0, 6.0, 0.03])], ids=["under", "over"])
def test_the_admittance_is_the_joint_s_seen_through_its_directions(kbj):
    fit = identify_irf(**make_record(kbj=kbj), rate_hz=RATE)

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
    fit = identify_irf(**make_record("angle"), rate_hz=RATE, input="angle")

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
