"""Pulses to exclude: copies, pulses without torque, torque that did not reach the joint."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from jointz.core.codes import Exclusion
from jointz.identify.prediction.unperturbed_prediction import Predicted
from jointz.identify.preparation.pulses import Pulse
from jointz.identify.preparation.raw_signals import DRIVING, FRICTION, RAW_ANGLE
from jointz.kernels.robust_spread import robust_sd

#: A copied window may begin so many samples before or after its logged onset.
_SHIFTS = 2
#: Torque below this share of the command, or of what most pulses reached, is none.
_LEAST_TORQUE = 0.2
#: Percentiles: the level of a pulse over its samples, and the usual level over pulses.
_REACHED_PCT, _LIKE_PCT = 90.0, 75.0
#: A joint that moves by less than this share of the usual response did not feel the torque, if
#: walking itself moves it by no more than the second share (sd).
_LEAST_RESPONSE, _LARGEST_NOISE = 0.4, 0.15
#: Torque of this share of a pulse, in this share of the unperturbed strides, is from stray pulses.
_STRAY_SIZE, _STRAY_SHARE = 0.5, 0.05
_EVERY, _EVEN_SHARE = 5, 1e-2


def copied_pulses(recording: xr.Dataset, pulses: Sequence[Pulse], *, window_s: float) -> list[bool]:
    """Return which pulses have the same samples as an earlier one.

    Two windows of a noisy sensor are never identical, so that identical ones are copies.
    """
    time = recording["time"].to_numpy()
    driving = "current" if "current" in recording else "torque"
    signals = np.stack([recording[name].to_numpy() for name in ("angle", driving)])
    seen: set[bytes] = set()
    copies = []
    # One length for all: rounding moves onsets that coincide with a sample.
    n = int(window_s / float(np.median(np.diff(time)))) - 2 * _SHIFTS if time.size > 1 else 0
    for pulse in pulses:
        first = int(np.searchsorted(time, pulse.onset_s))
        starts = range(first, first + 2 * _SHIFTS + 1)
        cuts = [signals[:, at : at + max(n, 0)].tobytes() for at in starts]
        copies.append(bool(cuts[0]) and any(cut in seen for cut in cuts))
        seen.add(cuts[_SHIFTS])
    return copies


def ineffective_pulses(predicted: Predicted, amplitudes_nm: np.ndarray) -> list[str]:
    """Return a code for pulses without torque, or whose torque did not reach the joint.

    Torque is compared with the command, or with that of the other pulses; a command of zero among
    others is no pulse. The response of the joint is its angle projected on the average response,
    per torque. This shows nothing if walking alone moves the joint as much, or if all pulses
    failed; :mod:`jointz.identify.walking.checks` checks the average.
    """
    responses = predicted.sign_aligned
    torque = responses[:, DRIVING] + responses[:, FRICTION]
    codes = np.full(len(torque), "", dtype=object)
    if not len(torque):
        return []
    known = bool(np.isfinite(amplitudes_nm).all() and amplitudes_nm.any())
    # A command of zero gives no ratio.
    commanded = np.where(amplitudes_nm > 0.0, np.maximum(amplitudes_nm, 1e-9), np.inf)
    size = commanded if known else np.ones(len(torque))
    # A wrong sign is found by the response of the joint.
    reached = np.percentile(np.abs(torque), _REACHED_PCT, axis=1) / size
    usual = max(1.0 if known else 0.0, float(np.percentile(reached, _LIKE_PCT)))
    pushed = reached >= _LEAST_TORQUE * usual
    codes[~pushed] = Exclusion.NO_TORQUE.value
    if pushed.sum() > 1:
        errors = predicted.prediction_errors[:, RAW_ANGLE]
        felt = _felt(responses[:, RAW_ANGLE], errors, torque, pushed)
        codes[pushed & ~felt] = Exclusion.NO_RESPONSE.value
    return [str(code) for code in codes]


def has_pulses_in_strides(predicted: Predicted, amplitude_nm: float) -> bool:
    """Return whether the unperturbed strides contain pulses.

    This happens if the pulse table does not match the signals: a table that is late by a stride, a
    clock that was restarted.
    """
    torque = predicted.prediction_errors[:, DRIVING] + predicted.prediction_errors[:, FRICTION]
    large = np.percentile(np.abs(torque), _REACHED_PCT, axis=1) > _STRAY_SIZE * amplitude_nm
    return bool(large.mean() > _STRAY_SHARE)


def _felt(
    angle: np.ndarray, errors: np.ndarray, torque: np.ndarray, pushed: np.ndarray
) -> np.ndarray:
    """Return which pulses moved the joint as most do; all if walking hides it."""
    # Every few samples, so that few strides determine the covariance.
    angle, errors = angle[:, ::_EVERY], errors[:, ::_EVERY]
    noise = np.cov(errors.T)
    noise += _EVEN_SHARE * np.trace(noise) / len(noise) * np.eye(len(noise))
    shape = np.linalg.solve(noise, angle[pushed].mean(axis=0))
    push = torque @ torque[pushed].mean(axis=0)
    response = angle @ shape / np.where(pushed, push / np.median(push[pushed]), 1.0)
    usual = float(np.percentile(response[pushed], _LIKE_PCT))
    if not float(robust_sd(errors @ shape)) <= _LARGEST_NOISE * usual:
        return np.ones(len(angle), dtype=bool)
    return np.asarray(response >= _LEAST_RESPONSE * usual)
