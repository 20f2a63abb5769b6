"""One time series of any joint to stiffness, damping and inertia."""

from collections.abc import Callable, Mapping
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr
from scipy.stats import t as student_t

from jointz.core import provenance
from jointz.core.errors import DataError
from jointz.identify.series.frequency_response import identify_frequency_response
from jointz.identify.series.impulse_response import identify_impulse_response
from jointz.identify.series.joint_estimators import ESTIMATORS, JointSignals, Solution
from jointz.identify.series.joint_record import check_choice, gather_record, sign_warnings
from jointz.identify.series.joint_signals import (
    EDGE_PERIODS,
    FILTER_ORDER,
    EstimatorName,
    default_estimator,
    prepare_signals,
)
from jointz.identify.series.reflex import identify_reflex
from jointz.identify.series.second_order_check import check_second_order, withhold_parameters
from jointz.kernels.block_sandwich import (
    CORRELATION_TIMES_PER_BLOCK,
    FEWEST_BLOCKS,
    block_sandwich,
    correlation_time,
    count_blocks,
)
from jointz.results.estimates import ParameterEstimate
from jointz.results.series.frequency_response_fit import FrequencyResponseFit
from jointz.results.series.impulse_response_fit import ImpulseResponseFit
from jointz.results.series.joint_fit import FitSeries, JointFit
from jointz.results.series.reflex_fit import ReflexFit
from jointz.results.series.second_order_verdict import SecondOrderCheck

Model = Literal["kbj", "irf", "frf", "reflex"]
Input = Literal["torque", "angle"]
TorqueSide = Literal["joint", "device"]

_PARAMETERS = ("stiffness", "damping", "inertia")
#: Estimators that keep K, B, J >= 0: their intervals do too.
_BOUNDED = ("bounded_least_squares", "admittance")
_OTHER_MODELS: dict[str, Callable[..., ImpulseResponseFit | FrequencyResponseFit | ReflexFit]] = {
    "irf": identify_impulse_response,
    "frf": identify_frequency_response,
    "reflex": identify_reflex,
}
_CUTOFF_HZ = 30.0
_LARGE_ANGLE_RAD = 0.2
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
    model: Model = "kbj",
    estimator: EstimatorName | None = None,
    input: Input = "torque",
    cutoff_hz: float | None = None,
    torque_acts_on: TorqueSide = "joint",
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
        ``time``, in SI. Either this or the arrays.
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
    model : str
        ``kbj``; ``irf``, ``frf`` and ``reflex`` call
        :func:`jointz.identify.series.impulse_response.identify_impulse_response`,
        :func:`jointz.identify.series.frequency_response.identify_frequency_response` and
        :func:`jointz.identify.series.reflex.identify_reflex`, and take no estimator.
    estimator : str, optional
        ``least_squares`` (default where the angle was perturbed),
        ``admittance`` (default where the torque was),
        ``bounded_least_squares`` or ``instrumental_variable``; see
        :mod:`jointz.identify.series.joint_estimators`.
    input : str
        What was perturbed: ``torque`` or ``angle``.
    cutoff_hz : float, optional
        Cutoff of the low-pass, 30 Hz by default, 20 Hz for ``reflex``; ``irf``
        and ``frf`` choose the end of their band from the record.
    torque_acts_on : str
        ``joint``, or ``device``: the sign of the torque is turned.
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
    EstimationError
        ``constant_angle``, ``constant_torque`` or ``ill_conditioned``.
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
    check_choice("input", input, get_args(Input))
    check_choice("torque_acts_on", torque_acts_on, get_args(TorqueSide))
    if estimator is not None:
        check_choice("estimator", estimator, tuple(ESTIMATORS))
    if not 0.0 < ci_level < 1.0:
        raise ValueError(f"ci_level: expected 0 < ci_level < 1, got {ci_level}")
    given = {"angle": angle, "torque": torque, "command": command, "time": time}
    if model != "kbj":
        if estimator is not None:
            raise DataError(f"identify_joint: model {model} has no choice of estimator. Drop it.")
        return _OTHER_MODELS[model](
            recording,
            **given,
            rate_hz=rate_hz,
            input=input,
            torque_acts_on=torque_acts_on,
            cutoff_hz=cutoff_hz,
            ci_level=ci_level,
        )
    cutoff_hz = _CUTOFF_HZ if cutoff_hz is None else cutoff_hz
    record = gather_record(recording, given, rate_hz=rate_hz, where="identify_joint")
    chosen = estimator or default_estimator(input, has_command="command" in record.channels)
    signals = prepare_signals(record, cutoff_hz, torque_acts_on)
    solution = ESTIMATORS[chosen](signals)
    settings = {
        "filter": f"Butterworth, order {FILTER_ORDER}, forward and backward",
        "edge_dropped_s": EDGE_PERIODS / cutoff_hz,
        "torque_acts_on": torque_acts_on,
        "ci_level": ci_level,
        "sha256": record.sha256,
        "jointz": provenance.software()["jointz"],
    }
    return _report(
        solution,
        signals,
        model=model,
        estimator=chosen,
        perturbed=input,
        cutoff_hz=cutoff_hz,
        settings=settings,
    )


def _report(
    solution: Solution,
    signals: JointSignals,
    *,
    model: str,
    estimator: str,
    perturbed: str,
    cutoff_hz: float,
    settings: dict[str, Any],
) -> JointFit:
    """Put intervals around the solution and say what is doubtful about it."""
    n, rate = signals.angle.size, signals.rate_hz
    score_s = max(correlation_time(s, rate_hz=rate) for s in _scores(solution)[:, :3].T)
    n_blocks = count_blocks(n / rate, correlation_time_s=score_s)
    doubt = solution.doubt or ("" if n_blocks else _too_short(n / rate, score_s))
    covariance = np.empty((0, 3)) if doubt else _covariance(solution, n_blocks)
    ci_method = "none" if doubt else _ci_method(n_blocks, n / rate / n_blocks)
    parameters = _parameters(
        solution,
        covariance,
        n_blocks=n_blocks,
        ci_level=settings["ci_level"],
        ci_method=ci_method,
        bounded=estimator in _BOUNDED,
    )
    check = SecondOrderCheck()
    if not doubt:
        check = check_second_order(
            ESTIMATORS[estimator], solution, signals, cutoff_hz=cutoff_hz, covariance=covariance
        )
    notes = _warnings(solution, signals, estimator, perturbed, doubt)
    if check.fails:
        parameters, note = withhold_parameters(parameters, check, model)
        covariance, ci_method, notes = np.empty((0, 3)), "none", (note, *notes)
    statuses = [p.status for p in parameters]
    return JointFit(
        model=model,
        estimator=estimator,
        input=perturbed,
        parameters=parameters,
        vaf_pct=_vaf_pct(solution),
        vaf_of=solution.fitted_signal,
        status=next((s for s in ("undecided", "at_bound") if s in statuses), "ok"),
        n_samples=n,
        rate_hz=rate,
        cutoff_hz=cutoff_hz,
        condition_number=solution.condition_number,
        covariance=tuple(tuple(row) for row in covariance.tolist()),
        residual_correlation_time_s=correlation_time(solution.residual, rate_hz=rate),
        ci_method=ci_method,
        settings=settings,
        warnings=notes,
        check=check,
        series=_series(solution, signals),
    )


def _scores(solution: Solution) -> np.ndarray:
    """Return (n, p): what sums to zero at the solution; its correlation sets the blocks.

    The residual itself may drift for seconds without harm to K, B and J: only
    its product with the motion enters them.
    """
    scores: np.ndarray = solution.instruments * solution.residual[:, None]
    return scores


def _too_short(seconds: float, score_s: float) -> str:
    return (
        f"the record is too short for an interval: {seconds:.3g} s, while the errors stay "
        f"correlated for {score_s:.3g} s; record at least "
        f"{FEWEST_BLOCKS * CORRELATION_TIMES_PER_BLOCK * score_s:.3g} s"
    )


def _ci_method(n_blocks: int, block_s: float) -> str:
    return (
        f"block sandwich over {n_blocks} blocks of {block_s:.3g} s, Student's t with "
        f"{n_blocks - len(_PARAMETERS)} degrees of freedom"
    )


def _covariance(solution: Solution, n_blocks: int) -> np.ndarray:
    """Return (3, 3); a parameter at its bound is held there for the others' covariance.

    Three fitted parameters make the block sums smaller than they are, as in
    any regression: n_b - 3 instead of n_b - 1 makes up for it. Without, 95 %
    intervals from ten blocks hold the truth in 91 % of simulated records.
    """
    scores = _scores(solution)
    full = block_sandwich(scores, solution.bread, n_blocks)
    spent = (n_blocks - 1) / (n_blocks - len(_PARAMETERS))
    if not solution.at_bound.any():
        return spent * full[:3, :3]
    free = np.flatnonzero(~np.pad(solution.at_bound, (0, scores.shape[1] - 3)))
    covariance = np.diag(np.diag(full))
    covariance[np.ix_(free, free)] = block_sandwich(
        scores[:, free], solution.bread[np.ix_(free, free)], n_blocks
    )
    return spent * covariance[:3, :3]


def _parameters(
    solution: Solution,
    covariance: np.ndarray,
    *,
    n_blocks: int,
    ci_level: float,
    ci_method: str,
    bounded: bool,
) -> tuple[ParameterEstimate, ...]:
    unbounded = [None] * 3 if solution.unbounded is None else solution.unbounded.tolist()
    common: dict[str, Any] = {"ci_level": ci_level, "ci_method": ci_method}
    if not covariance.size:
        return tuple(
            ParameterEstimate(name, None, None, None, "undecided", **common) for name in _PARAMETERS
        )
    both, upper = student_t.ppf([(1.0 + ci_level) / 2.0, ci_level], n_blocks - len(_PARAMETERS))
    sd = np.sqrt(np.diag(covariance))
    estimates = []
    for i, name in enumerate(_PARAMETERS):
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


def _vaf_pct(solution: Solution) -> float:
    """Return (2.7) on the signal without its mean."""
    measured = solution.measured - solution.measured.mean()
    return 100.0 * (1.0 - float(np.sum(solution.residual**2) / np.sum(measured**2)))


def _warnings(
    solution: Solution, signals: JointSignals, estimator: str, perturbed: str, doubt: str
) -> tuple[str, ...]:
    notes = [f"undecided: {doubt}"] if doubt else []
    regression = estimator in ("least_squares", "bounded_least_squares")
    if perturbed == "torque" and regression:
        notes.append(
            "input is torque but a torque-on-angle estimator was chosen: stiffness is biased low "
            "by torque inside the joint"
        )
    if perturbed == "angle" and estimator == "admittance":
        notes.append(
            "input is angle but a torque-to-angle estimator was chosen: torque inside the joint is "
            "taken for its cause"
        )
    largest = float(np.abs(signals.angle).max())
    if largest > _LARGE_ANGLE_RAD:
        notes.append(
            f"the angle moves {largest:.2f} rad from its mean, above {_LARGE_ANGLE_RAD} rad: one "
            "stiffness may not hold over such a range"
        )
    return (*notes, *([] if doubt else sign_warnings(solution.kbj)))


def _series(solution: Solution, signals: JointSignals) -> FitSeries:
    """Return the middle of the record, thinned to what a figure can show."""
    n, width = signals.time.size, int(_SERIES_S * signals.rate_hz)
    first = max(0, (n - width) // 2)
    step = max(1, min(n, width) // _SERIES_POINTS)
    shown = slice(first, min(n, first + width), step)
    measured = solution.measured - solution.measured.mean()
    return FitSeries(
        time_s=tuple(signals.time[shown].tolist()),
        measured=tuple(measured[shown].tolist()),
        modelled=tuple((measured - solution.residual)[shown].tolist()),
    )
