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
    # square of tau, s^2; 0 for a pure delay. Slightly negative values, which noise can bring about,
    # raise high frequencies as much as positive ones lower them
    spread_s2: float = 0.0

    @property
    def filter_time_s(self) -> float:
        """Time constant of the filter, s."""
        return float(np.sqrt(max(self.spread_s2, 0.0)))

    def response(self, omega: np.ndarray) -> np.ndarray:
        """Return the frequency response."""
        if self.spread_s2 < 0.0:
            return np.asarray(np.exp(-1j * omega * self.total_s - omega**2 * self.spread_s2 / 2))
        tau = self.filter_time_s
        return np.asarray(np.exp(-1j * omega * (self.total_s - tau)) / (1.0 + 1j * omega * tau))

    def log_slope(self, omega: np.ndarray, name: str) -> np.ndarray:
        """Return the derivative of the logarithm of the response by one part of the lag."""
        jw, tau = 1j * omega, self.filter_time_s
        if name == "total":
            return np.asarray(-jw)
        if name == "spread":
            return np.asarray(jw**2 / (2.0 * (1.0 + jw * tau)))
        return np.asarray(-jw / (1.0 + jw * tau))  # tau, with the total

    def moved(self, step: np.ndarray, free: Sequence[str]) -> "Lag":
        """Return the lag with its free parts changed, inside the range of instruments."""
        total, spread = self.total_s, self.spread_s2
        for name, change in zip(free, step, strict=True):
            if name == "spread":
                spread = float(np.clip(spread + change, _MOST_NEGATIVE_SPREAD, LONGEST_LAG_S**2))
            else:
                total = float(np.clip(total + change, SHORTEST_LAG_S, LONGEST_LAG_S))
        if "tau" in free:
            total = max(total, 0.0)
            spread = total**2
        return Lag(total, spread)


@dataclass(frozen=True, slots=True)
class LagPrior:
    """Prior of the total lag."""

    value_s: float  # expected total lag
    sd_s: float  # sd of the total lag
    weight: float  # weight of the squared difference from ``value_s`` in the cost, N^2*m^2/s^2


@dataclass(frozen=True, slots=True)
class LoadRegression:
    """Fit of K, B, J and friction with one lag."""

    values: np.ndarray  # K, B, J (SI) and, where fitted, the friction torque, N*m
    lag: Lag
    regressors: np.ndarray  # columns of ``values`` and of the free parts of the lag, means removed
    scores: np.ndarray  # estimating functions, one row a sample
    # derivative of the estimating functions, corrected for the noise of the angle
    bread: np.ndarray
    residual: np.ndarray  # measured minus modelled torque, N*m
    measured: np.ndarray  # filtered torque, mean removed, N*m
    noise_share: float  # share of the acceleration's variance that is noise of the angle
    # sum of squares less the part of the angle's noise, prior of the lag included, N^2*m^2
    cost: float
    prior: LagPrior | None = None  # prior of the lag

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


@dataclass(frozen=True, slots=True)
class LoadModel:
    """Model of one load, and the records that it is fitted to."""

    records: Sequence[BandRecord]
    friction: bool  # whether friction is fitted
    prior: LagPrior | None = None

    @property
    def step_s(self) -> float:
        """Time between samples."""
        return self.records[0].step_s

    def fit(self, start: Lag | None, free: Sequence[str]) -> LoadRegression:
        """Fit K, B, J, friction and the free parts of the lag.

        Variable projection: given the lag, everything else is linear and solved exactly. The
        lag's best value on a grid of -10 to 20 ms is refined by Gauss-Newton steps, cut until
        the sum of squares falls; it never leaves the range of the grid.

        Noise of the angle adds to the regressors' sums of squares; what it adds is known from its
        sd and taken off (corrected scores, Stefanski 1989, doi:10.1080/03610928908830159), so that
        inertia is not attenuated. Noise of the torque is the residual.
        """
        if start is not None:
            lags = [start]
        elif "tau" in free:
            lags = [Lag(t, t**2) for t in _LAG_GRID_S if t >= 0.0]
        else:
            lags = [Lag(t) for t in _LAG_GRID_S]
        fit = min((self.fit_at(lag) for lag in lags), key=lambda fit: fit.cost)
        for _ in range(_PASSES if free else 0):
            step = self._lag_step(fit, free)
            fit, share = self._descended(fit, free, step)
            if share == 0.0 or np.abs(share * step[0]) < _SMALL_LAG_STEP_S:
                break
        return self._with_lag_scores(fit, free)

    def fit_at(self, lag: Lag) -> LoadRegression:
        """Fit everything but the lag."""
        values = np.zeros(_WITHOUT_FRICTION + self.friction)
        X, y, noise = self._columns(lag, values, ())
        size = np.linalg.norm(X, axis=0)
        size[size == 0.0] = 1.0
        scaled = (X.T @ X - noise) / np.outer(size, size)
        values = np.linalg.lstsq(scaled, X.T @ y / size, rcond=1e-13)[0] / size
        residual = y - X @ values
        cost = float(residual @ residual - values @ noise @ values)
        if self.prior is not None:
            cost += self.prior.weight * (lag.total_s - self.prior.value_s) ** 2
        return LoadRegression(
            values=values,
            lag=lag,
            regressors=X,
            scores=X * residual[:, None] + noise @ values / y.size,
            bread=X.T @ X - noise,
            residual=residual,
            measured=y,
            noise_share=float(noise[2, 2] / size[2] ** 2),
            cost=cost,
            prior=self.prior,
        )

    def profile(self, fit: LoadRegression, lags_s: np.ndarray) -> list[LoadRegression]:
        """Return the regressions at given total lags, all else fitted anew."""
        lag = fit.lag
        return [
            self.fit_at(Lag(float(t), lag.spread_s2 if t >= lag.filter_time_s else 0.0))
            for t in lags_s
        ]

    def _with_lag_scores(self, fit: LoadRegression, free: Sequence[str]) -> LoadRegression:
        """Add the free parts of the lag to regressors, scores and bread."""
        if not free:
            return fit
        X, y, noise = self._columns(fit.lag, fit.values, free)
        count = fit.values.size
        residual = y - X[:, :count] @ fit.values
        bread = X.T @ X - noise
        if self.prior is not None:
            bread[count, count] += self.prior.weight
        scores = X * residual[:, None] + noise[:, :count] @ fit.values / y.size
        return replace(fit, regressors=X, scores=scores, bread=bread)

    def _lag_step(self, fit: LoadRegression, free: Sequence[str]) -> np.ndarray:
        """Return the step of Gauss and Newton for the free parts of the lag."""
        full = self._with_lag_scores(fit, free)
        moment = full.scores.sum(axis=0)
        if self.prior is not None:
            moment[fit.values.size] -= self.prior.weight * (fit.lag.total_s - self.prior.value_s)
        size = np.sqrt(np.abs(np.diag(full.bread)))
        size[size == 0.0] = 1.0
        scaled = full.bread / np.outer(size, size)
        step = np.linalg.lstsq(scaled, moment / size, rcond=1e-13)[0] / size
        return np.asarray(step[fit.values.size :])

    def _descended(
        self, fit: LoadRegression, free: Sequence[str], step: np.ndarray
    ) -> tuple[LoadRegression, float]:
        """Return the fit after a step, cut until its cost falls, and the share that was taken."""
        share = 1.0
        while share > _SHORTEST_STEP_SHARE:
            candidate = self.fit_at(fit.lag.moved(share * step, free))
            if candidate.cost < fit.cost:
                return candidate, share
            share /= 4.0
        return fit, 0.0

    def _columns(
        self, lag: Lag, values: np.ndarray, free: Sequence[str]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return regressors, torque, and the part of angle noise in the sums of squares."""
        parts = [_record_columns(record, lag, values, free) for record in self.records]
        X, y, noise = zip(*parts, strict=True)
        return np.concatenate(X), np.concatenate(y), np.sum(noise, axis=0)


def _record_columns(
    record: BandRecord, lag: Lag, values: np.ndarray, free: Sequence[str]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    n, keep = record.torque.size, record.keep
    jw = 1j * record.omega
    delayed = record.window * lag.response(record.omega)
    of_angle = [delayed, delayed * jw, delayed * jw**2]
    spectra = [gain * record.angle for gain in of_angle]
    if values.size > _WITHOUT_FRICTION:
        of_angle.append(np.zeros_like(delayed))
        spectra.append(delayed * record.direction)
    model_gain = sum(v * gain for v, gain in zip(values, of_angle, strict=True))
    model = sum(v * column for v, column in zip(values, spectra, strict=True))
    for name in free:
        slope = lag.log_slope(record.omega, name)
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
