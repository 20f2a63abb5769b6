"""Lag of a bench's torque: its kind, and whether the records decide it."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from jointz.identify.bench.bench_regression import (
    LONGEST_LAG_S,
    SHORTEST_LAG_S,
    Lag,
    LagPrior,
    LoadModel,
    LoadRegression,
)
from jointz.identify.record.block_regression import fitted_sandwich
from jointz.kernels.block_sandwich import correlation_time, count_blocks

LagKind = Literal["delay", "first_order", "mixed"]

_FREE: dict[LagKind, tuple[str, ...]] = {
    "delay": ("total",),
    "first_order": ("tau",),
    "mixed": ("total", "spread"),
}
#: A kind of lag is refused where the spread lies this many sds from what the kind says.
_REFUSED = 2.5
#: Above this the regressors are one motion, and what the filter leaves decides.
LARGEST_CONDITION = 300.0
#: The records do not decide the lag if one this far from the best is not refused, s.
_FAR_LAG_S = 0.002
_PROFILE_STEP_S = 0.001
#: Torque that neither model nor white noise explains may hide in the estimates: the best
#: fit may have taken up this share of what it leaves.
_HIDDEN_SHARE = 0.5
#: Of noise alone, a lag this many sds from the best one is refused.
_LAG_SDS = 2.5
_ROUNDING = 1e-9
#: A known lag is refused if the records' own is so many of its sds, and 2 ms, from it.
_CONFLICT = 4.5


@dataclass(frozen=True, slots=True)
class LagChoice:
    """The regression with the known, requested or chosen lag."""

    kind: LagKind
    regression: LoadRegression
    # of ``regression.values`` and the free parts of the lag, error of the chosen kind included;
    # infinite where the records are too short
    covariance: np.ndarray
    n_blocks: int  # blocks behind the covariance; 0 where the records are too short
    # lags that the records do not refuse, where they leave the lag undecided
    range_s: tuple[float, float] | None = None
    at_end: bool = False  # whether the best lag is at an end of the search range
    contradicted: bool = False  # whether the records refuse the known lag


def choose_lag(
    model: LoadModel, *, known_s: tuple[float, float] | None, kind: LagKind | None
) -> LagChoice:
    """Fit the load with the known, requested or chosen lag.

    A spring without inertia moves in step with its torque: a lag T then is a damping K*T,
    and no record tells one from the other. So lags 2 ms from the best are tried. Where one
    of them fits nearly as well, the lag stays undecided: it is held at the one nearest to
    zero (or to what is known), and the values' change over all lags that are not refused
    enters their covariance as an sd of half its size.
    """
    if known_s is not None and known_s[1] == 0.0:
        kind = kind or "delay"
        start = Lag(known_s[0], known_s[0] ** 2 if kind == "first_order" else 0.0)
        return _choice(kind, model, model.fit(start, ("spread",) if kind == "mixed" else ()))
    if known_s is not None:
        # In units of the sum of squares, whose noise is correlated in time.
        held = model.fit_at(Lag(known_s[0]))
        weight = _noise_weight(held, model.step_s) / known_s[1] ** 2
        without = model
        model = replace(model, prior=LagPrior(*known_s, weight))
    if kind is None and known_s is None:
        choice = _tested(model)
    else:
        kind = kind or "delay"
        choice = _choice(kind, model, model.fit(None, _FREE[kind]))
    choice = _decided_or_held(model, choice)
    if known_s is None:
        return choice
    return replace(choice, contradicted=_contradicts(without, known_s))


def _contradicts(model: LoadModel, known_s: tuple[float, float]) -> bool:
    """Return whether the records by themselves decide a lag far from the known one."""
    free = _decided_or_held(model, _choice("delay", model, model.fit(None, _FREE["delay"])))
    far = abs(free.regression.lag.total_s - known_s[0]) > _CONFLICT * known_s[1] + _FAR_LAG_S
    return far and (free.at_end or free.range_s is None)


def _choice(kind: LagKind, model: LoadModel, fit: LoadRegression) -> LagChoice:
    return LagChoice(kind, fit, *_sandwich(fit, model.step_s))


def _noise_weight(fit: LoadRegression, step_s: float) -> float:
    """Return the residual's spectral density: its variance per independent sample."""
    correlated = correlation_time(fit.residual, rate_hz=1.0 / step_s)
    return float(np.mean(fit.residual**2)) * max(1.0, 2.0 * correlated / step_s)


def _tested(model: LoadModel) -> LagChoice:
    """Choose the kind of the lag; the sum of squares of a wrong one refuses it."""
    mixed = _choice("mixed", model, model.fit(None, _FREE["mixed"]))
    kinds = _accepted(mixed)
    if len(kinds) != 1:
        return mixed
    lag = mixed.regression.lag
    start = Lag(lag.total_s, lag.total_s**2 if kinds[0] == "first_order" else 0.0)
    choice = _choice(kinds[0], model, model.fit(start, _FREE[kinds[0]]))
    fit = choice.regression
    # The other kind was possible: what it would change is an error of the choice.
    moved = np.append(mixed.regression.values - fit.values, lag.total_s - fit.lag.total_s)
    return replace(choice, covariance=choice.covariance + np.outer(moved, moved))


def _accepted(mixed: LagChoice) -> list[LagKind]:
    """Return the simple kinds of lag that the free spread does not refuse."""
    if mixed.n_blocks == 0 or mixed.regression.condition_number > LARGEST_CONDITION:
        return ["delay"]
    total, spread = mixed.regression.lag.total_s, mixed.regression.lag.spread_s2
    slope = np.array([-2.0 * total, 1.0])  # of spread - total^2 by total and spread
    filter_sd = float(np.sqrt(slope @ mixed.covariance[-2:, -2:] @ slope))
    accepted: list[LagKind] = []
    if abs(spread) <= _REFUSED * float(np.sqrt(mixed.covariance[-1, -1])):
        accepted.append("delay")
    if total > 0.0 and abs(spread - total**2) <= _REFUSED * filter_sd:
        accepted.append("first_order")
    return accepted


def _decided_or_held(model: LoadModel, choice: LagChoice) -> LagChoice:
    """Return the choice if the records decide its lag; else hold the lag and widen."""
    fit, prior = choice.regression, model.prior
    low, high = SHORTEST_LAG_S, LONGEST_LAG_S
    nearest = 0.0
    if prior is not None:
        low, high = (prior.value_s + s * _LAG_SDS * prior.sd_s for s in (-1.0, 1.0))
        nearest = prior.value_s
    near = 0.5 * _PROFILE_STEP_S
    at_end = not SHORTEST_LAG_S + near < fit.lag.total_s < LONGEST_LAG_S - near
    choice = replace(choice, at_end=at_end and prior is None)
    doubt = fit.cost + _cost_of_doubt(model, fit)
    far = fit.lag.total_s + np.array([-_FAR_LAG_S, _FAR_LAG_S])
    far = far[(far >= low) & (far <= high)]
    if all(other.cost > doubt for other in model.profile(fit, far)):
        return choice
    lags = np.arange(low, high + _PROFILE_STEP_S / 2, _PROFILE_STEP_S)
    profile = model.profile(fit, np.append(far, lags))
    possible = [other for other in profile if other.cost <= doubt]
    held = min(possible, key=lambda other: abs(other.lag.total_s - nearest))
    reach = np.max([np.abs(other.values - held.values) for other in possible], axis=0) / 2.0
    totals = [other.lag.total_s for other in possible]
    widened = _choice("delay", model, held)
    return replace(
        widened,
        covariance=widened.covariance + np.diag(reach**2),
        range_s=(min(totals), max(totals)),
        at_end=choice.at_end,
    )


def _cost_of_doubt(model: LoadModel, fit: LoadRegression) -> float:
    """Return by how much the sum of squares of a lag may be larger without refusing it."""
    noise = float(np.mean([record.torque_noise_nm2 for record in model.records]))
    unexplained = max(float(np.mean(fit.residual**2)) - noise, 0.0)
    by_noise = _LAG_SDS**2 * _noise_weight(fit, model.step_s)
    return _HIDDEN_SHARE * fit.residual.size * unexplained + by_noise


def _sandwich(regression: LoadRegression, step_s: float) -> tuple[np.ndarray, int]:
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
    scaled = fitted_sandwich(regression.scores / size, bread, n_blocks)
    if regression.prior is not None and n_fitted > regression.values.size:
        pull = np.zeros(n_fitted)
        place = regression.values.size
        pull[place] = regression.prior.weight * regression.prior.sd_s / size[place]
        moved = np.linalg.solve(bread, pull)
        scaled += np.outer(moved, moved)
    return scaled / np.outer(size, size), n_blocks
