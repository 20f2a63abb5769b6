r"""A leg that hangs, bare and with a known weight, behind one late sensor: posterior mode.

:math:`J\ddot x + B\dot x + Kx = \tau + f\,\tau_f` for every condition, simulated from rest under
the average measured torque and seen through tissue, lag and delay
(:mod:`~jointz.identify.calibration.late_sensor`), compared with the average angle and weighed with
its covariance. All is in units of the measured torque over the measured angle; with r the ratio of
their gains,
:math:`J_w = J_b + r(\Delta J + \delta_J)` and :math:`K_w = K_b + r(\Delta K + \delta_K)`, the
errors of the weight within its sd, and that of K within what a relaxed leg may change.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from jointz.core.study import Calibrated
from jointz.identify.calibration.late_sensor import joint_motion, sensed
from jointz.kernels.steps import at_steps

#: Parameter -> mean and sd before the data (wide where nothing is known), lowest and highest
#: value of the search, and its step.
_PARAMETERS = {
    "log_inertia": (float(np.log(0.15)), 1.5, -7.0, 2.5, 0.1),
    "stiffness": (15.0, 30.0, -100.0, 1e3, 1.0),
    "damping": (1.0, 2.0, -5.0, 50.0, 0.1),
    "damping_weighted": (1.0, 2.0, -5.0, 50.0, 0.1),
    "stiffness_more": (0.0, 1.0, -20.0, 20.0, 0.5),
    "inertia_more": (0.0, 1e-3, -0.5, 0.5, 1e-3),
    "gain_ratio": (1.0, 0.3, 0.2, 5.0, 0.05),
    "friction_gain": (1.0, 0.2, 0.0, 3.0, 0.1),
    "cross_talk": (0.0, 3e-4, -0.05, 0.05, 1e-4),
    "lag": (0.008, 0.008, 0.0, 0.06, 1e-3),
    "delay": (0.003, 0.003, -0.02, 0.04, 1e-3),
    "log_resonance": (float(np.log(30.0)), 0.4, float(np.log(6.0)), float(np.log(150.0)), 0.1),
    "resonance_damping": (0.3, 0.1, 0.03, 0.97, 0.1),
}
NAMES = tuple(_PARAMETERS)
(
    LOG_INERTIA,
    STIFFNESS,
    DAMPING,
    DAMPING_WEIGHTED,
    STIFFNESS_MORE,
    INERTIA_MORE,
    GAIN_RATIO,
    FRICTION_GAIN,
    CROSS_TALK,
    LAG,
    DELAY,
    LOG_RESONANCE,
    RESONANCE_DAMPING,
) = range(len(NAMES))
_PRIOR = {name: row[:2] for name, row in _PARAMETERS.items()}
_LOW, _HIGH, _SCALE = np.array([row[2:] for row in _PARAMETERS.values()]).T
_STARTS = (0.06, 0.2, 0.6)
_SUBSTEP_S = 1e-3
_LEAST_SD = 1e-6
#: White noise added before a covariance is inverted, share of its mean variance.
_EVEN_SHARE = 1e-3
#: Place of the known total lag among the priors, behind those of the parameters.
KNOWN_LAG = len(NAMES)


@dataclass(frozen=True, slots=True, eq=False)
class HangingCell:
    """The average response of one condition."""

    angle: np.ndarray  # measured angle from rest, rad
    torque: np.ndarray  # (2, n) N*m: torque without friction; friction
    noise: np.ndarray  # covariance of the error of ``angle``, rad^2
    period_s: float  # s: between samples

    def root(self) -> np.ndarray:
        """Return a whitening matrix: its product with the noise's errors has unit covariance."""
        n = self.angle.size
        even = _EVEN_SHARE * np.trace(self.noise) / n * np.eye(n)
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self.noise + even)))


@dataclass(frozen=True, slots=True)
class KnownWeight:
    """Inertia and stiffness that a strapped weight adds about the joint."""

    inertia: Calibrated  # kg*m^2
    stiffness: Calibrated  # N*m/rad: weight times distance


@dataclass(frozen=True, slots=True, eq=False)
class HangingPosterior:
    """Mode and covariance under one model of the sensor."""

    values: np.ndarray  # parameters in the order of ``NAMES``
    bread: np.ndarray  # inverse of the curvature; zero where a parameter is idle
    prior_sd: np.ndarray  # prior sd of each parameter
    lag_sd_s: float  # s: prior sd of the total lag; infinite where it was unknown
    log_evidence: float  # up to a constant that both models share
    misfit: float  # squared distance from the data over the degrees of freedom; about 1
    fitted: tuple[np.ndarray, ...]  # angles shown by the sensor, rad, one array a condition
    motions: tuple[np.ndarray, ...]  # angles of the joint, rad, one array a condition

    def variances(self, slopes: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the variance of a function of the parameters, by where it comes from."""
        reach = slopes @ self.bread
        of_lag = (reach[LAG] + reach[DELAY]) / self.lag_sd_s
        priors = np.append(reach / self.prior_sd, of_lag) ** 2
        noise = max(float(reach @ slopes) - float(priors.sum()), 0.0)
        return max(self.misfit, 1.0) * noise, priors


def _substeps(cell: HangingCell) -> int:
    """Return the number of steps of the integration in one sample."""
    return max(1, round(cell.period_s / _SUBSTEP_S))


class HangingModel:
    """Finds the posterior mode of one or two conditions under one sensor."""

    def __init__(
        self,
        cells: Sequence[HangingCell],
        weight: KnownWeight | None,
        known: dict[str, tuple[float, float]],
        *,
        resonance: bool,
        total_lag: tuple[float, float] = (0.0, np.inf),
    ) -> None:
        self._cells = cells
        self._weight = weight
        self._roots = [cell.root() for cell in cells]
        self._torques = [[at_steps(x, _substeps(cell)) for x in cell.torque] for cell in cells]
        self._resonance = resonance
        self._total_lag = total_lag
        if weight is not None:
            change = float(np.hypot(_PRIOR["stiffness_more"][1], weight.stiffness.sd))
            mounted = {"inertia_more": (0.0, max(weight.inertia.sd, _LEAST_SD))}
            known = known | mounted | {"stiffness_more": (0.0, change)}
        self._mean, self._sd = np.array([(_PRIOR | known)[name] for name in NAMES]).T
        idle = [] if resonance else [LOG_RESONANCE, RESONANCE_DAMPING]
        if weight is None:
            idle += [DAMPING_WEIGHTED, STIFFNESS_MORE, INERTIA_MORE, GAIN_RATIO]
        self._free = np.setdiff1d(np.arange(len(NAMES)), idle)

    def fit(self) -> HangingPosterior:
        """Return the posterior mode, the best from light and heavy legs."""
        fits = []
        for inertia in _STARTS:
            start = self._mean.copy()
            start[LOG_INERTIA] = np.log(inertia)
            fit = least_squares(
                self._distances,
                np.clip(start, _LOW + 1e-9, _HIGH - 1e-9)[self._free],
                bounds=(_LOW[self._free], _HIGH[self._free]),
                x_scale=_SCALE[self._free],
                max_nfev=60,
            )
            fits.append(fit)
        best = min(fits, key=lambda fit: float(fit.cost))
        return self._posterior(np.asarray(best.x))

    def joint(self, values: np.ndarray, i: int) -> tuple[float, float, float]:
        """Return K, B, J of a condition, in measured units."""
        K, B, J = values[STIFFNESS], values[DAMPING], np.exp(values[LOG_INERTIA])
        if i == 1 and self._weight is not None:
            ratio = values[GAIN_RATIO]
            K += ratio * (self._weight.stiffness.value + values[STIFFNESS_MORE])
            J += ratio * (self._weight.inertia.value + values[INERTIA_MORE])
            B = values[DAMPING_WEIGHTED]
        return float(K), float(B), float(J)

    def respond(self, values: np.ndarray, i: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the angle that the sensor shows and that of the joint, rad, at the samples."""
        cell = self._cells[i]
        K, B, J = self.joint(values, i)
        substeps = _substeps(cell)
        step_s = cell.period_s / substeps
        driving, friction = self._torques[i]
        torque = driving + values[FRICTION_GAIN] * friction
        motion = joint_motion(torque, K, B, J, step_s)
        shown = sensed(
            motion,
            step_s=step_s,
            samples_s=np.arange(cell.angle.size) * cell.period_s,
            delay_s=float(values[DELAY]),
            lag_s=float(values[LAG]),
            resonance_hz=float(np.exp(values[LOG_RESONANCE])) if self._resonance else 0.0,
            damping_ratio=float(values[RESONANCE_DAMPING]) if self._resonance else 0.0,
        )
        return shown + values[CROSS_TALK] * torque[::substeps], motion[::substeps]

    def _distances(self, free: np.ndarray) -> np.ndarray:
        values = self._mean.copy()
        values[self._free] = free
        parts = [
            root @ (cell.angle - self.respond(values, i)[0])
            for i, (cell, root) in enumerate(zip(self._cells, self._roots, strict=True))
        ]
        from_prior = ((values - self._mean) / self._sd)[self._free]
        known, sd = self._total_lag
        of_lag = (values[LAG] + values[DELAY] - known) / sd
        apart = np.concatenate([*parts, np.append(from_prior, of_lag)])
        return np.asarray(np.nan_to_num(apart, nan=1e6))

    def _posterior(self, free: np.ndarray) -> HangingPosterior:
        at = self._distances(free)
        jacobian = np.empty((at.size, free.size))
        for j, scale in enumerate(_SCALE[self._free]):
            step = np.zeros(free.size)
            step[j] = 1e-3 * scale
            up, down = self._distances(free + step), self._distances(free - step)
            jacobian[:, j] = (up - down) / (2e-3 * scale)
        curvature = jacobian.T @ jacobian
        bread = np.linalg.inv(curvature)
        n_data = at.size - free.size - 1
        misfit = float(at[:n_data] @ at[:n_data]) / max(n_data - free.size, 1)
        values, full = self._mean.copy(), np.zeros((len(NAMES), len(NAMES)))
        values[self._free] = free
        full[np.ix_(self._free, self._free)] = bread
        evidence = -0.5 * float(at @ at) - 0.5 * float(np.linalg.slogdet(curvature)[1])
        answers = [self.respond(values, i) for i in range(len(self._cells))]
        return HangingPosterior(
            values=values,
            bread=full,
            prior_sd=self._sd,
            lag_sd_s=self._total_lag[1],
            log_evidence=evidence - float(np.log(self._sd[self._free]).sum()),
            misfit=misfit,
            fitted=tuple(shown for shown, _ in answers),
            motions=tuple(motion for _, motion in answers),
        )
