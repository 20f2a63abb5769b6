"""K, B, J of ``--model frf`` and ``--model irf`` beside the Cramer-Rao bound.

The record of the issue: K 80, B 1.2, J 0.03; torque of 4 N*m RMS below 30 Hz (third order), 30 s
at 1 kHz; white sensor noise of 0.33 N*m and 1 mrad. The truth is stepped by the exact matrix
exponential for a torque linear between samples of 10 kHz, so that at 1 kHz it is continuous.
"""

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import butter, lfilter, sosfilt

from jointz.identify.record.joint import identify_joint

RATE, FINE = 1000.0, 10
SECONDS, LEAD_S = 30.0, 3.0
KBJ = np.array([80.0, 1.2, 0.03])
TORQUE_NOISE, ANGLE_NOISE = 0.33, 1e-3
MODELS = ("frf", "irf")


def low_passed(rng: np.random.Generator, n: int, *, cutoff_hz: float, rms: float) -> np.ndarray:
    white = rng.standard_normal(n)
    x = sosfilt(butter(3, cutoff_hz, fs=RATE * FINE, output="sos"), white)
    return x * (rms / x.std())


def joint_angle(torque: np.ndarray) -> np.ndarray:
    """Angle of the joint at rest at first, exact for a torque linear between samples."""
    K, B, J = KBJ
    step = 1.0 / (RATE * FINE)
    system = np.zeros((4, 4))
    system[0, 1] = step
    system[1, :3] = -K / J * step, -B / J * step, step / J
    system[2, 3] = 1.0
    E = expm(system)
    now, after = E[:2, 2] - E[:2, 3], E[:2, 3]
    numerator = [
        after[0],
        now[0] - E[1, 1] * after[0] + E[0, 1] * after[1],
        E[0, 1] * now[1] - E[1, 1] * now[0],
    ]
    return lfilter(numerator, [1.0, -np.trace(E[:2, :2]), np.linalg.det(E[:2, :2])], torque)


def make_record(
    seed: int, *, muscle: float = 0.0, torque_noise: float = TORQUE_NOISE
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return what sensors see, and the true torque of the device."""
    rng = np.random.default_rng(seed)
    n = int((SECONDS + LEAD_S) * RATE * FINE)
    torque = low_passed(rng, n, cutoff_hz=30.0, rms=4.0)
    inside = low_passed(rng, n, cutoff_hz=2.0, rms=muscle) if muscle else 0.0
    angle = joint_angle(torque + inside)
    kept = slice(int(LEAD_S * RATE * FINE), None, FINE)
    torque, angle = torque[kept], angle[kept]
    seen = {
        "torque": torque + torque_noise * rng.standard_normal(torque.size),
        "angle": angle + ANGLE_NOISE * rng.standard_normal(angle.size),
    }
    return seen, torque


def cramer_rao_sd(torque: np.ndarray) -> np.ndarray:
    """Return the bound on the sd of K, B, J for errors of known power in both signals.

    The true torque is a fixed, unknown trajectory: at each frequency its two unknowns are
    profiled out, which leaves the error angle - G torque of power s_a^2 + |G|^2 s_t^2, and the
    information 2 |U|^2 Re(dG dG^*) / (s_a^2 + |G|^2 s_t^2). U is the spectrum of this torque.
    """
    n = torque.size
    s = 2j * np.pi * np.fft.rfftfreq(n, 1.0 / RATE)[1:]
    power = np.abs(np.fft.rfft(torque)[1:]) ** 2 / n
    G = 1.0 / (KBJ @ np.stack([np.ones_like(s), s, s**2]))
    slopes = -np.stack([G**2, s * G**2, s**2 * G**2])
    weight = 2.0 * power / (ANGLE_NOISE**2 + np.abs(G) ** 2 * TORQUE_NOISE**2)
    information = np.real((slopes * weight) @ slopes.conj().T)
    return np.sqrt(np.diag(np.linalg.inv(information)))


def calibrate(model: str, n_seeds: int) -> dict[str, Any]:
    values, bounds, held, vafs, warned = [], [], [], [], []
    for seed in range(n_seeds):
        seen, torque = make_record(seed)
        fit = identify_joint(**seen, rate_hz=RATE, model=model)
        values.append([p.value for p in fit.parameters])
        bounds.append(cramer_rao_sd(torque))
        held.append([p.ci_low < v < p.ci_high for p, v in zip(fit.parameters, KBJ, strict=True)])
        vafs.append(fit.vaf_pct)
        warned.append(fit.warnings)
    error = np.array(values) - KBJ
    return {
        "bias_pct": 100.0 * error.mean(axis=0) / KBJ,
        "bias_error_pct": 100.0 * error.std(axis=0) / KBJ / np.sqrt(n_seeds),
        "ratio": np.sqrt((error**2).mean(axis=0)) / np.mean(bounds, axis=0),
        "coverage": np.mean(held, axis=0),
        "vaf_pct": min(vafs),
        "warnings": set().union(*warned),
    }


def check(found: dict[str, Any], *, coverage: float, ratio: float) -> None:
    """Bias up to 0.05 % beyond two Monte-Carlo standard errors of its mean."""
    beyond = np.abs(found["bias_pct"]) - 2.0 * found["bias_error_pct"]
    assert np.all(beyond <= 0.05)
    assert np.all(found["ratio"] <= ratio)
    assert np.all(found["coverage"] >= coverage)
    assert found["vaf_pct"] >= 99.88
    assert found["warnings"] == set()


@pytest.mark.parametrize("model", MODELS)
def test_a_few_records_come_as_close_as_the_bound_allows(model):
    # Few records: a ratio of 1.3 is exceeded by chance now and then, 1.6 hardly.
    check(calibrate(model, 3), coverage=0.7, ratio=1.6)


@pytest.mark.slow
@pytest.mark.parametrize("model", MODELS)
def test_a_hundred_records_have_no_bias_and_the_error_of_the_bound(model):
    found = calibrate(model, 100)

    check(found, coverage=0.88, ratio=1.3)
    assert np.all(np.abs(found["bias_pct"]) <= 0.05)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("n_seeds", [3, pytest.param(100, marks=pytest.mark.slow)])
def test_torque_noise_of_half_the_torque_makes_no_bias(model, n_seeds):
    """2 N*m beside 4 N*m RMS: left in, it makes K and J 2 % too large."""
    errors, held, warned, refused = [], [], [], 0
    for seed in range(n_seeds):
        seen, _ = make_record(seed, torque_noise=2.0)
        fit = identify_joint(**seen, rate_hz=RATE, model=model)
        assert fit.settings["input_noise_sd"] == pytest.approx(2.0, rel=0.05)
        assert not any("cannot be told" in w for w in fit.warnings)
        warned.append(any("looks angle-perturbed" in w for w in fit.warnings))
        if fit.check.fails:  # a false alarm: one record in twenty at most
            refused += 1
            continue
        errors.append([p.value / v - 1.0 for p, v in zip(fit.parameters, KBJ, strict=True)])
        held.append([p.ci_low < v < p.ci_high for p, v in zip(fit.parameters, KBJ, strict=True)])

    mean = np.mean(errors, axis=0)
    # Beyond four standard errors nothing is left but the share of noise times itself.
    assert np.all(np.abs(mean) < 4.0 * np.std(errors, axis=0) / np.sqrt(n_seeds) + 0.0015)
    assert np.mean(held) >= 0.85
    assert refused <= 0.05 * n_seeds
    assert np.mean(warned) <= 0.05


@pytest.mark.parametrize("model", MODELS)
def test_noise_that_cannot_be_told_from_the_input_is_said(model):
    """At 200 Hz the signal reaches half the rate: K is 2 % too large, and no interval knows."""
    for seed in range(2):
        seen, _ = make_record(seed, torque_noise=1.0)
        thinned = {name: values[::5] for name, values in seen.items()}
        fit = identify_joint(**thinned, rate_hz=RATE / 5, model=model)

        (note,) = (w for w in fit.warnings if "noise of the torque cannot be told" in w)
        share_pct = float(note.split("up to ")[2].split(" %")[0])
        assert 0.0 < 100.0 * (fit.parameter("stiffness").value / KBJ[0] - 1.0) < share_pct
        assert fit.settings["input_noise_sd"] == 0.0
