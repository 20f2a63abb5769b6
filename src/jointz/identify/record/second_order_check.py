"""Tests of a second-order joint's residual for a stretch reflex and for further dynamics."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_toeplitz
from scipy.signal import bilinear, lfilter

from jointz.identify.record.joint_estimators import JointSignals, Solution, simulate_motion
from jointz.kernels.block_sandwich import autocorrelation, correlation_time, count_blocks
from jointz.kernels.derivatives import derivative
from jointz.results.estimates import REACH_95, ParameterEstimate
from jointz.results.series.second_order_verdict import SecondOrderCheck

#: Of each of the two tests: both together refuse one sound record in a hundred.
_LEVEL = 0.005
_FLIPS = 999
#: Samples of the thinned record in one period of the cutoff.
_SAMPLES_PER_PERIOD = 5.0
#: Reflex paths: latency, corner of the critically damped muscle, and threshold as a share of
#: the largest velocity.
_LATENCIES_S = (0.025, 0.04, 0.055, 0.07)
_MUSCLES_HZ = (1.5, 4.0, 10.0)
_THRESHOLDS = (0.0, 0.3)
#: Linear paths: a spring behind a damper relaxes in the one, velocity is late by the other.
_RELAXATIONS_S = (0.008, 0.02, 0.05, 0.15, 0.4)
_DELAYS_S = (0.015, 0.03, 0.05, 0.07)
#: Order of the autoregression that whitens the residual, and white power added to it: what lies
#: above the low-pass is not amplified.
_WHITENING_LAGS = 12
_FLOOR = 0.01
#: Lags of the angle, in half periods of the cutoff, that together stand for any linear dynamics.
_LAGS = range(-3, 13)
#: Share of the largest eigenvalue below which a direction of these lags is dropped.
_RANK = 1e-11
#: A path that changes K, B and J by less than this share is left to the intervals.
_SMALLEST_SHIFT = 0.02
_ROUNDING = 1e-6
#: A lag of the torque is looked for up to this, in so many steps.
_LONGEST_LAG_S = 0.03
_LAG_STEPS = 2


def check_second_order(
    estimate: Callable[[JointSignals], Solution],
    solution: Solution,
    signals: JointSignals,
    *,
    cutoff_hz: float,
    covariance: np.ndarray,
) -> SecondOrderCheck:
    """Test whether more than K, B and J answers the motion.

    Score tests: the residual, whitened by its autocovariance, is correlated with the torque of
    candidate paths, less what K, B and J explain of them, in blocks of time. The largest of the
    scores, each over the root of its blocks' sum of squares, is compared with itself under
    random signs of the blocks (Hansen 1996), so that neither the colour of the noise nor the
    number of candidates matters. Paths of the reflex are also freed of all linear dynamics of
    the angle: a lag is no reflex. The check fails where a p-value is small and a path moves K, B
    or J out of their 95 % intervals, whatever the level of those that are shown.
    """
    reach = np.fmax(REACH_95 * np.sqrt(np.diag(covariance)), _SMALLEST_SHIFT * np.abs(solution.kbj))
    equations = _Equations.of(solution, signals, cutoff_hz)
    check = _check(equations, cutoff_hz, reach)
    if check.finding != "higher_order" or not equations.is_regression:
        return check
    lag_s = 0.0
    for _ in range(_LAG_STEPS):
        lag_s += equations.lag()
        if not abs(lag_s) < _LONGEST_LAG_S:
            return check
        earlier = _earlier_torque(signals, lag_s)
        equations = _Equations.of(estimate(earlier), earlier, cutoff_hz)
    explained = _check(equations, cutoff_hz, reach).finding == "none"
    return replace(check, lag_s=lag_s) if explained else check


def _check(equations: "_Equations", cutoff_hz: float, reach: np.ndarray) -> SecondOrderCheck:
    linear = _linear_paths(equations)
    any_linear = np.hstack([_delayed_angles(equations, cutoff_hz), linear])
    reflex_p, reflex_shift = equations.test(_reflex_paths(equations), any_linear)
    linear_p, linear_shift = equations.test(np.hstack([linear, -linear]))
    if reflex_p is None or linear_p is None:
        return SecondOrderCheck("not_tested", reflex_p, linear_p)
    finding = "none"
    if np.any(np.maximum(reflex_shift, linear_shift) > reach):
        finding = "reflex" if reflex_p < _LEVEL else "higher_order"
    return SecondOrderCheck(finding, reflex_p, linear_p)


def _earlier_torque(signals: JointSignals, lag_s: float) -> JointSignals:
    """Return the signals with the torque shifted to earlier times, edges without torque cut off."""
    edge = int(np.ceil(abs(lag_s) * signals.rate_hz)) + 1
    torque = CubicSpline(signals.time, signals.torque)(signals.time + lag_s)
    shifted = replace(signals, torque=torque, command=None)
    names = ("time", "angle", "velocity", "acceleration", "torque")
    return replace(shifted, **{name: getattr(shifted, name)[edge:-edge] for name in names})


def withhold_parameters(
    parameters: Sequence[ParameterEstimate], check: SecondOrderCheck, model: str
) -> tuple[tuple[ParameterEstimate, ...], str]:
    """Return K, B, J without values (kept as ``unbounded``), and a note of the reason."""
    kept = tuple(
        replace(
            p,
            value=None,
            ci_low=None,
            ci_high=None,
            status="undecided",
            ci_method="none",
            unbounded=p.value if p.unbounded is None else p.unbounded,
        )
        for p in parameters
    )
    values = ", ".join(
        f"{p.name} {p.unbounded:.3g} {p.unit}" for p in kept if p.unbounded is not None
    )
    fit = f". The second-order fit reads {values}" if values else ""
    return kept, f"undecided: {check.advice(model)}{fit}"


@dataclass(frozen=True, slots=True)
class _Equations:
    """Estimating equations of a fit, thinned, and the motion that is free of its noise."""

    rate_hz: float
    values: np.ndarray  # K, B, J, SI
    residual: np.ndarray  # N*m or rad
    instruments: np.ndarray
    regressors: np.ndarray
    motion: np.ndarray  # (n, 3) angle (rad), velocity (rad/s), acceleration (rad/s^2)
    fits_torque: bool  # whether the fitted signal is the torque, not the angle

    @classmethod
    def of(cls, solution: Solution, signals: JointSignals, cutoff_hz: float) -> "_Equations":
        step = max(1, int(signals.rate_hz / (_SAMPLES_PER_PERIOD * cutoff_hz)))
        rate_hz = signals.rate_hz / step
        instruments = solution.instruments[::step]
        fits_torque = solution.fitted_signal == "torque"
        if fits_torque:
            regressors, motion = signals.regressors()[::step], instruments[:, :3]
        else:
            angle = (solution.measured - solution.residual)[::step]
            velocity = derivative(angle, rate_hz=rate_hz)
            acceleration = derivative(velocity, rate_hz=rate_hz)
            regressors, motion = instruments, np.column_stack([angle, velocity, acceleration])
        return cls(
            rate_hz=rate_hz,
            values=solution.kbj,
            residual=solution.residual[::step],
            instruments=instruments,
            regressors=regressors,
            motion=motion,
            fits_torque=fits_torque,
        )

    def test(
        self, paths: np.ndarray, nuisance: np.ndarray | None = None
    ) -> tuple[float | None, np.ndarray]:
        """Return the p-value of the best path, None if untestable, and how far paths move K, B, J.

        Only significant paths count: (3,), zero if there is none.
        """
        torques, whiten = self._unit_columns(paths), self._whitening()
        Z, X = whiten(self.instruments), whiten(self.regressors)
        if nuisance is not None:
            more = _basis(_free(whiten(self._unit_columns(nuisance)), Z, Z))
            Z, X = np.hstack([Z, more]), np.hstack([X, more])
        white = whiten(torques)
        free = _free(white, Z, X)
        # A path that Z explains up to rounding, such as a stretch that never occurs, is dropped.
        apart = np.linalg.norm(free, axis=0) > _ROUNDING * np.linalg.norm(white, axis=0)
        free, torques = free[:, apart], torques[:, apart]
        residual = _free(whiten(self.residual[:, None]), X, Z)[:, 0]
        seconds = residual.size / self.rate_hz
        times = np.array([correlation_time(f * residual, rate_hz=self.rate_hz) for f in free.T])
        testable = [bool(count_blocks(seconds, correlation_time_s=t)) for t in times]
        if not any(testable):
            return None, np.zeros(3)
        free, torques = free[:, testable], torques[:, testable]
        n_blocks = count_blocks(seconds, correlation_time_s=times[testable].max())
        p_value, significant = _largest_score(free * residual[:, None], n_blocks)
        if not significant.any():
            return p_value, np.zeros(3)
        return p_value, np.abs(self._shift_and_gain(torques[:, significant])[0]).max(axis=1)

    def _whitening(self) -> Callable[[np.ndarray], np.ndarray]:
        """Return a filter along time that makes the residual nearly white inside the band."""
        covariance = autocorrelation(self.residual)[: _WHITENING_LAGS + 1].copy()
        covariance[0] += _FLOOR
        taps = np.append(1.0, -solve_toeplitz(covariance[:-1], covariance[1:]))

        def whiten(columns: np.ndarray) -> np.ndarray:
            white = lfilter(taps, 1.0, columns, axis=0) if columns.size else columns
            return np.asarray(white[_WHITENING_LAGS:])

        return whiten

    @property
    def is_regression(self) -> bool:
        """True if the regressors are their own instruments."""
        return np.allclose(self.instruments[:, :3], self.regressors[:, :3])

    def lag(self) -> float:
        """Return how late the torque is: a lag T adds -T*J of jerk."""
        shift, gain = self._shift_and_gain(self._torque_in_fit(_linear_paths(self)[:, :1]))
        return float(-gain[0] / (self.values[2] + shift[2, 0]))

    def _shift_and_gain(self, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return by how much each of further columns moves K, B, J, (3, m), and its gain (m,)."""
        Z, X = self.instruments, self.regressors
        rows, size = np.linalg.norm(Z, axis=0), np.linalg.norm(X, axis=0)
        inner = np.linalg.inv((Z / rows).T @ (X / size))
        free = columns - Z / rows @ (inner.T @ ((X / size).T @ columns))
        gain = free.T @ self.residual / np.sum(free * columns, axis=0)
        shift = -gain * (inner @ ((Z / rows).T @ columns)) / size[:, None]
        return shift[:3], gain

    def _torque_in_fit(self, paths: np.ndarray) -> np.ndarray:
        """Return torques beside the joint's as the fitted signal shows them, means removed."""
        if not self.fits_torque:
            acts = [-simulate_motion(self.values, path, self.rate_hz)[0] for path in paths.T]
            paths = np.column_stack(acts)
        return np.asarray(paths - paths.mean(axis=0))

    def _unit_columns(self, paths: np.ndarray) -> np.ndarray:
        columns = self._torque_in_fit(paths)
        size = np.linalg.norm(columns, axis=0)
        return np.asarray(columns[:, size > 0.0] / size[size > 0.0])


def _free(columns: np.ndarray, Z: np.ndarray, X: np.ndarray) -> np.ndarray:
    """Return columns less their part along Z, orthogonal to X."""
    Z, X = Z / np.linalg.norm(Z, axis=0), X / np.linalg.norm(X, axis=0)
    return np.asarray(columns - Z @ np.linalg.solve(X.T @ Z, X.T @ columns))


def _basis(columns: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of nearly dependent columns."""
    size, turn = np.linalg.eigh(columns.T @ columns)
    kept = size > _RANK * size[-1]
    return np.asarray(columns @ turn[:, kept] / np.sqrt(size[kept]))


def _largest_score(products: np.ndarray, n_blocks: int) -> tuple[float, np.ndarray]:
    """Return the p-value of the largest score, and which scores are significant, (m,) bool."""
    starts = np.arange(n_blocks) * products.shape[0] // n_blocks
    sums = np.add.reduceat(products, starts, axis=0)
    scaled = sums / np.maximum(np.linalg.norm(sums, axis=0), np.finfo(float).tiny)
    signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(_FLIPS, n_blocks))
    by_chance, scores = np.sort((signs @ scaled).max(axis=1)), scaled.sum(axis=0)
    above = _FLIPS - np.searchsorted(by_chance, scores)
    p_values = (1 + above) / (1 + _FLIPS)
    return float(p_values.min()), p_values < _LEVEL


def _linear_paths(equations: _Equations) -> np.ndarray:
    """Return jerk, then relaxed and late velocities, (n, m)."""
    _, velocity, acceleration = equations.motion.T
    rate = equations.rate_hz
    jerk = derivative(acceleration, rate_hz=rate)
    relaxed = [_lowpass(velocity, 0.5 / np.pi / tau, rate, order=1) for tau in _RELAXATIONS_S]
    late = [_late(velocity, round(delay * rate)) for delay in _DELAYS_S]
    return np.column_stack([jerk, *relaxed, *late])


def _delayed_angles(equations: _Equations, cutoff_hz: float) -> np.ndarray:
    step = 0.5 / cutoff_hz * equations.rate_hz
    return np.column_stack([_late(equations.motion[:, 0], round(lag * step)) for lag in _LAGS])


def _reflex_paths(equations: _Equations) -> np.ndarray:
    """Return torque that resists stretches of either direction, (n, m)."""
    velocity, rate = equations.motion[:, 1], equations.rate_hz
    largest = float(np.quantile(np.abs(velocity), 0.999))
    paths = []
    for sign in (1.0, -1.0):
        for share in _THRESHOLDS:
            stretch = np.maximum(sign * velocity - share * largest, 0.0)
            for corner_hz in _MUSCLES_HZ:
                twitch = sign * _lowpass(stretch - stretch.mean(), corner_hz, rate, order=2)
                paths += [_late(twitch, round(latency * rate)) for latency in _LATENCIES_S]
    return np.column_stack(paths)


def _lowpass(x: np.ndarray, corner_hz: float, rate_hz: float, *, order: int) -> np.ndarray:
    poles = np.full(order, -2.0 * np.pi * corner_hz)
    b, a = bilinear([poles[0] ** order * (-1) ** order], np.poly(poles), rate_hz)
    return np.asarray(lfilter(b, a, x))


def _late(x: np.ndarray, samples: int) -> np.ndarray:
    """Return a signal delayed by ``samples`` (advanced if negative), with zeros around it."""
    if samples < 0:
        return np.concatenate([x[-samples:], np.zeros(-samples)])
    return np.concatenate([np.zeros(samples), x[: x.size - samples]])
