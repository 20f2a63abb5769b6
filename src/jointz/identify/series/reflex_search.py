"""Search of the reflex path in a prepared record, and the covariance of what was found."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfreqz

from jointz.core.codes import Failure
from jointz.core.errors import DataError, EstimationError
from jointz.identify.series.joint_record import JointRecord, refuse_constant
from jointz.kernels.block_sandwich import block_sandwich, correlation_time, count_blocks
from jointz.kernels.derivatives import derivative
from jointz.kernels.filtering import lowpass_zero_phase
from jointz.kernels.series.parallel_cascade import (
    CascadeFit,
    RectifiedPath,
    chance_of_largest_score,
    fit_cascade,
    linear_fit,
    rectified_path,
)

_WHERE = "identify_reflex"
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

    rate_hz: float  # of the thinned record
    time: np.ndarray  # time of the thinned samples that enter the fit
    motion: np.ndarray  # angle, velocity, acceleration
    torque: np.ndarray  # on the joint
    # by the direction that stretches, ``positive`` and ``negative``
    paths: dict[str, RectifiedPath]
    drift_share: float  # share of the torque's power that was slower than ``DRIFT_S``


@dataclass(frozen=True, slots=True)
class Found:
    """What the search found."""

    linear: np.ndarray  # K, B, J without a reflex
    linear_residual: np.ndarray  # of that fit
    fit: CascadeFit | None  # both paths, where a reflex stands out
    stretch: str  # direction that stretches
    p_value: float  # of the reflex
    # of K, B, J, and where there is a fit gain and delay; empty where the record is too short
    covariance: np.ndarray
    n_blocks: int  # blocks, and numbers fitted
    n_fitted: int
    condition_number: float  # of the scaled sensitivities
    doubt: str = ""  # why there is no interval


def prepare(record: JointRecord, *, cutoff_hz: float, torque_sign: float) -> ReflexSignals:
    """Low-pass, differentiate, thin and take off what is slow."""
    rate = record.rate_hz
    _check(record, cutoff_hz)
    step = max(1, int(rate / (_SAMPLES_PER_PERIOD * cutoff_hz)))
    n = record.time.size // step * step
    angle, torque = (record.channels[name][:n] for name in ("angle", "torque"))
    angle, torque = angle - angle.mean(), torque_sign * (torque - torque.mean())
    smooth = lowpass_zero_phase(np.stack([angle, torque]), cutoff_hz=cutoff_hz, rate_hz=rate)
    velocity = derivative(smooth[0], rate_hz=rate)
    acceleration = derivative(velocity, rate_hz=rate)
    kept = _kept(n // step, rate / step, cutoff_hz)
    motion = np.column_stack([smooth[0], velocity, acceleration])[::step][kept]
    total = smooth[1][::step][kept]
    _check_moves(record, motion[:, 0], total)
    total -= total.mean()
    drift = _slow_functions(total.size, rate / step)
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
        rate_hz=rate / step,
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
            f"{_WHERE}: expected {_LOWEST_CUTOFF_HZ:g} <= cutoff_hz < {half:.6g} (half the "
            f"sampling rate), got {cutoff_hz:g}. Change cutoff_hz, or record faster."
        )
    seconds = record.time.size / record.rate_hz
    if seconds < _SHORTEST_S:
        raise DataError(
            f"{_WHERE}: the record lasts {seconds:.4g} s, at least {_SHORTEST_S:g} s are needed "
            "to tell a reflex. Give a longer record."
        )
    refuse_constant(record)


def _check_moves(record: JointRecord, angle: np.ndarray, torque: np.ndarray) -> None:
    """Refuse a record that stands still where it is fitted."""
    for name, kept, code in (
        ("angle", angle, Failure.CONSTANT_ANGLE),
        ("torque", torque, Failure.CONSTANT_TORQUE),
    ):
        if np.ptp(kept) <= _STILL * np.ptp(record.channels[name]):
            raise EstimationError(
                code.value,
                f"the {name} is constant after the first second, which is not fitted: nothing to "
                "identify. Cut the record to where the joint is perturbed.",
            )


def _kept(n: int, rate_hz: float, cutoff_hz: float) -> slice:
    edge_s = _EDGE_PERIODS / cutoff_hz
    return slice(int(np.ceil(max(_SETTLE_S, edge_s) * rate_hz)), n - int(np.ceil(edge_s * rate_hz)))


def _slow_functions(n: int, rate_hz: float) -> np.ndarray:
    """Return (n, m), orthonormal: a constant and half-cosines slower than ``DRIFT_S``."""
    count = 1 + int(2.0 * n / rate_hz / DRIFT_S)
    phase = np.pi * (np.arange(n) + 0.5)[:, None] / n
    slow = np.cos(phase * np.arange(count))
    orthonormal: np.ndarray = slow / np.linalg.norm(slow, axis=0)
    return orthonormal


def search(signals: ReflexSignals, *, ci_level: float) -> Found:
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
    tried = {
        direction: fit_cascade(path, signals.motion, signals.torque)
        for direction, path in signals.paths.items()
    }
    candidates = np.column_stack([own for _, own in tried.values()])
    scores = signals.motion * residual[:, None]
    n_blocks, doubt = _blocks(scores, signals, fitted=3)
    fits = {direction: fit for direction, (fit, _) in tried.items() if fit is not None}
    p_value, stretch = 1.0, ""
    if n_blocks and fits:
        p_value = chance_of_largest_score(candidates, residual, n_blocks)
        stretch = min(fits, key=lambda name: float(np.sum(fits[name].residual ** 2)))
    without = Found(
        linear=linear,
        linear_residual=residual,
        fit=None,
        stretch="",
        p_value=p_value,
        covariance=_covariance(signals.motion, residual, n_blocks),
        n_blocks=n_blocks,
        n_fitted=3,
        condition_number=condition,
        doubt=doubt,
    )
    if p_value >= 1.0 - ci_level:
        return without
    return _with_reflex(without, fits[stretch], stretch, signals)


def _with_reflex(without: Found, fit: CascadeFit, stretch: str, signals: ReflexSignals) -> Found:
    """Return both paths, with the covariance of K, B, J, gain and delay.

    The delay stays free even at the end of its range: held there, the other
    intervals would be too narrow. The rest of the shape is held there.
    """
    free = np.append(np.ones(_DELAY_COLUMN, dtype=bool), ~fit.at_edge)
    free[_DELAY_COLUMN] = True
    jacobian = fit.jacobian[:, free]
    size = np.linalg.norm(jacobian, axis=0)
    condition = float(np.linalg.cond(jacobian / size))
    n_blocks, doubt = _blocks(jacobian[:, :5] * fit.residual[:, None], signals, fitted=_FITTED)
    covariance = _covariance(jacobian, fit.residual, n_blocks)[:5, :5]
    return Found(
        linear=without.linear,
        linear_residual=without.linear_residual,
        fit=fit,
        stretch=stretch,
        p_value=without.p_value,
        covariance=covariance,
        n_blocks=n_blocks,
        n_fitted=jacobian.shape[1],
        condition_number=condition,
        doubt=doubt,
    )


def fast_inertia(found: Found, signals: ReflexSignals) -> tuple[float, float]:
    """Return J and its sd from the differenced record, which weighs the fast motion more.

    In a second-order joint it is the same J.
    """
    torque = signals.motion @ found.linear + found.linear_residual
    if found.fit is not None:
        torque = signals.motion @ found.fit.linear + found.fit.residual
    motion, change = np.diff(signals.motion, axis=0), np.diff(torque)
    values, _ = linear_fit(motion, change)
    covariance = _covariance(motion, change - motion @ values, found.n_blocks)
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
    """Return (p, p) with n_b - p for n_b - 1, as in a regression with p numbers; or empty."""
    if n_blocks == 0:
        return np.empty((0, 0))
    size = np.linalg.norm(jacobian, axis=0)
    scaled = jacobian / size
    covariance = block_sandwich(scaled * residual[:, None], scaled.T @ scaled, n_blocks)
    spent = (n_blocks - 1) / (n_blocks - jacobian.shape[1])
    out: np.ndarray = spent * covariance / np.outer(size, size)
    return out
