"""Pulses that are none: copies, pulses without torque, torque that never reached the joint."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from jointz.core.codes import Exclusion
from jointz.identify.preparation.pulses import Pulse
from jointz.identify.preparation.raw_signals import DRIVING, FRICTION, RAW_ANGLE
from jointz.identify.recommended.unperturbed_prediction import Predicted
from jointz.kernels.robust_spread import robust_sd

#: A copied window may begin so many samples beside the onset that was logged for it.
_SHIFTS = 2
#: Torque below this share of what was commanded, or of what most pulses reached, is none.
_LEAST_TORQUE = 0.2
#: High and usual: a level that most of a pulse reaches, a pulse that most pulses are like.
_REACHED_PCT, _LIKE_PCT = 90.0, 75.0
#: A joint that moves by less than this share of what others do with this torque did not get it ...
_LEAST_ANSWER = 0.4
#: ... where walking itself moves it by no more than this share (sd).
_TELLING = 0.15
#: Torque of half a pulse in one unperturbed stride of twenty is no accident.
_STRAY_SIZE, _STRAY_SHARE = 0.5, 0.05
_EVERY, _EVEN_SHARE = 5, 1e-2


def copied_pulses(recording: xr.Dataset, pulses: Sequence[Pulse], *, window_s: float) -> list[bool]:
    """Tell which pulses have the very samples of an earlier one.

    Two windows of a noisy sensor are never the same: identical ones are one window, copied, and
    a mean over them knows less than it seems to.
    """
    time = recording["time"].to_numpy()
    driving = "current" if "current" in recording else "torque"
    signals = np.stack([recording[name].to_numpy() for name in ("angle", driving)])
    seen: set[bytes] = set()
    copies = []
    # One length for all: onsets that lie on a sample fall to either side of it.
    n = int(window_s / float(np.median(np.diff(time)))) - 2 * _SHIFTS if time.size > 1 else 0
    for pulse in pulses:
        first = int(np.searchsorted(time, pulse.onset_s))
        starts = range(first, first + 2 * _SHIFTS + 1)
        cuts = [signals[:, at : at + max(n, 0)].tobytes() for at in starts]
        copies.append(bool(cuts[0]) and any(cut in seen for cut in cuts))
        seen.add(cuts[_SHIFTS])
    return copies


def lame_pulses(predicted: Predicted, amplitudes_nm: np.ndarray) -> list[str]:
    """Name the pulses whose torque did not come, or whose torque the joint did not feel.

    Torque is compared with the command, or with that of the other pulses. One that was commanded
    no torque, where others were some, is no pulse. The answer of the joint is its angle along the
    average response, per torque: pulses of other sizes are alike in it. Where walking alone moves
    the joint as much, or all pulses failed alike, this tells nothing;
    :mod:`jointz.identify.recommended.response_checks` looks at the average.
    """
    torque = predicted.responses[:, DRIVING] + predicted.responses[:, FRICTION]
    codes = np.full(len(torque), "", dtype=object)
    if not len(torque):
        return []
    known = bool(np.isfinite(amplitudes_nm).all() and amplitudes_nm.any())
    # What one of no torque reached is no multiple of it, and no measure for the others.
    asked = np.where(amplitudes_nm > 0.0, np.maximum(amplitudes_nm, 1e-9), np.inf)
    size = asked if known else np.ones(len(torque))
    # Torque of the wrong sign is torque: what it did to the joint tells of that.
    reached = np.percentile(np.abs(torque), _REACHED_PCT, axis=1) / size
    usual = max(1.0 if known else 0.0, float(np.percentile(reached, _LIKE_PCT)))
    came = reached >= _LEAST_TORQUE * usual
    codes[~came] = Exclusion.NO_TORQUE.value
    if came.sum() > 1:
        felt = _felt(predicted, torque, came)
        codes[came & ~felt] = Exclusion.NO_RESPONSE.value
    return [str(code) for code in codes]


def stray_pulses(predicted: Predicted, amplitude_nm: float) -> bool:
    """Tell whether the strides that were learned from hold pulses that nobody commanded.

    That is so where table and signals do not belong together: a table a stride late, a clock
    that was restarted.
    """
    torque = predicted.misses[:, DRIVING] + predicted.misses[:, FRICTION]
    large = np.percentile(np.abs(torque), _REACHED_PCT, axis=1) > _STRAY_SIZE * amplitude_nm
    return bool(large.mean() > _STRAY_SHARE)


def _felt(predicted: Predicted, torque: np.ndarray, came: np.ndarray) -> np.ndarray:
    """Tell which pulses moved the joint as most do, as far as walking lets that be told."""
    angle, misses = predicted.responses[:, RAW_ANGLE], predicted.misses[:, RAW_ANGLE]
    # Every few samples: a covariance that few strides can tell of.
    angle, misses = angle[:, ::_EVERY], misses[:, ::_EVERY]
    mean = angle[came].mean(axis=0)
    noise = np.cov(misses.T)
    noise += _EVEN_SHARE * np.trace(noise) / len(noise) * np.eye(len(noise))
    shape = np.linalg.solve(noise, mean)
    push = torque @ torque[came].mean(axis=0)
    answer = angle @ shape / np.where(came, push / np.median(push[came]), 1.0)
    usual = float(np.percentile(answer[came], _LIKE_PCT))
    by_itself = misses @ shape
    if not float(robust_sd(by_itself)) <= _TELLING * usual:
        return np.ones(len(angle), dtype=bool)
    return np.asarray(answer >= _LEAST_ANSWER * usual)
