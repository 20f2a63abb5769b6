"""One time series of any joint to its intrinsic and its reflex impedance."""

from collections.abc import Mapping
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr
from scipy.stats import t as student_t

from jointz.core import provenance
from jointz.identify.series.joint_record import (
    JointRecord,
    check_choice,
    gather_record,
    sign_warnings,
)
from jointz.identify.series.reflex_search import (
    DRIFT_S,
    FILTER_ORDER,
    Found,
    ReflexSignals,
    fast_inertia,
    prepare,
    search,
)
from jointz.kernels.series.parallel_cascade import DELAY_S, CascadeFit
from jointz.results.estimates import ParameterEstimate
from jointz.results.series.reflex_fit import ReflexFit, ReflexPath, ReflexSeries

Input = Literal["torque", "angle"]
TorqueSide = Literal["joint", "device"]

_WHERE = "identify_reflex"
_CUTOFF_HZ = 20.0
_INTRINSIC = ("stiffness", "damping", "inertia")
_REFLEX = ("reflex_gain", "reflex_delay")
_GAIN, _DELAY = 3, 4
_SPLIT_CORRELATION = 0.95
_DRIFT_SHARE = 0.05
#: Two inertias further apart than this are not one.
_APART_SDS = 3.0
_LARGE_ANGLE_RAD = 0.2
_SERIES_S = 5.0


def identify_reflex(  # noqa: PLR0913 - the fixed public signature of identify
    recording: xr.Dataset | Mapping[str, npt.ArrayLike] | pd.DataFrame | None = None,
    *,
    angle: npt.ArrayLike | None = None,
    torque: npt.ArrayLike | None = None,
    command: npt.ArrayLike | None = None,
    time: npt.ArrayLike | None = None,
    rate_hz: float | None = None,
    input: Input = "torque",
    torque_acts_on: TorqueSide = "joint",
    cutoff_hz: float | None = None,
    ci_level: float = 0.95,
) -> ReflexFit:
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
    check_choice("input", input, get_args(Input))
    check_choice("torque_acts_on", torque_acts_on, get_args(TorqueSide))
    if not 0.0 < ci_level < 1.0:
        raise ValueError(f"ci_level: expected 0 < ci_level < 1, got {ci_level}")
    given = {"angle": angle, "torque": torque, "command": command, "time": time}
    record = gather_record(recording, given, rate_hz=rate_hz, where=_WHERE)
    cutoff_hz = _CUTOFF_HZ if cutoff_hz is None else cutoff_hz
    sign = -1.0 if torque_acts_on == "device" else 1.0
    signals = prepare(record, cutoff_hz=cutoff_hz, torque_sign=sign)
    found = search(signals, ci_level=ci_level)
    settings = {
        "filter": f"Butterworth, order {FILTER_ORDER}, forward and backward",
        "drift_removed_s": DRIFT_S,
        "delay_range_s": list(DELAY_S),
        "torque_acts_on": torque_acts_on,
        "ci_level": ci_level,
        "sha256": record.sha256,
        "jointz": provenance.software()["jointz"],
    }
    return _report(found, signals, record, perturbed=input, cutoff_hz=cutoff_hz, settings=settings)


def _report(
    found: Found,
    signals: ReflexSignals,
    record: JointRecord,
    *,
    perturbed: str,
    cutoff_hz: float,
    settings: dict[str, Any],
) -> ReflexFit:
    kbj = found.linear if found.fit is None else found.fit.linear
    intrinsic = signals.motion @ kbj
    residual = found.linear_residual if found.fit is None else found.fit.residual
    reflex = signals.torque - intrinsic - residual
    parameters, notes = _parameters(found, settings["ci_level"])
    undecided = any(p.status == "undecided" for p in parameters)
    return ReflexFit(
        model="reflex",
        estimator="parallel_cascade",
        input=perturbed,
        parameters=parameters,
        vaf_pct=_vaf_pct(signals.torque, residual),
        intrinsic_vaf_pct=_vaf_pct(signals.torque, signals.torque - intrinsic),
        reflex_vaf_pct=_vaf_pct(signals.torque, signals.torque - reflex),
        linear_vaf_pct=_vaf_pct(signals.torque, found.linear_residual),
        linear_stiffness=float(found.linear[0]),
        vaf_of="torque",
        status="undecided" if undecided else "ok",
        path=_path(found, signals),
        n_samples=signals.torque.size,
        rate_hz=record.rate_hz,
        fit_rate_hz=signals.rate_hz,
        cutoff_hz=cutoff_hz,
        condition_number=found.condition_number,
        covariance=tuple(tuple(row) for row in found.covariance.tolist()),
        ci_method=_ci_method(found, signals),
        settings=settings,
        warnings=(*notes, *_warnings(found, signals, record, perturbed)),
        series=_series(signals, intrinsic, reflex),
    )


def _vaf_pct(measured: np.ndarray, residual: np.ndarray) -> float:
    return 100.0 * (1.0 - float(np.sum(residual**2) / np.sum(measured**2)))


def _ci_method(found: Found, signals: ReflexSignals) -> str:
    if not found.covariance.size:
        return "none"
    seconds = signals.torque.size / signals.rate_hz / found.n_blocks
    return (
        f"block sandwich over {found.n_blocks} blocks of {seconds:.3g} s, Student's t with "
        f"{found.n_blocks - found.n_fitted} degrees of freedom"
    )


def _parameters(
    found: Found, ci_level: float
) -> tuple[tuple[ParameterEstimate, ...], tuple[str, ...]]:
    """Return the estimates, and why those without a value have none."""
    common: dict[str, Any] = {"ci_level": ci_level, "ci_method": "block sandwich"}
    if found.doubt:
        empty = (
            ParameterEstimate(name, None, None, None, "undecided", ci_level=ci_level)
            for name in (*_INTRINSIC, *_REFLEX)
        )
        return tuple(empty), (f"undecided: {found.doubt}",)
    values = found.linear.tolist()
    if found.fit is not None:
        values = [*found.fit.linear.tolist(), found.fit.gain, found.fit.shape.delay_s]
    freedom = found.n_blocks - found.n_fitted
    reach = float(student_t.ppf((1.0 + ci_level) / 2.0, freedom)) * np.sqrt(
        np.diag(found.covariance)
    )
    doubts = _reflex_doubts(found, reach)
    estimates = []
    for i, name in enumerate((*_INTRINSIC, *_REFLEX)):
        if name in doubts:
            estimate = ParameterEstimate(name, None, None, None, "undecided", **common)
        else:
            low, high = values[i] - float(reach[i]), values[i] + float(reach[i])
            estimate = ParameterEstimate(name, values[i], low, high, "ok", **common)
        estimates.append(estimate)
    # Both may have the same reason: once is enough.
    return tuple(estimates), tuple(dict.fromkeys(doubts.values()))


def _reflex_doubts(found: Found, reach: np.ndarray) -> dict[str, str]:
    """Say why gain or delay are undecided."""
    if found.fit is None:
        reason = (
            f"undecided: no reflex can be told from zero (p {found.p_value:.2g}); stiffness, "
            "damping and inertia are those of the fit without one"
        )
        return dict.fromkeys(_REFLEX, reason)
    if reach[_GAIN] >= found.fit.gain:
        reason = (
            f"undecided: there may be a reflex (p {found.p_value:.2g}) but the interval of its "
            "gain holds zero: gain, threshold and filter explain one another; perturb with steps "
            "of several sizes, or record longer"
        )
        return dict.fromkeys(_REFLEX, reason)
    shortest, longest = DELAY_S
    if found.fit.at_edge[0] or reach[_DELAY] > (longest - shortest) / 2.0:
        reason = (
            "undecided: the delay cannot be told within "
            f"{1e3 * shortest:.0f} to {1e3 * longest:.0f} ms; the best fit is at "
            f"{1e3 * found.fit.shape.delay_s:.0f} ms"
        )
        return {"reflex_delay": reason}
    return {}


def _path(found: Found, signals: ReflexSignals) -> ReflexPath:
    if found.fit is None:
        return ReflexPath(p_value=found.p_value)
    shape, thresholds = found.fit.shape, signals.paths[found.stretch].thresholds
    return ReflexPath(
        stretch=found.stretch,
        threshold_rad_s=float(np.interp(shape.threshold, np.arange(thresholds.size), thresholds)),
        frequency_hz=float(np.exp(shape.log_frequency) / (2.0 * np.pi)),
        damping_ratio=float(np.exp(shape.log_ratio)),
        p_value=found.p_value,
    )


def _warnings(
    found: Found, signals: ReflexSignals, record: JointRecord, perturbed: str
) -> list[str]:
    notes = []
    if perturbed == "torque":
        notes.append(
            "input is torque, but a reflex path needs the angle as the regressor: torque inside "
            "the joint is taken for its response and biases stiffness low; perturb the angle"
        )
    if "command" in record.channels:
        notes.append("the command is not used by the model reflex")
    if found.fit is not None:
        notes += _path_notes(found.fit, found.covariance)
    if not found.doubt:
        notes += sign_warnings(found.linear if found.fit is None else found.fit.linear)
    notes += _inertia_notes(found, signals)
    if signals.drift_share > _DRIFT_SHARE:
        notes.append(
            f"{100.0 * signals.drift_share:.0f} % of the torque's power was slower than "
            f"{DRIFT_S:g} s and was removed as tonic; VAF is of the rest"
        )
    largest = float(np.abs(signals.motion[:, 0]).max())
    if largest > _LARGE_ANGLE_RAD:
        notes.append(
            f"the angle moves {largest:.2f} rad from its mean, above {_LARGE_ANGLE_RAD} rad: one "
            "stiffness and one gain may not hold over such a range"
        )
    return notes


def _inertia_notes(found: Found, signals: ReflexSignals) -> list[str]:
    if not found.covariance.size:
        return []
    inertia = float((found.linear if found.fit is None else found.fit.linear)[2])
    fast, fast_sd = fast_inertia(found, signals)
    if abs(fast - inertia) <= _APART_SDS * np.hypot(fast_sd, np.sqrt(found.covariance[2, 2])):
        return []
    return [
        f"the inertia depends on the band ({fast:.3g} kg*m^2 where fast motion weighs more): the "
        "intrinsic path is not of second order; its interval is too narrow; compare cutoff_hz"
    ]


def _path_notes(fit: CascadeFit, covariance: np.ndarray) -> list[str]:
    notes = []
    if covariance.size:
        sd = np.sqrt(np.diag(covariance))
        correlation = float(covariance[0, _GAIN] / (sd[0] * sd[_GAIN]))
        if abs(correlation) > _SPLIT_CORRELATION:
            notes.append(
                f"stiffness and reflex gain are confounded (correlation {correlation:.2f}): "
                "displacement and stretch velocity do not decide the split; perturb in both "
                "directions and with steps of several sizes"
            )
    names = ("threshold", "filter frequency", "filter damping")
    held = [name for name, edge in zip(names, fit.at_edge[1:], strict=True) if edge]
    if held:
        notes.append(
            f"held at the end of the range of the search: {', '.join(held)} of the reflex path; "
            "the intervals do not know them"
        )
    return notes


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
