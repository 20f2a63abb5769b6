"""Zero-phase low-pass: closed-form gain, no phase, edges, refusals."""

import numpy as np
import pytest

from jointz.kernels.filtering import SHORTEST_RECORD, lowpass_zero_phase

RATE_HZ = 1000.0


@pytest.mark.parametrize("frequency_hz", [2.0, 20.0, 45.0])
def test_a_sine_comes_out_with_the_squared_butterworth_gain_and_no_phase(frequency_hz):
    time = np.arange(4000) / RATE_HZ
    sine = np.sin(2 * np.pi * frequency_hz * time)
    filtered = lowpass_zero_phase(sine, cutoff_hz=20.0, rate_hz=RATE_HZ)
    warped = np.tan(np.pi * frequency_hz / RATE_HZ) / np.tan(np.pi * 20.0 / RATE_HZ)
    gain = 1.0 / (1.0 + warped**8)
    inside = slice(1500, 2500)
    np.testing.assert_allclose(filtered[inside], gain * sine[inside], atol=1e-9)


def test_a_constant_passes_unchanged_up_to_the_ends():
    filtered = lowpass_zero_phase(np.full(200, 0.3), cutoff_hz=20.0, rate_hz=RATE_HZ)
    np.testing.assert_allclose(filtered, 0.3, atol=1e-9)


def test_the_shortest_record_passes_and_one_sample_less_does_not():
    n = SHORTEST_RECORD
    settings = {"cutoff_hz": 20.0, "rate_hz": RATE_HZ}
    assert lowpass_zero_phase(np.ones(n), **settings).shape == (n,)
    with pytest.raises(ValueError, match=f"at least {n} samples .* got {n - 1}"):
        lowpass_zero_phase(np.ones(n - 1), **settings)


@pytest.mark.parametrize("cutoff_hz", [0.0, 500.0, float("nan")])
def test_a_cutoff_outside_the_band_is_refused(cutoff_hz):
    with pytest.raises(ValueError, match=r"0 < cutoff_hz < rate_hz / 2 = 500 Hz"):
        lowpass_zero_phase(np.ones(100), cutoff_hz=cutoff_hz, rate_hz=RATE_HZ)
