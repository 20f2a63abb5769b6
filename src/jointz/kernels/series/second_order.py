"""Likelihood of a second-order joint when angle and torque are both noisy.

Torque that is linear between samples moves a joint ``torque = K*angle + B*velocity +
J*acceleration`` so that, exactly, ``angle[k] + a1*angle[k-1] + a2*angle[k-2] = b0*torque[k] +
b1*torque[k-1] + b2*torque[k-2]``. With white noise in both records the left side minus the
right side is a moving average of known, banded covariance: its whitened sum of squares is the
errors-in-variables criterion, and costs some ten microseconds for a pulse. A lag between samples is
a windowed sinc, continuous in the lag: linear interpolation would change the noise with the lag,
and the likelihood would follow the noise; a filter that switches at half a sample would stop the
search there.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.signal import savgol_filter

from jointz.kernels.series.second_order_recursion import (
    BAND,
    covariance_band,
    interpolated,
    recursion_error,
    transfer_coefficients,
    whiten,
)

#: Order of the parameters.
N_PARAMETERS = 5
#: A joint that turns or decays by more than this in a sample cannot be seen in the record.
_FASTEST = 3.0
_DIFFERENCE = 1e-5
_PASSES = 60
_SMALL_STEP = 1e-7
_HOPELESS_DAMPING = 1e10
_RIDGE = 1e-14
_LEAST_COST, _ROOT = 0, 1  # aims of the search
#: Half-width of the local cubic that smooths records, s.
_SMOOTH_S = 0.02


@dataclass(frozen=True, slots=True)
class PulseSignals:
    """One stretch of angle and torque, evenly sampled.

    ``angle`` (n,) rad: angle from the first sample of the window; ``torque`` (m,) N*m: torque
    record; ``lead``: samples of torque before the first angle, to shift by a negative lag;
    ``step_s``: time between samples; ``at_rest``: whether angle, velocity and torque are zero
    before the first sample.
    """

    angle: np.ndarray
    torque: np.ndarray
    lead: int
    step_s: float
    at_rest: bool


@dataclass(frozen=True, slots=True)
class LikelihoodFit:
    """Where the errors-in-variables likelihood is largest.

    ``values`` (5,): K, B, J (SI), lag (s), torque offset (N*m); ``covariance`` (5, 5): inverse
    information; ``chi_square``: whitened sum of squares, prior included; ``n_residuals``: number of
    its terms; ``condition_number``: of the scaled Jacobian of the free parameters; ``converged``:
    whether the search ended.
    """

    values: np.ndarray
    covariance: np.ndarray
    chi_square: float
    n_residuals: int
    condition_number: float
    converged: bool


@njit(cache=True, nogil=True)
def _error(
    p: np.ndarray,
    angle: np.ndarray,
    torque: np.ndarray,
    fixed: tuple[int, float, bool, float, float, float, float],
) -> np.ndarray:
    """Return the recursion's error; empty where the parameters are impossible."""
    lead, step_s, at_rest = fixed[:3]
    nothing = np.empty(0)
    K, B, J = np.exp(p[0]), p[1], np.exp(p[2])
    if K * step_s**2 / J > _FASTEST or abs(B) * step_s / J > _FASTEST:
        return nothing
    shift = lead + p[3] / step_s
    if not 0.0 <= shift <= torque.size - angle.size:
        return nothing
    taps = _taps(p, step_s)
    seen = interpolated(torque, shift, angle.size)
    error = recursion_error(angle, seen, taps, 0 if at_rest else BAND - 1)
    error += p[4] * np.sum(taps[1])
    return error


@njit(cache=True, nogil=True)
def _taps(p: np.ndarray, step_s: float) -> np.ndarray:
    """Return (2, 3): what angle and torque are multiplied by in the recursion."""
    ab = transfer_coefficients(np.exp(p[0]), p[1], np.exp(p[2]), step_s)
    taps = np.zeros((2, BAND))
    taps[0, 0], taps[0, 1:], taps[1] = 1.0, ab[:2], ab[2:]
    return taps


@njit(cache=True, nogil=True)
def _whitened(
    error: np.ndarray,
    p: np.ndarray,
    n: int,
    fixed: tuple[int, float, bool, float, float, float, float],
) -> bool:
    """Whiten an error in place by the covariance at p; say whether there is one."""
    _, step_s, at_rest, angle_sd, torque_sd = fixed[:5]
    first = 0 if at_rest else BAND - 1
    band = covariance_band(n, first, _taps(p, step_s), (angle_sd**2, torque_sd**2))
    return whiten(error, band)


@njit(cache=True, nogil=True)
def _residual(
    p: np.ndarray,
    angle: np.ndarray,
    torque: np.ndarray,
    fixed: tuple[int, float, bool, float, float, float, float],
) -> np.ndarray:
    """Return whitened residuals and the prior's; empty where the parameters are impossible."""
    prior_lag, prior_sd = fixed[5:]
    error = _error(p, angle, torque, fixed)
    if error.size == 0 or not _whitened(error, p, angle.size, fixed):
        return np.empty(0)
    out = np.zeros(error.size + 1)
    out[:-1] = error
    if prior_sd > 0.0:
        out[-1] = (p[3] - prior_lag) / prior_sd
    return out


@njit(cache=True, nogil=True)
def _sensitivity(
    p: np.ndarray,
    scale: np.ndarray,
    smooth: tuple[np.ndarray, np.ndarray],
    fixed: tuple[int, float, bool, float, float, float, float],
) -> np.ndarray:
    """Return the derivative of the mean residual in units of ``scale``; scale 0 is held.

    It is that of the smooth records, whitened as they are at p: noise has no part in it.
    """
    angle, torque = smooth
    prior_sd = fixed[6]
    n = angle.size + 1 if fixed[2] else angle.size + 2 - BAND
    out = np.zeros((n, p.size))
    for i in range(p.size):
        if scale[i] == 0.0:
            continue
        high, low = p.copy(), p.copy()
        high[i] += _DIFFERENCE * scale[i]
        low[i] -= _DIFFERENCE * scale[i]
        above, below = _error(high, angle, torque, fixed), _error(low, angle, torque, fixed)
        if above.size != n - 1 or below.size != n - 1:
            continue
        slope = (above - below) / (2.0 * _DIFFERENCE)
        if _whitened(slope, p, angle.size, fixed):
            out[:-1, i] = slope
    if prior_sd > 0.0:
        out[-1, 3] = scale[3] / prior_sd
    return out


@njit(cache=True, nogil=True)
def _step(
    sensitivity: np.ndarray, residual: np.ndarray, damping: float
) -> tuple[np.ndarray, float]:
    """Return the damped step, and how much of the residual the sensitivities explain."""
    information = sensitivity.T @ sensitivity
    gradient = sensitivity.T @ residual
    floor = _RIDGE * max(np.max(np.diag(information)), 1e-300)
    for i in range(gradient.size):
        held = information[i, i] == 0.0
        information[i, i] = 1.0 if held else information[i, i] * (1.0 + damping) + floor
    move = np.linalg.solve(information, -gradient)
    return move, -float(np.sum(move * gradient))


@njit(cache=True, nogil=True)
def _descend(
    start: np.ndarray,
    scale: np.ndarray,
    records: tuple[np.ndarray, np.ndarray],
    smooth: tuple[np.ndarray, np.ndarray],
    fixed: tuple[int, float, bool, float, float, float, float],
    aim: int,
) -> tuple[np.ndarray, bool]:
    """Levenberg and Marquardt, towards the least cost or the root of what is explained."""
    p, damping = start.copy(), 1e-3
    residual = _residual(p, records[0], records[1], fixed)
    if residual.size == 0:
        return p, False
    slopes = _sensitivity(p, scale, smooth, fixed)
    if not np.isfinite(slopes).all():
        return p, False
    merit = residual @ residual if aim == _LEAST_COST else _step(slopes, residual, 0.0)[1]
    for _ in range(_PASSES):
        while damping < _HOPELESS_DAMPING:
            move = _step(slopes, residual, damping)[0]
            if np.max(np.abs(move)) < _SMALL_STEP:
                return p + move * scale, True
            trial = p + move * scale
            found = _residual(trial, records[0], records[1], fixed)
            if found.size:
                new = _sensitivity(trial, scale, smooth, fixed)
                now = found @ found if aim == _LEAST_COST else _step(new, found, 0.0)[1]
                if now <= merit:
                    p, residual, slopes, merit = trial, found, new, now
                    damping *= 0.1
                    break
            damping *= 10.0
        else:
            return p, False
    return p, False


def maximise_likelihood(
    record: PulseSignals,
    start: np.ndarray,
    *,
    noise_sd: tuple[float, float],
    lag_prior: tuple[float, float] | None,
) -> LikelihoodFit:
    """Return K, B, J, lag and offset of largest errors-in-variables likelihood.

    ``start`` (5,): K, B, J, lag in s, torque offset in N*m; ``noise_sd``: of the white noise of
    angle (rad) and torque (N*m); ``lag_prior``: value and sd of the lag in s, an sd of zero holds
    it. The true torque is profiled out (functional errors in variables): no bias from noise.
    Residuals are made orthogonal to the sensitivities of the smoothed records, since noise shifted
    with the lag ripples the likelihood and looks like information.
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
    records, smooth = (angle, torque), (_smoothed(angle, record), _smoothed(torque, record))
    p, _ = _descend(p, scale, smooth, smooth, fixed, _LEAST_COST)
    p, converged = _descend(p, scale, records, smooth, fixed, _ROOT)
    residual = _residual(p, angle, torque, fixed)
    jacobian = _sensitivity(p, scale, smooth, fixed)
    free = np.flatnonzero(scale)
    covariance, condition = _inverse_information(jacobian[:, free])
    values = np.array([np.exp(p[0]), p[1], np.exp(p[2]), p[3], p[4]])
    unit = scale * np.array([values[0], 1.0, values[2], 1.0, 1.0])
    full = np.zeros((N_PARAMETERS, N_PARAMETERS))
    if np.isfinite(condition):
        covariance = covariance * np.outer(unit[free], unit[free])
    full[np.ix_(free, free)] = covariance
    return LikelihoodFit(
        values=values,
        covariance=full,
        chi_square=float(residual @ residual) if residual.size else np.inf,
        n_residuals=jacobian.shape[0] - int(prior[1] == 0.0),
        condition_number=condition,
        converged=bool(converged),
    )


def _smoothed(values: np.ndarray, record: PulseSignals) -> np.ndarray:
    """Return a local cubic through the values, as wide as a load's motion allows."""
    half = max(3, round(_SMOOTH_S / record.step_s))
    width = min(2 * half + 1, (record.angle.size - 1) // 2 * 2 + 1)
    return np.asarray(savgol_filter(values, width, 3))


def _check(record: PulseSignals, start: np.ndarray, noise_sd: tuple[float, float]) -> None:
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
