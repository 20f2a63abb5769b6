"""From the posterior of a timing point to what is reported: values, intervals, refusals."""

from dataclasses import dataclass

import numpy as np

from jointz.core.codes import Failure
from jointz.core.study import CalibrationSpec
from jointz.identify.methods.cell_parameters import per_mass
from jointz.identify.preparation.calibration import relative_sd
from jointz.identify.preparation.cell_data import PARAMETERS
from jointz.identify.recommended.instrument_knowledge import removed_variances
from jointz.identify.recommended.response_model import CellResponse
from jointz.identify.recommended.response_posterior import JointPosterior, Moments
from jointz.kernels.bounded_normal import bounded_interval
from jointz.results.estimates import REACH_95, ParameterEstimate, decides

_LEVEL = 0.95
#: Share of the variance that the prior's is of an estimate it has twice the sd of: more is not
#: told by the data.
_ASSUMED = 0.25
#: Sd below zero beyond which the bound contradicts the data.
_BELOW = 4.0
#: Beyond these logarithms of kg*m^2 an inertia without prior is as good as unknown.
_LOG_INERTIA_RANGE = (-12.0, 6.0)
_MADE = "posterior over hypotheses about joint and sensor; errors of virtual pulses, calibration"


@dataclass(frozen=True, slots=True)
class NaturalSize:
    """What K, B and J would be if each alone had answered the torque at the end of the window."""

    stiffness: float  # N*m/rad, N*m*s/rad, kg*m^2
    damping: float
    inertia: float

    @classmethod
    def of(cls, response: CellResponse) -> "NaturalSize":
        """Return the sizes of an average response."""
        torque = float(np.abs(response.torque.sum(axis=0)).max())
        angle = float(np.abs(response.angle).max())
        length_s = float(response.samples_s[-1])
        stiffness = torque / max(angle, 1e-9)
        return cls(stiffness, stiffness * length_s / 2.0, stiffness * length_s**2 / 2.0)


@dataclass(frozen=True, slots=True)
class Decision:
    """What else goes into the rows of a timing point."""

    known: CalibrationSpec  # gains' sd and the intrinsic impedance
    subtract_intrinsic: tuple[str, ...]  # which of K, B and J still hold the device's own
    mass_kg: float | None  # for values per kg
    natural: NaturalSize  # by which a limit at the bound is measured

    @property
    def gain_sd(self) -> float:
        """Relative sd of what both gains leave open: common to K, B and J."""
        return float(
            np.hypot(relative_sd(self.known.angle_gain), relative_sd(self.known.torque_gain))
        )


def decided_parameters(
    i: int, posterior: JointPosterior, decision: Decision
) -> tuple[ParameterEstimate, ...]:
    """Return K, B, J and the values per kg of a timing point, or why there are none."""
    rows = [
        _row(name, m, decision, natural=getattr(decision.natural, name))
        for name, m in zip(PARAMETERS, _moments(i, posterior), strict=True)
    ]
    return (*rows, *per_mass(rows, decision.mass_kg))


def error_budget(
    i: int, posterior: JointPosterior, decision: Decision
) -> dict[str, dict[str, float]]:
    """Return where the uncertainty of K, B and J comes from: sd by source, SI."""
    budget = {}
    for name, m in zip(PARAMETERS, _moments(i, posterior), strict=True):
        entry = getattr(decision.known, f"intrinsic_{name}")
        budget[name] = {
            **{source: float(np.sqrt(max(v, 0.0))) for source, v in m.sources.items()},
            "gain": decision.gain_sd * abs(m.mean),
            "intrinsic": 0.0 if entry is None else entry.sd,
        }
    return budget


def instrument_shares(i: int, posterior: JointPosterior) -> dict[str, dict[str, float]]:
    """Return the part of each error that measuring the instruments would take away: sd, SI."""
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
    """Return what the priors of K, B and J did to the estimates of every timing point, SI."""
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
    """Return how the errors of K, B and J go together, (3, 3) SI."""
    values = np.array([moments.mean for moments in _moments(i, posterior)])
    scale = np.array([1.0, 1.0, values[2]])  # the posterior's is of the logarithm of J
    entries = [getattr(decision.known, f"intrinsic_{name}") for name in PARAMETERS]
    intrinsic = [0.0 if entry is None else entry.sd**2 for entry in entries]
    gains = decision.gain_sd**2 * np.outer(values, values)
    own = posterior.impedance_covariance(i) * np.outer(scale, scale)
    return np.asarray(own + gains + np.diag(intrinsic))


def _moments(i: int, posterior: JointPosterior) -> tuple[Moments, Moments, Moments]:
    """Return K, B and J of a timing point."""
    inertia = _exponential(posterior.log_inertia(i))
    return posterior.stiffness(i), posterior.damping(i), inertia


def _row(name: str, moments: Moments, decision: Decision, *, natural: float) -> ParameterEstimate:
    entry = getattr(decision.known, f"intrinsic_{name}")
    intrinsic = 0.0 if entry is None else entry.value
    left_in = intrinsic if name in decision.subtract_intrinsic else 0.0
    value = moments.mean - left_in
    parts = [np.sqrt(moments.variance), decision.gain_sd * moments.mean]
    parts.append(0.0 if entry is None else entry.sd)
    sd = float(np.linalg.norm(parts))
    if name == "inertia":
        low, high = (end - left_in for end in _positive_interval(moments.mean, sd))
        low = max(low, 0.0)
    else:
        low, high = bounded_interval(value, sd, level=_LEVEL)
    if high <= 0.0 or value < -_BELOW * sd:
        status = Failure.BELOW_ZERO.status
        return ParameterEstimate(name, None, None, None, status, unbounded=value)
    at_bound = low == 0.0
    assumed = moments.sources.get("prior", 0.0) > _ASSUMED * moments.variance
    told = high <= 0.5 * natural and not assumed if at_bound else decides(value, high - value)
    if not told:
        return ParameterEstimate(name, None, None, None, "undecided", unbounded=value)
    return ParameterEstimate(
        name=name,
        value=max(value, 0.0),
        ci_low=low,
        ci_high=high,
        status="at_bound" if at_bound else "ok",
        ci_level=_LEVEL,
        ci_method=_MADE,
        unbounded=value,
    )


def _positive_interval(value: float, sd: float) -> tuple[float, float]:
    """Return the interval of a mass: its logarithm is what was estimated."""
    factor = float(np.exp(REACH_95 * sd / value))
    return value / factor, value * factor


def _exponential(moments: Moments) -> Moments:
    """Return the moments of exp(x), to first order."""
    value = float(np.exp(moments.mean))
    return Moments(value, {name: value**2 * v for name, v in moments.sources.items()})
