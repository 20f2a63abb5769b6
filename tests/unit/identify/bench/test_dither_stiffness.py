"""Dither stiffness: K and B at one frequency, beside slow motion and noise."""

import numpy as np
import pytest
from scipy.signal import lfilter

from jointz.core.errors import DataError, EstimationError
from jointz.identify.bench.dither_stiffness import identify_dither_stiffness

RATE, K, B, J = 500.0, 146.39, 0.3, 0.0092
TIME = np.arange(10_000) / RATE
DITHER_HZ = 5.0
#: A dither of 0.4 deg beside a slow sine.
PHASE = 2 * np.pi * DITHER_HZ * TIME + 0.7
SLOW = 2 * np.pi * 0.1 * TIME


def bench(*, inertia=0.0, slow=0.0, amplitude=0.007):
    """Return angle and torque = K angle + B velocity + J acceleration, in closed form."""
    angle, torque = np.zeros(TIME.size), np.zeros(TIME.size)
    for size, phase, hz in ((amplitude, PHASE, DITHER_HZ), (slow, SLOW, 0.1)):
        omega = 2 * np.pi * hz
        angle = angle + size * np.sin(phase)
        torque = torque + size * (
            (K - inertia * omega**2) * np.sin(phase) + B * omega * np.cos(phase)
        )
    return angle, torque


def fitted(angle, torque, **options):
    return identify_dither_stiffness(
        angle=angle, torque=torque, rate_hz=RATE, **{"frequency_hz": DITHER_HZ} | options
    )


def test_stiffness_and_damping_come_back():
    fit = fitted(*bench())

    assert fit.parameter("stiffness").value == pytest.approx(K, rel=1e-10)
    assert fit.parameter("damping").value == pytest.approx(B, rel=1e-9)
    assert fit.excursion_rad == pytest.approx(0.007)
    assert fit.frequency_hz == DITHER_HZ


def test_a_given_inertia_is_put_back():
    angle, torque = bench(inertia=J)

    assert fitted(angle, torque, inertia=J).parameter("stiffness").value == pytest.approx(K)
    without = fitted(angle, torque).parameter("stiffness").value
    assert without == pytest.approx(K - J * (2 * np.pi * DITHER_HZ) ** 2)


def test_slow_motion_beside_the_dither_is_left_over():
    fit = fitted(*bench(slow=0.07))

    assert fit.parameter("stiffness").value == pytest.approx(K, rel=1e-9)
    assert fit.vaf_pct < 5.0


def test_a_record_that_ends_inside_a_cycle_loses_only_that_cycle():
    angle, torque = bench()

    fit = fitted(angle[:9_930], torque[:9_930])

    assert fit.n_samples == 9_900
    assert fit.parameter("stiffness").value == pytest.approx(K, rel=1e-10)


def noise(seed, sd, share):
    white = np.random.default_rng(seed).standard_normal(TIME.size)
    return sd * np.sqrt(1 - share**2) * lfilter([1.0], [1.0, -share], white)


def test_intervals_cover_under_noise_of_torque_and_angle():
    angle, torque = bench()
    fits = [
        fitted(angle + noise(seed, 5e-4, 0.0), torque + noise(100 + seed, 0.3, 0.9))
        for seed in range(40)
    ]

    for name, truth in (("stiffness", K), ("damping", B)):
        found = [fit.parameter(name) for fit in fits]
        # 95 % of 40 is 38; 34 or fewer has a probability of 2 % at 95 %.
        assert sum(p.ci_low <= truth <= p.ci_high for p in found) >= 35
        values = [p.unbounded if p.value is None else p.value for p in found]
        spread = np.std(values, ddof=1)
        assert abs(np.mean(values) - truth) < 3 * spread / np.sqrt(40)
        width = np.mean([p.ci_high - p.ci_low for p in found]) / (2 * 2.1)
        assert width == pytest.approx(spread, rel=0.3)


def test_a_dither_below_the_noise_is_refused():
    angle, torque = bench(amplitude=1e-5)

    with pytest.raises(EstimationError) as refused:
        fitted(angle + noise(1, 1e-3, 0.0), torque)

    assert refused.value.code == "not_coherent"


def test_a_dead_sensor_is_refused():
    angle, torque = bench()

    with pytest.raises(EstimationError) as refused:
        fitted(np.zeros(angle.size), torque)

    assert refused.value.code == "constant_angle"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"frequency_hz": 260.0}, "250 Hz"),
        ({"frequency_hz": 0.1}, "0.1 Hz"),
        ({"inertia": -1.0}, "inertia"),
        ({"ci_level": 0.0}, "ci_level"),
    ],
)
def test_settings_out_of_range_are_refused(options, message):
    with pytest.raises(DataError, match=message):
        fitted(*bench(), **options)
