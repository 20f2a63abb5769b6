"""Intrinsic and reflex impedance of a joint from one time series."""

from typing import Any

import numpy as np

from jointz.identify.record.block_regression import t_factor
from jointz.identify.record.joint_record import (
    PARAMETERS,
    JointRequest,
    angle_warnings,
    value_warnings,
)
from jointz.identify.record.reflex_search import (
    DRIFT_S,
    FILTER_ORDER,
    ReflexEstimate,
    ReflexSignals,
    fast_inertia,
    prepare,
    search_reflex,
)
from jointz.kernels.series.parallel_cascade import DELAY_S, CascadeFit
from jointz.results.estimates import ParameterEstimate
from jointz.results.impedance_limits import weakest_status, withhold_impossible
from jointz.results.series.reflex_fit import ReflexFit, ReflexPath, ReflexSeries

_CUTOFF_HZ = 20.0
_REFLEX = ("reflex_gain", "reflex_delay")
_GAIN, _DELAY = 3, 4
_SPLIT_CORRELATION = 0.95
_DRIFT_SHARE = 0.05
#: Two inertias further apart than this are not one.
_APART_SDS = 3.0
_SERIES_S = 5.0


def fit_reflex(request: JointRequest) -> ReflexFit:
    """Estimate intrinsic K, B, J, and gain and delay of the stretch reflex.

    The model is a parallel cascade: ``torque = K*angle + B*velocity + J*acceleration +
    gain*F[max(velocity - threshold, 0)](t - delay) + slow torque``, with F a second-order
    low-pass of unit steady gain. Which direction of the angle stretches is found by the
    fit; the reflex resists it.

    Kearney, Stein and Parameswaran 1997, doi:10.1109/10.581944, with a parametric reflex
    path instead of an iterated impulse response: gain, K, B and J are eliminated by least
    squares for each delay (20 to 100 ms), threshold and filter, so nothing iterates
    between the paths.

    Torque slower than 20 s is tonic: it is taken off all signals, and VAF (2.7) is of what
    is left, for the linear model too. The velocity is rectified with twice the band of the
    other signals. The first second is not fitted. The p-value is that of the largest score
    of 240 candidate paths under random signs of blocks of time
    (:func:`jointz.kernels.series.parallel_cascade.chance_of_largest_score`). Intervals are a
    block sandwich over K, B, J, gain and the shape together.

    It misleads when the torque was perturbed (torque inside the joint is taken for its
    response); when one direction is intrinsically stiffer (short-range stiffness), which
    reads as a fast reflex; when stretches are all alike, so that threshold and gain are
    one, and the gain is that at these stretches; and with a lag between the sensors.
    """
    cutoff_hz = _CUTOFF_HZ if request.cutoff_hz is None else request.cutoff_hz
    signals = prepare(request, cutoff_hz)
    estimate = search_reflex(signals, ci_level=request.ci_level)
    intrinsic = signals.motion @ estimate.kbj
    reflex = signals.torque - intrinsic - estimate.residual
    parameters, doubts = _parameters(estimate, request.ci_level)
    parameters = withhold_impossible(parameters)

    def vaf_pct(residual: np.ndarray) -> float:
        return 100.0 * (1.0 - float(np.sum(residual**2) / np.sum(signals.torque**2)))

    return ReflexFit(
        model="reflex",
        estimator="parallel_cascade",
        input=request.input,
        parameters=parameters,
        vaf_pct=vaf_pct(estimate.residual),
        intrinsic_vaf_pct=vaf_pct(signals.torque - intrinsic),
        reflex_vaf_pct=vaf_pct(signals.torque - reflex),
        linear_vaf_pct=vaf_pct(estimate.linear_residual),
        linear_stiffness=float(estimate.linear[0]),
        vaf_of="torque",
        status=weakest_status(parameters),
        path=_path(estimate, signals),
        n_samples=signals.torque.size,
        rate_hz=request.record.rate_hz,
        fit_rate_hz=signals.rate_hz,
        cutoff_hz=cutoff_hz,
        condition_number=estimate.condition_number,
        covariance=tuple(tuple(row) for row in estimate.covariance.tolist()),
        ci_method=_ci_method(estimate, signals),
        settings=request.settings(
            filter=f"Butterworth, order {FILTER_ORDER}, forward and backward",
            drift_removed_s=DRIFT_S,
            delay_range_s=list(DELAY_S),
        ),
        warnings=(*doubts, *_warnings(estimate, signals, request)),
        series=_series(signals, intrinsic, reflex),
    )


def _ci_method(estimate: ReflexEstimate, signals: ReflexSignals) -> str:
    if not estimate.covariance.size:
        return "none"
    seconds = signals.torque.size / signals.rate_hz / estimate.n_blocks
    return (
        f"block sandwich over {estimate.n_blocks} blocks of {seconds:.3g} s, Student's t with "
        f"{estimate.n_blocks - estimate.n_fitted} degrees of freedom"
    )


def _parameters(
    estimate: ReflexEstimate, ci_level: float
) -> tuple[tuple[ParameterEstimate, ...], tuple[str, ...]]:
    """Return the estimates, and why those without a value have none."""
    names = (*PARAMETERS, *_REFLEX)
    if estimate.doubt:
        empty = (
            ParameterEstimate(name, None, None, None, "undecided", ci_level=ci_level)
            for name in names
        )
        return tuple(empty), (f"undecided: {estimate.doubt}",)
    common: dict[str, Any] = {"ci_level": ci_level, "ci_method": "block sandwich"}
    values = estimate.kbj.tolist()
    if estimate.cascade is not None:
        values += [estimate.cascade.gain, estimate.cascade.shape.delay_s]
    factor = t_factor(ci_level, estimate.n_blocks - estimate.n_fitted)
    reach = factor * np.sqrt(np.diag(estimate.covariance))
    doubts = _reflex_doubts(estimate, reach)
    parameters = []
    for i, name in enumerate(names):
        if name in doubts:
            parameter = ParameterEstimate(name, None, None, None, "undecided", **common)
        else:
            low, high = values[i] - float(reach[i]), values[i] + float(reach[i])
            parameter = ParameterEstimate(name, values[i], low, high, "ok", **common)
        parameters.append(parameter)
    # Both may have the same reason: once is enough.
    return tuple(parameters), tuple(dict.fromkeys(doubts.values()))


def _reflex_doubts(estimate: ReflexEstimate, reach: np.ndarray) -> dict[str, str]:
    """Say why gain or delay are undecided."""
    if estimate.cascade is None:
        reason = (
            f"undecided: no reflex can be told from zero (p {estimate.p_value:.2g}); stiffness, "
            "damping and inertia are those of the fit without one"
        )
        return dict.fromkeys(_REFLEX, reason)
    if reach[_GAIN] >= estimate.cascade.gain:
        reason = (
            f"undecided: there may be a reflex (p {estimate.p_value:.2g}) but the interval of its "
            "gain holds zero: gain, threshold and filter explain one another; perturb with steps "
            "of several sizes, or record longer"
        )
        return dict.fromkeys(_REFLEX, reason)
    shortest, longest = DELAY_S
    if estimate.cascade.at_edge[0] or reach[_DELAY] > (longest - shortest) / 2.0:
        reason = (
            "undecided: the delay cannot be told within "
            f"{1e3 * shortest:.0f} to {1e3 * longest:.0f} ms; the best fit is at "
            f"{1e3 * estimate.cascade.shape.delay_s:.0f} ms"
        )
        return {"reflex_delay": reason}
    return {}


def _path(estimate: ReflexEstimate, signals: ReflexSignals) -> ReflexPath:
    if estimate.cascade is None:
        return ReflexPath(p_value=estimate.p_value)
    shape, thresholds = estimate.cascade.shape, signals.paths[estimate.stretch].thresholds
    return ReflexPath(
        stretch=estimate.stretch,
        threshold_rad_s=float(np.interp(shape.threshold, np.arange(thresholds.size), thresholds)),
        frequency_hz=float(np.exp(shape.log_frequency) / (2.0 * np.pi)),
        damping_ratio=float(np.exp(shape.log_ratio)),
        p_value=estimate.p_value,
    )


def _warnings(estimate: ReflexEstimate, signals: ReflexSignals, request: JointRequest) -> list[str]:
    warnings = []
    if request.input == "torque":
        warnings.append(
            "input is torque, but a reflex path needs the angle as the regressor: torque inside "
            "the joint is taken for its response and biases stiffness low; perturb the angle"
        )
    if "command" in request.record.channels:
        warnings.append("the command is not used by the model reflex")
    if estimate.cascade is not None:
        warnings += _path_warnings(estimate.cascade, estimate.covariance)
    if not estimate.doubt:
        warnings += value_warnings(estimate.kbj)
    if estimate.covariance.size:
        warnings += _inertia_warnings(estimate, signals)
    if signals.drift_share > _DRIFT_SHARE:
        warnings.append(
            f"{100.0 * signals.drift_share:.0f} % of the torque's power was slower than "
            f"{DRIFT_S:g} s and was removed as tonic; VAF is of the rest"
        )
    return warnings + angle_warnings(signals.motion[:, 0], assumption="one stiffness and one gain")


def _inertia_warnings(estimate: ReflexEstimate, signals: ReflexSignals) -> list[str]:
    inertia = float(estimate.kbj[2])
    fast, fast_sd = fast_inertia(estimate, signals)
    sd = np.hypot(fast_sd, np.sqrt(estimate.covariance[2, 2]))
    if abs(fast - inertia) <= _APART_SDS * sd:
        return []
    return [
        f"the inertia depends on the band ({fast:.3g} kg*m^2 where fast motion weighs more): the "
        "intrinsic path is not of second order; its interval is too narrow; compare cutoff_hz"
    ]


def _path_warnings(cascade: CascadeFit, covariance: np.ndarray) -> list[str]:
    warnings = []
    if covariance.size:
        sd = np.sqrt(np.diag(covariance))
        correlation = float(covariance[0, _GAIN] / (sd[0] * sd[_GAIN]))
        if abs(correlation) > _SPLIT_CORRELATION:
            warnings.append(
                f"stiffness and reflex gain are confounded (correlation {correlation:.2f}): "
                "displacement and stretch velocity do not decide the split; perturb in both "
                "directions and with steps of several sizes"
            )
    names = ("threshold", "filter frequency", "filter damping")
    held = [name for name, edge in zip(names, cascade.at_edge[1:], strict=True) if edge]
    if held:
        warnings.append(
            f"held at the end of the range of the search: {', '.join(held)} of the reflex path; "
            "the intervals do not know them"
        )
    return warnings


def _series(signals: ReflexSignals, intrinsic: np.ndarray, reflex: np.ndarray) -> ReflexSeries:
    """Return the middle of the record."""
    n, width = signals.time.size, int(_SERIES_S * signals.rate_hz)
    first = max(0, (n - width) // 2)
    shown = slice(first, first + width)
    columns = {
        "time_s": signals.time,
        "measured": signals.torque,
        "modelled": intrinsic + reflex,
        "intrinsic": intrinsic,
        "reflex": reflex,
    }
    return ReflexSeries(**{name: tuple(x[shown].tolist()) for name, x in columns.items()})
