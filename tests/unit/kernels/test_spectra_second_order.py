import numpy as np
import pytest

from jointz.kernels.series.spectra_second_order import fit_second_order, record_spectra

RATE = 500.0
KBJ = np.array([80.0, 1.2, 0.03])


def make_motion(seed: int = 0, n: int = 10_000) -> tuple[np.ndarray, np.ndarray]:
    """Angle and torque of a joint in any motion, exact: sines that fit no window, and a jump-in."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) / RATE
    f = rng.uniform(0.3, 25.0, 60)
    w, phase = 2 * np.pi * f[:, None], rng.uniform(0.0, 2 * np.pi, (60, 1))
    wave = 0.01 / (1.0 + f[:, None]) * np.exp(1j * (w * t + phase))
    angle, velocity = wave.imag.sum(axis=0), (1j * w * wave).imag.sum(axis=0)
    acceleration = (-(w**2) * wave).imag.sum(axis=0)
    return angle, KBJ @ np.stack([angle, velocity, acceleration])


@pytest.mark.parametrize("perturbed", ["torque", "angle"])
@pytest.mark.parametrize("weighting", ["error", "even"])
def test_k_b_j_come_back_whatever_the_motion_at_the_ends(perturbed, weighting):
    angle, torque = make_motion()

    spectra = record_spectra(angle, torque, rate_hz=RATE, highest_hz=30.0)
    fit = fit_second_order(spectra, perturbed=perturbed, weighting=weighting)

    assert fit.values == pytest.approx(KBJ, rel=1e-6)
    assert fit.vaf_pct == pytest.approx(100.0)
    assert fit.converged


def make_loop(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A device of stiffness 40: the measured torque answers to what muscle does to the angle."""
    rng = np.random.default_rng(seed)
    n = 30_000
    s = 2j * np.pi * np.fft.rfftfreq(n, 1.0 / RATE)
    drive, muscle = (np.fft.rfft(rng.standard_normal(n)) for _ in range(2))
    drive, muscle = drive * (np.abs(s) < 2 * np.pi * 20.0), muscle * (np.abs(s) < 2 * np.pi * 8.0)
    joint, device = KBJ @ np.stack([np.ones_like(s), s, s**2]), 40.0
    theta = (drive + muscle) / (joint + device)
    angle, torque, command = (np.fft.irfft(z, n) for z in (theta, drive - device * theta, drive))
    return angle, torque, command


def test_the_command_as_the_instrument_opens_a_loop():
    with_command, without = [], []
    for seed in range(10):
        angle, torque, command = make_loop(seed)
        for instrument, found in ((command, with_command), (None, without)):
            spectra = record_spectra(
                angle, torque, rate_hz=RATE, highest_hz=18.0, command=instrument
            )
            fit = fit_second_order(spectra, perturbed="torque", weighting="even")
            found.append(fit.values)

    mean, error = np.mean(with_command, axis=0), np.std(with_command, axis=0) / np.sqrt(10)
    assert mean == pytest.approx(KBJ, rel=0.015)
    assert np.all(np.abs(mean - KBJ) < 4.0 * error)
    assert abs(np.mean(without, axis=0)[0] / 80.0 - 1.0) > 0.05


def test_a_single_sine_is_called_ill_conditioned():
    t = np.arange(10_000) / RATE
    angle = np.sin(2 * np.pi * 3.0 * t)

    spectra = record_spectra(angle, 5.0 * angle, rate_hz=RATE, highest_hz=30.0)

    assert fit_second_order(spectra, perturbed="angle").condition_number > 1e3


def test_a_floor_that_still_falls_is_signal():
    rng = np.random.default_rng(0)
    torque = np.cumsum(rng.standard_normal(10_000))

    spectra = record_spectra(torque, torque, rate_hz=RATE, highest_hz=30.0)

    assert spectra.noise == (0.0, 0.0)
    assert 0.0 < max(spectra.untold_share) < 0.01


def test_a_signal_up_to_half_the_rate_is_not_taken_for_noise():
    torque = np.random.default_rng(0).standard_normal(10_000)

    for highest_hz in (30.0, 0.49 * RATE):
        spectra = record_spectra(torque, torque, rate_hz=RATE, highest_hz=highest_hz)
        assert spectra.noise == (0.0, 0.0)
        assert spectra.untold_share == pytest.approx((1.0, 1.0), abs=0.15)


def test_too_few_frequencies_are_refused():
    with pytest.raises(ValueError, match="at least 12 frequencies below 2 Hz"):
        record_spectra(*make_motion(n=1000), rate_hz=RATE, highest_hz=2.0)
