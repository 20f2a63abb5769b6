"""Straight-line fits with instruments, where a regressor moves with the error it is fitted in.

Hansen 1982 (doi:10.2307/1912775): instruments times residual have mean zero; weighed with the
covariance of their sums over blocks of time. Covariance of the coefficients by leaving out one
block at a time (Quenouille, Tukey), which takes blocks that matter more than others.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.stats import t as student_t

from jointz.identify.calibration.steady_fit import blocks_for
from jointz.results.estimates import REACH_95

#: Added to the moments' covariance before it is inverted, share of its trace.
_EVEN_SHARE = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class InstrumentedFit:
    """A linear fit."""

    values: np.ndarray  # coefficients
    # squared distance of the moments from zero: chi squared with as many degrees of freedom as
    # there are instruments more than coefficients
    distance: float
    residual: np.ndarray  # measured minus modelled


class Instruments:
    """Instruments of one signal, for any number of models of it."""

    def __init__(self, time: np.ndarray, y: np.ndarray, columns: np.ndarray) -> None:
        self._time, self._y = time, y
        self._z = columns / np.sqrt(np.mean(columns**2, axis=0))
        self._weights = np.linalg.inv(self._z.T @ self._z)
        self._starts = np.zeros(1, dtype=int)
        self._lost = 0

    def weigh(self, residual: np.ndarray, *, fitted: int) -> None:
        """Weigh the moments by their covariance."""
        n_blocks = blocks_for(self._time, residual, size=float(np.std(self._y)), fitted=fitted)
        self._starts = np.arange(n_blocks) * residual.size // n_blocks
        self._lost = fitted
        sums = np.add.reduceat(self._z * residual[:, None], self._starts, axis=0)
        covariance = sums.T @ sums * n_blocks / (n_blocks - fitted)
        size = float(np.trace(covariance))
        if size > 0.0:  # else nothing is left that could be weighed
            even = _EVEN_SHARE * size * np.eye(len(covariance))
            self._weights = np.linalg.inv(covariance + even)

    @cached_property
    def _against_signal(self) -> np.ndarray:
        return np.asarray(self._z.T @ self._y)

    def fit(self, regressors: np.ndarray) -> InstrumentedFit:
        """Fit the signal by regressors."""
        cross = self._z.T @ regressors
        values = self._solved(cross, self._against_signal)
        missed = self._against_signal - cross @ values
        residual = self._y - regressors @ values
        return InstrumentedFit(values, float(missed @ self._weights @ missed), residual)

    def sds(self, regressors: np.ndarray) -> np.ndarray:
        """Return the sd of the coefficients."""
        n = self._starts.size
        ends = [*self._starts[1:], len(self._y)]
        parts = [slice(a, b) for a, b in zip(self._starts, ends, strict=True)]
        cross = np.array([self._z[part].T @ regressors[part] for part in parts])
        signal = np.array([self._z[part].T @ self._y[part] for part in parts])
        without = np.array(
            [
                self._solved(cross.sum(axis=0) - block, signal.sum(axis=0) - moment)
                for block, moment in zip(cross, signal, strict=True)
            ]
        )
        scatter = np.sqrt((n - 1) / n * np.sum((without - without.mean(axis=0)) ** 2, axis=0))
        return np.asarray(scatter * student_t.ppf(0.975, n - self._lost) / REACH_95)

    def _solved(self, cross: np.ndarray, signal: np.ndarray) -> np.ndarray:
        leaning = cross.T @ self._weights
        return np.asarray(np.linalg.solve(leaning @ cross, leaning @ signal))
