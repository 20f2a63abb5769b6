"""Parameters of a cell with intervals, from replicates or a jackknife."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.stats import t as student_t

from jointz.core.codes import Failure
from jointz.core.errors import EstimationError
from jointz.core.study import Calibrated
from jointz.identify.preparation.calibration import gains_sd, relative_sd
from jointz.identify.preparation.cell_data import PARAMETERS, FitSettings, intrinsic_impedance
from jointz.results.estimates import ONE_SIDED_95, ParameterEstimate

_PER_MASS = {"stiffness": "stiffness_per_mass", "damping": "damping_per_mass"}
_LEVEL = 0.95


@dataclass(frozen=True, slots=True)
class Replicates:
    """Estimates of resamples, one row each."""

    bounded: np.ndarray  # K, B, J within bounds, SI; NaN where singular
    unbounded: np.ndarray  # K, B, J without bounds, SI; NaN where singular
    active: np.ndarray  # bit i is set where parameter i is at its bound of zero

    def decided(self) -> "Replicates":
        """Return the replicates without singular ones."""
        fine = np.isfinite(self.bounded).all(axis=1)
        if not fine.any():
            raise EstimationError(Failure.ILL_CONDITIONED, Failure.ILL_CONDITIONED.meaning)
        return Replicates(self.bounded[fine], self.unbounded[fine], self.active[fine])

    def unconstrained(self) -> "Replicates":
        """Return the replicates without bounds."""
        return Replicates(self.unbounded, self.unbounded, np.zeros_like(self.active))


@dataclass(frozen=True, slots=True)
class Point:
    """An estimate before its interval."""

    value: np.ndarray  # reported K, B, J, SI
    unbounded: np.ndarray  # K, B, J without bounds, SI
    held: int  # bit i is set where parameter i is at its bound of zero


class BootstrapSpread:
    """Intervals by percentiles of the replicates."""

    kind = "percentile interval"  # name of the two-sided interval

    def __init__(
        self,
        replicates: Replicates,
        settings: FitSettings,
        *,
        with_strides: bool,
        rng: np.random.Generator,
    ) -> None:
        self.active = replicates.active
        scale, intrinsic = _calibration_draws(settings, len(replicates.bounded), rng)
        self._bounded = scale[:, None] * replicates.bounded - intrinsic
        self._free = scale[:, None] * replicates.unbounded - intrinsic
        drawn = "pulses and unperturbed strides" if with_strides else "pulses"
        self.basis = f"of {settings.n_resamples} bootstrap resamples of {drawn}"

    def interval(
        self, i: int, point: Point, *, bound: float, at_bound: bool
    ) -> tuple[float, float]:
        """Return the percentile interval, one-sided if the bound is active.

        If all replicates are at the bound, their percentile would be an interval of zero width;
        the limit then follows from the spread of the unbounded replicates.
        """
        del point  # percentiles need no centre
        draws = self._bounded[:, i]
        if not at_bound:
            low, high = np.quantile(draws, [(1 - _LEVEL) / 2, (1 + _LEVEL) / 2])
            return float(low), float(high)
        limit = float(np.quantile(draws, _LEVEL))
        return bound, max(limit, bound + ONE_SIDED_95 * float(self._free[:, i].std()))


class JackknifeSpread:
    """Intervals by Student's t over the estimates that leave one pulse out.

    B. Efron, "The jackknife, the bootstrap and other resampling plans" (1982),
    chapter 3; n - 1 degrees of freedom. Errors of the calibration are added in square.
    """

    kind = "Student's t interval"

    def __init__(
        self, left_out: Replicates, instrument_shift: np.ndarray, settings: FitSettings
    ) -> None:
        self.active = left_out.active
        self._sd = [_jackknife_sd(v) for v in (left_out.bounded, left_out.unbounded)]
        self._n = len(left_out.bounded)
        self.basis = f"of the delete-one jackknife over {self._n} pulses"
        self._instrument_shift = instrument_shift
        self._settings = settings

    def interval(
        self, i: int, point: Point, *, bound: float, at_bound: bool
    ) -> tuple[float, float]:
        """Return the t interval, one-sided if the bound is active."""
        bounded, free = (self._total(sd[i], i, point) for sd in self._sd)
        value = float(point.value[i]) + bound
        if not at_bound:
            reach = float(student_t.ppf((1 + _LEVEL) / 2, self._n - 1)) * bounded
            return value - reach, value + reach
        one_sided = float(student_t.ppf(_LEVEL, self._n - 1))
        return bound, max(value + one_sided * bounded, bound + one_sided * free)

    def _total(self, sd: float, i: int, point: Point) -> float:
        known = self._settings.calibration
        gain = gains_sd(known)
        intrinsic_sd = intrinsic_impedance(known)[1][i]
        parts = [sd, self._instrument_shift[i], gain * point.value[i], intrinsic_sd]
        return float(np.linalg.norm(parts))


#: Uncertainty of an estimate: an interval for each parameter, without the intrinsic impedance.
Spread = BootstrapSpread | JackknifeSpread


def parameter_estimates(
    point: Point, spread: Spread, settings: FitSettings
) -> tuple[ParameterEstimate, ...]:
    """Return K, B, J and the values per kg with intervals and statuses."""
    estimates = []
    for i, name in enumerate(PARAMETERS):
        known = intrinsic_impedance(settings.calibration)[0][i]
        share = float((spread.active >> i & 1).mean())  # of the replicates at the bound
        at_bound = bool(point.held >> i & 1) or share >= 0.5 or point.value[i] == 0.0
        kind = "one-sided upper limit" if at_bound else spread.kind
        low, high = spread.interval(i, point, bound=float(0.0 - known), at_bound=at_bound)
        estimates.append(
            ParameterEstimate(
                name=name,
                value=float(point.value[i] - known),
                ci_low=low,
                ci_high=high,
                status="at_bound" if at_bound else "ok",
                ci_level=_LEVEL,
                ci_method=f"{kind} {spread.basis}",
                share_at_bound=share,
                unbounded=float(point.unbounded[i] - known),
            )
        )
    mass_unknown = settings.mass_kg is None and not settings.wants_per_mass
    return tuple(estimates) + (() if mass_unknown else per_mass(estimates, settings.mass_kg))


def failed_parameters(
    failure: Failure, *, mass_kg: float | None, wants_per_mass: bool
) -> tuple[ParameterEstimate, ...]:
    """Return the rows of a cell without an estimate."""
    per_mass = mass_kg is not None or wants_per_mass
    names = [*PARAMETERS, *(_PER_MASS.values() if per_mass else ())]
    return tuple(ParameterEstimate(name, None, None, None, failure.status) for name in names)


def _jackknife_sd(left_out: np.ndarray) -> np.ndarray:
    n = len(left_out)
    return np.asarray(np.sqrt((n - 1) / n * ((left_out - left_out.mean(axis=0)) ** 2).sum(axis=0)))


def _calibration_draws(
    settings: FitSettings, n: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Draw the remaining gain (n,) and the intrinsic impedance (n, 3)."""
    known = settings.calibration
    angle, torque = (_gain_draws(gain, n, rng) for gain in (known.angle_gain, known.torque_gain))
    values, sds = intrinsic_impedance(known)
    return angle / torque, values + sds * rng.standard_normal((n, len(PARAMETERS)))


def _gain_draws(entry: Calibrated | None, n: int, rng: np.random.Generator) -> np.ndarray:
    if entry is None or entry.sd == 0.0:
        return np.ones(n)
    return np.asarray(1.0 + relative_sd(entry) * rng.standard_normal(n))


def per_mass(
    estimates: Sequence[ParameterEstimate], mass_kg: float | None
) -> tuple[ParameterEstimate, ...]:
    """Return the values per kg, failed if the mass is missing."""
    return tuple(_divided(e, _PER_MASS[e.name], mass_kg) for e in estimates if e.name in _PER_MASS)


def _divided(estimate: ParameterEstimate, name: str, mass: float | None) -> ParameterEstimate:
    if mass is None:
        return ParameterEstimate(name, None, None, None, Failure.MASS_MISSING.status)

    values = {f: getattr(estimate, f) for f in ("value", "ci_low", "ci_high", "unbounded")}
    per_kg: dict[str, Any] = {f: v if v is None else v / mass for f, v in values.items()}
    return replace(estimate, name=name, **per_kg)
