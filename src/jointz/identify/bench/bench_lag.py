"""Which lag a bench's torque has, of which kind, and whether the records tell it at all."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from jointz.identify.bench.bench_band import BandRecord
from jointz.identify.bench.bench_regression import (
    LONGEST_LAG_S,
    SHORTEST_LAG_S,
    Lag,
    LagPrior,
    Regression,
    profile_lag,
    solve_regression,
)
from jointz.kernels.block_sandwich import block_sandwich, correlation_time, count_blocks

LagModel = Literal["delay", "first_order", "mixed"]

_FREE: dict[LagModel, tuple[str, ...]] = {
    "delay": ("total",),
    "first_order": ("tau",),
    "mixed": ("total", "spread"),
}
#: A kind of lag is refused where the spread lies this many sds from what the kind says.
_REFUSED = 2.5
#: Above this the regressors are one motion, and what the filter leaves decides.
LARGEST_CONDITION = 300.0
#: A lag that this far from the best one is not refused is not told by the records, s.
_FAR_LAG_S = 0.002
_PROFILE_STEP_S = 0.001
#: Torque that neither model nor white noise explains may hide in the estimates: the best
#: fit may have taken up this share of what it leaves.
_HIDDEN_SHARE = 0.5
#: Of noise alone, a lag this many sds from the best one is refused.
_LAG_SDS = 2.5
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class LagChoice:
    """The regression with the lag that was given, asked for or chosen."""

    model: LagModel  # the kind of the lag
    regression: Regression  # the fit
    # of the values and the free parts of the lag; what the choice of the kind leaves open is in it.
    # Infinite where the records are too short
    covariance: np.ndarray
    n_blocks: int  # blocks behind it; 0 where the records are too short
    # lags that the records do not refuse, where they do not tell the lag
    range_s: tuple[float, float] | None = None


def choose_lag(
    records: Sequence[BandRecord],
    *,
    known_s: tuple[float, float] | None,
    model: LagModel | None,
    friction: bool,
) -> LagChoice:
    """Fit the load with the lag that is given, asked for or chosen.

    A spring without inertia moves in step with its torque: a lag T then is a damping K*T,
    and no record tells one from the other. So lags 2 ms from the best are tried. Where one
    of them fits nearly as well, the lag stays undecided: it is held at the one nearest to
    zero (or to what is known), and the values' change over all lags that are not refused
    enters their covariance as an sd of half its size.
    """
    if known_s is not None and known_s[1] == 0.0:
        kind = model or "delay"
        start = Lag(known_s[0], known_s[0] ** 2 if kind == "first_order" else 0.0)
        free = ("spread",) if kind == "mixed" else ()
        fit = solve_regression(records, start=start, free=free, friction=friction)
        return LagChoice(kind, fit, *_sandwich(fit, records[0].step_s))
    prior = _prior(records, known_s, friction=friction) if known_s else None
    if model is None and prior is None:
        choice = _tested(records, friction=friction)
    else:
        kind = model or "delay"
        fit = _estimated(records, kind, friction=friction, prior=prior)
        choice = LagChoice(kind, fit, *_sandwich(fit, records[0].step_s))
    return _told_or_held(records, choice)


def _estimated(
    records: Sequence[BandRecord],
    model: LagModel,
    *,
    friction: bool,
    start: Lag | None = None,
    prior: LagPrior | None = None,
) -> Regression:
    return solve_regression(records, start=start, free=_FREE[model], friction=friction, prior=prior)


def _prior(
    records: Sequence[BandRecord], known_s: tuple[float, float], *, friction: bool
) -> LagPrior:
    """Return the prior in units of the sum of squares, whose noise is correlated in time."""
    held = solve_regression(records, start=Lag(known_s[0]), free=(), friction=friction)
    return LagPrior(*known_s, _noise_weight(held, records[0].step_s) / known_s[1] ** 2)


def _noise_weight(fit: Regression, step_s: float) -> float:
    """Return the residual's spectral density: variance over what is independent of it."""
    correlated = correlation_time(fit.residual, rate_hz=1.0 / step_s)
    return float(np.mean(fit.residual**2)) * max(1.0, 2.0 * correlated / step_s)


def _tested(records: Sequence[BandRecord], *, friction: bool) -> LagChoice:
    """Choose the kind of the lag; the sum of squares of a wrong one refuses it."""
    step_s = records[0].step_s
    mixed = _estimated(records, "mixed", friction=friction)
    covariance, n_blocks = _sandwich(mixed, step_s)
    accepted = _accepted(mixed, covariance, n_blocks)
    if len(accepted) != 1:
        return LagChoice("mixed", mixed, covariance, n_blocks)
    total = mixed.lag.total_s
    start = Lag(total, total**2 if accepted[0] == "first_order" else 0.0)
    fit = _estimated(records, accepted[0], friction=friction, start=start)
    covariance, n_blocks = _sandwich(fit, step_s)
    # The other kind was possible: what it would change is an error of the choice.
    moved = np.append(mixed.values - fit.values, mixed.lag.total_s - fit.lag.total_s)
    return LagChoice(accepted[0], fit, covariance + np.outer(moved, moved), n_blocks)


def _accepted(mixed: Regression, covariance: np.ndarray, n_blocks: int) -> list[LagModel]:
    """Return which simple kinds of lag the free spread does not refuse."""
    if n_blocks == 0 or mixed.condition_number > LARGEST_CONDITION:
        return ["delay"]
    total, spread = mixed.lag.total_s, mixed.lag.spread_s2
    slope = np.array([-2.0 * total, 1.0])  # of spread - total^2 by total and spread
    filter_sd = float(np.sqrt(slope @ covariance[-2:, -2:] @ slope))
    accepted: list[LagModel] = []
    if abs(spread) <= _REFUSED * float(np.sqrt(covariance[-1, -1])):
        accepted.append("delay")
    if total > 0.0 and abs(spread - total**2) <= _REFUSED * filter_sd:
        accepted.append("first_order")
    return accepted


def _told_or_held(records: Sequence[BandRecord], choice: LagChoice) -> LagChoice:
    """Return the choice if the records tell its lag; else hold the lag and widen."""
    fit, prior, step_s = choice.regression, choice.regression.prior, records[0].step_s
    low, high = SHORTEST_LAG_S, LONGEST_LAG_S
    nearest = 0.0
    if prior is not None:
        low, high = (prior.value_s + s * _LAG_SDS * prior.sd_s for s in (-1.0, 1.0))
        nearest = prior.value_s
    doubt = fit.cost + _cost_of_doubt(records, fit)
    far = fit.lag.total_s + np.array([-_FAR_LAG_S, _FAR_LAG_S])
    far = far[(far >= low) & (far <= high)]
    if all(one.cost > doubt for one in profile_lag(records, fit, far)):
        return choice
    lags = np.arange(low, high + _PROFILE_STEP_S / 2, _PROFILE_STEP_S)
    tried = [one for one in profile_lag(records, fit, np.append(far, lags)) if one.cost <= doubt]
    held = min(tried, key=lambda one: abs(one.lag.total_s - nearest))
    covariance, n_blocks = _sandwich(held, step_s)
    reach = np.max([np.abs(one.values - held.values) for one in tried], axis=0) / 2.0
    seen = [one.lag.total_s for one in tried]
    return LagChoice(
        "delay", held, covariance + np.diag(reach**2), n_blocks, (min(seen), max(seen))
    )


def _cost_of_doubt(records: Sequence[BandRecord], fit: Regression) -> float:
    """Return by how much the sum of squares of a lag may be larger without refusing it."""
    n = fit.residual.size
    noise = float(np.mean([record.torque_noise_nm2 for record in records]))
    unexplained = max(float(np.mean(fit.residual**2)) - noise, 0.0)
    by_noise = _LAG_SDS**2 * _noise_weight(fit, records[0].step_s)
    return _HIDDEN_SHARE * n * unexplained + by_noise


def _sandwich(regression: Regression, step_s: float) -> tuple[np.ndarray, int]:
    """Return the covariance of all fitted parameters, and its blocks; 0 where too short."""
    n_fitted = len(regression.bread)
    duration = regression.residual.size * step_s
    rounding = _ROUNDING * float(np.std(regression.measured))
    exact = float(np.std(regression.residual)) < rounding  # its correlation means nothing
    correlated = 0.0 if exact else correlation_time(regression.residual, rate_hz=1.0 / step_s)
    n_blocks = count_blocks(duration, correlation_time_s=correlated)
    size = np.sqrt(np.abs(np.diag(regression.bread)))
    if n_blocks <= n_fitted + 1 or size.min() == 0.0:
        return np.full((n_fitted, n_fitted), np.inf), 0
    bread = regression.bread / np.outer(size, size)
    scaled = block_sandwich(regression.scores / size, bread, n_blocks)
    scaled *= (n_blocks - 1) / (n_blocks - n_fitted)
    if regression.prior is not None and n_fitted > regression.values.size:
        pull = np.zeros(n_fitted)
        place = regression.values.size
        pull[place] = regression.prior.weight * regression.prior.sd_s / size[place]
        moved = np.linalg.solve(bread, pull)
        scaled += np.outer(moved, moved)
    return scaled / np.outer(size, size), n_blocks
