"""One time series of any joint to stiffness, damping and inertia."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr
from scipy.stats import t as student_t

from jointz.core.codes import Failure
from jointz.core.errors import DataError, EstimationError
from jointz.identify.preparation.command_slope import DOUBTED, REFUSED, CommandSlope, record_slope
from jointz.identify.preparation.instrument_checks import is_clipped, is_held
from jointz.identify.record.block_regression import fitted_sandwich
from jointz.identify.record.frequency_response_second_order import estimate_second_order
from jointz.identify.record.frequency_response_spectra import impedance_spectra
from jointz.identify.record.impulse_response import fit_impulse_response
from jointz.identify.record.joint_estimators import (
    ESTIMATORS,
    JointSignals,
    Solution,
    least_squares,
)
from jointz.identify.record.joint_record import (
    JOINT,
    OPPOSITE_SIGN,
    PARAMETERS,
    Input,
    JointRecord,
    JointRequest,
    TorqueSide,
    angle_warnings,
    check_choice,
    value_warnings,
)
from jointz.identify.record.joint_signals import (
    EDGE_PERIODS,
    FILTER_ORDER,
    EstimatorName,
    default_estimator,
    prepare_signals,
    response_curve,
)
from jointz.identify.record.reflex import fit_reflex
from jointz.identify.record.second_order_check import check_second_order, withhold_parameters
from jointz.kernels.block_sandwich import (
    CORRELATION_TIMES_PER_BLOCK,
    FEWEST_BLOCKS,
    correlation_time,
    count_blocks,
)
from jointz.results.estimates import ParameterEstimate
from jointz.results.impedance_limits import weakest_status, withhold_impossible
from jointz.results.series.frequency_response_fit import FrequencyResponseFit
from jointz.results.series.impulse_response_fit import ImpulseResponseFit
from jointz.results.series.joint_fit import FitSeries, JointFit
from jointz.results.series.reflex_fit import ReflexFit
from jointz.results.series.second_order_verdict import SecondOrderCheck

Model = Literal["kbj", "irf", "frf", "reflex"]

#: Estimators that keep K, B, J >= 0: their intervals do too.
_BOUNDED = ("bounded_least_squares", "admittance")
_CUTOFF_HZ = 30.0
#: Of the sampling rate: the highest cutoff with which the sign is looked at.
_LARGEST_CUTOFF = 0.4
#: Share of the torque that K, B, J must explain for their sign to say that of the torque.
_SIGN_EXPLAINED = 0.5
#: A warning is given for a fit that explains less of its signal than this, %.
_LITTLE_EXPLAINED_PCT = 50.0
_UNRELATED = (
    "angle and torque do not show that they belong together: none of stiffness, damping and "
    "inertia differs from zero. Check the columns and torque_acts_on, perturb more, or record "
    "longer"
)
_SERIES_S = 5.0
_SERIES_POINTS = 1000


def identify_joint(  # noqa: PLR0913 - the fixed public signature: keywords after the first
    recording: xr.Dataset | Mapping[str, npt.ArrayLike] | pd.DataFrame | None = None,
    *,
    angle: npt.ArrayLike | None = None,
    torque: npt.ArrayLike | None = None,
    command: npt.ArrayLike | None = None,
    time: npt.ArrayLike | None = None,
    rate_hz: float | None = None,
    units: Mapping[str, str] | None = None,
    model: Model = "kbj",
    estimator: EstimatorName | None = None,
    input: Input = "torque",
    cutoff_hz: float | None = None,
    torque_acts_on: TorqueSide = "joint",
    length_s: float | None = None,
    ci_level: float = 0.95,
) -> JointFit | ImpulseResponseFit | FrequencyResponseFit | ReflexFit:
    """Estimate stiffness, damping and inertia of a joint from one record.

    The model is torque = K*angle + B*velocity + J*acceleration + offset (1.5,
    2.1). Offsets are removed; every signal passes the same zero-phase
    fourth-order Butterworth low-pass before it is differentiated (8th-order
    central differences); ``3/cutoff_hz`` is dropped at each end.

    Parameters
    ----------
    recording : xarray.Dataset, mapping or pandas.DataFrame, optional
        Channels ``angle``, ``torque`` and, where there are, ``command`` and
        ``time``. Either this or the arrays.
    angle : (n,) float, rad, optional
        Joint angle.
    torque : (n,) float, N*m, optional
        Measured torque.
    command : (n,) float, N*m, optional
        Commanded torque; the instrument of ``instrumental_variable``.
    time : (n,) float, s, optional
        Time stamps. Jitter is resampled linearly; a gap is an error.
    rate_hz : float, optional
        Sampling rate, where there are no time stamps.
    units : mapping, optional
        Channel -> unit, such as ``{"angle": "deg"}``. Otherwise the unit that a dataset states
        (``attrs["units"]``), else SI: rad, N*m, s.
    model : str
        ``kbj``: stiffness, damping and inertia. ``irf``: impulse response
        (:func:`jointz.identify.record.impulse_response.fit_impulse_response`). ``frf``:
        frequency response
        (:func:`jointz.identify.record.joint.fit_frequency_response`).
        ``reflex``: with a stretch reflex (:func:`jointz.identify.record.reflex.fit_reflex`).
    estimator : str, optional
        Of ``kbj``: ``least_squares`` (default where the angle was perturbed),
        ``admittance`` (default where the torque was),
        ``bounded_least_squares`` or ``instrumental_variable``; see
        :mod:`jointz.identify.record.joint_estimators`.
    input : str
        What was perturbed: ``torque`` or ``angle``.
    cutoff_hz : float, optional
        Cutoff of the low-pass, 30 Hz by default, 20 Hz for ``reflex``; ``irf``
        and ``frf`` choose the end of their band from the record.
    torque_acts_on : str
        ``joint``, or ``device``: the sign of the torque is turned.
    length_s : float, optional
        Length of the response of ``irf``; chosen from the record by default.
    ci_level : float
        Level of the intervals.

    Returns
    -------
    JointFit, ImpulseResponseFit, FrequencyResponseFit or ReflexFit
        Parameters with intervals, VAF (2.7), warnings. A value that the record
        cannot decide has status ``undecided`` and is None; so has every value where
        the residual refutes a second-order joint (``check``).

    Raises
    ------
    DataError
        When the samples cannot be trusted: missing channel, unequal lengths,
        NaN, gap, a record too short, a cutoff above half the rate.
    UnitError
        When a unit is unknown, or not the one that the dataset states.
    EstimationError
        ``constant_angle``, ``constant_torque``, ``ill_conditioned`` or ``opposite_sign``.
    ValueError
        Unknown model, estimator, input or side; the message lists the choices.

    Notes
    -----
    Intervals: covariance from sums of the estimating equations over blocks
    longer than the correlation of the residuals
    (:func:`jointz.kernels.block_sandwich.block_sandwich`), Student's t. They
    do not know errors of the instruments: lag, gain and drift.

    Examples
    --------
    >>> t = np.arange(20_000) / 1000.0
    >>> angle = 0.02 * np.sin(2 * np.pi * 1.3 * t) + 0.01 * np.sin(2 * np.pi * 7.1 * t)
    >>> acceleration = -0.02 * (2 * np.pi * 1.3) ** 2 * np.sin(2 * np.pi * 1.3 * t)
    >>> acceleration -= 0.01 * (2 * np.pi * 7.1) ** 2 * np.sin(2 * np.pi * 7.1 * t)
    >>> fit = identify_joint(
    ...     angle=angle, torque=50 * angle + 0.02 * acceleration, rate_hz=1000.0, input="angle"
    ... )
    >>> round(fit.parameter("stiffness").value, 2)
    50.0
    """
    check_choice("model", model, get_args(Model))
    if estimator is not None:
        check_choice("estimator", estimator, tuple(ESTIMATORS))
    if model != "kbj" and estimator is not None:
        raise DataError(f"{JOINT}: model {model} has no choice of estimator. Drop it.")
    if model != "irf" and length_s is not None:
        raise DataError(f"{JOINT}: model {model} has no length_s. Drop it.")
    request = JointRequest.of(
        recording,
        {"angle": angle, "torque": torque, "command": command, "time": time},
        rate_hz=rate_hz,
        units=units,
        input=input,
        torque_acts_on=torque_acts_on,
        cutoff_hz=cutoff_hz,
        ci_level=ci_level,
    )
    slope = _slope_on_command(request)
    _refuse_torque(request.record, slope)
    _refuse_opposite_sign(request)
    fit: JointFit | ImpulseResponseFit | FrequencyResponseFit | ReflexFit
    if model == "irf":
        fit = fit_impulse_response(request, length_s)
    elif model == "frf":
        fit = fit_frequency_response(request)
    elif model == "reflex":
        fit = fit_reflex(request)
    else:
        fit = _fit_second_order(request, estimator)
    if slope is None or not slope.exceeds(DOUBTED):
        return fit
    return replace(fit, warnings=(*fit.warnings, f"{slope}: check units and gains of both"))


def _slope_on_command(request: JointRequest) -> CommandSlope | None:
    """Return the slope of a perturbing torque on its command, None if there is none."""
    record, command = request.record, request.record.channels.get("command")
    if command is None or request.input != "torque":
        return None
    return record_slope(record.channels["torque"], command, record.rate_hz)


def _refuse_torque(record: JointRecord, slope: CommandSlope | None) -> None:
    """Refuse a torque that is clipped, sampled too slowly, or unlike its command."""
    torque = record.channels["torque"]
    for failure, is_refused in (
        (Failure.TORQUE_SATURATED, is_clipped(torque)),
        (Failure.TORQUE_HELD, is_held(torque, record.rate_hz)),
        (Failure.TORQUE_UNLIKE_COMMAND, slope is not None and slope.exceeds(REFUSED)),
    ):
        if is_refused:
            details = f" ({slope})" if failure is Failure.TORQUE_UNLIKE_COMMAND else ""
            raise EstimationError(failure.value, f"{JOINT}: {failure.meaning}{details}.")


def _refuse_opposite_sign(request: JointRequest) -> None:
    """Refuse a torque that all of stiffness, damping and inertia turn against the motion."""
    record = request.record
    cutoff_hz = min(request.cutoff_hz or _CUTOFF_HZ, _LARGEST_CUTOFF * record.rate_hz)
    try:
        signals = prepare_signals(record, cutoff_hz, request.torque_acts_on)
        solution = least_squares(signals)
    except (DataError, EstimationError):
        return  # the fit of the model raises its own error
    explained = 1.0 - float(np.sum(solution.residual**2) / np.sum(signals.torque**2))
    if np.all(solution.kbj < 0.0) and explained > _SIGN_EXPLAINED:
        raise EstimationError(Failure.OPPOSITE_SIGN.value, OPPOSITE_SIGN)


def _fit_second_order(request: JointRequest, estimator: EstimatorName | None) -> JointFit:
    cutoff_hz = _CUTOFF_HZ if request.cutoff_hz is None else request.cutoff_hz
    has_command = "command" in request.record.channels
    chosen = estimator or default_estimator(request.input, has_command=has_command)
    signals = prepare_signals(request.record, cutoff_hz, request.torque_acts_on)
    solution = ESTIMATORS[chosen](signals)
    intervals = _Intervals.of(solution, signals)
    parameters = withhold_impossible(
        intervals.parameters(request.ci_level, bounded=chosen in _BOUNDED)
    )
    covariance, ci_method = intervals.covariance, intervals.ci_method
    measured = solution.measured - solution.measured.mean()
    vaf_pct = 100.0 * (1.0 - float(np.sum(solution.residual**2) / np.sum(measured**2)))
    warnings = _warnings(request, chosen, solution, vaf_pct, intervals.doubt)
    warnings += angle_warnings(signals.angle)
    warnings += [] if intervals.doubt else value_warnings(solution.kbj)
    check = SecondOrderCheck()
    if not intervals.doubt:
        check = check_second_order(
            ESTIMATORS[chosen], solution, signals, cutoff_hz=cutoff_hz, covariance=covariance
        )
    if check.fails:
        parameters, note = withhold_parameters(parameters, check, "kbj")
        covariance, ci_method, warnings = np.empty((0, 3)), "none", [note, *warnings]
    return JointFit(
        model="kbj",
        estimator=chosen,
        input=request.input,
        parameters=parameters,
        vaf_pct=vaf_pct,
        vaf_of=solution.fitted_signal,
        status=weakest_status(parameters),
        n_samples=signals.angle.size,
        rate_hz=signals.rate_hz,
        cutoff_hz=cutoff_hz,
        condition_number=solution.condition_number,
        covariance=tuple(tuple(row) for row in covariance.tolist()),
        residual_correlation_time_s=correlation_time(solution.residual, rate_hz=signals.rate_hz),
        ci_method=ci_method,
        settings=request.settings(
            filter=f"Butterworth, order {FILTER_ORDER}, forward and backward",
            edge_dropped_s=EDGE_PERIODS / cutoff_hz,
        ),
        warnings=tuple(warnings),
        check=check,
        series=_series(measured, solution, signals),
    )


@dataclass(frozen=True, slots=True)
class _Intervals:
    """Covariance of a solution by blocks of time, or why there is none."""

    solution: Solution
    covariance: np.ndarray
    n_blocks: int
    ci_method: str = "none"
    doubt: str = ""  # reason for missing intervals; "" otherwise

    @classmethod
    def of(cls, solution: Solution, signals: JointSignals) -> "_Intervals":
        # The residual itself may drift for seconds without harm to K, B and J: only its product
        # with the motion enters them.
        scores = solution.instruments * solution.residual[:, None]
        rate_hz = signals.rate_hz
        seconds = signals.angle.size / rate_hz
        score_s = max(correlation_time(s, rate_hz=rate_hz) for s in scores[:, :3].T)
        n_blocks = count_blocks(seconds, correlation_time_s=score_s)
        needed_s = FEWEST_BLOCKS * CORRELATION_TIMES_PER_BLOCK * score_s
        too_short = (
            f"the record is too short for an interval: {seconds:.3g} s, while the errors stay "
            f"correlated for {score_s:.3g} s; record at least {needed_s:.3g} s"
        )
        doubt = solution.doubt or ("" if n_blocks else too_short)
        if doubt:
            return cls(solution, np.empty((0, 3)), n_blocks, doubt=doubt)
        freedom = n_blocks - len(PARAMETERS)
        covariance = _covariance(scores, solution, n_blocks)
        half_width = student_t.ppf(0.975, freedom) * np.sqrt(np.diag(covariance))
        if np.all(np.abs(solution.kbj) <= half_width):
            return cls(solution, np.empty((0, 3)), n_blocks, doubt=_UNRELATED)
        ci_method = (
            f"block sandwich over {n_blocks} blocks of {seconds / n_blocks:.3g} s, Student's t "
            f"with {freedom} degrees of freedom"
        )
        return cls(solution, covariance, n_blocks, ci_method)

    def parameters(self, ci_level: float, *, bounded: bool) -> tuple[ParameterEstimate, ...]:
        common: dict[str, Any] = {"ci_level": ci_level, "ci_method": self.ci_method}
        if self.doubt:
            return tuple(
                ParameterEstimate(name, None, None, None, "undecided", **common)
                for name in PARAMETERS
            )
        solution, freedom = self.solution, self.n_blocks - len(PARAMETERS)
        unbounded = [None] * 3 if solution.unbounded is None else solution.unbounded.tolist()
        both, upper = student_t.ppf([(1.0 + ci_level) / 2.0, ci_level], freedom)
        sd = np.sqrt(np.diag(self.covariance))
        estimates = []
        for i, name in enumerate(PARAMETERS):
            value = float(solution.kbj[i])
            low, high = value - float(both * sd[i]), value + float(both * sd[i])
            status = "ok"
            if solution.at_bound[i]:
                low, high, status = 0.0, float(upper * sd[i]), "at_bound"
            elif bounded:
                low = max(low, 0.0)
            estimates.append(
                ParameterEstimate(name, value, low, high, status, unbounded=unbounded[i], **common)
            )
        return tuple(estimates)


def _covariance(scores: np.ndarray, solution: Solution, n_blocks: int) -> np.ndarray:
    """Return (3, 3); a parameter at its bound is held there for the others' covariance."""
    full = fitted_sandwich(scores, solution.bread, n_blocks, fitted=len(PARAMETERS))
    if not solution.at_bound.any():
        return full[:3, :3]
    free = np.flatnonzero(~np.pad(solution.at_bound, (0, scores.shape[1] - 3)))
    covariance = np.diag(np.diag(full))
    covariance[np.ix_(free, free)] = fitted_sandwich(
        scores[:, free], solution.bread[np.ix_(free, free)], n_blocks, fitted=len(PARAMETERS)
    )
    return covariance[:3, :3]


def _warnings(
    request: JointRequest, estimator: str, solution: Solution, vaf_pct: float, doubt: str
) -> list[str]:
    warnings = [f"undecided: {doubt}"] if doubt else []
    regression = estimator in ("least_squares", "bounded_least_squares")
    if request.input == "torque" and regression:
        warnings.append(
            "input is torque but a torque-on-angle estimator was chosen: stiffness is biased low "
            "by torque inside the joint"
        )
    if request.input == "angle" and estimator == "admittance":
        warnings.append(
            "input is angle but a torque-to-angle estimator was chosen: torque inside the joint is "
            "taken for its cause"
        )
    if vaf_pct < _LITTLE_EXPLAINED_PCT:
        warnings.append(
            f"the model explains {max(vaf_pct, 0.0):.2g} % of the {solution.fitted_signal}: check "
            "that angle and torque are not exchanged"
        )
    return warnings


def _series(measured: np.ndarray, solution: Solution, signals: JointSignals) -> FitSeries:
    """Return the middle of the record, thinned to what a figure can show."""
    n, width = signals.time.size, int(_SERIES_S * signals.rate_hz)
    first = max(0, (n - width) // 2)
    shown = slice(first, min(n, first + width), max(1, min(n, width) // _SERIES_POINTS))
    columns = (signals.time, measured, measured - solution.residual)
    return FitSeries(*(tuple(column[shown].tolist()) for column in columns))


def fit_frequency_response(request: JointRequest) -> FrequencyResponseFit:
    """Estimate the impedance of a joint over frequency, and K, B, J.

    The curve is Welch's with 16 Hann segments, half overlapping, of 4 s at most: a
    resonance narrower than ``resolution_hz`` reads too flat. K, B, J are not read
    off the curve: they are fitted to the spectra of the whole record, which have
    no such bias (:func:`jointz.kernels.series.spectra_second_order.fit_second_order`),
    weighted by the error. White noise of the input is taken off where the top
    of its spectrum shows it.

    It misleads when input names the wrong signal (torque inside the joint is
    then taken for its response; a warning tells where the record shows it),
    with reflexes, and with a lag between the sensors: a lag T reads as B + K T
    and J + B T.
    """
    spectra = impedance_spectra(request)
    joint = estimate_second_order(request, spectra, model="frf")
    band = spectra.band
    frequency_hz = spectra.spectra.frequency_hz[band]
    s = 2j * np.pi * frequency_hz
    has_instrument = request.input == "torque" and "command" in request.record.channels
    return FrequencyResponseFit(
        **joint.result_fields(
            curve="Welch, Hann segments overlapping by half",
            instrument="command" if has_instrument else "none",
        ),
        vaf_pct=joint.fit.vaf_pct,
        response=response_curve(
            frequency_hz,
            spectra.impedance[band],
            relative_sd=spectra.relative_sd[band],
            coherence=spectra.coherence[band],
            n_averages=spectra.spectra.n_averages,
            ci_level=request.ci_level,
            fitted=joint.fit.values @ np.stack([np.ones_like(s), s, s**2]),  # noqa: PD011 - a field
        ),
        resolution_hz=spectra.spectra.resolution_hz,
        n_averages=spectra.spectra.n_averages,
    )
