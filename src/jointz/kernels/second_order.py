"""Likelihood of a second-order joint when angle and torque are both noisy.

Torque that is linear between samples moves a joint ``torque = K*angle + B*velocity +
J*acceleration`` so that, exactly, ``angle[k] + a1*angle[k-1] + a2*angle[k-2] = b0*torque[k] +
b1*torque[k-1] + b2*torque[k-2]``. With white noise in both records the left side minus the
right side is a moving average of known, banded covariance: its whitened sum of squares is the
errors-in-variables criterion, and costs a few microseconds for a pulse. A lag between samples is
an all-pass filter of first order (Thiran): linear interpolation would change the noise with the
lag, and the likelihood would follow the noise.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

#: Order of the parameters.
N_PARAMETERS = 5
_BAND = 3  # of the covariance: the recursion spans three samples
#: A joint that turns or decays by more than this in a sample cannot be seen in the record.
_FASTEST = 3.0
_TAYLOR_TERMS = 40
_DIFFERENCE = 1e-5
_PASSES = 60
_SMALL_STEP = 1e-7
_HOPELESS_DAMPING = 1e10
_RIDGE = 1e-14


@dataclass(frozen=True, slots=True)
class PulseRecord:
    """One stretch of angle and torque, evenly sampled.

    Parameters
    ----------
    angle : (n,) float, rad
        Angle from the first sample of the window.
    torque : (m,) float, N*m
        Torque record; the sample ``lead`` has the time of the first angle.
    lead : int
        Samples of torque before the first angle, to shift by a negative lag.
    step_s : float
        Time between samples.
    at_rest : bool
        Whether angle, velocity and torque are zero before the first sample.
    """

    angle: np.ndarray
    torque: np.ndarray
    lead: int
    step_s: float
    at_rest: bool


@dataclass(frozen=True, slots=True)
class LikelihoodFit:
    """Where the errors-in-variables likelihood is largest.

    Parameters
    ----------
    values : (5,) float
        K, B, J, lag in s, torque offset in N*m.
    covariance : (5, 5) float
        Inverse information; zero for what was held.
    chi_square : float
        Whitened sum of squares, prior included.
    n_residuals : int
        Residuals behind it, prior included.
    condition_number : float
        Of the scaled Jacobian of the free parameters.
    converged : bool
        Whether the steps became small.
    """

    values: np.ndarray
    covariance: np.ndarray
    chi_square: float
    n_residuals: int
    condition_number: float
    converged: bool


@njit(cache=True, nogil=True)
def transfer_coefficients(
    stiffness: float, damping: float, inertia: float, step_s: float
) -> np.ndarray:
    """Return a1, a2, b0, b1, b2 of the exact recursion from torque to angle.

    Parameters
    ----------
    stiffness, damping, inertia : float
        K in N*m/rad, B in N*m*s/rad, J in kg*m^2.
    step_s : float
        Time between samples.

    Returns
    -------
    (5,) float
        Of ``angle[k] + a1*angle[k-1] + a2*angle[k-2] = b0*torque[k] + b1*torque[k-1] +
        b2*torque[k-2]``; b in rad/(N*m).

    Notes
    -----
    First-order hold: exact for torque that is linear between samples. The matrix
    exponential and its two integrals are summed as Taylor series in units of one
    sample, where the matrix is small.

    Examples
    --------
    At rest the angle is torque over stiffness:

    >>> a1, a2, b0, b1, b2 = transfer_coefficients(50.0, 1.0, 0.02, 0.001)
    >>> float(round((b0 + b1 + b2) / (1.0 + a1 + a2) * 50.0, 6))
    1.0
    """
    k = stiffness * step_s**2 / inertia
    b = damping * step_s / inertia
    # Row by row: power of the matrix over i!, and the sums over i!, (i+1)!, (i+2)!.
    p00, p01, p10, p11 = 1.0, 0.0, 0.0, 1.0
    e00, e01, e10, e11 = 0.0, 0.0, 0.0, 0.0
    f01, f11, g01, g11 = 0.0, 0.0, 0.0, 0.0
    for i in range(_TAYLOR_TERMS):
        e00, e01, e10, e11 = e00 + p00, e01 + p01, e10 + p10, e11 + p11
        f01, f11 = f01 + p01 / (i + 1), f11 + p11 / (i + 1)
        g01, g11 = g01 + p01 / ((i + 1) * (i + 2)), g11 + p11 / ((i + 1) * (i + 2))
        q00, q01 = -k * p01, p00 - b * p01
        q10, q11 = -k * p11, p10 - b * p11
        p00, p01, p10, p11 = q00 / (i + 1), q01 / (i + 1), q10 / (i + 1), q11 / (i + 1)
    gain = step_s**2 / inertia
    late0, late1 = gain * g01, gain * g11
    early0, early1 = gain * f01 - late0, gain * f11 - late1
    out = np.empty(5)
    out[0] = -(e00 + e11)
    out[1] = e00 * e11 - e01 * e10
    out[2] = late0
    out[3] = early0 - e11 * late0 + e01 * late1
    out[4] = -e11 * early0 + e01 * early1
    return out


@njit(cache=True, nogil=True)
def _whiten(residual: np.ndarray, band: np.ndarray) -> bool:
    """Solve L w = residual in place, L the Cholesky factor of the banded covariance."""
    n = residual.size
    for k in range(n):
        for m in range(min(k, _BAND - 1), -1, -1):
            total = band[k, m]
            for s in range(m + 1, min(k, _BAND - 1) + 1):
                total -= band[k, s] * band[k - m, s - m]
            if m > 0:
                band[k, m] = total / band[k - m, 0]
            elif total <= 0.0:
                return False
            else:
                band[k, 0] = np.sqrt(total)
        value = residual[k]
        for m in range(1, min(k, _BAND - 1) + 1):
            value -= band[k, m] * residual[k - m]
        residual[k] = value / band[k, 0]
    return True


@njit(cache=True, nogil=True)
def _delayed(torque: np.ndarray, samples: float) -> np.ndarray:
    """Return the torque delayed by 0.5 to 1.5 samples, its noise as white as it was."""
    d = (1.0 - samples) / (1.0 + samples)
    out = np.empty(torque.size)
    out[0] = torque[0]
    for i in range(1, torque.size):
        out[i] = d * (torque[i] - out[i - 1]) + torque[i - 1]
    return out


@njit(cache=True, nogil=True)
def _recursion_error(
    angle: np.ndarray, torque: np.ndarray, taps: np.ndarray, first: int
) -> np.ndarray:
    """Return the recursion's left minus right side, samples before the window being zero."""
    out = np.zeros(angle.size - first)
    for k in range(first, angle.size):
        for i in range(min(k, _BAND - 1) + 1):
            out[k - first] += taps[0, i] * angle[k - i] - taps[1, i] * torque[k - i]
    return out


@njit(cache=True, nogil=True)
def _covariance_band(
    n: int, first: int, taps: np.ndarray, variances: tuple[float, float]
) -> np.ndarray:
    """Return (n - first, 3): covariance of a row with itself and the two before it."""
    band = np.zeros((n - first, _BAND))
    for k in range(first, n):
        if k > first + _BAND and k > _BAND:  # from here on every row is the same
            band[k - first] = band[k - first - 1]
            continue
        for m in range(min(k - first, _BAND - 1) + 1):
            angle_part, torque_part = 0.0, 0.0
            for i in range(min(k - m, _BAND - 1 - m) + 1):
                angle_part += taps[0, i] * taps[0, i + m]
                torque_part += taps[1, i] * taps[1, i + m]
            band[k - first, m] = variances[0] * angle_part + variances[1] * torque_part
    return band


@njit(cache=True, nogil=True)
def _residual(
    p: np.ndarray,
    angle: np.ndarray,
    torque: np.ndarray,
    fixed: tuple[int, float, bool, float, float, float, float],
) -> np.ndarray:
    """Return whitened residuals and the prior's; empty where the parameters are impossible."""
    lead, step_s, at_rest, angle_sd, torque_sd, prior_lag, prior_sd = fixed
    nothing = np.empty(0)
    K, B, J = np.exp(p[0]), p[1], np.exp(p[2])
    if K * step_s**2 / J > _FASTEST or abs(B) * step_s / J > _FASTEST:
        return nothing
    shift = lead + p[3] / step_s
    whole = int(np.floor(shift + 1.5))
    n = angle.size
    if whole < 1 or whole + n > torque.size:
        return nothing
    ab = transfer_coefficients(K, B, J, step_s)
    taps = np.zeros((2, _BAND))
    taps[0, 0], taps[0, 1:], taps[1] = 1.0, ab[:2], ab[2:]
    first = 0 if at_rest else _BAND - 1
    out = np.empty(n - first + 1)
    seen = _delayed(torque, whole - shift)[whole:]
    error = _recursion_error(angle, seen, taps, first)
    error += p[4] * np.sum(taps[1])
    band = _covariance_band(n, first, taps, (angle_sd**2, torque_sd**2))
    if not _whiten(error, band):
        return nothing
    out[:-1] = error
    out[-1] = (p[3] - prior_lag) / prior_sd if prior_sd > 0.0 else 0.0
    return out


@njit(cache=True, nogil=True)
def _jacobian(
    p: np.ndarray,
    scale: np.ndarray,
    angle: np.ndarray,
    torque: np.ndarray,
    fixed: tuple[int, float, bool, float, float, float, float],
) -> np.ndarray:
    """Return the Jacobian in units of ``scale`` by central differences; scale 0 is held."""
    n = angle.size + 1 if fixed[2] else angle.size + 2 - _BAND
    out = np.zeros((n, p.size))
    for i in range(p.size):
        if scale[i] == 0.0:
            continue
        high, low = p.copy(), p.copy()
        high[i] += _DIFFERENCE * scale[i]
        low[i] -= _DIFFERENCE * scale[i]
        above = _residual(high, angle, torque, fixed)
        below = _residual(low, angle, torque, fixed)
        if above.size == n and below.size == n:
            out[:, i] = (above - below) / (2.0 * _DIFFERENCE)
    return out


@njit(cache=True, nogil=True)
def _minimise(
    start: np.ndarray,
    scale: np.ndarray,
    angle: np.ndarray,
    torque: np.ndarray,
    fixed: tuple[int, float, bool, float, float, float, float],
) -> tuple[np.ndarray, bool]:
    """Levenberg and Marquardt, with the diagonal of the information as the damping."""
    p = start.copy()
    residual = _residual(p, angle, torque, fixed)
    damping = 1e-3
    if residual.size == 0:
        return p, False
    cost = residual @ residual
    for _ in range(_PASSES):
        jacobian = _jacobian(p, scale, angle, torque, fixed)
        information = jacobian.T @ jacobian
        floor = _RIDGE * np.max(np.diag(information))
        if not np.isfinite(floor) or floor == 0.0:
            return p, False
        gradient = jacobian.T @ residual
        while damping < _HOPELESS_DAMPING:
            damped = information.copy()
            for i in range(p.size):
                damped[i, i] = damped[i, i] * (1.0 + damping) + floor if scale[i] > 0.0 else 1.0
            move = np.linalg.solve(damped, -gradient)
            trial = p + move * scale
            found = _residual(trial, angle, torque, fixed)
            if found.size and found @ found <= cost:
                p, residual, cost = trial, found, found @ found
                damping *= 0.1
                break
            damping *= 10.0
        else:
            return p, False
        if np.max(np.abs(move)) < _SMALL_STEP:
            return p, True
    return p, False


def maximise_likelihood(
    record: PulseRecord,
    start: np.ndarray,
    *,
    noise_sd: tuple[float, float],
    lag_prior: tuple[float, float] | None,
) -> LikelihoodFit:
    """Return K, B, J, lag and offset of largest errors-in-variables likelihood.

    Parameters
    ----------
    record : PulseRecord
        Angle and torque.
    start : (5,) float
        K, B, J, lag in s, torque offset in N*m to start from; K, J > 0.
    noise_sd : tuple of float
        Sd of the white noise of angle (rad) and torque (N*m); one may be zero.
    lag_prior : tuple of float or None
        Value and sd of the lag in s; None: nothing is known. An sd of zero holds the lag.

    Returns
    -------
    LikelihoodFit
        Values and their covariance.

    Raises
    ------
    ValueError
        When shapes, noise or start make no sense.

    Notes
    -----
    The true torque of every sample is unknown and profiled out (functional
    errors in variables): no bias from noise in either record. The offset is
    zero for a record at rest; otherwise initial state and offset are free. K and
    J are kept positive through their logarithms, B is not bounded.
    """
    _check(record, start, noise_sd)
    free_lag = lag_prior is None or lag_prior[1] > 0.0
    scale = np.array(
        [1.0, np.sqrt(start[0] * start[2]), 1.0, 1e-3 * free_lag, float(not record.at_rest)]
    )
    angle, torque = record.angle, record.torque
    prior = (0.0, 0.0) if lag_prior is None else lag_prior
    fixed = (record.lead, record.step_s, record.at_rest, *noise_sd, *prior)
    p = np.array([np.log(start[0]), start[1], np.log(start[2]), start[3], start[4]])
    p, converged = _minimise(p, scale, angle, torque, fixed)
    residual = _residual(p, angle, torque, fixed)
    jacobian = _jacobian(p, scale, angle, torque, fixed)
    free = np.flatnonzero(scale)
    covariance, condition = _inverse_information(jacobian[:, free])
    values = np.array([np.exp(p[0]), p[1], np.exp(p[2]), p[3], p[4]])
    unit = scale * np.array([values[0], 1.0, values[2], 1.0, 1.0])
    full = np.zeros((N_PARAMETERS, N_PARAMETERS))
    full[np.ix_(free, free)] = covariance * np.outer(unit[free], unit[free])
    return LikelihoodFit(
        values=values,
        covariance=full,
        chi_square=float(residual @ residual) if residual.size else np.inf,
        n_residuals=jacobian.shape[0] - int(prior[1] == 0.0),
        condition_number=condition,
        converged=bool(converged),
    )


def _check(record: PulseRecord, start: np.ndarray, noise_sd: tuple[float, float]) -> None:
    if record.angle.ndim != 1 or record.torque.ndim != 1 or record.angle.size < 10:
        raise ValueError("maximise_likelihood: expected 1-d angle and torque of 10 samples or more")
    if start.shape != (N_PARAMETERS,) or not (start[0] > 0 and start[2] > 0):
        raise ValueError(f"maximise_likelihood: expected 5 start values, K and J > 0, got {start}")
    if min(noise_sd) < 0 or max(noise_sd) <= 0:
        raise ValueError(f"maximise_likelihood: noise must be >= 0, one of it > 0, got {noise_sd}")


def _inverse_information(jacobian: np.ndarray) -> tuple[np.ndarray, float]:
    """Return covariance and condition number; the columns are scaled to length one."""
    size = np.linalg.norm(jacobian, axis=0)
    n = size.size
    if not np.all(np.isfinite(size)) or size.min() == 0.0:
        return np.full((n, n), np.inf), np.inf
    _, singular, right = np.linalg.svd(jacobian / size, full_matrices=False)
    if singular[-1] < 1e-12 * singular[0]:
        return np.full((n, n), np.inf), np.inf
    half = right.T / singular / size[:, None]
    return half @ half.T, float(singular[0] / singular[-1])
