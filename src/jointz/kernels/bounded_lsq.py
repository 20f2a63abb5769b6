"""Least squares in three parameters that must not be negative, in batch.

The model is ``torque = K * angle + B * velocity + J * acceleration`` with
``K, B, J >= 0``. Three parameters have eight active sets, so the exact answer
is found by trying them (conditions: Lawson and Hanson, "Solving Least Squares
Problems", 1974, chapter 23). The 3x3 normal equations are solved with columns
scaled to unit length: angle and acceleration differ by a factor of a thousand.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from jointz.kernels.resampling import check_weights, resampled_normal_equations, trial_products

#: A system is singular where some column keeps less than this share of its square once
#: the others are taken out (one over its variance inflation factor): few digits are left.
SINGULAR_SHARE = 1e-12

#: Resamples fitted at once: large enough for BLAS, small enough for the cache.
BLOCK_ROWS = 1024

_CANCELLED_SHARE = 1e-3  # of the trials' mean power
_N_CHANNELS = 4  # angle, velocity, acceleration, torque
_REORDER = {"reassoc", "contract"}  # lets sums run in vector registers; NaN keeps its meaning


@dataclass(frozen=True, slots=True)
class BootstrapFits:
    """Fits of the resampled averages, one row a resample.

    ``bounded``, ``unbounded`` (R, 3): K, B, J in N*m/rad, N*m*s/rad, kg*m^2, with and without
    bounds; NaN where singular. ``active`` (R,): bit i is set where parameter i is held at zero.
    """

    bounded: np.ndarray
    unbounded: np.ndarray
    active: np.ndarray


def normal_equations(averages: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the sums of products that a fit needs, in one pass.

    ``averages`` (R, 4, T): angle, velocity, acceleration, torque; rad, rad/s, rad/s^2, N*m. Returns
    ``gram`` (R, 3, 3): products of angle, velocity and acceleration with one another; ``moment``
    (R, 3): their products with torque; ``power`` (R,): sum of torque squared.
    """
    values = np.ascontiguousarray(averages, dtype=np.float64)
    _check_channels("normal_equations: averages", values)
    n = len(values)
    gram, moment, power = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty(n)
    _normal_equations(values, gram, moment, power)
    return gram, moment, power


def nonnegative_least_squares(
    gram: np.ndarray, moment: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Minimise ``||X b - y||^2`` over ``b >= 0`` exactly, by its active sets.

    ``gram`` (R, 3, 3): X'X; ``moment`` (R, 3): X'y. Returns ``solution`` (R, 3), NaN where X is
    singular (:data:`SINGULAR_SHARE`), and ``active`` (R,): bit i is set where parameter i is held
    at zero. The minimiser is the candidate whose free parameters and whose gradients at the held
    ones are all >= 0 (Karush, Kuhn and Tucker); where rounding leaves none, the nearest one,
    clipped.
    """
    fits = _solved("nonnegative_least_squares", gram, moment)
    return fits.bounded, fits.active


def least_squares(gram: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Minimise ``||X b - y||^2`` without bounds.

    ``gram`` (R, 3, 3): X'X; ``moment`` (R, 3): X'y. Returns (R, 3); NaN where X is singular
    (:data:`SINGULAR_SHARE`).
    """
    return _solved("least_squares", gram, moment).unbounded


def condition_numbers(gram: np.ndarray) -> np.ndarray:
    """Return the condition number of X with its columns scaled to unit length.

    ``gram`` (R, 3, 3): X'X. Returns (R,): largest over smallest singular value, good up to about
    1e7; infinite where X is singular. Unit columns are within sqrt(3) of the best scaling (van der
    Sluis 1969, Numer. Math. 14, 14, doi:10.1007/BF02165096).
    """
    gram = np.asarray(gram, dtype=np.float64)
    _check_gram("condition_numbers", gram)
    square = np.diagonal(gram, axis1=1, axis2=2)
    missing = np.isnan(gram).any(axis=(1, 2))
    usable = ~missing & (square > 0).all(axis=1)
    length = np.sqrt(square[usable])
    eigenvalues = np.linalg.eigvalsh(gram[usable] / (length[:, :, None] * length[:, None, :]))
    smallest, largest = eigenvalues[:, 0], eigenvalues[:, -1]
    ratio = np.divide(largest, smallest, out=np.full_like(largest, np.inf), where=smallest > 0)
    condition = np.where(missing, np.nan, np.inf)
    condition[usable] = np.sqrt(ratio)
    return condition


def bootstrap_fits(weights: np.ndarray, trials: np.ndarray) -> BootstrapFits:
    """Average the trials with each row of weights and fit K, B, J to each average.

    ``weights`` (R, P): weight of each trial in a resample (:func:`resample_weights`); ``trials``
    (P, 4, T): angle, velocity, acceleration, torque; rad, rad/s, rad/s^2, N*m. Resamples are fitted
    in blocks: only the result grows with R. Raises ValueError for a trial that is not finite: it
    would spoil every resample.
    """
    weights = np.ascontiguousarray(weights, dtype=np.float64)
    trials = np.ascontiguousarray(trials, dtype=np.float64)
    _check_bootstrap(weights, trials)
    fits = _empty_fits(len(weights))
    # Both ways give the same sums; products of trials are cheaper while trials are few.
    products = trial_products(trials) if len(trials) <= trials.shape[2] else None
    for start in range(0, len(weights), BLOCK_ROWS):
        rows = slice(start, start + BLOCK_ROWS)
        gram, moment = _block_equations(weights[rows], trials, products)
        _solve(gram, moment, fits.bounded[rows], fits.unbounded[rows], fits.active[rows])
    return fits


def _block_equations(
    weights: np.ndarray, trials: np.ndarray, products: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    if products is None:
        averages = weights @ trials.reshape(len(trials), -1)
        return normal_equations(averages.reshape(-1, *trials.shape[1:]))[:2]
    gram, moment = resampled_normal_equations(weights, products)
    # Where trials cancel in their average, as pulses of both signs do, its square keeps few digits.
    power = np.einsum("pct,pct->c", trials[:, :3], trials[:, :3]) / len(trials)
    lost = (np.diagonal(gram, axis1=1, axis2=2) < _CANCELLED_SHARE * power).any(axis=1)
    if lost.any():
        gram[lost], moment[lost] = _block_equations(weights[lost], trials, None)
    return gram, moment


def _empty_fits(n: int) -> BootstrapFits:
    return BootstrapFits(np.empty((n, 3)), np.empty((n, 3)), np.empty(n, dtype=np.uint8))


def _check_channels(where: str, values: np.ndarray) -> None:
    if values.ndim != 3 or values.shape[1] != _N_CHANNELS:
        raise ValueError(
            f"{where}: expected shape (n, 4, T) with channels angle, velocity, acceleration, "
            f"torque, got {values.shape}."
        )


def _check_bootstrap(weights: np.ndarray, trials: np.ndarray) -> None:
    _check_channels("bootstrap_fits: trials", trials)
    check_weights("bootstrap_fits", weights, len(trials))
    finite = np.isfinite(trials).all(axis=(1, 2))
    if not finite.all():
        raise ValueError(
            "bootstrap_fits: expected finite trials, got NaN or infinity in trial(s) "
            f"{np.flatnonzero(~finite).tolist()}. Leave them out."
        )


def _check_gram(where: str, gram: np.ndarray) -> None:
    if gram.ndim != 3 or gram.shape[1:] != (3, 3):
        raise ValueError(f"{where}: expected gram of shape (R, 3, 3), got {gram.shape}.")


def _solved(where: str, gram: np.ndarray, moment: np.ndarray) -> BootstrapFits:
    """Return the checked systems solved with and without bounds."""
    gram = np.ascontiguousarray(gram, dtype=np.float64)
    moment = np.ascontiguousarray(moment, dtype=np.float64)
    _check_gram(where, gram)
    if moment.shape != gram.shape[:2]:
        raise ValueError(
            f"{where}: expected moment of shape {gram.shape[:2]} beside gram, got {moment.shape}."
        )
    fits = _empty_fits(len(gram))
    _solve(gram, moment, fits.bounded, fits.unbounded, fits.active)
    return fits


@njit(cache=True, nogil=True, fastmath=_REORDER)
def _normal_equations(
    averages: np.ndarray, gram: np.ndarray, moment: np.ndarray, power: np.ndarray
) -> None:
    for r in range(len(averages)):
        row = averages[r]
        qq = qv = qa = vv = va = aa = qt = vt = at = tt = 0.0
        for i in range(row.shape[1]):
            q, v, a, t = row[0, i], row[1, i], row[2, i], row[3, i]
            qq, qv, qa = qq + q * q, qv + q * v, qa + q * a
            vv, va, aa = vv + v * v, va + v * a, aa + a * a
            qt, vt, at, tt = qt + q * t, vt + v * t, at + a * t, tt + t * t
        gram[r, 0, 0], gram[r, 1, 1], gram[r, 2, 2] = qq, vv, aa
        gram[r, 0, 1] = gram[r, 1, 0] = qv
        gram[r, 0, 2] = gram[r, 2, 0] = qa
        gram[r, 1, 2] = gram[r, 2, 1] = va
        moment[r, 0], moment[r, 1], moment[r, 2] = qt, vt, at
        power[r] = tt


@njit(cache=True, nogil=True)
def _cofactors(p: float, q: float, r: float) -> tuple[float, ...]:
    """Return cofactors (00, 01, 02, 11, 12, 22) and determinant; p, q, r are G01, G02, G12."""
    c00, c11, c22 = 1.0 - r * r, 1.0 - q * q, 1.0 - p * p
    c01, c02, c12 = q * r - p, p * r - q, p * q - r
    return c00, c01, c02, c11, c12, c22, c00 + p * c01 + q * c02


@njit(cache=True, nogil=True)
def _solve_unit(
    p: float, q: float, r: float, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Solve the system of unit diagonal for (x, y, z), with one step of refinement."""
    c00, c01, c02, c11, c12, c22, det = _cofactors(p, q, r)
    scale = 1.0 / det
    b0 = (c00 * x + c01 * y + c02 * z) * scale
    b1 = (c01 * x + c11 * y + c12 * z) * scale
    b2 = (c02 * x + c12 * y + c22 * z) * scale
    x -= b0 + p * b1 + q * b2
    y -= p * b0 + b1 + r * b2
    z -= q * b0 + r * b1 + b2
    b0 += (c00 * x + c01 * y + c02 * z) * scale
    b1 += (c01 * x + c11 * y + c12 * z) * scale
    b2 += (c02 * x + c12 * y + c22 * z) * scale
    return b0, b1, b2


@njit(cache=True, nogil=True)
def _best_set(
    p: float, q: float, r: float, x: float, y: float, z: float
) -> tuple[float, float, float, int]:
    """Return the candidate that breaks the Karush-Kuhn-Tucker conditions least, and its set."""
    least, best = -np.inf, (0.0, 0.0, 0.0, 0)
    for active in range(8):
        # A held parameter is taken out by an identity row and a zero moment.
        f0, f1, f2 = 1.0 - (active & 1), 1.0 - (active >> 1 & 1), 1.0 - (active >> 2 & 1)
        b0, b1, b2 = _solve_unit(p * f0 * f1, q * f0 * f2, r * f1 * f2, x * f0, y * f1, z * f2)
        k0 = b0 if active & 1 == 0 else p * b1 + q * b2 - x
        k1 = b1 if active & 2 == 0 else p * b0 + r * b2 - y
        k2 = b2 if active & 4 == 0 else q * b0 + r * b1 - z
        worst = min(k0, k1, k2)
        if worst > least:
            least, best = worst, (b0, b1, b2, active)
        if worst >= 0.0:
            break
    return best


@njit(cache=True, nogil=True)
def _solve_row(
    gram: np.ndarray, moment: np.ndarray, bounded: np.ndarray, unbounded: np.ndarray
) -> int:
    """Fill both solutions of one system and return the active set."""
    bounded[:] = unbounded[:] = np.nan
    g0, g1, g2 = gram[0, 0], gram[1, 1], gram[2, 2]
    if not (g0 > 0.0 and g1 > 0.0 and g2 > 0.0):
        return 0
    s0, s1, s2 = 1.0 / np.sqrt(g0), 1.0 / np.sqrt(g1), 1.0 / np.sqrt(g2)
    p, q, r = gram[0, 1] * s0 * s1, gram[0, 2] * s0 * s2, gram[1, 2] * s1 * s2
    x, y, z = moment[0] * s0, moment[1] * s1, moment[2] * s2
    c00, _, _, c11, _, c22, det = _cofactors(p, q, r)
    # det / cofactor is what a column keeps beside the other two; a cofactor, beside one of them.
    # det is NaN where anything is, and NaN fails the comparison.
    least, most = min(c00, c11, c22), max(c00, c11, c22)
    if not (least > SINGULAR_SHARE and det > SINGULAR_SHARE * most and np.isfinite(x + y + z)):
        return 0
    b0, b1, b2 = _solve_unit(p, q, r, x, y, z)
    unbounded[0], unbounded[1], unbounded[2] = b0 * s0, b1 * s1, b2 * s2
    active = 0
    if min(b0, b1, b2) < 0.0:
        b0, b1, b2, active = _best_set(p, q, r, x, y, z)
    bounded[0] = b0 * s0 if b0 > 0.0 else 0.0
    bounded[1] = b1 * s1 if b1 > 0.0 else 0.0
    bounded[2] = b2 * s2 if b2 > 0.0 else 0.0
    return active | (b0 < 0.0) | (b1 < 0.0) << 1 | (b2 < 0.0) << 2


@njit(cache=True, nogil=True)
def _solve(
    gram: np.ndarray,
    moment: np.ndarray,
    bounded: np.ndarray,
    unbounded: np.ndarray,
    active: np.ndarray,
) -> None:
    for r in range(len(gram)):
        active[r] = _solve_row(gram[r], moment[r], bounded[r], unbounded[r])
