"""Intrinsic and reflex impedance of a joint from one time series."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.signal import butter, sosfreqz

from jointz.core.codes import Failure
from jointz.core.errors import DataError, EstimationError
from jointz.identify.record.block_regression import fitted_sandwich, t_factor
from jointz.identify.record.joint_record import (
    JOINT,
    PARAMETERS,
    JointRecord,
    JointRequest,
    angle_warnings,
    refuse_constant,
    value_warnings,
)
from jointz.kernels.block_sandwich import correlation_time, count_blocks
from jointz.kernels.derivatives import derivative
from jointz.kernels.filtering import lowpass_zero_phase
from jointz.kernels.series.parallel_cascade import (
    DELAY_S,
    CascadeFit,
    RectifiedPath,
    chance_of_largest_score,
    fit_cascade,
    linear_fit,
    rectified_path,
)
from jointz.results.estimates import ParameterEstimate
from jointz.results.impedance_limits import weakest_status, withhold_impossible
from jointz.results.series.reflex_fit import ReflexFit, ReflexPath, ReflexSeries

FILTER_ORDER = 4
#: Samples of the thinned record in one period of the cutoff.
_SAMPLES_PER_PERIOD = 5.0
#: The velocity is rectified with its corners: it is low-passed at this multiple of the cutoff.
_VELOCITY_BAND = 2.0
_HIGHEST_BAND = 0.4
#: The reflex of stretches before the record reaches this far into it.
_SETTLE_S = 1.0
_EDGE_PERIODS = 3.0
#: Torque slower than this period is tonic and drifts; it is no response to the perturbation.
DRIFT_S = 20.0
_SHORTEST_S = 20.0
_LARGEST_CONDITION = 1e3
#: A delay of 20 to 100 ms cannot be told from a filter below this.
_LOWEST_CUTOFF_HZ = 5.0
#: Less than this share of a record's range is what the filter leaves of motion before it.
_STILL = 1e-6
#: Blocks left over beside one a fitted number.
_SPARE_BLOCKS = 8
#: Numbers fitted: K, B, J, gain, delay, threshold, frequency, damping ratio.
_FITTED = 8
_DELAY_COLUMN = 4


@dataclass(frozen=True, slots=True)
class ReflexSignals:
    """Low-passed and thinned signals, slow torque removed, and the velocity at full rate."""

    rate_hz: float  # rate of the thinned record
    time: np.ndarray  # thinned samples in the fit, s
    motion: np.ndarray  # angle (rad), velocity (rad/s), acceleration (rad/s^2)
    torque: np.ndarray  # on the joint, N*m
    # direction that stretches (``positive`` or ``negative``) -> path
    paths: dict[str, RectifiedPath]
    drift_share: float  # share of the torque's power at periods above ``DRIFT_S``


@dataclass(frozen=True, slots=True)
class ReflexEstimate:
    """K, B, J without a reflex and, where one stands out, both paths."""

    linear: np.ndarray  # K, B, J without a reflex, SI
    linear_residual: np.ndarray  # residual of the fit without a reflex, N*m
    # of K, B, J and, with a cascade, gain and delay; empty where the record is too short
    covariance: np.ndarray
    n_blocks: int
    n_fitted: int  # number of fitted parameters
    condition_number: float  # of the scaled sensitivities
    p_value: float  # of the test for a reflex
    doubt: str = ""  # reason for a missing interval
    cascade: CascadeFit | None = None  # both paths; None without a significant reflex
    stretch: str = ""  # direction that stretches, ``positive`` or ``negative``

    @property
    def kbj(self) -> np.ndarray:
        """K, B, J of the intrinsic path."""
        return self.linear if self.cascade is None else self.cascade.linear

    @property
    def residual(self) -> np.ndarray:
        """Measured minus modelled torque, N*m."""
        return self.linear_residual if self.cascade is None else self.cascade.residual


def prepare(request: JointRequest, cutoff_hz: float) -> ReflexSignals:
    """Low-pass, differentiate and thin the signals, and subtract slow drift."""
    record, rate = request.record, request.record.rate_hz
    _check(record, cutoff_hz)
    step = max(1, int(rate / (_SAMPLES_PER_PERIOD * cutoff_hz)))
    n = record.time.size // step * step
    angle, torque = (record.channels[name][:n] for name in ("angle", "torque"))
    sign = -1.0 if request.torque_acts_on == "device" else 1.0
    angle, torque = angle - angle.mean(), sign * (torque - torque.mean())
    smooth = lowpass_zero_phase(np.stack([angle, torque]), cutoff_hz=cutoff_hz, rate_hz=rate)
    velocity = derivative(smooth[0], rate_hz=rate)
    acceleration = derivative(velocity, rate_hz=rate)
    edge_s, thinned_hz = _EDGE_PERIODS / cutoff_hz, rate / step
    first = int(np.ceil(max(_SETTLE_S, edge_s) * thinned_hz))
    kept = slice(first, n // step - int(np.ceil(edge_s * thinned_hz)))
    motion = np.column_stack([smooth[0], velocity, acceleration])[::step][kept]
    total = smooth[1][::step][kept]
    _check_moves(record, motion[:, 0], total)
    total -= total.mean()
    drift = _slow_functions(total.size, thinned_hz)
    frequency = np.fft.rfftfreq(n // step, step / rate)
    section = butter(FILTER_ORDER, cutoff_hz, fs=rate, output="sos")
    lowpass = np.abs(sosfreqz(section, worN=frequency, fs=rate)[1]) ** 2
    band_hz = max(cutoff_hz, min(_VELOCITY_BAND * cutoff_hz, _HIGHEST_BAND * rate))
    fast = derivative(lowpass_zero_phase(angle, cutoff_hz=band_hz, rate_hz=rate), rate_hz=rate)
    # Torque that resists a stretch to negative angles is negative: so is that low-pass.
    paths = {
        direction: rectified_path(
            sign * fast, rate_hz=rate, step=step, lowpass=sign * lowpass, kept=kept, drift=drift
        )
        for direction, sign in (("positive", 1.0), ("negative", -1.0))
    }
    return ReflexSignals(
        rate_hz=thinned_hz,
        time=record.time[:n:step][kept],
        motion=motion - drift @ (drift.T @ motion),
        torque=total - drift @ (drift.T @ total),
        paths=paths,
        drift_share=float(np.sum((drift.T @ total) ** 2) / np.sum(total**2)),
    )


def _check(record: JointRecord, cutoff_hz: float) -> None:
    half = record.rate_hz / 2.0
    if not _LOWEST_CUTOFF_HZ <= cutoff_hz < half:
        raise DataError(
            f"{JOINT}: expected {_LOWEST_CUTOFF_HZ:g} <= cutoff_hz < {half:.6g} (half the "
            f"sampling rate), got {cutoff_hz:g}. Change cutoff_hz, or record faster."
        )
    if record.seconds < _SHORTEST_S:
        raise DataError(
            f"{JOINT}: the record lasts {record.seconds:.4g} s, at least {_SHORTEST_S:g} s are "
            "needed to tell a reflex. Give a longer record."
        )
    refuse_constant(record)


def _check_moves(record: JointRecord, angle: np.ndarray, torque: np.ndarray) -> None:
    """Refuse a record that stands still where it is fitted."""
    for name, kept in (("angle", angle), ("torque", torque)):
        if np.ptp(kept) <= _STILL * np.ptp(record.channels[name]):
            raise EstimationError(
                f"constant_{name}",
                f"the {name} is constant after the first second, which is not fitted: nothing to "
                "identify. Cut the record to where the joint is perturbed.",
            )


def _slow_functions(n: int, rate_hz: float) -> np.ndarray:
    """Return (n, m), orthonormal: a constant and half-cosines slower than ``DRIFT_S``."""
    count = 1 + int(2.0 * n / rate_hz / DRIFT_S)
    slow = np.cos(np.pi * (np.arange(n) + 0.5)[:, None] / n * np.arange(count))
    return np.asarray(slow / np.linalg.norm(slow, axis=0))


def search_reflex(signals: ReflexSignals, *, ci_level: float) -> ReflexEstimate:
    """Fit K, B, J without and with a reflex in either direction."""
    linear, condition = linear_fit(signals.motion, signals.torque)
    if condition > _LARGEST_CONDITION:
        raise EstimationError(
            Failure.ILL_CONDITIONED.value,
            "angle, velocity and acceleration do not tell K, B and J apart: condition number "
            f"{condition:.3g}, expected below {_LARGEST_CONDITION:.0g}. Perturb with more than "
            "one frequency, or raise cutoff_hz.",
        )
    residual = signals.torque - signals.motion @ linear
    cascades = {
        direction: fit_cascade(path, signals.motion, signals.torque)
        for direction, path in signals.paths.items()
    }
    candidates = np.column_stack([scores for _, scores in cascades.values()])
    n_blocks, doubt = _blocks(signals.motion * residual[:, None], signals, fitted=3)
    fits = {direction: fit for direction, (fit, _) in cascades.items() if fit is not None}
    p_value = 1.0
    if n_blocks and fits:
        p_value = chance_of_largest_score(candidates, residual, n_blocks)
    without = ReflexEstimate(
        linear=linear,
        linear_residual=residual,
        covariance=_covariance(signals.motion, residual, n_blocks),
        n_blocks=n_blocks,
        n_fitted=3,
        condition_number=condition,
        p_value=p_value,
        doubt=doubt,
    )
    if p_value >= 1.0 - ci_level:
        return without
    stretch = min(fits, key=lambda name: float(np.sum(fits[name].residual ** 2)))
    return _with_reflex(without, fits[stretch], stretch, signals)


def _with_reflex(
    without: ReflexEstimate, cascade: CascadeFit, stretch: str, signals: ReflexSignals
) -> ReflexEstimate:
    """Return both paths, with the covariance of K, B, J, gain and delay.

    The delay stays free even at the end of its range: held there, the other
    intervals would be too narrow. The rest of the shape is held there.
    """
    free = np.append(np.ones(_DELAY_COLUMN, dtype=bool), ~cascade.at_edge)
    free[_DELAY_COLUMN] = True
    jacobian, residual = cascade.jacobian[:, free], cascade.residual
    n_blocks, doubt = _blocks(jacobian[:, :5] * residual[:, None], signals, fitted=_FITTED)
    return replace(
        without,
        covariance=_covariance(jacobian, residual, n_blocks)[:5, :5],
        n_blocks=n_blocks,
        n_fitted=jacobian.shape[1],
        condition_number=float(np.linalg.cond(jacobian / np.linalg.norm(jacobian, axis=0))),
        doubt=doubt,
        cascade=cascade,
        stretch=stretch,
    )


def fast_inertia(estimate: ReflexEstimate, signals: ReflexSignals) -> tuple[float, float]:
    """Return J and its sd from the differenced record, which weighs the fast motion more.

    In a second-order joint it is the same J.
    """
    torque = signals.motion @ estimate.kbj + estimate.residual
    motion, change = np.diff(signals.motion, axis=0), np.diff(torque)
    values, _ = linear_fit(motion, change)
    covariance = _covariance(motion, change - motion @ values, estimate.n_blocks)
    return float(values[2]), float(np.sqrt(covariance[2, 2]))


def _blocks(scores: np.ndarray, signals: ReflexSignals, *, fitted: int) -> tuple[int, str]:
    """Return the number of blocks, or 0 and why."""
    seconds = signals.torque.size / signals.rate_hz
    score_s = max(correlation_time(column, rate_hz=signals.rate_hz) for column in scores.T)
    n_blocks = count_blocks(seconds, correlation_time_s=score_s)
    if n_blocks >= fitted + _SPARE_BLOCKS:
        return n_blocks, ""
    return 0, (
        f"the record is too short for an interval: {seconds:.3g} s, while the errors stay "
        f"correlated for {score_s:.3g} s; record longer"
    )


def _covariance(jacobian: np.ndarray, residual: np.ndarray, n_blocks: int) -> np.ndarray:
    if n_blocks == 0:
        return np.empty((0, 0))
    size = np.linalg.norm(jacobian, axis=0)
    scaled = jacobian / size
    covariance = fitted_sandwich(scaled * residual[:, None], scaled.T @ scaled, n_blocks)
    return np.asarray(covariance / np.outer(size, size))


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
    """Return why gain or delay are undecided."""
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
