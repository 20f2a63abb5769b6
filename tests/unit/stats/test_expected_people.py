"""Means and differences that people let expect, where they can be written down."""

import numpy as np
import pytest

from jointz.kernels.statistics.people_model import RESPONSE_SD
from jointz.stats.expected_people import ExpectedPeople
from jointz.stats.people_together import LEVEL_SD, POINT_SD, SHARED

NAMES = ("stiffness", "damping", "inertia")
POINTS = 2
BETWEEN = np.repeat([np.hypot(LEVEL_SD[n], POINT_SD[n]) ** 2 for n in NAMES], POINTS)
OWN = np.array([0.2, 0.25, 0.3, 0.35, 0.08, 0.1])


def expected(own_sd=OWN, gain_sd=0.0):
    kinds, places = np.repeat(np.arange(3), POINTS), np.tile(np.arange(POINTS), 3)
    return ExpectedPeople(kinds, places, np.diag(own_sd**-2.0), own_sd, gain_sd)


@pytest.mark.parametrize("n", [1, 4, 25])
def test_a_mean_is_of_people_and_their_errors(n):
    variance = (BETWEEN + OWN**2) / n + (SHARED * OWN) ** 2 + 0.03**2

    np.testing.assert_allclose(expected(gain_sd=0.03).mean_sd(n), np.sqrt(variance), rtol=0.02)


def test_exact_estimates_leave_what_people_differ_by():
    exact = expected(np.full(6, 1e-4))

    np.testing.assert_allclose(exact.person_sd(), np.sqrt(BETWEEN), rtol=1e-3)
    response = RESPONSE_SD**2
    np.testing.assert_allclose(exact.difference_sd(), np.sqrt(2.0 * response * BETWEEN), rtol=1e-3)


def test_a_difference_has_the_errors_of_both_conditions():
    response = RESPONSE_SD**2
    variance = 2.0 * (response * BETWEEN + OWN**2)

    np.testing.assert_allclose(expected().difference_sd(), np.sqrt(variance), rtol=0.03)


def test_no_number_of_people_averages_out_what_all_share():
    gains = expected(gain_sd=0.05)

    shared = np.hypot(SHARED * OWN, 0.05)
    np.testing.assert_allclose(gains.mean_sd(10**9), shared, rtol=1e-3)
    np.testing.assert_allclose(gains.difference_sd(), expected().difference_sd())
