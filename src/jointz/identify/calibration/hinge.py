r"""Lag and gain of the goniometer against an encoder on one rigid hinge.

The goniometer shows :math:`g\,(h * \theta)(t)` and noise, h being a pure delay, a first-order lag
or both in a row, of total lag L. Swinging by hand tells L and g well and the kind of h badly; a
filter takes more of fast motion than a delay does, so that g depends on it. The share of the
filter in L is weighed by the data, flat between none and all.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from jointz.gait.timestamps import find_gaps
from jointz.identify.calibration.calibration_step import (
    RefusedError,
    calibration_step,
    check_same_sign,
    checked_channels,
    middle_range,
    step_series,
    weighted_moments,
)
from jointz.identify.calibration.late_sensor import sensed
from jointz.identify.calibration.steady_fit import linear_fit, sandwich
from jointz.kernels.block_sandwich import correlation_time
from jointz.results.bench.calibration_failure import CalibrationFailure
from jointz.results.bench.calibration_fit import CalibrationEntry, CalibrationFit, decided

#: Candidate shares of the filter, first from 0 to 1, then where the weight is: steps too wide
#: for the data would bias the gain by more than its sd.
_SHARES = 11
_FINER = 2
_NO_WEIGHT = 1e-4
_STEP_S = 1e-3
_LAG_STEP_S = 2e-4
_PASSES = 12
_LAG_RANGE_S = (-0.05, 0.1)
#: The filter's memory of what came before the record, or before a hole.
_SETTLED_S = 0.4
_LARGEST_SDS = {"angle_lag_s": 0.5e-3, "angle_gain": 0.03}
#: The encoder may come so much after the angle before the channels count as swapped, s.
_AHEAD_S = 2e-3
_GAIN_RANGE = (0.5, 2.0)
_SHOWN_S = 4.0
_LEAST_SWING_RAD = float(np.radians(3.0))
#: Samples at the end of the range, share of all, and what the encoder does meanwhile, share of
#: its swing.
_CLIPPED_SHARE, _GOES_ON = 0.01, 0.1
_PLAY_RAD, _CLEAR_SDS = float(np.radians(0.25)), 5.0
_SLIP_RAD = float(np.radians(1.0))
#: Residual of the fit, over means of 0.1 s.
_SMOOTH_S, _LEFT_RAD, _LEFT_SHARE = 0.1, float(np.radians(0.6)), 0.08
_METHOD = (
    "the encoder, delayed and filtered, fitted to the angle; share of the filter weighed; block "
    "sandwich"
)


@dataclass(frozen=True, slots=True, eq=False)
class _Swing:
    """A record, and the samples that enter the fit."""

    time: np.ndarray  # s
    angle: np.ndarray  # of the goniometer, rad
    encoder: np.ndarray  # angle of the encoder, rad
    counts: np.ndarray  # (n,) bool: samples in the fit

    def shown(self, lag_s: float, share: float) -> np.ndarray:
        """Return the encoder as a sensor with this lag would show it, where samples count."""
        since = self.time - self.time[0]
        grid = np.arange(int(since[-1] / _STEP_S) + 2) * _STEP_S
        even = np.interp(grid, since, self.encoder) - self.encoder[0]
        filtered_s = share * max(lag_s, 0.0)
        return sensed(
            even,
            step_s=_STEP_S,
            samples_s=since[self.counts],
            delay_s=lag_s - filtered_s,
            lag_s=filtered_s,
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    share: float  # share of the lag that is a first-order filter
    values: np.ndarray  # lag (s), gain, offset (rad)
    derivatives: np.ndarray  # of the modelled angle by lag (rad/s), gain (rad) and offset
    residual: np.ndarray  # measured minus modelled angle, rad


@calibration_step("hinge", "angle_lag_s", "angle_gain")
def fit_hinge(time: np.ndarray, angle: np.ndarray, motor_angle: np.ndarray) -> CalibrationFit:
    """Estimate lag and gain of a goniometer that is clamped to the hinge of an encoder.

    The encoder is taken to be without noise: its steps (4e-5 rad on an ActPack) are a millionth
    of the variance of the swing, and lower the gain by as little. A lag of the encoder itself
    is not seen; it reduces the estimated lag of the goniometer.
    """
    time, angle, encoder = checked_channels(time, angle=angle, motor_angle=motor_angle)
    _check_swing(angle, encoder)
    swing = _Swing(time, angle, encoder, _settled(time))
    candidates, chances = _weighted_candidates(swing)
    best = candidates[int(np.argmax(chances))]
    values = np.array([c.values for c in candidates])
    _check_values(chances @ values)
    used = time[swing.counts]
    _check_rigid(used, encoder[swing.counts], best.residual)
    shares = [c.share for c in candidates]
    delays = (1.0 - np.array(shares)) * values[:, 0]
    delay_s, _, delay_sd = weighted_moments(chances, delays)
    shown = used < used[0] + _SHOWN_S
    measured = angle[swing.counts]
    return CalibrationFit(
        step="hinge",
        entries=_entries(swing, candidates, chances),
        reported=(decided("angle_delay_s", float(delay_s), {"delay_or_filter": float(delay_sd)}),),
        method=_METHOD,
        n_samples=int(swing.counts.sum()),
        notes=(
            f"Of the lag {best.share:.0%} as a filter fits best, {shares[0]:.0%} to "
            f"{shares[-1]:.0%} are possible.",
        ),
        settings={"filter_shares": shares},
        series=step_series(
            used[shown],
            np.degrees(measured[shown]),
            np.degrees((measured - best.residual)[shown]),
            x_label="time (s)",
            y_label="angle shown (deg)",
        ),
    )


def _settled(time: np.ndarray) -> np.ndarray:
    """Return the samples that a filter shows free of the time before the record or a gap."""
    counts = time >= time[0] + _SETTLED_S
    for _, after in find_gaps(time):
        counts &= (time < after) | (time >= after + _SETTLED_S)
    # The future that a negative lag asks for is not in the record.
    return np.asarray(counts & (time <= time[-1] + _LAG_RANGE_S[0]))


def _weighted_candidates(swing: _Swing) -> tuple[list[_Candidate], np.ndarray]:
    """Return fits with shares of the filter over all that is possible, and their weights."""
    low, high = 0.0, 1.0
    for _ in range(_FINER):
        shares = np.linspace(low, high, _SHARES).tolist()
        candidates = [_candidate(swing, share) for share in shares]
        chances = _chances(swing, candidates)
        possible = np.flatnonzero(chances > _NO_WEIGHT)
        low, high = shares[max(possible[0] - 1, 0)], shares[min(possible[-1] + 1, _SHARES - 1)]
    return candidates, chances


def _candidate(swing: _Swing, share: float) -> _Candidate:
    """Return the fit with this share of the lag in the filter (Gauss and Newton)."""
    y, lag_s = swing.angle[swing.counts], 0.005
    for _ in range(_PASSES):
        late = swing.shown(lag_s, share)
        slope = (swing.shown(lag_s + _LAG_STEP_S, share) - late) / _LAG_STEP_S
        level = np.column_stack([late, np.ones(y.size)])
        gain, offset = np.linalg.lstsq(level, y, rcond=None)[0]
        if gain == 0.0:
            break
        derivatives = np.column_stack([gain * slope, level])
        residual = y - level @ np.array([gain, offset])
        step = float(np.linalg.lstsq(derivatives, residual, rcond=None)[0][0])
        lag_s = float(np.clip(lag_s + step, *_LAG_RANGE_S))
        if abs(step) < 1e-7:
            break
    return _Candidate(share, np.array([lag_s, gain, offset]), derivatives, residual)


def _chances(swing: _Swing, candidates: list[_Candidate]) -> np.ndarray:
    """Return the weights of the candidates: squares over the noise's spectral density."""
    sums = np.array([float(c.residual @ c.residual) for c in candidates])
    residual = candidates[int(np.argmin(sums))].residual
    rate = residual.size / float(np.ptp(swing.time[swing.counts]))
    density = float(np.var(residual)) * max(
        1.0, 2.0 * rate * correlation_time(residual, rate_hz=rate)
    )
    logs = -0.5 * (sums - sums.min()) / max(density, 1e-300)
    return np.asarray(np.exp(logs) / np.exp(logs).sum())


def _entries(
    swing: _Swing, candidates: list[_Candidate], chances: np.ndarray
) -> tuple[CalibrationEntry, ...]:
    time, size = swing.time[swing.counts], float(np.std(swing.angle))
    variances = np.array(
        [np.diag(sandwich(time, c.derivatives, c.residual, size=size)[0]) for c in candidates]
    )
    values = np.array([c.values for c in candidates])
    mean, noise, kind = weighted_moments(chances, values, variances)
    return tuple(
        decided(
            name,
            float(mean[i]),
            {"noise": noise[i], "delay_or_filter": kind[i]},
            largest_sd=largest_sd,
        )
        for i, (name, largest_sd) in enumerate(_LARGEST_SDS.items())
    )


def _check_swing(angle: np.ndarray, encoder: np.ndarray) -> None:
    """Refuse a record without motion, with opposite signs or with a sensor at its end."""
    for name, values in (("angle", angle), ("motor_angle", encoder)):
        swing = middle_range(values)
        if swing < _LEAST_SWING_RAD:
            detail = f"{name} swings by {np.degrees(swing):.2g} deg, expected 3 deg or more"
            raise RefusedError(CalibrationFailure.NO_MOTION, detail)
    check_same_sign(angle, encoder, "encoder")
    for end, at in (("highest", angle == angle.max()), ("lowest", angle == angle.min())):
        goes_on = float(np.ptp(encoder[at])) / float(np.ptp(encoder))
        if at.mean() > _CLIPPED_SHARE and goes_on > _GOES_ON:
            detail = f"{at.mean():.1%} of the samples have the {end} angle"
            raise RefusedError(CalibrationFailure.CLIPPED, detail)


def _check_rigid(time: np.ndarray, encoder: np.ndarray, residual: np.ndarray) -> None:
    """Refuse a residual that no rigid hinge leaves."""
    velocity = np.gradient(encoder, time)
    columns = np.column_stack([np.sign(velocity), velocity, encoder, np.ones(time.size)])
    without = residual - columns @ np.linalg.lstsq(columns, residual, rcond=None)[0]
    apart = float(np.ptp(_block_values(time, without, 1.0, np.median)))
    if apart > _SLIP_RAD:
        detail = f"its difference from the encoder moves by {np.degrees(apart):.2g} deg"
        raise RefusedError(CalibrationFailure.SLIP, detail)
    play = linear_fit(time, residual, columns)
    width = abs(float(play.values[0]))
    if width > max(_PLAY_RAD, _CLEAR_SDS * play.sd(0)):
        detail = f"the angle differs by {np.degrees(2.0 * width):.2g} deg between the directions"
        raise RefusedError(CalibrationFailure.PLAY, detail)
    left = float(np.std(_block_values(time, residual, _SMOOTH_S, np.mean)))
    if left > max(_LEFT_RAD, _LEFT_SHARE * float(np.std(encoder))):
        raise RefusedError(CalibrationFailure.NOT_RIGID, f"{np.degrees(left):.2g} deg RMS are left")


def _block_values(
    time: np.ndarray,
    values: np.ndarray,
    length_s: float,
    statistic: Callable[[np.ndarray], float],
) -> np.ndarray:
    """Return a statistic of each block of time that has samples enough."""
    blocks = ((time - time[0]) / length_s).astype(int)
    parts = np.split(values, np.flatnonzero(np.diff(blocks)) + 1)
    enough = 0.5 * float(np.median([part.size for part in parts]))
    return np.array([statistic(part) for part in parts if part.size >= enough])


def _check_values(values: np.ndarray) -> None:
    """Refuse a lag and a gain that no sensor has."""
    lag_s, gain = float(values[0]), float(values[1])
    if not _LAG_RANGE_S[0] < lag_s < _LAG_RANGE_S[1]:
        raise RefusedError(CalibrationFailure.LAG_OUT_OF_RANGE, f"lag {1e3 * lag_s:.0f} ms")
    if lag_s < -_AHEAD_S:
        detail = f"the angle comes {-1e3 * lag_s:.1f} ms before the encoder"
        raise RefusedError(CalibrationFailure.SWAPPED_CHANNELS, detail)
    if not _GAIN_RANGE[0] <= gain <= _GAIN_RANGE[1]:
        detail = f"angle_gain {gain:.3g}, expected {_GAIN_RANGE[0]:g} to {_GAIN_RANGE[1]:g}"
        raise RefusedError(CalibrationFailure.GAIN_OUT_OF_RANGE, detail)
