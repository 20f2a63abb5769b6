"""Three baselines: the motion and torque of the joint without the pulse.

``unperturbed_mean``
    Mean of the unperturbed condition, aligned at heel strike, in time
    (dissertation 4.2.3).
``pre_pulse``
    The mean level just before the onset. All four signals lose their own
    level, so the second-order model holds for the differences exactly.
``matched_strides``
    Mean of the unperturbed strides of the same recording whose angle was most
    alike before the onset.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from jointz.core.codes import Exclusion
from jointz.identify.preparation.conditioning import ANGLE, Conditioned

PRE_PULSE_S = 0.05
MATCH_S = 0.15
N_MATCHES = 10
#: Posture drifts, so that neighbouring strides are similar and are resampled together.
STRIDE_BLOCK = 4
N_NEIGHBOURS = 100
_FEWEST_MATCHES = 3
#: Angles are compared at this rate: they are low-passed far below.
_MATCH_HZ = 100.0
_ANGLE_ONLY = slice(ANGLE, ANGLE + 1)


@dataclass(frozen=True, slots=True)
class Baseline:
    """Unperturbed windows for every pulse of a cell."""

    # (n_pulse, k, 4, n) alternative windows: angle (rad), velocity (rad/s), acceleration (rad/s^2),
    # torque (N*m); 0 where not valid
    windows: np.ndarray
    sources: np.ndarray  # (n_pulse, k) number of the stride of each window, for resampling
    valid: np.ndarray  # (n_pulse, k) bool: whether the window exists
    block: int = 1  # number of neighbouring strides that are resampled together

    @property
    def codes(self) -> list[str]:
        """``""`` for each pulse with a baseline, else ``no_baseline``."""
        return ["" if row.any() else Exclusion.NO_BASELINE.value for row in self.valid]

    @property
    def n_sources(self) -> int:
        """Number of strides to draw from."""
        return int(self.sources.max(initial=-1)) + 1

    @property
    def has_strides(self) -> bool:
        """Whether there are strides to draw; otherwise each pulse is its own baseline."""
        return bool(self.sources.shape[1] != 1)

    def mean(self) -> np.ndarray:
        """Return the mean window of each pulse, (n_pulse, 4, n)."""
        counts = np.maximum(self.valid.sum(axis=1), 1)
        return np.asarray(self.windows.sum(axis=1) / counts[:, None, None])

    def weights(self, draws: np.ndarray) -> np.ndarray:
        """Return the weight of every window in its pulse's mean, for resampled strides.

        A draw without any of a pulse's strides uses all of them.
        """
        weights: np.ndarray = draws[:, self.sources] * self.valid  # large: changed in place
        np.copyto(weights, self.valid, where=~(weights.sum(axis=2, keepdims=True) > 0))
        weights /= np.maximum(weights.sum(axis=2, keepdims=True), 1e-300)
        return weights

    def take(self, pulses: np.ndarray) -> "Baseline":
        """Return the baseline of some of the pulses."""
        if pulses.dtype == bool and pulses.all():
            return self
        return replace(
            self,
            windows=self.windows[pulses],
            sources=self.sources[pulses],
            valid=self.valid[pulses],
        )


@dataclass(frozen=True, slots=True)
class StridePool:
    """Unperturbed strides of one or more recordings."""

    recordings: tuple[Conditioned, ...]
    starts_s: tuple[np.ndarray, ...]  # heel strikes (or starts of a bench trial) of each recording
    # onsets of the pulses of each recording; a window that contains one is not valid
    onsets_s: tuple[np.ndarray, ...]

    @property
    def size(self) -> int:
        """Number of strides."""
        return sum(len(s) for s in self.starts_s)

    def windows(
        self, elapsed_s: Sequence[float], *, window_s: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return a window for each elapsed time and stride, and whether it is valid."""
        elapsed = np.asarray(elapsed_s, dtype=float)
        parts = []
        for recording, starts in zip(self.recordings, self.starts_s, strict=True):
            moments = (elapsed[:, None] + starts[None, :]).ravel()
            cut, _ = recording.cut(moments, before_s=0.0, after_s=window_s)
            parts.append(cut.reshape(elapsed.size, len(starts), *cut.shape[1:]))
        windows = parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)
        valid = ~np.isnan(windows[:, :, 0, 0]) & self.undisturbed(elapsed + window_s)
        windows[~valid] = 0.0
        return windows, valid

    def undisturbed(self, until_s: np.ndarray) -> np.ndarray:
        """Return whether no pulse begins between a stride's start and a time after it."""
        return np.concatenate(
            [
                np.searchsorted(onsets, starts)
                == np.searchsorted(onsets, starts + np.asarray(until_s)[:, None])
                for onsets, starts in zip(self.onsets_s, self.starts_s, strict=True)
            ],
            axis=1,
        )


def unperturbed_mean(pool: StridePool, elapsed_s: Sequence[float], *, window_s: float) -> Baseline:
    """Return every unperturbed stride at the same time since heel strike."""
    windows, valid = pool.windows(elapsed_s, window_s=window_s)
    sources = np.tile(np.arange(pool.size), (len(valid), 1))
    return Baseline(windows, sources, valid, STRIDE_BLOCK)


def matched_strides(
    pool: StridePool,
    onsets_s: np.ndarray,
    elapsed_s: Sequence[float],
    before: np.ndarray,
    *,
    window_s: float,
) -> Baseline:
    """Return the unperturbed strides most similar before the onset, among those nearby.

    Similarity is the root mean square difference of the angle; torque is near zero between
    pulses. Only the :data:`N_NEIGHBOURS` strides nearest in time are compared, because posture
    and sensors drift over half an hour of walking.
    """
    (recording,), (starts,) = pool.recordings, pool.starts_s
    every = max(1, int(recording.rate_hz / _MATCH_HZ))
    undisturbed = pool.undisturbed(np.asarray(elapsed_s) + window_s)
    best = np.zeros((len(before), min(N_MATCHES, starts.size)), dtype=int)
    moments = np.zeros(best.shape)
    for i, (onset, elapsed, angle) in enumerate(zip(onsets_s, elapsed_s, before, strict=True)):
        near = np.sort(np.argsort(np.abs(starts - onset), kind="stable")[:N_NEIGHBOURS])
        others, _ = recording.cut(
            starts[near] + elapsed, before_s=MATCH_S, after_s=0.0, rows=_ANGLE_ONLY, every=every
        )
        distance = ((others[:, 0] - angle[::every]) ** 2).mean(axis=1)
        distance[~undisturbed[i, near]] = np.nan
        best[i] = near[np.argsort(distance, kind="stable")[: best.shape[1]]]  # NaN comes last
        moments[i] = starts[best[i]] + elapsed
    windows, _ = recording.cut(moments.ravel(), before_s=MATCH_S, after_s=window_s)
    windows = windows[:, :, before.shape[1] :].reshape(*best.shape, 4, -1)
    valid = np.isfinite(windows[:, :, 0, 0]) & np.take_along_axis(undisturbed, best, axis=1)
    valid &= valid.sum(axis=1, keepdims=True) >= _FEWEST_MATCHES
    windows[~valid] = 0.0
    return Baseline(windows, best, valid)


def pre_pulse(before: np.ndarray, *, n_samples: int) -> Baseline:
    """Return each pulse's own level before its onset, held over the window."""
    windows = np.repeat(before.mean(axis=2, keepdims=True), n_samples, axis=2)[:, None]
    valid = np.isfinite(windows[:, :, 0, 0])
    sources = np.arange(len(before))[:, None]
    return Baseline(np.where(valid[:, :, None, None], windows, 0.0), sources, valid)
