"""Strides and segments of a time-varying estimate."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr

from jointz.core.codes import Exclusion, Failure
from jointz.core.errors import DataError, EstimationError
from jointz.gait.heel_strikes import find_heel_strikes
from jointz.gait.strides import find_strides
from jointz.identify.over_cycle.time_varying_segments import SegmentLayout
from jointz.identify.record.joint_record import JointRecord

_WHERE = "identify_time_varying"
#: Samples of a segment in one period of the highest frequency.
_SAMPLES_PER_PERIOD = 5.0
#: Reach of the filter, in periods of its corner: kept free at the ends of the record.
_GUARD_PERIODS = 2.0
#: Longest lag of the admittance and of the instrument; of the two-sided impedance to each side,
#: before any reflex.
_ADMITTANCE_S, _IMPEDANCE_S = 0.3, 0.04
_FEWEST_STRIDES, _FEWEST_SAMPLES = 30, 5
#: Longest segment, as a share of the stride.
_LONGEST_SEGMENT = 0.5


@dataclass(frozen=True, slots=True)
class TimeVaryingSettings:
    """Settings of :func:`jointz.identify_time_varying`."""

    input: str
    torque_acts_on: str
    segment_s: float
    length_s: float
    n_phases: int
    cutoff_hz: float
    resamples: int
    seed: int
    ci_level: float

    def check(self, rate_hz: float) -> None:
        """Raise DataError for a setting outside its range."""
        highest = rate_hz / _SAMPLES_PER_PERIOD
        if not 0.0 < self.cutoff_hz <= highest:
            raise DataError(
                f"{_WHERE}: cutoff_hz: expected 0 < cutoff_hz <= {highest:g} Hz (five samples a "
                f"period at {rate_hz:g} Hz), got {self.cutoff_hz:g}"
            )
        shortest = (_FEWEST_SAMPLES - 1) / (_SAMPLES_PER_PERIOD * self.cutoff_hz)
        ranges = {
            "segment_s": (self.segment_s, shortest, 1.0),
            "length_s": (self.length_s, 0.25 / self.cutoff_hz, 2.0),
            "n_phases": (self.n_phases, 1, 1000),
            "resamples": (self.resamples, 100, 100_000),
            "ci_level": (self.ci_level, 0.5, 0.999),
        }
        for name, (value, low, high) in ranges.items():
            if not low <= value <= high:
                raise DataError(
                    f"{_WHERE}: {name}: expected {low:.4g} <= {name} <= {high:g}, got {value:g}"
                )


@dataclass(frozen=True, slots=True)
class ChosenStrides:
    """Strides for an estimate, and counts of the excluded ones by code."""

    start_s: np.ndarray
    duration_s: np.ndarray
    excluded: dict[str, int]  # code -> number of excluded strides


def default_length_s(perturbed: str) -> float:
    """Return the default longest lag of the impulse response, s."""
    return _ADMITTANCE_S if perturbed == "torque" else _IMPEDANCE_S


def locate_strikes(
    recording: xr.Dataset | Mapping[str, npt.ArrayLike] | pd.DataFrame | None,
    given_s: npt.ArrayLike | None,
    record: JointRecord,
) -> np.ndarray:
    """Return the heel strikes: the stated ones, else those of the recording's contact."""
    if given_s is not None:
        strikes = np.asarray(given_s, dtype=float)
        if strikes.ndim != 1 or not np.all(np.isfinite(strikes)):
            raise DataError(
                f"{_WHERE}: heel_strikes must be a list of times in s, got shape {strikes.shape} "
                f"with {np.count_nonzero(~np.isfinite(strikes))} value(s) without a number."
            )
        return strikes
    if isinstance(recording, xr.Dataset):
        if "time" not in recording.coords:  # xarray would count samples
            recording = recording.assign_coords(time=record.time)
        return find_heel_strikes(recording).time_s
    if recording is None or "contact" not in recording:
        raise EstimationError(
            Failure.NO_HEEL_STRIKES.value,
            f"{_WHERE}: the gait cycle needs heel strikes, found none. Give heel_strikes= (times "
            "in s) or a channel 'contact'.",
        )
    time = recording.get("time", record.time)
    contact = xr.Dataset(
        {"contact": ("time", np.asarray(recording["contact"], dtype=float))},
        coords={"time": np.asarray(time, dtype=float)},
    )
    return find_heel_strikes(contact).time_s


def choose_strides(
    record: JointRecord, strikes: np.ndarray, settings: TimeVaryingSettings
) -> ChosenStrides:
    """Return the accepted strides whose segments lie inside the record."""
    strides = find_strides(strikes, np.empty((0, 2)))
    longest = max(settings.length_s, _ADMITTANCE_S)
    reach = 0.5 * settings.segment_s + longest + _GUARD_PERIODS / settings.cutoff_hz
    inside = (strides.start_s - reach >= record.time[0]) & (
        strides.end_s + reach <= record.time[-1]
    )
    good = strides.accepted & inside
    codes = [
        code or Exclusion.EDGE_OF_RECORD.value
        for code, kept in zip(strides.code, good, strict=True)
        if not kept
    ]
    excluded = dict(sorted(Counter(codes).items()))
    count = int(np.count_nonzero(good))
    if count < _FEWEST_STRIDES:
        why = ", ".join(f"{n} {code}" for code, n in excluded.items()) or "none excluded"
        raise DataError(
            f"{_WHERE}: expected at least {_FEWEST_STRIDES} strides, found {count} of "
            f"{strides.start_s.size} ({why}). Record more strides; a stride must last 0.75 to 1.33 "
            "times the usual one, on the clock of the record."
        )
    duration = strides.duration_s[good]
    if settings.segment_s > _LONGEST_SEGMENT * duration.min():
        raise DataError(
            f"{_WHERE}: segment_s of {settings.segment_s:g} s is over half of the shortest stride "
            f"({duration.min():.3g} s): nothing of the cycle would be resolved. Shorten it."
        )
    return ChosenStrides(strides.start_s[good], duration, excluded)


def lay_out(
    record: JointRecord, used: ChosenStrides, gait: np.ndarray, settings: TimeVaryingSettings
) -> SegmentLayout:
    """Return where the segments of all strides lie."""
    rate = record.rate_hz
    step = max(1, round(rate / (_SAMPLES_PER_PERIOD * settings.cutoff_hz)))
    at = used.start_s[:, np.newaxis] + gait * used.duration_s[:, np.newaxis] - record.time[0]
    half = max(_FEWEST_SAMPLES // 2, round(0.5 * settings.segment_s * rate / step))
    last = round(settings.length_s * rate / step)
    first = -last if settings.input == "angle" else 0
    return SegmentLayout(
        centres=np.rint(at * rate).astype(int),
        offsets=step * np.arange(-half, half + 1),
        response_lags=step * np.arange(first, last + 1),
        instrument_lags=step * np.arange(round(_ADMITTANCE_S * rate / step) + 1),
    )
