"""Single pulses on a known load, simulated by scipy's first-order hold."""

import numpy as np
import pytest
from scipy.signal import cont2discrete, dlsim

from jointz.core.errors import DataError, EstimationError
from jointz.identify.bench.pulse_likelihood import NoiseLevels, fit_pulse
from jointz.results.bench.bench_fits import PulseFit

RATE_HZ = 900.0
STEP = 1 / RATE_HZ
K, B, J = 168.388, 0.163, 0.0374
NOISE = NoiseLevels(1e-5, 0.1)


def pulse(t: np.ndarray) -> np.ndarray:
    return 7.0 * np.interp(t, [0, 0.075, 0.175, 0.25], [0, 1, 1, 0])


def moved(torque: np.ndarray) -> np.ndarray:
    num, den, _ = cont2discrete(([1.0], [J, B, K]), STEP, method="foh")
    return np.ravel(dlsim((np.ravel(num), den, STEP), torque)[1])


def record(seed: int, *, lag: float = 0.0, raw: bool = False, noise: NoiseLevels = NOISE):
    """Time, angle, measured torque; 50 ms before the onset at zero, 330 ms after."""
    rng = np.random.default_rng(seed)
    t = STEP * np.arange(-900, 300)

    def applied(t):
        return pulse(t) + (32.0 + 5.0 * np.sin(8.8 * t + 1.0) if raw else 0.0)

    start = applied(t[:1])[0]
    angle = moved(applied(t) - start) + start / K
    torque = applied(t - lag)
    shown = slice(900 - 45, None)
    angle = angle[shown] + rng.normal(scale=noise.angle_sd_rad, size=345)
    torque = torque[shown] + rng.normal(scale=noise.torque_sd_nm, size=345)
    return t[shown], angle, torque


def z_scores(fit: PulseFit, lag: float) -> np.ndarray:
    truth = np.array([K, B, J, lag])
    values = np.array([p.value for p in fit.parameters])
    return (values - truth) / np.sqrt(np.diag(fit.covariance))


@pytest.mark.parametrize("signal", ["response", "raw"])
def test_estimates_scatter_about_the_truth_as_their_covariance_says(signal):
    z = []
    for seed in range(60):
        data = record(seed, lag=0.0024, raw=signal == "raw")
        fit = fit_pulse(*data, onset_s=0.0, signal=signal, noise=NOISE)
        z.append(z_scores(fit, 0.0024))

    z = np.array(z)
    assert np.abs(z.mean(axis=0)).max() < 3.2 / np.sqrt(60)
    np.testing.assert_allclose(z.std(axis=0), 1.0, atol=0.3)


@pytest.mark.parametrize(
    "n_seeds", [pytest.param(12, id="few"), pytest.param(100, id="many", marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("torque_sd", [0.15, 0.5])
@pytest.mark.parametrize("signal", ["response", "raw"])
def test_noisy_torque_leaves_intervals_of_lag_and_damping_true(signal, torque_sd, n_seeds):
    noise, lag = NoiseLevels(1e-5, torque_sd), 0.0012
    held, width = [], []
    for seed in range(n_seeds):
        data = record(seed, lag=lag, raw=signal == "raw", noise=noise)
        fit = fit_pulse(*data, onset_s=0.0, signal=signal)
        if fit.status == "ok":
            found = [(fit.parameter("torque_lag"), lag), (fit.parameter("damping"), B)]
            held.append([p.ci_low <= truth <= p.ci_high for p, truth in found])
            width.append(found[0][0].ci_high - found[0][0].ci_low)

    assert len(held) >= 0.9 * n_seeds
    assert (np.mean(held, axis=0) >= (0.88 if n_seeds >= 100 else 0.74)).all()
    assert np.median(width) > 2 * 0.001 * torque_sd


def test_noise_is_read_off_the_record():
    settings = fit_pulse(*record(1), onset_s=0.0).settings

    assert settings["angle_sd_rad"] == pytest.approx(1e-5, rel=0.25)
    assert settings["torque_sd_nm"] == pytest.approx(0.1, rel=0.25)


def test_an_uncertain_lag_widens_damping_and_is_reported():
    data = record(2, lag=0.0024)
    sure = fit_pulse(*data, onset_s=0.0, noise=NOISE, lag=(0.0024, 0.0))
    unsure = fit_pulse(*data, onset_s=0.0, noise=NOISE, lag=(0.0024, 0.001))

    def width(fit, name):
        return fit.parameter(name).ci_high - fit.parameter(name).ci_low

    assert width(unsure, "damping") > 1.1 * width(sure, "damping")
    assert [p.name for p in sure.parameters] == ["stiffness", "damping", "inertia"]
    assert sure.lag_model == "given"


def test_a_window_on_the_ramp_decides_little():
    fit = fit_pulse(*record(3), onset_s=0.0, window_s=0.02, noise=NOISE)

    assert fit.status == "undecided"


def test_slow_noise_widens_the_intervals():
    t, angle, torque = record(4, noise=NoiseLevels(1e-5, 0.01))
    drift = 0.3 * np.sin(60.0 * t)
    fit = fit_pulse(t, angle, torque + drift, onset_s=0.0, noise=NoiseLevels(1e-5, 0.01))
    clean = fit_pulse(t, angle, torque, onset_s=0.0, noise=NoiseLevels(1e-5, 0.01))

    assert fit.covariance[0][0] > 4 * clean.covariance[0][0]


def test_a_pulse_the_other_way_gives_the_same():
    t, angle, torque = record(5)

    fits = [fit_pulse(t, s * angle, s * torque, onset_s=0.0, noise=NOISE) for s in (1.0, -1.0)]

    np.testing.assert_allclose(*[[p.value for p in f.parameters] for f in fits], rtol=1e-6)


def test_a_dead_angle_is_named():
    t, angle, torque = record(7)
    with pytest.raises(EstimationError) as caught:
        fit_pulse(t, np.zeros_like(angle), torque, onset_s=0.0)

    assert caught.value.code == "constant_angle"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"window_s": 3.0}, "record"),
        ({"onset_s": -1.0}, "-1 s"),
        ({"lag": (0.0, -1.0)}, "lag"),
    ],
)
def test_what_the_record_does_not_hold_is_refused(options, message):
    with pytest.raises(DataError, match=message):
        fit_pulse(*record(6), **({"onset_s": 0.0} | options))
