"""Responses to pulses from rest, averaged over both signs."""

from dataclasses import dataclass

import numpy as np

from jointz.gait.timestamps import rate_hz
from jointz.identify.calibration.calibration_step import RefusedError, checked_channels
from jointz.results.bench.calibration_failure import CalibrationFailure

#: Rest before a pulse, s: its mean is the zero of a response.
_REST_S = 0.2
_FEWEST_OF_A_SIGN = 4
#: Angle and velocity at an onset are those of a line over this time, s.
_STATE_S = 0.06
#: Speed before a pulse over the fastest after it: of one pulse, and on average.
_MOVING, _MOVING_ON_AVERAGE = 0.3, 0.15
#: The two signs may differ by so much of the response, and by so many times what noise does.
_UNLIKE, _CLEAR = 0.15, 4.0
_LEAST_TORQUE_NM = 0.3
#: Friction grows with a tanh of the velocity over this; the velocity is one over 2 x 4 ms.
_SLIDING_RAD_S, _SMOOTHING_S = 0.05, 4e-3


@dataclass(frozen=True, slots=True, eq=False)
class PulsedRecord:
    """A record of something that hangs and is pushed both ways."""

    time: np.ndarray  # increasing time stamps, s
    angle: np.ndarray  # angle of the goniometer, rad
    motor_angle: np.ndarray  # angle of the encoder at the output, rad
    driving: np.ndarray  # torque on the joint by the current, without friction, N*m
    # torque of the stated friction, of full size whenever there is motion, N*m
    friction: np.ndarray
    onset_s: np.ndarray  # onsets of the pulses
    amplitude_nm: np.ndarray  # signed amplitudes of the pulses


@dataclass(frozen=True, slots=True, eq=False)
class PulseAverage:
    """Responses to the pulses of a record: negative ones turned, the level before subtracted."""

    time_s: np.ndarray  # time from the onset
    angle: np.ndarray  # (pulse, n) of the goniometer, rad
    motor_angle: np.ndarray  # (pulse, n) of the encoder, rad
    driving: np.ndarray  # (pulse, n) torque by the current, without friction, N*m
    friction: np.ndarray  # (pulse, n) torque of the stated friction, N*m
    n_left_out: int  # excluded pulses: not from rest, or beyond the ends of the record

    @property
    def count(self) -> int:
        """Pulses behind the average."""
        return len(self.angle)

    @property
    def period_s(self) -> float:
        """Between samples, s."""
        return float(self.time_s[1] - self.time_s[0])


def left_out_notes(*averages: PulseAverage) -> tuple[str, ...]:
    """Return a note of the pulses that were left out."""
    count = sum(average.n_left_out for average in averages)
    note = f"{count} pulses excluded: not from rest, or at the record's ends."
    return (note,) if count else ()


def average_pulses(
    record: PulsedRecord, *, lead_s: float, length_s: float, name: str
) -> PulseAverage:
    """Cut the responses out of a record."""
    time, *channels = checked_channels(
        record.time,
        angle=record.angle,
        motor_angle=record.motor_angle,
        driving=record.driving,
        friction=record.friction,
    )
    signs = np.sign(np.asarray(record.amplitude_nm, dtype=float))
    onsets = np.asarray(record.onset_s, dtype=float)
    period_s = 1.0 / rate_hz(time)
    steps = np.arange(-round(max(_REST_S, lead_s) / period_s), round(length_s / period_s) + 1)
    since = steps * period_s
    inside = (onsets + since[0] >= time[0]) & (onsets + since[-1] <= time[-1]) & (signs != 0.0)
    _check_counts(signs[inside], name)
    at = onsets[inside][:, None] + since
    rows = [signs[inside][:, None] * np.interp(at, time, values) for values in channels]
    states = _states(rows[1], signs[inside], since)
    before = since < 0.0
    for row in rows[:3]:  # not friction: at rest it holds whatever there is
        row -= row[:, before].mean(axis=1, keepdims=True)
    rows[3] = rows[3] * _share_of_friction(rows[1], period_s)
    good = _at_rest(rows[1], since, name)
    _check_counts(signs[inside][good], name)
    kept = since >= -lead_s - 0.5 * period_s
    angle, encoder, driving, friction = (
        _without_free_motion(row[good][:, kept], states[good]) for row in rows
    )
    _check_signs(encoder, signs[inside][good], name)
    _check_torque(driving, encoder, name)
    left_out = int(signs.size - good.sum())
    return PulseAverage(since[kept], angle, encoder, driving, friction, left_out)


def _states(encoder: np.ndarray, signs: np.ndarray, since: np.ndarray) -> np.ndarray:
    """Return angle and velocity at the onsets, (m, 2), by a line through the samples before."""
    if not len(encoder):
        return np.zeros((0, 2))
    last = (since >= -_STATE_S) & (since <= 0.0)
    line = np.column_stack([np.ones(last.sum()), since[last]])
    states = encoder[:, last] @ np.linalg.pinv(line).T
    rest = float(np.mean(signs * states[:, 0]))  # where it hangs
    states[:, 0] -= signs * rest
    return np.asarray(states)


def _without_free_motion(rows: np.ndarray, states: np.ndarray) -> np.ndarray:
    """Return responses as they would be from rest.

    What was moving before a pulse goes on moving: a regression over the pulses on angle and
    velocity at the onset tells how. Scatter is enlarged by what the regression has taken up, so
    that the variance of the mean is that of its intercept.
    """
    m = len(rows)
    slopes, *_ = np.linalg.lstsq(np.column_stack([np.ones(m), states]), rows, rcond=None)
    still = rows - states @ slopes[1:]
    centred = states - states.mean(axis=0)
    shift = np.linalg.lstsq(centred.T @ centred, states.mean(axis=0), rcond=None)[0]
    intercept = 1.0 + m * float(states.mean(axis=0) @ shift)
    enlarged = np.sqrt((m - 1) / (m - 3) * intercept)
    middle = still.mean(axis=0)
    return np.asarray(middle + enlarged * (still - middle))


def _share_of_friction(encoder: np.ndarray, period_s: float) -> np.ndarray:
    """Return how much of sliding friction there is: at rest none drives, it only holds."""
    reach = max(1, round(_SMOOTHING_S / period_s))
    padded = np.pad(encoder, ((0, 0), (reach, reach)), mode="edge")
    moved = padded[:, 2 * reach :] - padded[:, : -2 * reach]
    return np.asarray(np.tanh(np.abs(moved) / (2 * reach * period_s) / _SLIDING_RAD_S))


def _at_rest(encoder: np.ndarray, since: np.ndarray, name: str) -> np.ndarray:
    """Return a mask of the pulses that begin at rest."""
    if not len(encoder):
        return np.zeros(0, dtype=bool)
    before = since < 0.0
    centred = since[before] - since[before].mean()
    speeds = encoder[:, before] @ centred / (centred @ centred)
    fastest = float(np.abs(np.gradient(encoder.mean(axis=0), since)).max())
    good = np.abs(speeds) <= _MOVING * fastest
    drift = abs(float(speeds[good].mean())) if good.any() else np.inf
    if good.mean() < 0.5 or drift > _MOVING_ON_AVERAGE * fastest:
        detail = f"{name}: {len(good) - good.sum()} of {len(good)} pulses begin in motion"
        raise RefusedError(CalibrationFailure.NOT_AT_REST, detail)
    return np.asarray(good)


def _check_counts(signs: np.ndarray, name: str) -> None:
    up, down = int((signs > 0).sum()), int((signs < 0).sum())
    if min(up, down) < _FEWEST_OF_A_SIGN:
        detail = f"{name}: {up} pulses one way, {down} the other"
        raise RefusedError(CalibrationFailure.TOO_FEW_PULSES, detail)


def _check_signs(encoder: np.ndarray, signs: np.ndarray, name: str) -> None:
    """Refuse responses that are not alike in both directions."""
    up, down = encoder[signs > 0], encoder[signs < 0]
    apart = np.sqrt(np.mean((up.mean(axis=0) - down.mean(axis=0)) ** 2))
    scatter = np.sqrt(np.mean(up.var(axis=0, ddof=1) / len(up) + down.var(axis=0) / len(down)))
    size = np.sqrt(np.mean(encoder.mean(axis=0) ** 2))
    if apart > max(_UNLIKE * size, _CLEAR * scatter):
        detail = f"{name}: responses of the two signs differ by {apart / size:.0%}"
        raise RefusedError(CalibrationFailure.NOT_LINEAR, detail)


def _check_torque(driving: np.ndarray, encoder: np.ndarray, name: str) -> None:
    torque, motion = driving.mean(axis=0), encoder.mean(axis=0)
    largest = float(np.abs(torque).max())
    if largest < _LEAST_TORQUE_NM:
        detail = f"{name}: largest torque {largest:.2g} N*m"
        raise RefusedError(CalibrationFailure.NO_TORQUE, detail)
    moved = float(motion[np.argmax(np.abs(motion))])
    if moved == 0.0:
        raise RefusedError(CalibrationFailure.NO_MOTION, f"{name}: the encoder does not move")
    if moved * float(torque[np.argmax(np.abs(torque))]) < 0.0:
        detail = f"{name}: largest torque {largest:.2g} N*m, the encoder moves against it"
        raise RefusedError(CalibrationFailure.OPPOSITE_SIGN, detail)
