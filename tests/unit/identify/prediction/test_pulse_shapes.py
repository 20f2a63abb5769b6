"""Pulses of one torque over time are one shape."""

import numpy as np
import pytest

from jointz.identify.prediction.pulse_shapes import pulse_shapes
from jointz.identify.preparation.pulses import Pulse

TIME_S = np.arange(0.0, 0.2, 0.002)
RNG = np.random.default_rng(1)


def hold(size, end_s):
    return size * (end_s > TIME_S)


def doublet(size, half_s):
    return hold(size, half_s) - hold(size, 2 * half_s) + hold(size, half_s)


def shapes_of(torques, amplitudes, noise_nm=0.5):
    noisy = np.array(torques) + noise_nm * RNG.standard_normal((len(torques), TIME_S.size))
    return pulse_shapes(noisy, [Pulse(0.0, 0.1, a) for a in amplitudes]).tolist()


@pytest.mark.parametrize("known", [True, False])
def test_signs_sizes_and_forms_are_told_apart(known):
    forms = [hold(12, 0.06), hold(-12, 0.06), hold(6, 0.06), doublet(12, 0.04), doublet(12, 0.09)]
    torques = [form for form in forms for _ in range(6)]
    amplitudes = [12.0, -12.0, 6.0, 12.0, 12.0] if known else [np.nan] * 5
    found = shapes_of(torques, np.repeat(amplitudes, 6))

    assert len(set(found)) == 5
    assert all(len(set(found[6 * k : 6 * k + 6])) == 1 for k in range(5))


def test_declared_amplitudes_that_the_noise_hides_are_shapes():
    found = shapes_of([hold(10, 0.1)] * 4 + [hold(11, 0.1)] * 4, [10.0] * 4 + [11.0] * 4)

    assert found == [0] * 4 + [1] * 4


def test_two_forms_of_two_similar_sizes_are_four_shapes():
    forms = [hold(8, 0.06), doublet(8, 0.09), hold(9.5, 0.06), doublet(9.5, 0.09)]
    found = shapes_of([f for f in forms for _ in range(2)], np.repeat([8.0, 8.0, 9.5, 9.5], 2))

    assert len(set(found)) == 4


def test_many_different_torques_are_joined_and_one_pulse_is_a_shape():
    sizes = np.geomspace(1.0, 40.0, 30)
    found = shapes_of([hold(size, 0.1) for size in sizes], sizes, noise_nm=0.0)

    assert len(set(found)) == 8
    assert shapes_of([hold(5, 0.1)], [5.0]) == [0]
