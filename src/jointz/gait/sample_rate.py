"""Plausible sampling rates, from strides and pulses."""

from contextlib import suppress

import numpy as np
import xarray as xr
from scipy.ndimage import maximum_filter1d

from jointz.core.errors import DataError, EstimationError
from jointz.gait.heel_strikes import find_heel_strikes
from jointz.gait.strides import find_strides

#: Median strides of walking lie between these, s.
SHORTEST_S, LONGEST_S = 0.7, 2.5
#: Usual ones of adults, 0.5 to 2 m/s, and the height of these adults, m; the time of a stride goes
#: with the square root of the leg's length (Hof 1996, Gait & Posture 4, 222).
_USUAL_STRIDES_S, _USUAL_HEIGHT_M = (0.8, 1.9), 1.75
_USUAL_S = 1.1
_LIKELY_S = (0.85, 1.4)
_FEWEST_STRIDES = 5
_MOST_NAMED = 3
#: Rates that instruments have, Hz; strides are looked for at every fourth.
USUAL_HZ = (
    *(25, 50, 60, 100, 120, 125, 150, 200, 240, 250, 300, 400, 500, 600, 800, 1000, 1200, 1500),
    *(2000, 2400, 2500, 3000, 4000, 5000, 10000),
)
#: Rates that few instruments have, Hz: powers of two, and wireless electrodes.
_RARE_HZ = (128, 148.148, 256, 370.37, 512, 1024, 1111.11, 1259.26, 1925.93, 2048, 2148.15)
_FEWEST_ONSETS = 8
_CURVED_S, _AROUND_S = 0.01, 0.03
#: Mean rank of the torque's curvature at the onsets: chance gives 0.5, the right rate nearly 1.
_DOUBTED, _CONVINCING = 0.75, 0.9
#: Factors between units of time; least share of a recording over which pulses are spread.
_UNITS, _SPANNED = (1000.0, 60.0, 1 / 60.0, 1e-3), 0.1


def median_stride_s(recording: xr.Dataset) -> float | None:
    """Return the median stride, None where there are too few or no channel shows them."""
    with suppress(DataError, EstimationError):
        strides = find_strides(find_heel_strikes(recording).time_s, np.empty((0, 2)))
        if strides.accepted.sum() >= _FEWEST_STRIDES:
            return float(np.median(strides.duration_s[strides.accepted]))
    return None


def rates_of_strides(recording: xr.Dataset) -> dict[float, float]:
    """Return usual rates in Hz, likeliest first, each with the median stride in s that it gives."""
    stride_of_rate = {
        hz: stride for hz in USUAL_HZ[::4] if (stride := median_stride_s(_at_rate(recording, hz)))
    }
    if not stride_of_rate:
        return {}
    best = min(stride_of_rate, key=lambda hz: _unusual(stride_of_rate[hz]))
    strides = {float(hz): stride_of_rate[best] * best / hz for hz in USUAL_HZ}
    ordered = sorted(strides, key=lambda hz: _unusual(strides[hz]))
    likely = [hz for hz in ordered if _LIKELY_S[0] <= strides[hz] <= _LIKELY_S[1]]
    return {hz: strides[hz] for hz in likely[:_MOST_NAMED]}


def format_rates(rates: dict[float, float]) -> str:
    """Return rates with their median strides, as text."""
    return " or ".join(f"{hz:g} Hz (strides of {stride:.2f} s)" for hz, stride in rates.items())


def is_walking_stride(stride_s: float) -> bool:
    """Return whether a median stride is one of walking."""
    return SHORTEST_S <= stride_s <= LONGEST_S


def usual_strides_s(height_m: float | None = None) -> tuple[float, float]:
    """Return the shortest and longest median stride that are usual; small people step faster."""
    scale = 1.0 if height_m is None else (height_m / _USUAL_HEIGHT_M) ** 0.5
    shortest, longest = _USUAL_STRIDES_S
    return max(SHORTEST_S, shortest * min(scale, 1.0)), longest * max(scale, 1.0)


def scale_of_onsets(
    recording: xr.Dataset, onset_s: np.ndarray, *, rate_hz: float, stamped: bool
) -> float | None:
    """Return the factor that aligns pulses with their onsets, None if aligned or unclear.

    Stamps of a recorder can be in another unit than their onsets; without stamps a usual rate can
    be the right one. Pulses bend the command, else the torque. Chance makes no factor convincing,
    and without a convincing one there is no answer.
    """
    name = next((n for n in ("command", "torque", "current") if n in recording), None)
    if name is None or onset_s.size < _FEWEST_ONSETS:
        return None
    signal = np.nan_to_num(recording[name].to_numpy())
    time = recording["time"].to_numpy()
    if _fit(signal, np.searchsorted(time, onset_s), rate_hz) >= _DOUBTED:
        return None
    fits: dict[float, float] = {}
    for scale in _UNITS if stamped else [hz / rate_hz for hz in (*USUAL_HZ, *_RARE_HZ)]:
        at = np.searchsorted(time, onset_s * scale)
        if np.ptp(at) >= _SPANNED * time.size:
            # It may be the stamps or the table that are in another unit.
            rates = {rate_hz, rate_hz * scale} if stamped else {rate_hz * scale}
            fits[scale] = max(_fit(signal, at, hz) for hz in rates)
    best = max(fits, key=lambda scale: fits[scale], default=1.0)
    return best if fits.get(best, 0.0) >= _CONVINCING else None


def _fit(signal: np.ndarray, at: np.ndarray, rate_hz: float) -> float:
    """Return the mean rank of the signal's curvature at the onsets, 0 where one lies outside."""
    half = max(1, round(_CURVED_S * rate_hz))
    if signal.size <= 4 * half or at.max() >= signal.size:
        return 0.0
    bend = np.zeros(signal.size)
    bend[half:-half] = np.abs(signal[2 * half :] - 2 * signal[half:-half] + signal[: -2 * half])
    near = maximum_filter1d(bend, 2 * max(1, round(_AROUND_S * rate_hz)) + 1)
    ordered = np.sort(near)
    below = np.searchsorted(ordered, near[at], side="left")
    above = np.searchsorted(ordered, near[at], side="right")
    return float((0.5 * (below + above) / signal.size).mean())


def _at_rate(recording: xr.Dataset, rate_hz: float) -> xr.Dataset:
    return recording.assign_coords(time=np.arange(recording.sizes["time"]) / rate_hz)


def _unusual(stride_s: float) -> float:
    return abs(float(np.log(stride_s / _USUAL_S)))
