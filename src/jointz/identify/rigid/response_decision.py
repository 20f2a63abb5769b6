"""Reported values, intervals and statuses of a timing point, from its posterior."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from jointz.core.codes import Failure
from jointz.core.study import CalibrationSpec
from jointz.identify.methods.cell_parameters import per_mass
from jointz.identify.preparation.calibration import gains_sd
from jointz.identify.preparation.cell_data import PARAMETERS, intrinsic_impedance
from jointz.identify.rigid.response_model import CellResponse
from jointz.identify.rigid.response_posterior import JointPosterior, Moments
from jointz.kernels.bounded_normal import bounded_interval
from jointz.kernels.response_search import CROSS_TALK, DELAY, FRICTION_GAIN, LAG, SHARED
from jointz.results.estimates import REACH_95, ParameterEstimate, decides

_LEVEL = 0.95
#: If the prior has a larger share of an estimate's variance, the data do not determine it.
_ASSUMED = 0.25
#: An estimate that is more sds below zero contradicts the bound.
_BELOW = 4.0
#: Limits of the logarithm (kg*m^2) of an inertia estimated without prior.
_LOG_INERTIA_RANGE = (-12.0, 6.0)
_CI_METHOD = (
    "posterior over hypotheses about joint and sensor; errors of virtual pulses, calibration"
)


@dataclass(frozen=True, slots=True)
class NaturalSize:
    """Sizes that K, B and J would have if each alone resisted the torque over the window."""

    stiffness: float  # N*m/rad
    damping: float  # N*m*s/rad
    inertia: float  # kg*m^2

    @classmethod
    def of(cls, response: CellResponse) -> "NaturalSize":
        """Return the sizes for an average response."""
        torque = float(np.abs(response.torque.sum(axis=0)).max())
        angle = float(np.abs(response.angle).max())
        length_s = float(response.samples_s[-1])
        stiffness = torque / max(angle, 1e-9)
        return cls(stiffness, stiffness * length_s / 2.0, stiffness * length_s**2 / 2.0)


@dataclass(frozen=True, slots=True)
class Decision:
    """What the estimates of a timing point depend on besides the posterior."""

    known: CalibrationSpec  # calibration: sds of the gains, and the intrinsic impedance
    subtract_intrinsic: tuple[str, ...]  # those of K, B and J that still include the device's part
    mass_kg: float | None  # body mass, for values per kg
    natural: NaturalSize  # sizes that upper limits are compared with

    @property
    def gain_sd(self) -> float:
        """Relative sd of both gains together, common to K, B and J."""
        return gains_sd(self.known)


def decided_parameters(
    i: int, posterior: JointPosterior, decision: Decision
) -> tuple[ParameterEstimate, ...]:
    """Return K, B, J and the values per kg of a timing point, each with its status."""
    rows = [_row(k, m, decision) for k, m in enumerate(_moments(i, posterior))]
    return (*rows, *per_mass(rows, decision.mass_kg))


def error_budget(
    i: int, posterior: JointPosterior, decision: Decision
) -> dict[str, dict[str, float]]:
    """Return the error of K, B and J by source: sd, SI."""
    intrinsic_sds = intrinsic_impedance(decision.known)[1].tolist()
    return {
        name: {
            **{source: float(np.sqrt(max(v, 0.0))) for source, v in m.sources.items()},
            "gain": decision.gain_sd * abs(m.mean),
            "intrinsic": intrinsic_sd,
        }
        for name, m, intrinsic_sd in zip(
            PARAMETERS, _moments(i, posterior), intrinsic_sds, strict=True
        )
    }


def instrument_shares(i: int, posterior: JointPosterior) -> dict[str, dict[str, float]]:
    """Return by how much measuring each instrument would reduce the errors: sd, SI."""
    sizes = (1.0, 1.0, _moments(i, posterior)[2].mean)  # the posterior's is of the logarithm of J
    picks = posterior.impedance_picks(i)
    return {
        name: {
            known: size * float(np.sqrt(variance))
            for known, variance in removed_variances(posterior, row).items()
        }
        for name, size, row in zip(PARAMETERS, sizes, picks, strict=True)
    }


def prior_effects(posterior: JointPosterior, n_points: int) -> list[dict[str, tuple[float, float]]]:
    """Return how the priors of K, B and J changed value and variance of every estimate, SI."""
    mean, covariance = posterior.without_impedance_priors()
    effects = []
    for i in range(n_points):
        picks = posterior.impedance_picks(i)
        values, variances = picks @ mean, np.diag(picks @ covariance @ picks.T).copy()
        values[2] = np.exp(np.clip(values[2], *_LOG_INERTIA_RANGE))
        variances[2] *= values[2] ** 2
        rows = zip(PARAMETERS, _moments(i, posterior), values, variances, strict=True)
        effects.append(
            {name: (m.mean - float(v), float(var) - m.variance) for name, m, v, var in rows}
        )
    return effects


def error_covariance(i: int, posterior: JointPosterior, decision: Decision) -> np.ndarray:
    """Return the covariance of the errors of K, B and J, (3, 3) SI."""
    values = np.array([moments.mean for moments in _moments(i, posterior)])
    scale = np.array([1.0, 1.0, values[2]])  # the posterior's is of the logarithm of J
    intrinsic = intrinsic_impedance(decision.known)[1] ** 2
    gains = decision.gain_sd**2 * np.outer(values, values)
    fit = posterior.impedance_covariance(i) * np.outer(scale, scale)
    return np.asarray(fit + gains + np.diag(intrinsic))


def _moments(i: int, posterior: JointPosterior) -> tuple[Moments, Moments, Moments]:
    """Return K, B and J of a timing point."""
    inertia = _exponential(posterior.log_inertia(i))
    return posterior.stiffness(i), posterior.damping(i), inertia


def _row(k: int, moments: Moments, decision: Decision) -> ParameterEstimate:
    name = PARAMETERS[k]
    intrinsic, intrinsic_sd = (float(x[k]) for x in intrinsic_impedance(decision.known))
    left_in = intrinsic if name in decision.subtract_intrinsic else 0.0
    value = moments.mean - left_in
    parts = (np.sqrt(moments.variance), decision.gain_sd * moments.mean, intrinsic_sd)
    sd = float(np.linalg.norm(parts))
    if name == "inertia":
        factor = float(np.exp(REACH_95 * sd / moments.mean))  # its logarithm was estimated
        low, high = max(moments.mean / factor - left_in, 0.0), moments.mean * factor - left_in
    else:
        low, high = bounded_interval(value, sd, level=_LEVEL)
    if high <= 0.0 or value < -_BELOW * sd:
        status = Failure.BELOW_ZERO.status
        return ParameterEstimate(name, None, None, None, status, unbounded=value)
    at_bound = low == 0.0
    assumed = moments.sources.get("prior", 0.0) > _ASSUMED * moments.variance
    small = high <= 0.5 * getattr(decision.natural, name) and not assumed
    if not (small if at_bound else decides(value, high - value)):
        return ParameterEstimate(name, None, None, None, "undecided", unbounded=value)
    return ParameterEstimate(
        name=name,
        value=max(value, 0.0),
        ci_low=low,
        ci_high=high,
        status="at_bound" if at_bound else "ok",
        ci_level=_LEVEL,
        ci_method=_CI_METHOD,
        unbounded=value,
    )


def _exponential(moments: Moments) -> Moments:
    """Return the moments of exp(x), to first order."""
    value = float(np.exp(moments.mean))
    return Moments(value, {name: value**2 * v for name, v in moments.sources.items()})


#: Measurable property of the instruments -> the shared parameters that sum to it.
_MEASURABLE: Final[Mapping[str, Sequence[int]]] = {
    "lag": (LAG, DELAY),
    "friction": (FRICTION_GAIN,),
    "cross_talk": (CROSS_TALK,),
}
#: Nodes and weights of a mean over a normal distribution.
_NODES, _NODE_WEIGHTS = np.polynomial.hermite_e.hermegauss(7)


def removed_variances(posterior: JointPosterior, picks: np.ndarray) -> dict[str, float]:
    """Return by how much knowing each instrument would reduce the variance of a sum of parameters.

    By the law of total variance, the remaining variance is the mean, over the distribution of the
    instrument, of the variance given its value, both within the hypotheses and between them, whose
    probabilities depend on that value. Errors are taken as normal, effects as linear about each
    mode.
    """
    removed = {}
    for name, places in _MEASURABLE.items():
        instrument = np.zeros(picks.size)
        instrument[[picks.size - SHARED + place for place in places]] = 1.0
        removed[name] = _removed(posterior, picks, instrument)
    return removed


def _removed(posterior: JointPosterior, picks: np.ndarray, instrument: np.ndarray) -> float:
    weights, hypotheses = posterior.weights, posterior.posteriors
    means, values = (np.array([x @ p.values for p in hypotheses]) for x in (picks, instrument))
    spread, shared = (
        np.array([x @ p.covariance @ instrument for p in hypotheses]) for x in (instrument, picks)
    )
    slopes, sds = shared / spread, np.sqrt(spread)
    between = float(weights @ (means - weights @ means) ** 2)
    nodes = values[:, None] + sds[:, None] * _NODES
    chances = weights[:, None] * _NODE_WEIGHTS / _NODE_WEIGHTS.sum()
    off = nodes.ravel()[:, None] - values
    likely = np.log(np.maximum(weights, 1e-300)) - 0.5 * (off / sds) ** 2 - np.log(sds)
    likely = np.exp(likely - likely.max(axis=1, keepdims=True))
    likely /= likely.sum(axis=1, keepdims=True)
    conditional = means + slopes * off
    middles = (likely * conditional).sum(axis=1, keepdims=True)
    remaining = float(chances.ravel() @ (likely * (conditional - middles) ** 2).sum(axis=1))
    return max(float(weights @ (slopes * shared)) + between - remaining, 0.0)
