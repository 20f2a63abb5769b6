"""The knee of a simulated walker: its motion, its impedance over the cycle, its response.

The simulation's own physics. It shares nothing with :mod:`jointz.identify`, so
that each can show the other's errors.
"""

import math
from collections.abc import Mapping

import numpy as np
from numba import njit
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from jointz.core.errors import DataError
from jointz.core.gait_phases import TIMING_POINTS

#: Fourier series of a normal knee, degrees of flexion: 18 in loading response, 62 in swing.
_KNEE_COSINES = (22.57, -3.43, -13.75, -0.29, -0.29, -0.15, 0.08)
_KNEE_SINES = (0.0, -20.23, 8.60, 4.65, 0.62, 0.45, 0.10)

# K and B stand still around each timing point so that the truth of a cell is a number.
_FLAT_BEFORE_PCT = 0.5
FLAT_AFTER_PCT = 11.0

#: Below this size of (system matrix x step) the series of 11 terms is exact to 1e-16.
_SERIES_LIMIT = 0.1
_SERIES_TERMS = 11
#: Below this (mu x step)^2 the two eigenvalues are too close to subtract.
_NEAR_CRITICAL = 1e-3


def knee_angle(cycles: np.ndarray) -> np.ndarray:
    """Return the mean unperturbed knee angle.

    Parameters
    ----------
    cycles : (n,) float
        Gait phase in cycles; whole numbers are heel strikes.

    Returns
    -------
    (n,) float, rad
        Knee flexion.

    Examples
    --------
    >>> np.degrees(knee_angle(np.array([0.0, 0.135, 0.39, 0.722]))).round()
    array([ 5., 18.,  5., 62.])
    """
    turn = np.exp(2j * np.pi * cycles)
    series = np.zeros(turn.shape, dtype=complex)
    for cosine, sine in zip(_KNEE_COSINES[::-1], _KNEE_SINES[::-1], strict=True):
        series *= turn
        series += complex(cosine, -sine)
    return np.asarray(np.radians(series.real), dtype=float)


def impedance_curve(per_point: Mapping[str, float], cycles: np.ndarray) -> np.ndarray:
    """Interpolate values at the timing points over the gait cycle.

    The curve is constant from 0.5 % before each timing point to 11 % after it
    (the next may begin 12.5 % later), with smooth monotone transitions between.

    Parameters
    ----------
    per_point : mapping of str to float
        Timing point -> value.
    cycles : (n,) float
        Gait phase in cycles.

    Returns
    -------
    (n,) float
        Values, periodic in phase.
    """
    flats = [(at - _FLAT_BEFORE_PCT, at + FLAT_AFTER_PCT) for at in TIMING_POINTS.values()]
    values = np.repeat([per_point[name] for name in TIMING_POINTS], 2)
    knots = np.ravel(flats) / 100.0
    turns = np.concatenate([knots - 1.0, knots, knots + 1.0])
    curve = PchipInterpolator(turns, np.tile(values, 3))
    return np.asarray(curve(np.mod(cycles, 1.0)), dtype=float)


def respond(
    torque: np.ndarray,
    stiffness: ArrayLike,
    damping: ArrayLike,
    inertia: ArrayLike,
    *,
    rate_hz: float,
    substeps: int = 4,
) -> tuple[np.ndarray, np.ndarray]:
    r"""Compute how a joint at rest moves away from its path under a torque.

    Solves :math:`J \ddot x + B \dot x + K x = \tau` (equation 1.5) with K, B
    and J given over time. The physics takes ``substeps`` steps from one sample
    to the next. Over a step torque, K, B and J are held at their values in the
    middle of the step, read off the straight line between the two samples, and
    the step itself is exact (matrix exponential). A sample of torque is thus
    the mean of the hold before and the hold after it: record and physics have
    no lag between them.

    Parameters
    ----------
    torque : (n,) float, N*m
        Torque on the joint, at the samples.
    stiffness : float or (n,) float, N*m/rad
        K; may be zero or negative.
    damping : float or (n,) float, N*m*s/rad
        B.
    inertia : float or (n,) float, kg*m^2
        J, positive.
    rate_hz : float
        Sample rate.
    substeps : int
        Steps of the physics to a sample.

    Returns
    -------
    angle : (n,) float, rad
        Deviation from the path; zero at the first sample.
    velocity : (n,) float, rad/s
        Its rate.

    Raises
    ------
    DataError
        When shapes differ, a value is not finite, J is not positive, or the
        rate or the number of substeps is not positive.

    Notes
    -----
    With a = K/J and :math:`2\sigma = B/J`, the step's matrix follows from its
    entry :math:`\varphi(h)`, the velocity-to-angle response, and its integral
    :math:`I(h)`: :math:`\Phi = [[1 - a I, \varphi], [-a \varphi, 1 - a I -
    2\sigma\varphi]]`, and the held torque adds :math:`[I, \varphi]\,\tau/J`.

    Examples
    --------
    A torque that stays moves the joint by torque / stiffness in the end:

    >>> angle, _ = respond(np.full(2000, 10.0), 50.0, 2.0, 0.05, rate_hz=1000.0)
    >>> round(float(angle[-1]), 6)
    0.2
    """
    tau = np.ascontiguousarray(torque, dtype=float)
    if tau.ndim != 1:
        raise DataError(f"respond: torque must have one dimension, got shape {tau.shape}.")
    K, B, J = (
        _along(values, tau.size, name=name)
        for name, values in (("stiffness", stiffness), ("damping", damping), ("inertia", inertia))
    )
    if not np.isfinite(tau).all():
        raise DataError("respond: torque must be finite. Fill or cut missing samples.")
    if not (J > 0).all():
        raise DataError(f"respond: inertia must be positive (kg*m^2), got {J.min():g}.")
    if not rate_hz > 0 or substeps < 1:
        raise DataError(
            f"respond: expected rate_hz > 0 and substeps >= 1, got {rate_hz} and {substeps}."
        )
    angle, velocity = np.zeros(tau.size), np.zeros(tau.size)
    _walk(tau, K, B, J, 1.0 / (rate_hz * substeps), substeps, angle, velocity)
    return angle, velocity


def _along(values: ArrayLike, n: int, *, name: str) -> np.ndarray:
    array = np.asarray(values, dtype=float)
    if array.shape not in ((), (n,)):
        raise DataError(
            f"respond: {name} must be one number or one per sample ({n}), got shape {array.shape}."
        )
    if not np.isfinite(array).all():
        raise DataError(f"respond: {name} must be finite. Fill or cut missing samples.")
    return np.full(n, array) if array.ndim == 0 else np.ascontiguousarray(array)


@njit(cache=True, nogil=True)
def _series(a: float, two_sigma: float, h: float) -> tuple[float, float]:
    """Return phi and I of a step that is short beside the joint's own times."""
    before, term = 0.0, h
    phi, integral = 0.0, 0.0
    for n in range(1, _SERIES_TERMS + 1):
        phi += term
        integral += term * h / (n + 1)
        before, term = term, -(two_sigma * term + a * before * h / n) * h / (n + 1)
    return phi, integral


@njit(cache=True, nogil=True)
def _modes(a: float, two_sigma: float, h: float) -> tuple[float, float]:
    """Return phi and I of a step of any length, from the eigenvalues."""
    sigma = 0.5 * two_sigma
    q = (sigma * sigma - a) * h * h
    if q > _NEAR_CRITICAL:
        # The slow eigenvalue as a quotient: -sigma + mu loses its digits when a is small.
        mu = math.sqrt(q) / h
        if sigma >= 0.0:
            fast = -(sigma + mu)
            slow = a / fast
        else:
            slow = mu - sigma
            fast = a / slow
        phi = (math.exp(slow * h) - math.exp(fast * h)) / (2.0 * mu)
        return phi, (_growth(slow, h) - _growth(fast, h)) / (2.0 * mu)
    decay = math.exp(-sigma * h)
    if q < -_NEAR_CRITICAL:
        omega = math.sqrt(-q) / h
        cosine, sine = math.cos(omega * h), math.sin(omega * h) / omega
    else:
        cosine = 1.0 + q / 2.0 * (1.0 + q / 12.0 * (1.0 + q / 30.0))
        sine = h * (1.0 + q / 6.0 * (1.0 + q / 20.0 * (1.0 + q / 42.0)))
    return decay * sine, (1.0 - decay * (cosine + sigma * sine)) / a


@njit(cache=True, nogil=True)
def _growth(eigenvalue: float, h: float) -> float:
    """Integrate exp(eigenvalue * s) over a step."""
    return h if eigenvalue == 0.0 else math.expm1(eigenvalue * h) / eigenvalue


@njit(cache=True, nogil=True)
def _step(a: float, two_sigma: float, h: float) -> tuple[float, float]:
    """Return phi and I of a step, by whichever form keeps all digits."""
    if abs(a) * h * h + abs(two_sigma) * h < _SERIES_LIMIT:
        return _series(a, two_sigma, h)
    return _modes(a, two_sigma, h)


@njit(cache=True, nogil=True)
def _walk(
    torque: np.ndarray,
    stiffness: np.ndarray,
    damping: np.ndarray,
    inertia: np.ndarray,
    h: float,
    substeps: int,
    angle: np.ndarray,
    velocity: np.ndarray,
) -> None:
    """Fill ``angle`` and ``velocity`` from their first sample on."""
    x, v = angle[0], velocity[0]
    held_K, held_B, held_J = math.nan, math.nan, math.nan
    a = two_sigma = phi = integral = 0.0
    for i in range(1, torque.size):
        for s in range(substeps):
            share = (s + 0.5) / substeps
            K = stiffness[i - 1] + share * (stiffness[i] - stiffness[i - 1])
            B = damping[i - 1] + share * (damping[i] - damping[i - 1])
            J = inertia[i - 1] + share * (inertia[i] - inertia[i - 1])
            if held_K != K or held_B != B or held_J != J:
                held_K, held_B, held_J = K, B, J
                a, two_sigma = K / J, B / J
                phi, integral = _step(a, two_sigma, h)
            drive = (torque[i - 1] + share * (torque[i] - torque[i - 1])) / J
            stay = 1.0 - a * integral
            x, v = (
                stay * x + phi * v + integral * drive,
                -a * phi * x + (stay - two_sigma * phi) * v + phi * drive,
            )
        angle[i] = x
        velocity[i] = v
