"""Regression of a load's torque on its motion, seen through a lag, in one frequency band.

Derivatives, delay and first-order filter act on the angle's spectrum, so that no difference
quotient and no fractional shift of a noisy record is needed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import fft

from jointz.identify.bench.bench_band import BandRecord

#: Largest spread of a lag on the unphysical side of a pure delay, s^2.
_MOST_NEGATIVE_SPREAD = -5e-6
#: Lags that instruments have, s: the torque may be late, or the angle somewhat.
SHORTEST_LAG_S, LONGEST_LAG_S = -0.01, 0.02
_LAG_GRID_S = np.linspace(SHORTEST_LAG_S, LONGEST_LAG_S, 16)
_PASSES = 30
_SMALL_LAG_STEP_S = 1e-9
_SHORTEST_STEP_SHARE = 1e-3
_WITHOUT_FRICTION = 3  # values: K, B, J


@dataclass(frozen=True, slots=True)
class Lag:
    """A lag of the torque record: a delay, and a first-order filter of time constant tau."""

    total_s: float = 0.0  # delay plus tau
    # square of tau; zero for a pure delay. Slightly negative values, which noise can bring about,
    # raise high frequencies as much as positive ones lower them
    spread_s2: float = 0.0

    @property
    def filter_time_s(self) -> float:
        """Time constant of the filter, s."""
        return float(np.sqrt(max(self.spread_s2, 0.0)))

    def response(self, omega: np.ndarray) -> np.ndarray:
        """Return the frequency response."""
        if self.spread_s2 < 0.0:
            response: np.ndarray = np.exp(
                -1j * omega * self.total_s - omega**2 * self.spread_s2 / 2
            )
            return response
        tau = self.filter_time_s
        response = np.exp(-1j * omega * (self.total_s - tau)) / (1.0 + 1j * omega * tau)
        return response


@dataclass(frozen=True, slots=True)
class LagPrior:
    """What is known of the total lag before the fit."""

    value_s: float  # of the lag, s
    sd_s: float
    # penalty of the sum of squares by the square of the lag's difference, N^2*m^2/s^2
    weight: float


@dataclass(frozen=True, slots=True)
class Regression:
    """Solution of the regression for one kind of lag."""

    values: np.ndarray  # K, B, J and, where fitted, the friction torque
    lag: Lag
    # columns of ``values`` and of the free parts of the lag, offsets removed
    regressors: np.ndarray
    scores: np.ndarray  # estimating functions, one row a sample
    bread: np.ndarray  # their derivative, corrected for the noise of the angle
    residual: np.ndarray  # of the filtered torque, offsets removed
    measured: np.ndarray
    noise_share: float  # share of the acceleration's variance that is noise of the angle
    cost: float  # sum of squares less what angle noise adds to it, penalty of the prior included
    prior: LagPrior | None = None  # what was known of the lag

    @property
    def condition_number(self) -> float:
        """Condition number of the scaled regressors, the prior of the lag among them."""
        gram = self.regressors.T @ self.regressors
        if self.prior is not None and len(gram) > self.values.size:
            gram[self.values.size, self.values.size] += self.prior.weight
        size = np.sqrt(np.diag(gram))
        if size.min() == 0.0:
            return float("inf")
        eigenvalues = np.linalg.eigvalsh(gram / np.outer(size, size))
        return float(np.sqrt(eigenvalues[-1] / max(eigenvalues[0], 1e-300)))


def solve_regression(
    records: Sequence[BandRecord],
    *,
    start: Lag | None,
    free: Sequence[str],
    friction: bool,
    prior: LagPrior | None = None,
) -> Regression:
    """Fit K, B, J, friction and the free parts of the lag.

    Variable projection: given the lag, everything else is linear and solved exactly. The
    lag's best value on a grid of -10 to 20 ms is refined by Gauss-Newton steps, cut until
    the sum of squares falls; it never leaves the range of the grid.

    Noise of the angle adds to the regressors' sums of squares; what it adds is known from its
    sd and taken off (corrected scores, Stefanski 1989, doi:10.1080/03610928908830159), so that
    inertia is not attenuated. Noise of the torque is the residual.
    """
    lags = _grid(free) if start is None else [start]
    found = [_given_lag(records, lag, friction=friction, prior=prior) for lag in lags]
    fit = min(found, key=lambda one: one.cost)
    for _ in range(_PASSES if free else 0):
        moved = _lag_step(records, fit, free)
        fit, taken = _descended(records, fit, free, moved)
        if taken == 0.0 or np.abs(taken * moved[0]) < _SMALL_LAG_STEP_S:
            break
    return _with_lag_scores(records, fit, free)


def _grid(free: Sequence[str]) -> list[Lag]:
    if "tau" in free:
        return [Lag(t, t**2) for t in _LAG_GRID_S if t >= 0.0]
    return [Lag(t) for t in _LAG_GRID_S]


def profile_lag(
    records: Sequence[BandRecord], fit: Regression, lags_s: np.ndarray
) -> list[Regression]:
    """Return the regressions at given total lags, all else fitted anew."""
    return [
        _given_lag(
            records,
            Lag(float(t), fit.lag.spread_s2 if t >= fit.lag.filter_time_s else 0.0),
            friction=fit.values.size > _WITHOUT_FRICTION,
            prior=fit.prior,
        )
        for t in lags_s
    ]


def _given_lag(
    records: Sequence[BandRecord], lag: Lag, *, friction: bool, prior: LagPrior | None
) -> Regression:
    values = np.zeros(_WITHOUT_FRICTION + friction)
    X, y, noise = _joined(records, lag, values, ())
    size = np.linalg.norm(X, axis=0)
    size[size == 0.0] = 1.0
    scaled = (X.T @ X - noise) / np.outer(size, size)
    values = np.linalg.lstsq(scaled, X.T @ y / size, rcond=1e-13)[0] / size
    residual = y - X @ values
    cost = float(residual @ residual - values @ noise @ values)
    if prior is not None:
        cost += prior.weight * (lag.total_s - prior.value_s) ** 2
    return Regression(
        values=values,
        lag=lag,
        regressors=X,
        scores=X * residual[:, None] + noise @ values / y.size,
        bread=X.T @ X - noise,
        residual=residual,
        measured=y,
        noise_share=float(noise[2, 2] / size[2] ** 2),
        cost=cost,
        prior=prior,
    )


def _with_lag_scores(
    records: Sequence[BandRecord], fit: Regression, free: Sequence[str]
) -> Regression:
    """Add the free parts of the lag to regressors, scores and bread."""
    if not free:
        return fit
    X, y, noise = _joined(records, fit.lag, fit.values, free)
    residual = y - X[:, : fit.values.size] @ fit.values
    bread = X.T @ X - noise
    if fit.prior is not None:
        bread[fit.values.size, fit.values.size] += fit.prior.weight
    scores = X * residual[:, None] + noise[:, : fit.values.size] @ fit.values / y.size
    return replace(fit, regressors=X, scores=scores, bread=bread)


def _lag_step(records: Sequence[BandRecord], fit: Regression, free: Sequence[str]) -> np.ndarray:
    """Return the step of Gauss and Newton for the free parts of the lag."""
    full = _with_lag_scores(records, fit, free)
    moment = full.scores.sum(axis=0)
    if fit.prior is not None:
        moment[fit.values.size] -= fit.prior.weight * (fit.lag.total_s - fit.prior.value_s)
    size = np.sqrt(np.abs(np.diag(full.bread)))
    size[size == 0.0] = 1.0
    step = np.linalg.lstsq(full.bread / np.outer(size, size), moment / size, rcond=1e-13)[0] / size
    moved: np.ndarray = step[fit.values.size :]
    return moved


def _descended(
    records: Sequence[BandRecord], fit: Regression, free: Sequence[str], moved: np.ndarray
) -> tuple[Regression, float]:
    """Return the fit after a step, cut until its cost falls, and the share that was taken."""
    share = 1.0
    while share > _SHORTEST_STEP_SHARE:
        lag = _moved(fit.lag, share * moved, free)
        found = _given_lag(
            records, lag, friction=fit.values.size > _WITHOUT_FRICTION, prior=fit.prior
        )
        if found.cost < fit.cost:
            return found, share
        share /= 4.0
    return fit, 0.0


def _moved(lag: Lag, step: np.ndarray, free: Sequence[str]) -> Lag:
    total, spread = lag.total_s, lag.spread_s2
    for name, change in zip(free, step, strict=True):
        if name == "spread":
            spread = float(np.clip(spread + change, _MOST_NEGATIVE_SPREAD, LONGEST_LAG_S**2))
        else:
            total = float(np.clip(total + change, SHORTEST_LAG_S, LONGEST_LAG_S))
    if "tau" in free:
        total = max(total, 0.0)
        spread = total**2
    return Lag(total, spread)


def _joined(
    records: Sequence[BandRecord], lag: Lag, values: np.ndarray, free: Sequence[str]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    parts = [_columns(record, lag, values, free) for record in records]
    X = np.concatenate([part[0] for part in parts])
    y = np.concatenate([part[1] for part in parts])
    return X, y, np.sum([part[2] for part in parts], axis=0)


def _columns(
    record: BandRecord, lag: Lag, values: np.ndarray, free: Sequence[str]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a trial's regressors, torque, and what angle noise adds to the sums of squares."""
    n, keep = record.torque.size, record.keep
    jw = 1j * record.omega
    seen = record.window * lag.response(record.omega)
    of_angle = [seen, seen * jw, seen * jw**2]
    spectra = [gain * record.angle for gain in of_angle]
    if values.size > _WITHOUT_FRICTION:
        of_angle.append(np.zeros_like(seen))
        spectra.append(seen * record.direction)
    model_gain = sum(v * gain for v, gain in zip(values, of_angle, strict=True))
    model = sum(v * column for v, column in zip(values, spectra, strict=True))
    for name in free:
        slope = _lag_slope(lag, record.omega, name)
        of_angle.append(slope * model_gain)
        spectra.append(slope * model)
    X = fft.irfft(np.stack(spectra), n).T[keep]  # at once: several times as fast
    y = record.torque[keep]
    gains = np.column_stack(of_angle)
    twice = np.full(record.omega.size, 2.0)  # negative frequencies
    twice[0] = 1.0
    density = record.angle_noise_sd**2 * y.size / n
    noise = density * np.real((gains.conj() * twice[:, None]).T @ gains)
    return X - X.mean(axis=0), y - y.mean(), noise


def _lag_slope(lag: Lag, omega: np.ndarray, name: str) -> np.ndarray:
    """Return the derivative of the logarithm of the lag's response."""
    jw, tau = 1j * omega, lag.filter_time_s
    slope: np.ndarray
    if name == "total":
        slope = -jw
    elif name == "spread":
        slope = jw**2 / (2.0 * (1.0 + jw * tau))
    else:  # tau, with the total
        slope = -jw / (1.0 + jw * tau)
    return slope
