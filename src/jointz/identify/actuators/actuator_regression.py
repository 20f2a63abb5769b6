"""Least squares with intervals that know of residuals correlated in time."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student_t

from jointz.kernels.block_sandwich import (
    CORRELATION_TIMES_PER_BLOCK,
    FEWEST_BLOCKS,
    block_sandwich,
    correlation_time,
    count_blocks,
)

#: Ten blocks of so many correlation times still make an interval, with a caution: the variance
#: is then read low by up to a third.
_FEWEST_TIMES = 3.0
_SAMPLES_PER_BLOCK = 2
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class Regression:
    """A linear fit."""

    names: tuple[str, ...]  # the parameters
    values: np.ndarray  # their estimates
    residual: np.ndarray  # what is left
    covariance: np.ndarray  # of the estimates; (0, 0) where the record is too short for any
    # of the intervals. Where the record is too short for them, those of independent errors, which
    # are the narrowest: they can show that a value is not known, and nothing else
    half_width: np.ndarray
    condition_number: float  # of the regressors, each scaled to length one
    ci_method: str  # how the covariance was made
    doubt: str  # why there is no interval; empty where there is
    caution: str  # why the interval is a rough one; empty where it is not

    def value(self, name: str) -> float:
        """Return an estimate."""
        return float(self.values[self.names.index(name)])

    @property
    def is_saturated(self) -> bool:
        """True with as many parameters as samples: any values fit."""
        return self.residual.size <= len(self.names)

    def interval(self, name: str) -> tuple[float, float]:
        """Return the ends of an interval."""
        half = float(self.half_width[self.names.index(name)])
        return self.value(name) - half, self.value(name) + half


def regress(
    measured: np.ndarray,
    columns: Mapping[str, np.ndarray],
    rate_hz: float | None,
    ci_level: float,
) -> Regression:
    """Fit a sum of columns by least squares."""
    names = tuple(columns)
    matrix = np.stack([columns[n] for n in names], axis=1)
    length = np.linalg.norm(matrix, axis=0)
    scaled = matrix / length
    values = np.linalg.lstsq(scaled, measured, rcond=None)[0]
    residual = measured - scaled @ values
    scores = scaled * residual[:, None]
    plan = BlockPlan.of(measured, residual, scores, rate_hz)
    covariance, half = np.empty((0, 0)), np.full(len(names), np.inf)
    if plan.n_blocks > len(names):
        # As many parameters as were fitted make the block sums smaller than they are.
        spent = (plan.n_blocks - 1) / (plan.n_blocks - len(names))
        scaled_covariance = spent * block_sandwich(scores, scaled.T @ scaled, plan.n_blocks)
        covariance = scaled_covariance / np.outer(length, length)
        wide = float(student_t.ppf((1.0 + ci_level) / 2.0, plan.n_blocks - len(names)))
        half = wide * np.sqrt(np.diag(covariance))
    elif (spare := measured.size - len(names)) > 0:
        variance = np.diag(np.linalg.inv(scaled.T @ scaled)) * (residual @ residual) / spare
        wide = float(student_t.ppf((1.0 + ci_level) / 2.0, spare))
        half = wide * np.sqrt(variance) / length
    return Regression(
        names=names,
        values=values / length,
        residual=residual,
        covariance=covariance,
        half_width=half,
        condition_number=float(np.linalg.cond(scaled)),
        ci_method=plan.ci_method,
        doubt=plan.doubt,
        caution=plan.caution,
    )


@dataclass(frozen=True, slots=True)
class BlockPlan:
    """How many blocks a record makes, and how good they are."""

    n_blocks: int  # 0 where the record is too short for any
    ci_method: str  # how a covariance is made of them
    doubt: str = ""  # why there are none, and why they are few; empty where all is well
    caution: str = ""

    @classmethod
    def of(
        cls,
        measured: np.ndarray,
        residual: np.ndarray,
        scores: np.ndarray,
        rate_hz: float | None,
    ) -> "BlockPlan":
        """Plan the blocks of a regression."""
        rate, unit = (1.0, "samples") if rate_hz is None else (rate_hz, "s")
        length = measured.size / rate
        # What is left of a perfect fit is rounding, however long it stays correlated.
        perfect = np.linalg.norm(residual) <= _ROUNDING * np.linalg.norm(measured)
        correlated = 0.0 if perfect else max(correlation_time(s, rate_hz=rate) for s in scores.T)
        told = f"{length:.3g} {unit} long, while its errors stay correlated for {correlated:.3g}"
        if measured.size < _SAMPLES_PER_BLOCK * FEWEST_BLOCKS:
            needed_size = _SAMPLES_PER_BLOCK * FEWEST_BLOCKS
            return cls(
                0,
                "none",
                f"the record is too short for an interval: it has {measured.size} samples. Record "
                f"at least {needed_size}",
            )
        n_blocks, caution = count_blocks(length, correlation_time_s=correlated), ""
        n_blocks = min(n_blocks, measured.size // _SAMPLES_PER_BLOCK)
        if not n_blocks:
            needed = FEWEST_BLOCKS * correlated
            if length < _FEWEST_TIMES * needed:
                return cls(
                    0,
                    "none",
                    f"the record is too short for an interval: {told} {unit}. Record at least "
                    f"{CORRELATION_TIMES_PER_BLOCK * needed:.3g} {unit}",
                )
            n_blocks = FEWEST_BLOCKS
            caution = (
                f"the intervals may be too narrow: the record is {told} {unit}. Record "
                f"{CORRELATION_TIMES_PER_BLOCK * needed:.3g} {unit}, or take a model that leaves "
                "less"
            )
        method = f"block sandwich over {n_blocks} blocks of {length / n_blocks:.3g} {unit}"
        return cls(n_blocks, f"{method}, Student's t", "", caution)
