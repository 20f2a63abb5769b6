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

    Parameters
    ----------
    value, slope, curvature : (m, n) float
        One row a function, one column a sample; times the step, so that a product with
        samples is an integral. Slope in 1/s, curvature in 1/s^2 of the value.
    """

    __test__ = False  # not a test of pytest's

    value: np.ndarray
    slope: np.ndarray
    curvature: np.ndarray


def bumps(n_samples: int, *, step_s: float) -> TestFunctions:
    """Return an orthonormal set of test functions, from bumps ``(1 - s^2)^6`` of five widths.

    Parameters
    ----------
    n_samples : int
        Length of the window.
    step_s : float
        Time between samples.

    Returns
    -------
    TestFunctions
        The directions that the bumps span; values are orthonormal rows times the step.

    Raises
    ------
    ValueError
        For a window of fewer than 26 samples.

    Notes
    -----
    Bumps that the samples are too coarse for are left out. Orthonormal by singular values, as
    D. A. Messenger and D. M. Bortz, "Weak SINDy: Galerkin-based data-driven model selection",
    Multiscale Model. Simul. 19 (2021) 1474, doi:10.1137/20M1343166. Sums over samples are
    integrals to the order of the power.

    Examples
    --------
    >>> functions = bumps(100, step_s=0.001)
    >>> moved = functions.slope @ (0.001 * np.arange(100.0))  # of a ramp of slope one, by parts
    >>> bool(np.allclose(moved, -functions.value.sum(axis=1), atol=1e-6))
    True
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

    Parameters
    ----------
    angle, torque : (..., n) float
        As sampled; rad, N*m.
    functions : TestFunctions
        Of the same window.

    Returns
    -------
    regressors : (..., m, 3) float
        What K, B and J are multiplied by.
    integrated : (..., m) float
        What they should add up to.

    Raises
    ------
    ValueError
        When the samples are not those of the functions.
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

    Parameters
    ----------
    kbj : (3,) float
        K, B, J: noise of the angle comes in through them.
    functions : TestFunctions
        The test functions.
    noise_sd : (float, float)
        Sd of the white noise of angle (rad) and torque (N*m).

    Returns
    -------
    (m, m) float
        Its product with a residual has unit covariance.

    Raises
    ------
    ValueError
        When there is no noise at all, or less than none.

    Notes
    -----
    D. M. Bortz, D. A. Messenger and V. Dukic, "Direct estimation of parameters in ODE models
    using WENDy", Bull. Math. Biol. 85 (2023) 110, doi:10.1007/s11538-023-01208-6.
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

    Parameters
    ----------
    angle, torque : (n,) float
        As sampled; rad, N*m.
    functions : TestFunctions
        Of the same window.
    noise_sd : (float, float)
        Sd of the white noise of angle (rad) and torque (N*m).

    Returns
    -------
    (m, m) float
        See :func:`whitening`, at K, B, J of four reweighted passes.
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

    Parameters
    ----------
    angles, torques : (R, n) float
        As sampled; rad, N*m.
    functions : TestFunctions
        Of the same window.
    whitener : (m, m) float
        As :func:`weak_fit` returns it.
    angle_sd : float, rad
        Sd of the white noise of the angles.

    Returns
    -------
    gram : (R, 3, 3) float
        Products of the whitened regressors, minus what is expected of their noise: without
        that, noise would pull K, B and J towards zero (W. A. Fuller, Measurement Error Models,
        1987, section 2.2).
    moment : (R, 3) float
        Their products with the whitened torque.
    """
    X, y = weak_system(angles, torques, functions)
    X, y = whitener @ X, y @ whitener.T
    rows = (functions.value, -functions.slope, functions.curvature)
    noise = angle_sd * np.stack([(whitener @ row).ravel() for row in rows])
    gram = X.transpose(0, 2, 1) @ X - noise @ noise.T
    return gram, np.einsum("rmi,rm->ri", X, y)
