"""A second-order joint driven by measured torque: fit to one average, and to many by slopes.

The criterion is that of :mod:`.second_order`: white noise in angle and torque, the
recursion's error whitened, made orthogonal to the sensitivities of the smoothed records. Without
noise of the torque it is output error. Here K and B may have any sign, and once the fit to an
average is there, averages near it are fitted by one Gauss-Newton step each: the error is linear in
the records, so the step takes in what they change to first order.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.signal import savgol_filter

from jointz.kernels.bounded_lsq import least_squares, nonnegative_least_squares
from jointz.kernels.series.second_order_recursion import (
    BAND,
    covariance_band,
    interpolated,
    recursion_error,
    transfer_coefficients,
    whiten,
)

_LAG = 3
_PASSES = 40
_SMALL_STEP = 1e-6
_DIFFERENCE = 1e-5
#: An inertia shrinks to no less than this share in a step.
_LEAST_SHRINKING = 0.3
#: A joint that turns or decays by more than this in a sample cannot be seen in the record.
_FASTEST = 3.0
_WORST_CONDITION = 1e8
#: Half-width of the local cubic that smooths records, s.
_SMOOTH_S = 0.02


@dataclass(frozen=True, slots=True)
class Drive:
    """What is known of the records of a joint at rest before the first sample.

    ``lead``: samples of torque before the first angle, to shift by a negative lag; ``step_s``: time
    between samples; ``noise_sd`` (float, float): sd of the white noise of angle (rad) and torque
    (N*m); ``lag_sd_s``: prior sd of the lag about zero; 0: no lag, None: unknown.
    """

    lead: int
    step_s: float
    noise_sd: tuple[float, float]
    lag_sd_s: float | None = 0.0

    @property
    def free(self) -> list[int]:
        """Which of K, B, J and lag are estimated."""
        return [0, 1, 2] if self.lag_sd_s == 0.0 else [0, 1, 2, _LAG]

    @property
    def prior(self) -> float:
        """Weight of the lag's square."""
        return 1.0 / self.lag_sd_s**2 if self.lag_sd_s else 0.0


@dataclass(frozen=True, slots=True)
class DrivenFit:
    """A joint fitted to one average.

    ``values`` (4,): K, B, J (SI), lag of the torque (s); ``sensitivity`` (n, 4): derivatives of the
    whitened errors of the smoothed records by ``values``; ``bread`` (4, 4): product of
    ``sensitivity`` and the derivatives for the unsmoothed records, prior included; ``cost``: sum of
    the whitened errors squared, prior included; ``converged``: whether the steps became small and
    the equations are regular.
    """

    values: np.ndarray
    sensitivity: np.ndarray
    bread: np.ndarray
    cost: float
    converged: bool


def fit_driven(
    angle: np.ndarray, torque: np.ndarray, start: np.ndarray, drive: Drive, *, bounded: bool
) -> DrivenFit:
    """Fit K, B, J and the lag to the angle that the torque drives from rest.

    ``angle`` (n,) rad from the onset; ``torque`` (m,) N*m; ``start`` (4,): K, B, J, lag in s;
    ``bounded``: whether K, B >= 0.
    """
    if not start[2] > 0.0 or not drive.noise_sd[0] > 0.0:
        raise ValueError(
            "fit_driven: expected inertia and noise of the angle > 0, got "
            f"{start[2]} and {drive.noise_sd[0]}."
        )
    smooth = _smoothed(angle, drive), _smoothed(torque, drive)
    values = np.array(start, dtype=float)
    converged = False
    for _ in range(_PASSES):
        sensitivity = _sensitivities(values, *smooth, drive)
        error = whitened_errors(values, values, angle[None], torque[None], drive)[0]
        if not (np.isfinite(error).all() and np.isfinite(sensitivity).all()):
            break
        free, held = _stepped(values, sensitivity, error[None], drive)
        new = held[0] if bounded else free[0]
        new[2] = max(new[2], _LEAST_SHRINKING * values[2])
        converged = bool((np.abs(new - values) < _SMALL_STEP * _scale(values)).all())
        values = new
        if converged:
            break
    error = whitened_errors(values, values, angle[None], torque[None], drive)[0]
    cost = float(error @ error + drive.prior * values[_LAG] ** 2)
    sensitivity = _sensitivities(values, *smooth, drive)
    bread = sensitivity.T @ _sensitivities(values, angle, torque, drive)
    bread[_LAG, _LAG] += drive.prior
    fine = converged and np.isfinite(cost) and _regular(bread[np.ix_(drive.free, drive.free)])
    return DrivenFit(values, sensitivity, bread, cost, fine)


def refit(
    fit: DrivenFit, angles: np.ndarray, torques: np.ndarray, drive: Drive
) -> tuple[np.ndarray, np.ndarray]:
    """Return the normal equations for K, B, J of averages near the one that was fitted.

    ``angles`` (R, n) rad, ``torques`` (R, m) N*m: averages near the fitted one. Returns ``gram``
    (R, 3, 3), information about K, B and J with the lag profiled out, and ``moment`` (R, 3), its
    product with their values.
    """
    errors = whitened_errors(fit.values, fit.values, angles, torques, drive)
    gradient = errors @ fit.sensitivity
    gradient[:, _LAG] += drive.prior * fit.values[_LAG]
    free = np.ix_(drive.free, drive.free)
    move = np.linalg.solve(fit.bread[free], gradient[:, drive.free].T).T
    kbj = fit.values[:3] - move[:, :3]
    gram = _profiled(_information(fit.sensitivity, drive), drive)
    return np.repeat(gram[None], len(kbj), axis=0), kbj @ gram


def whitened_errors(
    values: np.ndarray, at: np.ndarray, angles: np.ndarray, torques: np.ndarray, drive: Drive
) -> np.ndarray:
    """Return the recursion's errors, whitened by the covariance at other values.

    ``values``, ``at`` (4,): K, B, J, lag of the error, and those of its covariance; ``angles`` (R,
    n) rad from the onset; ``torques`` (R, m) N*m with ``drive.lead`` samples before it. Returns (R,
    n); NaN where the joint is too quick for the record.
    """
    angles, torques = np.ascontiguousarray(angles), np.ascontiguousarray(torques)
    out = np.full(angles.shape, np.nan)
    if all(_slow_enough(v, drive.step_s) for v in (values, at)):
        noise = (drive.noise_sd[0] ** 2, drive.noise_sd[1] ** 2)
        _errors(values, at, (angles, torques), (drive.lead, drive.step_s, *noise), out)
    return out


def _regular(matrix: np.ndarray) -> bool:
    """Tell whether a matrix can be solved with, whatever the units of its rows and columns."""
    size = np.sqrt(np.abs(np.diag(matrix)))
    if not np.isfinite(matrix).all() or not size.all():
        return False
    return bool(np.linalg.cond(matrix / np.outer(size, size)) < _WORST_CONDITION)


def _slow_enough(values: np.ndarray, step_s: float) -> bool:
    K, B, J = values[:3]
    return bool(J > 0 and max(abs(K) * step_s**2, abs(B) * step_s) < _FASTEST * J)


def _smoothed(values: np.ndarray, drive: Drive) -> np.ndarray:
    """Return a local cubic through the values, as wide as a joint's motion allows."""
    width = 2 * max(3, round(_SMOOTH_S / drive.step_s)) + 1
    width = min(width, (values.size - 1) // 2 * 2 + 1)
    return np.asarray(savgol_filter(values, width, 3))


def _scale(values: np.ndarray) -> np.ndarray:
    """Return what a change of K, B, J, lag is compared with."""
    K, B, J = np.abs(values[:3])
    return np.array([K + J, B + np.sqrt((K + J) * J), J, 1e-2])


def _sensitivities(
    values: np.ndarray, angle: np.ndarray, torque: np.ndarray, drive: Drive
) -> np.ndarray:
    """Return the derivative of the whitened error of the smoothed records, (n, 4)."""
    slopes = np.zeros((angle.size, 4))
    for i in drive.free:
        step = np.zeros(4)
        step[i] = _DIFFERENCE * _scale(values)[i]
        high, low = (
            whitened_errors(values + s, values, angle[None], torque[None], drive)[0]
            for s in (step, -step)
        )
        slopes[:, i] = (high - low) / (2.0 * step[i])
    return slopes


def _information(sensitivity: np.ndarray, drive: Drive) -> np.ndarray:
    information = sensitivity.T @ sensitivity
    information[_LAG, _LAG] += drive.prior
    return np.asarray(information)


def _profiled(information: np.ndarray, drive: Drive) -> np.ndarray:
    """Return the information about K, B, J, the lag profiled out."""
    rest = information[:3, _LAG]
    if _LAG not in drive.free or information[_LAG, _LAG] == 0.0:
        return information[:3, :3]
    return np.asarray(information[:3, :3] - np.outer(rest, rest) / information[_LAG, _LAG])


def _stepped(
    values: np.ndarray, sensitivity: np.ndarray, errors: np.ndarray, drive: Drive
) -> tuple[np.ndarray, np.ndarray]:
    """Return one Gauss-Newton step from the values for each error, free and with K, B, J >= 0."""
    information = _information(sensitivity, drive)
    moment = sensitivity.T @ (sensitivity @ values)[:, None] - sensitivity.T @ errors.T
    gram = _profiled(information, drive)
    profiled = moment[:3]
    with_lag = _LAG in drive.free and information[_LAG, _LAG] > 0.0
    if with_lag:
        share = information[:3, _LAG] / information[_LAG, _LAG]
        profiled = profiled - share[:, None] * moment[_LAG]
    grams = np.repeat(gram[None], errors.shape[0], axis=0)
    solutions = []
    for kbj in (least_squares(grams, profiled.T), nonnegative_least_squares(grams, profiled.T)[0]):
        lag = np.full(len(kbj), values[_LAG])
        if with_lag:
            lag = (moment[_LAG] - kbj @ information[:3, _LAG]) / information[_LAG, _LAG]
        solutions.append(np.column_stack([kbj, lag]))
    return solutions[0], solutions[1]


@njit(cache=True, nogil=True)
def _taps(values: np.ndarray, step_s: float) -> np.ndarray:
    """Return (2, 3): what angle and torque are multiplied by in the recursion."""
    ab = transfer_coefficients(values[0], values[1], values[2], step_s)
    taps = np.zeros((2, BAND))
    taps[0, 0], taps[0, 1:], taps[1] = 1.0, ab[:2], ab[2:]
    return taps


@njit(cache=True, nogil=True)
def _errors(
    values: np.ndarray,
    at: np.ndarray,
    records: tuple[np.ndarray, np.ndarray],
    fixed: tuple[int, float, float, float],
    out: np.ndarray,
) -> None:
    lead, step_s, angle_variance, torque_variance = fixed
    angles, torques = records
    n = angles.shape[1]
    taps = _taps(values, step_s)
    band = covariance_band(n, 0, _taps(at, step_s), (angle_variance, torque_variance))
    for r in range(len(angles)):
        seen = interpolated(torques[r], lead + values[3] / step_s, n)
        error = recursion_error(angles[r], seen, taps, 0)
        if whiten(error, band.copy()):
            out[r] = error
