r"""The responses of all timing points of a participant under one hypothesis: posterior mode.

A joint :math:`J\ddot x + B\dot x + Kx = \tau` at every timing point, K and B free to drift over
the window, one inertia from which the points may deviate, and one chain of instruments for all:
friction gain, cross-talk of torque into the angle, delay, first-order lag and, under some
hypotheses, a resonance of the tissue between joint and sensor. The angle of the average pulse
is simulated from its measured torque and compared with the measured angle, weighted with the
covariance of what the prediction of the unperturbed motion misses.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from jointz.kernels.joint_response import joint_motion, sensed
from jointz.kernels.response_search import (
    B_FLOOR,
    DELAY,
    FRICTION_GAIN,
    J_DEVIATION,
    K_FLOOR,
    LAG,
    LOG_J,
    LOG_RESONANCE,
    PER_POINT,
    RESONANCE_DAMPING,
    SHARED,
    B,
    Frame,
    K,
    Responses,
    point_response,
    prior_curvature,
    search,
)

_SUBSTEP_S = 1e-3
_PASSES, _FIRST_PASSES = 40, 30
#: White noise added to that of the data before it is inverted, share of its mean variance.
_EVEN_SHARE = 1e-3
#: Length scale of the curve through the timing points, cycles: about their distance.
_CURVE_CYCLES = 0.16
_ANY_LEVEL, _CURVE_NUGGET = 10.0, 1e-4
#: Limits of the search: parameters of a point, then the shared ones.
_POINT_RANGE = np.array([[-500.0, 5000.0], [-3, 3], [-5.0, 100.0], [-3, 3], [-1.5, 1.5]])
_SHARED_RANGE = np.array(
    [
        [np.log(1e-3), np.log(20.0)],
        [0.0, 0.06],
        [-0.03, 0.03],
        [0.0, 3.0],
        [-0.05, 0.05],
        [np.log(6.0), np.log(150.0)],
        [0.03, 0.97],
    ]
)


@dataclass(frozen=True, slots=True, eq=False)
class CellResponse:
    """The average response of a timing point."""

    label: str  # name of the timing point
    angle: np.ndarray  # (n,) from the first sample on, rad
    torque: np.ndarray  # (2, n) N*m: torque without friction; friction
    noise: np.ndarray  # (n, n) covariance of the error of the average angle, rad^2
    period_s: float  # s: between samples
    phase: float  # of the onset, cycles; NaN where unknown
    stride_s: float  # s: duration of a stride
    # s: time from the first sample, with the joint at rest, to the onset
    lead_s: float = 0.0

    @property
    def samples_s(self) -> np.ndarray:
        """Times of the samples, from the first."""
        return np.asarray(np.arange(self.angle.size) * self.period_s)

    def weights(self) -> np.ndarray:
        """Return the inverse of the noise covariance, regularised.

        A covariance from few strides has directions without noise, which would dominate a fit.
        """
        n = self.angle.size
        even = _EVEN_SHARE * np.trace(self.noise) / n * np.eye(n)
        return np.asarray(np.linalg.inv(self.noise + even))


@dataclass(frozen=True, slots=True)
class Priors:
    """Prior means and sds."""

    stiffness: tuple[float, float] = (60.0, 100.0)  # N*m/rad; normal, negative values included
    damping: tuple[float, float] = (2.5, 4.0)  # N*m*s/rad; normal, negative values included
    log_inertia: tuple[float, float] = (float(np.log(0.08)), 1.0)  # natural logarithm of kg*m^2
    lag_s: tuple[float, float] = (0.012, 0.010)  # s: total lag of the angle behind the torque
    delay_s: tuple[float, float] = (0.002, 0.00115)  # s: pure delay within the total lag
    friction_gain: tuple[float, float] = (1.0, 0.2)  # true over stated friction
    cross_talk: tuple[float, float] = (0.0, 3e-4)  # rad/(N*m): angle shown per torque
    # natural logarithm of Hz: resonance of the tissue
    log_resonance: tuple[float, float] = (float(np.log(30.0)), 0.4)
    resonance_damping: tuple[float, float] = (0.3, 0.1)  # damping ratio of the tissue

    def scaled(self, factor: float) -> "Priors":
        """Return priors whose medians of K, B and J are multiplied."""
        (k, k_sd), (b, b_sd), (j, j_sd) = self.stiffness, self.damping, self.log_inertia
        return replace(
            self,
            stiffness=(factor * k, factor * k_sd),
            damping=(factor * b, factor * b_sd),
            log_inertia=(j + float(np.log(factor)), j_sd),
        )


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """A hypothesis about the joint and the sensor."""

    inertia_sd: float  # relative sd of the inertia of a timing point about the shared one
    drift_sd: float  # relative sd of the change of K and B over the window
    # whether K and B also follow the curve through the timing points
    follows_curve: bool = False
    resonance: bool = False  # whether soft tissue resonates between joint and sensor
    chance: float = 1.0  # prior probability
    reflex_s: float = 0.0  # s: latency of a reflex; 0: no reflex


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """Mode and covariance under one hypothesis."""

    hypothesis: Hypothesis
    values: np.ndarray  # parameters of one timing point after the other, then the shared ones
    covariance: np.ndarray  # sandwich of the covariance of the responses and the priors
    bread: np.ndarray  # inverse of the curvature
    prior_precision: np.ndarray  # curvature by the priors
    prior_mean: np.ndarray
    # by Laplace's approximation, with the prior probability; up to a constant common to all
    # hypotheses
    log_evidence: float
    # one for each point: bread * Jacobian^T * weights, from the angle (rad) to the parameters
    gains: tuple[np.ndarray, ...]
    fitted: tuple[np.ndarray, ...]  # simulated angle of each point, rad
    # (m, 3) times from the first sample at which K, B and J of each point apply
    middle_s: np.ndarray
    reflex_reach: np.ndarray  # change of ``values`` by a reflex of one sd

    def point(self, i: int) -> np.ndarray:
        """Return the parameters of a timing point, (5,)."""
        return self.values[PER_POINT * i : PER_POINT * (i + 1)]

    @property
    def shared(self) -> np.ndarray:
        """The shared parameters, (7,)."""
        return self.values[-SHARED:]

    @property
    def late_s(self) -> float:
        """Lag and delay of the sensor, s; a resonance before it not counted."""
        return float(self.shared[LAG] + self.shared[DELAY])

    @property
    def friction_gain(self) -> float:
        """True over stated friction."""
        return float(self.shared[FRICTION_GAIN])


class ResponseModel:
    """Finds the posterior mode under one hypothesis."""

    def __init__(
        self,
        cells: Sequence[CellResponse],
        priors: Priors,
        hypothesis: Hypothesis,
        *,
        window_s: float,
    ) -> None:
        self._cells = cells
        self._priors = priors
        self._window_s = window_s
        self._responses = _padded(cells)
        self._suppose(hypothesis)

    def under(self, hypothesis: Hypothesis) -> "ResponseModel":
        """Return the model of the same responses under another hypothesis."""
        other = copy(self)
        other._suppose(hypothesis)
        return other

    def _suppose(self, hypothesis: Hypothesis) -> None:
        cells, window_s, n = self._cells, self._window_s, len(self._cells)
        self._hypothesis = hypothesis
        mean, sd = _prior_moments(self._priors, hypothesis, n)
        low, high = np.vstack([np.tile(_POINT_RANGE, (n, 1)), _SHARED_RANGE]).T
        curves = hypothesis.follows_curve
        self._frame = Frame(
            mean=mean,
            sd=sd,
            low=np.ascontiguousarray(low),
            high=np.ascontiguousarray(high),
            late_s=np.array(self._priors.lag_s),
            middle_s=np.tile(np.array([0.62, 0.5, 0.4]) * window_s, (n, 1)),
            size_per_s=np.tile(np.array([50.0, 2.5]) / window_s, (n, 1)),
            slope_map=_slope_map(cells) if curves else np.zeros((n, n)),
            curves=curves,
            resonance=hypothesis.resonance,
        )

    def fit(self, start: np.ndarray) -> Posterior:
        """Return the posterior mode, from a start that may be far off."""
        values, _, _ = search(start, self._responses, self._frame, _FIRST_PASSES)
        return self.refine(values)

    def refine(self, start: np.ndarray) -> Posterior:
        """Return the posterior mode, from parameters of another hypothesis or window."""
        self._refer(start)
        values, cost, curvature = search(start, self._responses, self._frame, _PASSES)
        return self._posterior(values, cost, curvature)

    def start(self, *, inertia: float) -> np.ndarray:
        """Return parameters to begin a search from."""
        values = self._frame.mean.copy()
        points = values[:-SHARED].reshape(-1, PER_POINT)
        points[:, K], points[:, B] = 40.0, 2.0
        values[-SHARED + LOG_J] = np.log(inertia)
        values[-SHARED + LAG] = max(self._frame.late_s[0] - values[-SHARED + DELAY], 1e-3)
        return values

    def _refer(self, values: np.ndarray) -> None:
        """Scale drifts by K and B, and set the times at which K, B and J hold."""
        points = values[:-SHARED].reshape(-1, PER_POINT)
        sizes = np.maximum(np.abs(points[:, [K, B]]), (K_FLOOR, B_FLOOR))
        middles = self._frame.middle_s.copy()
        for i, cell in enumerate(self._cells):
            middle = self._middle_of(cell, points[i], values[-SHARED:])
            if middle is not None:
                middles[i] = middle
        self._frame = self._frame._replace(size_per_s=sizes / self._window_s, middle_s=middles)

    def _middle_of(
        self, cell: CellResponse, point: np.ndarray, shared: np.ndarray
    ) -> np.ndarray | None:
        """Return the mean times at which the response depends on K, B and J; None if it does not.

        A change at time t moves the angle from then on; least squares on the angle weights it by
        its effect on the value for the whole window.
        """
        n = int((cell.lead_s + self._window_s) / cell.period_s + 1e-9) + 1
        torque = cell.torque[:, :n]
        impedance = _steady(point, shared)
        kick = np.zeros((2, n))
        kick[0, 0] = 1.0
        still = np.zeros(3)
        x = joint_motion(torque, shared[FRICTION_GAIN], impedance, still, cell.period_s, 1)[:, 0]
        response = joint_motion(kick, 1.0, impedance, still, cell.period_s, 1)[:, 0]
        v = np.gradient(x, cell.period_s)
        times = np.arange(n) * cell.period_s
        middles = []
        for motion in (x, v, np.gradient(v, cell.period_s)):
            effect = np.convolve(response, motion)[:n]
            weight = motion * np.convolve(response, effect[::-1])[:n][::-1]
            total = weight.sum()
            if not total > 0.0:
                return None
            middles.append(float(weight @ times / total))
        return np.array(middles)

    def _posterior(self, values: np.ndarray, cost: float, curvature: np.ndarray) -> Posterior:
        frame = self._frame
        bread, precision = np.linalg.inv(curvature), prior_curvature(frame)
        covariance = bread @ precision @ bread
        gains, fitted = [], []
        for i, cell in enumerate(self._cells):
            n = cell.angle.size
            angle, derivatives, places = point_response(i, values, self._responses, frame)
            weights = self._responses.weights[i, :n, :n]
            jacobian = np.zeros((n, values.size))
            for place, column in zip(places, derivatives.T, strict=True):
                jacobian[:, place] += column
            gain = bread @ jacobian.T @ weights
            covariance += gain @ cell.noise @ gain.T
            gains.append(gain)
            fitted.append(angle)
        free = np.log(frame.sd).sum() + np.log(frame.late_s[1])
        evidence = -0.5 * cost - 0.5 * np.linalg.slogdet(curvature)[1] - free
        return Posterior(
            hypothesis=self._hypothesis,
            values=values,
            covariance=covariance,
            bread=bread,
            prior_precision=precision,
            prior_mean=frame.mean,
            log_evidence=float(evidence + np.log(self._hypothesis.chance)),
            gains=tuple(gains),
            fitted=tuple(fitted),
            middle_s=frame.middle_s.copy(),
            reflex_reach=np.zeros(values.size),
        )


def _padded(cells: Sequence[CellResponse]) -> Responses:
    """Return responses in arrays of one width."""
    n, widest = len(cells), max(cell.angle.size for cell in cells)
    angle, torque = np.zeros((n, widest)), np.zeros((n, 2, widest))
    weights = np.zeros((n, widest, widest))
    for i, cell in enumerate(cells):
        m = cell.angle.size
        angle[i, :m], torque[i, :, :m] = cell.angle, cell.torque
        weights[i, :m, :m] = cell.weights()
    periods = np.array([cell.period_s for cell in cells])
    return Responses(
        angle=angle,
        torque=torque,
        weights=weights,
        samples=np.array([cell.angle.size for cell in cells]),
        period_s=periods,
        substeps=np.maximum(1, np.ceil(periods / _SUBSTEP_S)).astype(np.int64),
    )


def response_to_kick(posterior: Posterior, i: int, *, period_s: float, n: int) -> np.ndarray:
    """Return the measured angle after one sample of torque of 1 N*m, (n,) rad/(N*m)."""
    shared = posterior.shared
    impedance = _steady(posterior.point(i), shared)
    kick = np.zeros((2, n + 1))
    kick[0, 1] = 1.0
    substeps = max(1, int(np.ceil(period_s / _SUBSTEP_S)))
    motion = joint_motion(kick, 1.0, impedance, np.zeros(3), period_s, substeps)[:, :1]
    resonance = posterior.hypothesis.resonance
    shown = sensed(
        motion,
        step_s=period_s / substeps,
        samples_s=np.arange(1, n + 1) * period_s,
        delay_s=float(shared[DELAY]),
        lag_s=float(shared[LAG]),
        resonance_hz=float(np.exp(shared[LOG_RESONANCE])) if resonance else 0.0,
        damping_ratio=float(shared[RESONANCE_DAMPING]) if resonance else 0.0,
    )
    return np.asarray(shown[:, 0])


def _steady(point: np.ndarray, shared: np.ndarray) -> np.ndarray:
    """Return the impedance of a point without drift, for ``joint_motion``."""
    inertia = float(np.exp(shared[LOG_J] + point[J_DEVIATION]))
    return np.array([max(point[K], 0.0), 0.0, max(point[B], 0.0), 0.0, inertia, 0.0])


def _prior_moments(priors: Priors, hypothesis: Hypothesis, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and sd of every parameter."""
    drift = (0.0, hypothesis.drift_sd)
    point = [priors.stiffness, drift, priors.damping, drift, (0.0, hypothesis.inertia_sd)]
    shared = [
        priors.log_inertia,
        # A calibration limits the sum of lag and delay, not the lag alone.
        (priors.lag_s[0], 0.05),
        priors.delay_s,
        priors.friction_gain,
        priors.cross_talk,
        priors.log_resonance,
        priors.resonance_damping,
    ]
    mean, sd = np.array(point * n + shared).T
    return mean, sd


def _slope_map(cells: Sequence[CellResponse]) -> np.ndarray:
    """Return the slope, per s, at each point of a smooth curve through values at all, (n, n).

    The curve is the mean of a periodic Gaussian process of unknown level through the values
    (MacKay 1998, Introduction to Gaussian processes, equation 47).
    """
    phases = np.array([cell.phase for cell in cells])
    apart = 2.0 * np.pi * (phases[:, None] - phases[None, :])
    width = 2.0 * np.pi * _CURVE_CYCLES
    alike = np.exp(-2.0 * (np.sin(apart / 2.0) / width) ** 2)
    turn = -2.0 * np.pi * np.sin(apart) / width**2 * alike
    values = alike + _ANY_LEVEL + _CURVE_NUGGET * np.eye(len(cells))
    strides = np.array([cell.stride_s for cell in cells])
    return np.asarray(np.linalg.solve(values, turn.T).T / strides[:, None])
