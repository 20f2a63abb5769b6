"""The equation of a second-order joint, integrated against smooth test functions.

``integral(phi * torque) = K * integral(phi * angle) - B * integral(phi' * angle) +
J * integral(phi'' * angle)`` for every ``phi`` that vanishes with its slope at the ends of its
support: integration by parts moves the derivatives from the data to ``phi``, which is known.
"""

from dataclasses import dataclass

import numpy as np

#: Exponent of the bumps: smooth enough for sums of samples to be integrals.
_POWER = 6
#: Supports, as shares of the window, and how many fit side by side in half a support.
_SUPPORTS = (0.2, 0.3, 0.45, 0.65, 1.0)
_PER_HALF_SUPPORT = 4
#: Half a support in samples at least: sums over the curvature are then integrals to 3e-4, at
#: half of that to 1 %, at a quarter to 20 %.
_LEAST_HALF = 8.0
#: Directions that carry less than this share of the strongest one are the others' rounding.
_LEAST_SHARE = 1e-2
#: The two widest supports then hold enough samples: too few directions are left otherwise.
FEWEST_SAMPLES = 26
_PASSES = 4


@dataclass(frozen=True, slots=True)
class TestFunctions:
    """Smooth functions on a window that are zero, with their slopes, at its ends.

    (m, n), a row for each function, a column for each sample. ``value``: values; ``slope``: first
    derivatives, 1/s; ``curvature``: second derivatives, 1/s^2. All are multiplied by the step (s),
    so that the product with samples is an integral.
    """

    __test__ = False  # not a test of pytest's

    value: np.ndarray
    slope: np.ndarray
    curvature: np.ndarray


def bumps(n_samples: int, *, step_s: float) -> TestFunctions:
    """Return an orthonormal set of test functions, from bumps ``(1 - s^2)^6`` of five widths.

    Returns the directions that the bumps span, orthonormal by singular values, as Messenger and
    Bortz 2021, Multiscale Model. Simul. 19, 1474, doi:10.1137/20M1343166. Bumps that the samples
    are too coarse for are left out; a window has at least 26 samples.
    """
    if n_samples < FEWEST_SAMPLES:
        raise ValueError(
            f"bumps: expected a window of at least {FEWEST_SAMPLES} samples, got {n_samples}. "
            "Take a longer window or record faster."
        )
    last = n_samples - 1
    rows = []
    for support in _SUPPORTS:
        half = 0.5 * support * last
        if half < _LEAST_HALF:
            continue
        count = 1 + max(0, round((last - 2 * half) / half * _PER_HALF_SUPPORT))
        rows += [_bump(n_samples, c, half) for c in np.linspace(half, last - half, count)]
    value, slope, curvature = np.array(rows).transpose(1, 0, 2)
    left, singular, _ = np.linalg.svd(value, full_matrices=False)
    kept = singular > _LEAST_SHARE * singular[0]
    mix = left[:, kept].T / singular[kept, None]
    return TestFunctions(mix @ value * step_s, mix @ slope, mix @ curvature / step_s)


def _bump(n: int, centre: float, half: float) -> np.ndarray:
    """Return (3, n): a bump, its first and its second derivative by the sample number."""
    s = (np.arange(n) - centre) / half
    inside = np.maximum(1.0 - s**2, 0.0)
    slope = -2.0 * _POWER * s * inside ** (_POWER - 1) / half
    curvature = 4.0 * _POWER * (_POWER - 1) * s**2 * inside ** (_POWER - 2)
    curvature -= 2.0 * _POWER * inside ** (_POWER - 1)
    return np.stack([inside**_POWER, slope, curvature / half**2])


def weak_system(
    angle: np.ndarray, torque: np.ndarray, functions: TestFunctions
) -> tuple[np.ndarray, np.ndarray]:
    """Return regressors and torque of the integrated equation.

    ``angle`` rad, ``torque`` N*m (..., n). Returns ``regressors`` (..., m, 3), what K, B and J are
    multiplied by, and ``integrated`` (..., m), what they should add up to.
    """
    n = functions.value.shape[1]
    if angle.shape != torque.shape or angle.shape[-1] != n:
        raise ValueError(
            f"weak_system: expected angle and torque of {n} samples, got {angle.shape} and "
            f"{torque.shape}. Cut the window that the functions were made for."
        )
    rows = (functions.value, -functions.slope, functions.curvature)
    return np.stack([angle @ row.T for row in rows], axis=-1), np.asarray(
        torque @ functions.value.T
    )


def whitening(
    kbj: np.ndarray, functions: TestFunctions, *, noise_sd: tuple[float, float]
) -> np.ndarray:
    """Return the matrix that makes the noise of the integrated equation white.

    ``kbj`` (3,): noise of the angle comes in through them; ``noise_sd``: of the white noise of
    angle (rad) and torque (N*m). Returns (m, m): its product with a residual has unit covariance.
    Bortz, Messenger and Dukic 2023, Bull. Math. Biol. 85, 110, doi:10.1007/s11538-023-01208-6.
    """
    if min(noise_sd) < 0.0 or max(noise_sd) <= 0.0:
        raise ValueError(f"whitening: expected noise >= 0, one of it > 0, got {noise_sd}.")
    K, B, J = kbj
    through = K * functions.value - B * functions.slope + J * functions.curvature
    parts = np.hstack([noise_sd[0] * through, noise_sd[1] * functions.value])
    left, singular, _ = np.linalg.svd(parts, full_matrices=False)
    floor = max(float(singular[0]) * 1e-9, np.finfo(float).tiny)
    return np.asarray(left.T / np.maximum(singular, floor)[:, None])


def weak_fit(
    angle: np.ndarray,
    torque: np.ndarray,
    functions: TestFunctions,
    *,
    noise_sd: tuple[float, float],
) -> np.ndarray:
    """Return the whitening of the generalised least squares fit to one average.

    ``angle`` rad, ``torque`` N*m (n,); ``noise_sd`` of both. Returns (m, m): :func:`whitening` at
    K, B, J of four reweighted passes.
    """
    X, y = weak_system(angle, torque, functions)
    size = np.linalg.norm(X, axis=0)
    size[size == 0.0] = 1.0
    kbj = np.linalg.lstsq(X / size, y, rcond=None)[0] / size
    for _ in range(_PASSES):
        whitener = whitening(kbj, functions, noise_sd=noise_sd)
        kbj = np.linalg.lstsq(whitener @ X / size, whitener @ y, rcond=None)[0] / size
    return whitening(kbj, functions, noise_sd=noise_sd)


def weak_equations(
    angles: np.ndarray,
    torques: np.ndarray,
    functions: TestFunctions,
    whitener: np.ndarray,
    *,
    angle_sd: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the normal equations of averages, what noise of the angle adds taken out.

    ``angles`` rad, ``torques`` N*m (R, n); ``whitener`` (m, m): of :func:`weak_fit`. Returns
    ``gram`` (R, 3, 3), minus what is expected of the regressors' noise, which would pull K, B and J
    towards zero (Fuller 1987, Measurement Error Models, section 2.2), and ``moment`` (R, 3).
    """
    X, y = weak_system(angles, torques, functions)
    X, y = whitener @ X, y @ whitener.T
    rows = (functions.value, -functions.slope, functions.curvature)
    noise = angle_sd * np.stack([(whitener @ row).ravel() for row in rows])
    gram = X.transpose(0, 2, 1) @ X - noise @ noise.T
    return gram, np.einsum("rmi,rm->ri", X, y)
