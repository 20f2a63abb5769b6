"""A linear path beside a delayed, half-wave rectified and low-passed one.

The second path is nonlinear in four numbers (delay, threshold, and the natural frequency and
damping ratio of its filter) and linear in its gain. So the gain and the coefficients of the
linear path are eliminated by least squares for each value of the four (variable projection:
Golub and Pereyra 1973, doi:10.1137/0710036; Kaufman 1975, doi:10.1007/BF01932995).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import least_squares

#: Delay (s), natural frequency (rad/s) and damping ratio are searched inside these.
DELAY_S = (0.02, 0.1)
FREQUENCY_RAD_S = (4.0, 120.0)
DAMPING_RATIO = (0.3, 2.0)
#: Thresholds kept, as shares of the largest velocity; between them regressors are interpolated.
THRESHOLD_SHARES = np.arange(-4, 13) / 16.0
#: Where the search starts: all combinations.
_START_DELAYS_S = (0.02, 0.04, 0.06, 0.08, 0.1)
_START_SHARES = (0.0, 0.25, 0.5)
_START_FREQUENCIES = (6.0, 12.0, 24.0, 60.0)
_START_RATIOS = (0.6, 1.2)
_REFINED = 3
_FLIPS = 999


class Shape(NamedTuple):
    """The four nonlinear numbers of the rectified path.

    ``delay_s``: delay; ``threshold``: index into the thresholds, with a fraction between two of
    them; ``log_frequency``: logarithm of the natural frequency of the filter, rad/s; ``log_ratio``:
    logarithm of its damping ratio.
    """

    delay_s: float
    threshold: float
    log_frequency: float
    log_ratio: float


_LOWEST = Shape(DELAY_S[0], 0.0, np.log(FREQUENCY_RAD_S[0]), np.log(DAMPING_RATIO[0]))
_HIGHEST = Shape(
    DELAY_S[1], THRESHOLD_SHARES.size - 1.0, np.log(FREQUENCY_RAD_S[1]), np.log(DAMPING_RATIO[1])
)
_SCALE = Shape(0.01, 2.0, 0.3, 0.3)


@dataclass(frozen=True, slots=True)
class RectifiedPath:
    """Spectra of the rectified velocity at all thresholds, thinned to the rate of the fit.

    ``spectra`` (n_threshold, n_frequency): of ``max(velocity - threshold, 0)``, rad/s, low-passed
    as the other signals are; ``thresholds`` (n_threshold,) rad/s: evenly spaced; ``s``
    (n_frequency,): Laplace variable on the imaginary axis, rad/s; ``n``: number of samples of the
    thinned record; ``kept``: thinned samples in the fit; ``drift`` (n_kept, n_drift): orthonormal
    slow functions, removed from every signal.
    """

    spectra: np.ndarray
    thresholds: np.ndarray
    s: np.ndarray
    n: int
    kept: slice
    drift: np.ndarray

    def without_drift(self, columns: np.ndarray) -> np.ndarray:
        """Return (n_kept, ...) less its part along the slow functions."""
        return np.asarray(columns - self.drift @ (self.drift.T @ columns))

    def regressor(self, shape: Shape) -> np.ndarray:
        """Return (n_kept,): torque of the path at a gain of one."""
        source, _ = self._source(shape)
        return self._in_time(source * self._filter(shape))[:, 0]

    def sensitivities(self, shape: Shape) -> np.ndarray:
        """Return (n_kept, 5): the regressor and its derivatives along the shape."""
        source, slope = self._source(shape)
        response = self._filter(shape)
        frequency, ratio = np.exp(shape.log_frequency), np.exp(shape.log_ratio)
        first, second = 2.0 * ratio / frequency * self.s, (self.s / frequency) ** 2
        regressor = source * response
        low = response / np.exp(-self.s * shape.delay_s)
        return self._in_time(
            np.stack(
                [
                    regressor,
                    -self.s * regressor,
                    slope * response,
                    (first + 2.0 * second) * low * regressor,
                    -first * low * regressor,
                ]
            )
        )

    def _source(self, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        """Return the spectrum at a threshold and its slope, linear between thresholds."""
        below = min(int(shape.threshold), self.thresholds.size - 2)
        slope = self.spectra[below + 1] - self.spectra[below]
        return self.spectra[below] + (shape.threshold - below) * slope, slope

    def _filter(self, shape: Shape) -> np.ndarray:
        frequency, ratio = np.exp(shape.log_frequency), np.exp(shape.log_ratio)
        denominator = 1.0 + 2.0 * ratio / frequency * self.s + (self.s / frequency) ** 2
        return np.asarray(np.exp(-self.s * shape.delay_s) / denominator)

    def _in_time(self, spectra: np.ndarray) -> np.ndarray:
        series = np.fft.irfft(np.atleast_2d(spectra), self.n, axis=1)[:, self.kept].T
        return self.without_drift(series)

    def starts(self) -> tuple[list[Shape], np.ndarray]:
        """Return the shapes where the search starts, and their regressors (n_kept, n_start)."""
        zero = int(np.flatnonzero(THRESHOLD_SHARES == 0.0)[0])
        per_share = 1.0 / float(THRESHOLD_SHARES[1] - THRESHOLD_SHARES[0])
        shapes = [
            Shape(delay_s, zero + per_share * share, float(np.log(w)), float(np.log(ratio)))
            for delay_s in _START_DELAYS_S
            for share in _START_SHARES
            for w in _START_FREQUENCIES
            for ratio in _START_RATIOS
        ]
        spectra = np.stack([self._source(shape)[0] * self._filter(shape) for shape in shapes])
        return shapes, self._in_time(spectra)


@dataclass(frozen=True, slots=True)
class CascadeFit:
    """The two paths at their best.

    ``shape``: of the rectified path; ``linear`` (p,): coefficients of the linear path; ``gain``: of
    the rectified path, output unit per rad/s; ``jacobian`` (n, p + 5): derivatives of the output;
    ``residual`` (n,): measured minus modelled; ``at_edge`` (4,): whether each number of the shape
    is at an end of its range.
    """

    shape: Shape
    linear: np.ndarray
    gain: float
    jacobian: np.ndarray
    residual: np.ndarray
    at_edge: np.ndarray


def rectified_path(
    velocity: np.ndarray,
    *,
    rate_hz: float,
    step: int,
    lowpass: np.ndarray,
    kept: slice,
    drift: np.ndarray,
) -> RectifiedPath:
    """Rectify a velocity at all thresholds and thin it by cutting its spectrum.

    ``velocity`` (n,) rad/s: positive where it stretches; ``step``: samples to one of the thinned
    record; ``lowpass`` (n_frequency,): gain of the other signals' low-pass at the frequencies of
    the thinned record; ``kept``: thinned samples that enter the fit; ``drift`` (n_kept, n_drift):
    orthonormal slow functions.
    """
    n, left = divmod(velocity.size, step)
    if left:
        raise ValueError(f"rectified_path: {velocity.size} samples are no multiple of {step}")
    largest = float(np.quantile(velocity, 0.999))
    if not largest > 0.0:
        raise ValueError("rectified_path: expected a velocity that is positive somewhere")
    thresholds = largest * THRESHOLD_SHARES
    spectra = np.empty((thresholds.size, n // 2 + 1), dtype=complex)
    for row, threshold in zip(spectra, thresholds, strict=True):
        rectified = np.maximum(velocity - threshold, 0.0)
        row[:] = np.fft.rfft(rectified - rectified.mean())[: row.size] * lowpass / step
    s = 2j * np.pi * np.fft.rfftfreq(n, step / rate_hz)
    return RectifiedPath(spectra, thresholds, s, n, kept, drift)


def fit_cascade(
    path: RectifiedPath, linear: np.ndarray, output: np.ndarray
) -> tuple[CascadeFit | None, np.ndarray]:
    """Fit both paths; the rectified one resists the stretch (gain above zero).

    ``path`` the rectified path; ``linear`` (n_kept, p): regressors of the linear path, drift
    removed; ``output`` (n_kept,): what is to be explained, drift removed. Returns ``fit``: the best
    of the refined starts; ``candidates`` (n_kept, n_start): regressors of the starts less what the
    linear path explains, for :func:`chance_of_largest_score`.
    """
    shapes, regressors = path.starts()
    Q = np.linalg.qr(linear)[0]
    candidates = regressors - Q @ (Q.T @ regressors)
    rest = output - Q @ (Q.T @ output)
    along = (candidates.T @ rest) / np.maximum(
        np.linalg.norm(candidates, axis=0), np.finfo(float).tiny
    )
    ranked = [int(i) for i in np.argsort(-along)[:_REFINED] if along[i] > 0.0]
    fits = (_refine(shapes[i], path, linear, output) for i in ranked)
    resisting = [fit for fit in fits if fit.gain > 0.0]
    best = min(resisting, key=lambda fit: float(fit.residual @ fit.residual), default=None)
    return best, candidates


def _refine(
    start: Shape, path: RectifiedPath, linear: np.ndarray, output: np.ndarray
) -> CascadeFit:
    Q = np.linalg.qr(linear)[0]
    rest = output - Q @ (Q.T @ output)

    def residual(values: np.ndarray) -> np.ndarray:
        own = path.regressor(Shape(*values))
        own -= Q @ (Q.T @ own)
        return np.asarray(rest - own * (float(own @ rest) / float(own @ own)))

    def jacobian(values: np.ndarray) -> np.ndarray:
        columns = path.sensitivities(Shape(*values))
        columns -= Q @ (Q.T @ columns)
        own, slopes = columns[:, 0], columns[:, 1:]
        power = float(own @ own)
        kaufman = -float(own @ rest) / power * (slopes - np.outer(own, own @ slopes) / power)
        return np.asarray(kaufman)

    solved = least_squares(
        residual, start, jac=jacobian, bounds=(_LOWEST, _HIGHEST), x_scale=_SCALE, xtol=1e-7
    )
    low, high = np.array(_LOWEST), np.array(_HIGHEST)
    near = 1e-3 * (high - low)
    at_edge = (solved.x - low < near) | (high - solved.x < near)
    return _at_shape(Shape(*solved.x.tolist()), path, linear, output, at_edge=at_edge)


def _at_shape(
    shape: Shape,
    path: RectifiedPath,
    linear: np.ndarray,
    output: np.ndarray,
    *,
    at_edge: np.ndarray,
) -> CascadeFit:
    sensitivities = path.sensitivities(shape)
    both = np.column_stack([linear, sensitivities[:, :1]])
    coefficients, _ = linear_fit(both, output)
    gain = float(coefficients[-1])
    return CascadeFit(
        shape=shape,
        linear=coefficients[:-1],
        gain=gain,
        jacobian=np.column_stack([both, gain * sensitivities[:, 1:]]),
        residual=output - both @ coefficients,
        at_edge=at_edge,
    )


def chance_of_largest_score(candidates: np.ndarray, residual: np.ndarray, n_blocks: int) -> float:
    """Return the p-value of the largest of many one-sided score statistics.

    ``candidates`` (n, m): regressors less what the model without them explains; ``residual`` (n,):
    of that model. Each has the statistic sum_b g_b / sqrt(sum_b g_b^2), g_b the sums of x *
    residual over blocks longer than the correlation; random signs of the blocks show how large the
    largest is by chance. Returns 0.001 to 1. Hansen 1996, doi:10.2307/2171789.
    """
    starts = np.arange(n_blocks) * residual.size // n_blocks
    sums = np.add.reduceat(candidates * residual[:, None], starts, axis=0)
    size = np.sqrt(np.sum(sums**2, axis=0))
    scaled = sums / np.maximum(size, np.finfo(float).tiny)
    signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(_FLIPS, n_blocks))
    by_chance = (signs @ scaled).max(axis=1)
    above = int(np.sum(by_chance >= scaled.sum(axis=0).max()))
    return (1 + above) / (1 + _FLIPS)


def linear_fit(regressors: np.ndarray, output: np.ndarray) -> tuple[np.ndarray, float]:
    """Return least-squares coefficients and the condition number of the scaled regressors.

    ``regressors`` (n, p); ``output`` (n,).
    """
    size = np.linalg.norm(regressors, axis=0)
    Q, R = np.linalg.qr(regressors / size)
    return solve_triangular(R, Q.T @ output) / size, float(np.linalg.cond(R))
