"""Thresholds of a footswitch that gives volts."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.stats import t as student_t

from jointz.identify.calibration.calibration_step import (
    RefusedError,
    calibration_step,
    checked_channels,
    step_series,
)
from jointz.kernels.robust_spread import robust_sd
from jointz.results.bench.calibration_failure import CalibrationFailure
from jointz.results.bench.calibration_fit import CalibrationEntry, CalibrationFit, decided
from jointz.results.estimates import REACH_95

#: Thresholds, share of the way from the open level to that of contact.
_CONTACT_SHARE, _RELEASE_SHARE = 0.6, 0.4
#: The least share of the time at either level.
_LEAST_SHARE = 0.1
#: A foot is on the ground for about 60 % of a stride: less than this is the other level.
_LEAST_CONTACT = 0.5
#: A threshold must lie so many sds from both levels.
_CLEAR_SDS = 4.0
#: Medians of the halves of one Gaussian level lie 1.15 times the sum of their spreads apart.
_TWO_LEVELS = 1.5
_PASSES = 50
#: Share of the longest time between closings that a stride lasts at least.
_LEAST_STRIDE = 0.3
_FEWEST_STRIDES, _FEWEST_DF = 10, 2.0
_METHOD = "medians of two clusters, a pair of levels every stride; sd is that of one stride"


@dataclass(frozen=True, slots=True, eq=False)
class _Levels:
    open_v: float
    contact_v: float
    open_sd_v: float
    contact_sd_v: float
    in_contact: np.ndarray  # (n,) bool: samples of the level in contact

    @property
    def apart_v(self) -> float:
        return self.contact_v - self.open_v


@calibration_step("footswitch", "contact_threshold_v", "contact_release_v")
def fit_footswitch(time: np.ndarray, voltage: np.ndarray) -> CalibrationFit:
    """Estimate the two levels of a footswitch during walking, and thresholds between them.

    Levels are medians: bounces and edges do not move them. The sd says how far the levels of any
    stride, in this session or a later one, lie from their mean: they creep, and a record of a
    minute is too short for the error of the mean to be known. Thresholds must stay clear of both
    levels as they spread over the whole record.
    """
    time, voltage = checked_channels(time, voltage=voltage)
    levels = _clusters(voltage)
    _check_levels(levels)
    pairs = _by_stride(voltage, levels)
    centre, spread = pairs.mean(axis=0), np.cov(pairs.T)
    correlated = _correlated_strides(pairs)
    spread = spread * _widening(len(pairs) / correlated)

    def level_between(name: str, share: float) -> CalibrationEntry:
        weights = np.array([1.0 - share, share])
        return decided(
            name, float(weights @ centre), {"creep": float(np.sqrt(weights @ spread @ weights))}
        )

    return CalibrationFit(
        step="footswitch",
        entries=(
            level_between("contact_threshold_v", _CONTACT_SHARE),
            level_between("contact_release_v", _RELEASE_SHARE),
        ),
        reported=(level_between("open_level_v", 0.0), level_between("contact_level_v", 1.0)),
        method=_METHOD,
        n_samples=time.size,
        notes=(f"In contact for {levels.in_contact.mean():.0%} of the time.",),
        settings={"n_strides": len(pairs), "correlated_strides": correlated},
        series=step_series(
            time,
            voltage,
            np.where(levels.in_contact, centre[1], centre[0]),
            x_label="time (s)",
            y_label="footswitch (V)",
        ),
    )


def _clusters(voltage: np.ndarray) -> _Levels:
    """Split samples into two levels by their medians (k-medians in one dimension)."""
    low, high = (float(v) for v in np.quantile(voltage, [0.02, 0.98]))
    if not high > low:
        raise RefusedError(CalibrationFailure.ONE_LEVEL, f"98 of 100 samples are {low:.4g} V")
    for _ in range(_PASSES):
        above = voltage > 0.5 * (low + high)
        if not 0 < above.sum() < voltage.size:
            break
        new = float(np.median(voltage[~above])), float(np.median(voltage[above]))
        if new == (low, high):
            break
        low, high = new
    above = voltage > 0.5 * (low + high)
    sds = [float(robust_sd(voltage[part])) for part in (~above, above)]
    return _Levels(low, high, sds[0], sds[1], above)


def _check_levels(levels: _Levels) -> None:
    share = float(levels.in_contact.mean())
    if not _LEAST_SHARE <= share <= 1.0 - _LEAST_SHARE:
        detail = f"{share:.1%} of the time at {levels.contact_v:.3g} V, the rest at "
        raise RefusedError(CalibrationFailure.ONE_LEVEL, f"{detail}{levels.open_v:.3g} V")
    reach = min(_RELEASE_SHARE, 1.0 - _CONTACT_SHARE) * levels.apart_v
    if max(levels.open_sd_v, levels.contact_sd_v) * _CLEAR_SDS > reach:
        one_level = levels.apart_v < _TWO_LEVELS * (levels.open_sd_v + levels.contact_sd_v)
        code = CalibrationFailure.ONE_LEVEL if one_level else CalibrationFailure.OVERLAPPING_LEVELS
        detail = (
            f"levels {levels.open_v:.3g} and {levels.contact_v:.3g} V, sd {levels.open_sd_v:.2g} "
            f"and {levels.contact_sd_v:.2g} V"
        )
        raise RefusedError(code, detail)
    if share < _LEAST_CONTACT:
        detail = f"volts are high for {share:.0%} of the time, expected {_LEAST_CONTACT:.0%}"
        raise RefusedError(CalibrationFailure.INVERTED_LEVELS, detail)


def _by_stride(voltage: np.ndarray, levels: _Levels) -> np.ndarray:
    """Return the levels of every stride, (n_stride, 2): medians between two closings."""
    release = levels.open_v + _RELEASE_SHARE * levels.apart_v
    contact = levels.open_v + _CONTACT_SHARE * levels.apart_v
    closings, closed = [], bool(voltage[0] > contact)
    for i in np.flatnonzero((voltage > contact) | (voltage < release)):
        if not closed and voltage[i] > contact:
            closings.append(int(i))
        closed = bool(voltage[i] > contact)
    # A switch chatters: closings soon after one belong to it.
    apart = np.diff(closings)
    shortest = _LEAST_STRIDE * float(apart.max()) if apart.size else 0.0
    starts = [i for i, gap in zip(closings[1:], apart, strict=True) if gap > shortest]
    pairs = []
    for first, stop in pairwise(starts):
        part, on = voltage[first:stop], levels.in_contact[first:stop]
        if 0 < on.sum() < on.size:
            pairs.append((np.median(part[~on]), np.median(part[on])))
    if len(pairs) < _FEWEST_STRIDES:
        detail = f"expected {_FEWEST_STRIDES} strides or more, found {len(pairs)}"
        raise RefusedError(CalibrationFailure.TOO_SHORT, detail)
    return np.array(pairs)


def _widening(independent: float) -> float:
    """Return the factor from the variance over strides to that of any stride, by Student's t."""
    df = max(independent - 1.0, _FEWEST_DF)
    return float((df + 1.0) / df * (student_t.ppf(0.975, df) / REACH_95) ** 2)


def _correlated_strides(pairs: np.ndarray) -> float:
    """Return over how many strides the levels stay correlated by slow creep."""
    longest = len(pairs) // 3
    most = 1.0
    for row in (pairs - pairs.mean(axis=0)).T:
        power = float(row @ row)
        if power == 0.0:
            continue
        total = 1.0
        for lag in range(1, longest):
            together = float(row[lag:] @ row[:-lag]) / power
            if together <= 0.0:
                break
            total += 2.0 * together
        most = max(most, total)
    return most
