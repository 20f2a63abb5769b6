"""Impedance of one cell: responses in, K, B and J with intervals out.

The method of the dissertation (4.2.3, settled in SCIENCE section 2): the
responses of a timing point are resampled with replacement, each resample is
averaged, ``torque = K*angle + B*velocity + J*acceleration`` is fitted to the
average by least squares with K, B, J >= 0, and the mean over the replicates is
reported. Intervals are percentiles of the replicates.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jointz.core.codes import Exclusion, Failure
from jointz.core.errors import EstimationError
from jointz.core.estimates import ParameterEstimate, Response
from jointz.core.study import Calibrated, CalibrationSpec
from jointz.identify.baselines import Baseline
from jointz.identify.conditioning import ANGLE, TORQUE
from jointz.kernels.bounded_lsq import (
    bootstrap_fits,
    condition_numbers,
    least_squares,
    nonnegative_least_squares,
    normal_equations,
)
from jointz.kernels.derivatives import derivative
from jointz.kernels.resampling import resample_weights

PARAMETERS = ("stiffness", "damping", "inertia")
_PER_MASS = {"stiffness": "stiffness_per_mass", "damping": "damping_per_mass"}
#: Below this motion a response is numerical dust, not a movement.
_DUST_RAD = 1e-9
_DUST_NM = 1e-9
#: Regressors this alike cannot be told apart from rounding.
_WORST_CONDITION = 1e6
#: A value below this share of its natural scale is zero.
_DUST_SHARE = 1e-9
_LEVEL = 0.95
_ONE_SIDED_Z = 1.6448536269514722


@dataclass(frozen=True, slots=True)
class Method:
    """How a cell is estimated.

    Parameters
    ----------
    name : str
        As given to ``--method``.
    baseline : str
        Its own baseline; the study may ask for another.
    """

    name: str
    baseline: str


#: The methods of this version; the first is the default.
METHODS = {
    "dissertation": Method("dissertation", "unperturbed_mean"),
    "pre_pulse": Method("pre_pulse", "pre_pulse"),
    "matched_strides": Method("matched_strides", "matched_strides"),
    "full_record": Method("full_record", "none"),
}
#: Those that only a bench can be estimated by.
BENCH_ONLY = ("full_record",)


@dataclass(frozen=True, slots=True)
class FitSettings:
    """Settings of a fit.

    Parameters
    ----------
    n_resamples : int
        Bootstrap resamples.
    seed : int
        Every cell starts its generator from this seed, so that a result does
        not depend on which other cells there are.
    rate_hz : float
        Sampling rate of the responses.
    letter : bool
        To the letter of 4.2.3: the unperturbed mean is held fixed and the mean
        over replicates is reported. Otherwise unperturbed strides are
        resampled too and the plug-in estimate is reported.
    calibration : CalibrationSpec
        Standard deviations go into the intervals, intrinsic impedance is
        subtracted.
    mass_kg : float or None
        For values per kg.
    wants_per_mass : bool
        Whether values per kg are expected even when the mass is missing.
    bounded : bool
        Whether K, B, J >= 0 is asked for, as in 4.2.3; 2.2.3 does not.
    """

    n_resamples: int
    seed: int
    rate_hz: float
    letter: bool
    calibration: CalibrationSpec
    mass_kg: float | None = None
    wants_per_mass: bool = True
    bounded: bool = True


@dataclass(frozen=True, slots=True)
class CellFit:
    """The fit of one cell.

    Parameters
    ----------
    parameters : tuple of ParameterEstimate
        K, B, J and values per kg.
    vaf_pct : float
        On the average response (2.7), %.
    condition_number : float
        Of the scaled regressors.
    displacement_rad : float
        Largest angle of the average response.
    response : Response
        The average response.
    """

    parameters: tuple[ParameterEstimate, ...]
    vaf_pct: float
    condition_number: float
    displacement_rad: float
    response: Response


def fit_cell(
    windows: np.ndarray, signs: np.ndarray, baseline: Baseline, *, settings: FitSettings
) -> CellFit:
    """Estimate the impedance of one cell.

    Parameters
    ----------
    windows : (n_pulse, 4, n) float
        Angle (rad), velocity, acceleration and torque (N*m) from each onset.
    signs : (n_pulse,) float
        Direction of each pulse; responses are turned by it before averaging.
    baseline : Baseline
        Unperturbed windows of each pulse.
    settings : FitSettings
        How.

    Returns
    -------
    CellFit
        Parameters with intervals, and the average response.

    Raises
    ------
    EstimationError
        With a code when the responses have no answer: no motion, no torque, or
        regressors that cannot be told apart.

    Notes
    -----
    VAF near 100 % says that the average response looks second-order. It does
    not say that K, B, J are right: a lag, a wrong baseline or a wrong torque
    gain leave it untouched (SCIENCE trap 1).
    """
    turned = signs[:, None, None]
    responses = turned * (windows - baseline.mean())
    average = responses.mean(axis=0)
    gram, moment, power = normal_equations(average[None])
    condition = float(condition_numbers(gram)[0])
    _check(average, condition)
    plug_in = nonnegative_least_squares(gram, moment)
    unbounded = least_squares(gram, moment)[0]
    rng = np.random.default_rng(settings.seed)
    weights = resample_weights(len(windows), settings.n_resamples, rng)
    only_pulses = settings.letter or baseline.own
    if only_pulses and not _lag_sd(settings.calibration):
        fits = bootstrap_fits(weights, responses)
        replicates = _Replicates(fits.bounded, fits.unbounded, fits.active)
    else:
        averages = _averages(weights, responses, turned, baseline, settings, rng=rng)
        replicates = _fit_averages(averages)
    replicates = replicates.decided()
    estimate, held = plug_in[0][0], int(plug_in[1][0])
    if not settings.bounded:
        replicates, estimate, held = replicates.freed(), unbounded, 0
    point = replicates.bounded.mean(axis=0) if settings.letter else estimate
    point = np.where(np.abs(point) < _dust(average), 0.0, point)
    fitted = point @ average[:TORQUE]
    parameters = _parameters(
        replicates,
        settings,
        point=point,
        held=held,
        unbounded=unbounded,
        only_pulses=only_pulses,
        rng=rng,
    )
    return CellFit(
        parameters=parameters,
        vaf_pct=float(100.0 * (1.0 - ((fitted - average[TORQUE]) ** 2).sum() / power[0])),
        condition_number=condition,
        displacement_rad=float(np.abs(average[ANGLE]).max()),
        response=Response(
            time_s=np.arange(average.shape[1]) / settings.rate_hz,
            angle=average[ANGLE],
            torque=average[TORQUE],
            fitted_torque=fitted,
        ),
    )


@dataclass(frozen=True, slots=True)
class _Replicates:
    bounded: np.ndarray
    unbounded: np.ndarray
    active: np.ndarray

    def decided(self) -> "_Replicates":
        """Leave out resamples that were singular."""
        fine = np.isfinite(self.bounded).all(axis=1)
        if not fine.any():
            raise EstimationError(Failure.ILL_CONDITIONED, Failure.ILL_CONDITIONED.meaning)
        return _Replicates(self.bounded[fine], self.unbounded[fine], self.active[fine])

    def freed(self) -> "_Replicates":
        """Forget the bounds."""
        return _Replicates(self.unbounded, self.unbounded, np.zeros_like(self.active))


def dead_signals(windows: np.ndarray) -> list[str]:
    """Name the signal that stands still in each window, before anything is subtracted.

    What is subtracted moves: a dead sensor minus a baseline looks like a response.

    Parameters
    ----------
    windows : (n, 4, T) float
        Angle, velocity, acceleration, torque as measured; NaN where missing.

    Returns
    -------
    list of str
        ``constant_angle``, ``constant_torque``, or ``""``.
    """
    angle = np.ptp(windows[:, ANGLE], axis=1) < _DUST_RAD
    torque = np.ptp(windows[:, TORQUE], axis=1) < _DUST_NM
    codes = np.select(
        [angle, torque],
        [Exclusion.CONSTANT_ANGLE.value, Exclusion.CONSTANT_TORQUE.value],
        default="",
    )
    return [str(code) for code in codes]


def _check(average: np.ndarray, condition: float) -> None:
    for row, dust, failure in (
        (ANGLE, _DUST_RAD, Failure.CONSTANT_ANGLE),
        (TORQUE, _DUST_NM, Failure.CONSTANT_TORQUE),
    ):
        if np.ptp(average[row]) < dust:
            raise EstimationError(failure, failure.meaning)
    if not condition < _WORST_CONDITION:
        raise EstimationError(Failure.ILL_CONDITIONED, Failure.ILL_CONDITIONED.meaning)


def _dust(average: np.ndarray) -> np.ndarray:
    """Values so small beside torque over motion that they are rounding."""
    motion = np.abs(average[:TORQUE]).max(axis=1)
    return np.asarray(_DUST_SHARE * np.abs(average[TORQUE]).max() / motion)


def _averages(
    weights: np.ndarray,
    responses: np.ndarray,
    turned: np.ndarray,
    baseline: Baseline,
    settings: FitSettings,
    *,
    rng: np.random.Generator,
) -> np.ndarray:
    """Return the averages of the resamples, (n_resamples, 4, n)."""
    shape = (len(weights), *responses.shape[1:])
    averages = np.asarray(weights @ responses.reshape(len(responses), -1))
    if not (settings.letter or baseline.own):
        n_strides = baseline.n_sources
        draws = resample_weights(n_strides, settings.n_resamples, rng, block=baseline.block)
        # The mean that was subtracted gives way to the mean of the strides drawn.
        change = baseline.weights(draws) - baseline.weights(np.ones((1, n_strides)))
        change *= (weights * turned[:, 0, 0])[:, :, None]
        windows = baseline.windows.reshape(-1, averages.shape[1])
        averages -= change.reshape(len(weights), -1) @ windows
    return _lag_uncertainty(averages.reshape(shape), settings, rng=rng)


def _lag_uncertainty(
    averages: np.ndarray, settings: FitSettings, *, rng: np.random.Generator
) -> np.ndarray:
    """Shift each resample's torque by a draw of the lag that may be left over."""
    sd = _lag_sd(settings.calibration)
    if not sd:
        return averages
    late = rng.normal(0.0, sd, size=(len(averages), 1))
    torque = averages[:, TORQUE]
    rate = derivative(torque, rate_hz=settings.rate_hz)
    curvature = derivative(rate, rate_hz=settings.rate_hz)
    averages[:, TORQUE] = torque - late * rate + 0.5 * late**2 * curvature
    return averages


def _lag_sd(calibration: CalibrationSpec) -> float:
    """Return the sd of the lag between angle and torque; only their difference matters."""
    return float(np.hypot(_sd(calibration.angle_lag_s), _sd(calibration.torque_lag_s)))


def _sd(entry: Calibrated | None) -> float:
    return 0.0 if entry is None else entry.sd


def _fit_averages(averages: np.ndarray) -> _Replicates:
    gram, moment, _ = normal_equations(averages)
    bounded, active = nonnegative_least_squares(gram, moment)
    return _Replicates(bounded, least_squares(gram, moment), active)


def _parameters(
    replicates: _Replicates,
    settings: FitSettings,
    *,
    point: np.ndarray,
    held: int,
    unbounded: np.ndarray,
    only_pulses: bool,
    rng: np.random.Generator,
) -> tuple[ParameterEstimate, ...]:
    scale, intrinsic, known = _calibration_draws(settings, len(replicates.bounded), rng)
    estimates = []
    for i, name in enumerate(PARAMETERS):
        bound = float(0.0 - known[i])
        draws = scale * replicates.bounded[:, i] - intrinsic[:, i]
        free = scale * replicates.unbounded[:, i] - intrinsic[:, i]
        share = float((replicates.active >> i & 1).mean())
        at_bound = bool(held >> i & 1) or share >= 0.5 or point[i] == 0.0
        low, high = _interval(draws, free, bound=bound, at_bound=at_bound)
        estimates.append(
            ParameterEstimate(
                name=name,
                value=float(point[i] - known[i]),
                ci_low=low,
                ci_high=high,
                status="at_bound" if at_bound else "ok",
                ci_level=_LEVEL,
                ci_method=_interval_method(settings, only_pulses=only_pulses, at_bound=at_bound),
                share_at_bound=share,
                unbounded=float(unbounded[i] - known[i]),
            )
        )
    return tuple(estimates) + tuple(_per_mass(estimates, settings))


def _calibration_draws(
    settings: FitSettings, n: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draw the gain left over (n,), the intrinsic impedance (n, 3) and its values (3,)."""
    calibration = settings.calibration
    scale = _gain_draws(calibration.angle_gain, n, rng) / _gain_draws(
        calibration.torque_gain, n, rng
    )
    entries = [getattr(calibration, f"intrinsic_{name}") for name in PARAMETERS]
    known = np.array([0.0 if e is None else e.value for e in entries])
    spread = np.array([_sd(e) for e in entries])
    intrinsic = known + spread * rng.standard_normal((n, len(PARAMETERS)))
    return scale, intrinsic, known


def _gain_draws(entry: Calibrated | None, n: int, rng: np.random.Generator) -> np.ndarray:
    if entry is None or entry.sd == 0.0:
        return np.ones(n)
    return np.asarray(1.0 + entry.sd / entry.value * rng.standard_normal(n))


def _interval(
    draws: np.ndarray, free: np.ndarray, *, bound: float, at_bound: bool
) -> tuple[float, float]:
    """Return the percentile interval, one-sided where the bound is active.

    Where all replicates stand at the bound their percentile would be a
    zero-width interval; the limit is then what the spread of the unbounded
    replicates allows above the bound.
    """
    if not at_bound:
        low, high = np.quantile(draws, [(1 - _LEVEL) / 2, (1 + _LEVEL) / 2])
        return float(low), float(high)
    limit = float(np.quantile(draws, _LEVEL))
    reach = bound + _ONE_SIDED_Z * float(free.std())
    return bound, max(limit, reach)


def _interval_method(settings: FitSettings, *, only_pulses: bool, at_bound: bool) -> str:
    what = "pulses" if only_pulses else "pulses and unperturbed strides"
    kind = "one-sided upper limit" if at_bound else "percentile interval"
    return f"{kind} of {settings.n_resamples} bootstrap resamples of {what}"


def _per_mass(
    estimates: Sequence[ParameterEstimate], settings: FitSettings
) -> list[ParameterEstimate]:
    mass = settings.mass_kg
    if mass is None and not settings.wants_per_mass:
        return []
    return [_divided(e, _PER_MASS[e.name], mass) for e in estimates if e.name in _PER_MASS]


def _divided(estimate: ParameterEstimate, name: str, mass: float | None) -> ParameterEstimate:
    if mass is None:
        return ParameterEstimate(name, None, None, None, Failure.MASS_MISSING.status)

    def per_kg(value: float | None) -> float | None:
        return None if value is None else value / mass

    return ParameterEstimate(
        name=name,
        value=per_kg(estimate.value),
        ci_low=per_kg(estimate.ci_low),
        ci_high=per_kg(estimate.ci_high),
        status=estimate.status,
        ci_level=estimate.ci_level,
        ci_method=estimate.ci_method,
        share_at_bound=estimate.share_at_bound,
        unbounded=per_kg(estimate.unbounded),
    )


def failed_parameters(
    failure: Failure, *, mass_kg: float | None, wants_per_mass: bool
) -> tuple[ParameterEstimate, ...]:
    """Return the rows of a cell without an estimate.

    Parameters
    ----------
    failure : Failure
        Why.
    mass_kg : float or None
        The participant's mass.
    wants_per_mass : bool
        Whether values per kg are expected.
    """
    names = list(PARAMETERS)
    if mass_kg is not None or wants_per_mass:
        names += list(_PER_MASS.values())
    return tuple(ParameterEstimate(name, None, None, None, failure.status) for name in names)
