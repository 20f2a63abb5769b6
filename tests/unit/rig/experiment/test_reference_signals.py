"""References as samples: closed forms, and noise with the statistics it states."""

from itertools import islice

import numpy as np
import pytest
from scipy.signal import butter, freqz_sos, welch

from jointz.core.protocols.reference_signal_models import (
    Chirps,
    Noise,
    Steps,
    SumOfSines,
    Sweep,
    Trajectory,
)
from jointz.rig.experiment.bench.reference_signals import endless_noise, reference_samples

RATE = 900.0
TIME = np.arange(9000) / RATE


def samples(reference, n=TIME.size, rate_hz=RATE, seed=1):
    return reference_samples(reference, n, rate_hz=rate_hz, rng=np.random.default_rng(seed))


def test_a_sum_repeats_after_its_cycle():
    terms = [{"amplitude": 2.5, "frequency_hz": 1.4}, {"amplitude": 3.0, "frequency_hz": 2.0}]
    reference = SumOfSines(kind="sum_of_sines", terms=terms, offset=40.0)
    found = samples(reference)

    cycle = round(reference.cycle_s * RATE)
    assert found[cycle : 2 * cycle] == pytest.approx(found[:cycle], abs=1e-9)
    expected = 40.0 + 2.5 * np.sin(2 * np.pi * 1.4 * TIME) + 3.0 * np.sin(2 * np.pi * 2.0 * TIME)
    assert found == pytest.approx(expected, abs=1e-12)


def test_a_chirp_goes_through_its_frequencies_and_amplitudes_linearly():
    sweep = Sweep(amplitude=(5.0, 3.0), frequency_hz=(10.0, 1.0), duration_s=10.0)
    found = samples(Chirps(kind="chirps", sweeps=(sweep,)), n=20_000, rate_hz=1000.0)

    crossings = np.flatnonzero(np.diff(np.signbit(found[:10_000]))) / 1000.0
    middle = 0.5 * (crossings[1:] + crossings[:-1])
    frequency = 0.5 / np.diff(crossings)
    assert frequency[3:] == pytest.approx(10.0 - 0.9 * middle[3:], rel=0.05)
    peaks = np.abs(found[:10_000]).reshape(10, -1).max(axis=1)
    assert peaks == pytest.approx(5.0 - 0.2 * (np.arange(10) + 0.5), abs=0.15)
    assert found[10_000:] == pytest.approx(found[:10_000])  # begins again


def test_sweeps_follow_each_other_and_one_without_amplitude_is_silent():
    sweeps = tuple(
        Sweep(amplitude=(a, a), frequency_hz=(1.0, 10.0), duration_s=2.0) for a in (5.0, 0.0, 7.0)
    )
    found = samples(Chirps(kind="chirps", sweeps=sweeps), n=6000, rate_hz=1000.0)

    assert np.abs(found.reshape(3, -1)).max(axis=1) == pytest.approx([5.0, 0.0, 7.0], abs=0.02)


def test_noise_has_the_stated_sd_and_the_spectrum_of_its_filter():
    noise = Noise(kind="noise", sd=10.0, cutoff_hz=40.0, order=3)
    found = samples(noise, n=400_000, rate_hz=1000.0)

    assert found.std() == pytest.approx(10.0, rel=0.02)
    frequency, power = welch(found, 1000.0, nperseg=2000)
    low = power[(frequency > 2) & (frequency < 10)].mean()
    _, gain = freqz_sos(butter(3, 40.0, fs=1000.0, output="sos"), frequency, fs=1000.0)
    band = (frequency > 20) & (frequency < 80)
    assert power[band] / low == pytest.approx(np.abs(gain[band]) ** 2, rel=0.4)
    assert np.median(power[band] / low / np.abs(gain[band]) ** 2) == pytest.approx(1.0, rel=0.05)


@pytest.mark.parametrize("rate_hz", [300.0, 900.0])
def test_steps_change_at_the_tick_of_their_time(rate_hz):
    found = samples(
        Steps(kind="steps", levels=(-1.0, 0.0, 2.0), hold_s=0.7),
        n=round(4.2 * rate_hz),
        rate_hz=rate_hz,
    )

    parts = found.reshape(6, -1)
    assert (parts == np.array([[-1.0], [0.0], [2.0]] * 2)).all()


def test_a_trajectory_goes_smoothly_through_its_samples_and_closes():
    shape = tuple(np.sin(2 * np.pi * np.arange(20) / 20.0))
    found = samples(
        Trajectory(kind="trajectory", samples=shape, duration_s=1.25), n=5000, rate_hz=1000.0
    )

    time = np.arange(5000) / 1000.0
    assert found == pytest.approx(np.sin(2 * np.pi * time / 1.25), abs=2e-4)


def test_endless_noise_is_the_noise_of_a_bench_within_its_bounds():
    noise = Noise(kind="noise", sd=1.5, cutoff_hz=20.0, order=2, offset=0.5)
    ticks = endless_noise(noise, rate_hz=RATE, rng=np.random.default_rng(1))
    found = np.array(list(islice(ticks, 20_000)))

    # The same random numbers through the same filter; blocks leave no seam.
    np.testing.assert_allclose(found, np.clip(samples(noise, n=20_000), -4.0, 5.0), atol=1e-12)
    assert (found.min(), found.max()) == (-4.0, 5.0)
