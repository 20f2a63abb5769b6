"""Short runs of missing samples are filled within the noise, others stay."""

import numpy as np
import pytest

from jointz.kernels.missing_samples import fill_holes

TIME_S = np.arange(2000) / 500.0
MOTION = 0.5 * np.sin(2 * np.pi * TIME_S) + 0.02 * np.sin(2 * np.pi * 10.0 * TIME_S)
ALLOWED = np.ones(TIME_S.size, dtype=bool)


def filled(values, allowed=ALLOWED):
    return fill_holes(TIME_S, values, longest_s=0.021, allowed=allowed)


@pytest.mark.parametrize(
    ("length", "error", "noise"), [(1, 1e-6, 1.2), (4, 1e-5, 1.0), (9, 3e-4, 1)]
)
def test_a_filled_sample_follows_the_motion_with_the_noise_of_one_sample(length, error, noise):
    missing = np.arange(TIME_S.size) % 60 >= 60 - length
    missing[:40] = missing[-40:] = False
    clean = filled(np.where(missing, np.nan, MOTION))
    assert clean == pytest.approx(MOTION, abs=error)
    np.testing.assert_array_equal(clean[~missing], MOTION[~missing])

    sd = 0.005
    noisy = MOTION + sd * np.random.default_rng(0).standard_normal(TIME_S.size)
    spread = (filled(np.where(missing, np.nan, noisy)) - MOTION)[missing].std()
    assert 0.4 * sd < spread < 1.1 * noise * sd


def test_long_holes_ends_and_holes_that_are_not_allowed_stay():
    values, allowed = MOTION.copy(), ALLOWED.copy()
    holes = [slice(0, 1), slice(500, 510), slice(512, 513), slice(900, 903), slice(1998, 1999)]
    for hole in holes:
        values[hole] = np.nan  # the third is too close to the second
    allowed[902] = False
    np.testing.assert_array_equal(filled(values, allowed), values)
