"""What the joint would have done without the pulse: three baselines.

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
#: Posture wanders: strides resemble their neighbours, and are resampled with them.
STRIDE_BLOCK = 4
N_NEIGHBOURS = 100
_FEWEST_MATCHES = 3
#: Angles are compared at this rate: they are low-passed far below.
_MATCH_HZ = 100.0
_ANGLE_ONLY = slice(ANGLE, ANGLE + 1)


@dataclass(frozen=True, slots=True)
class Baseline:
    """Unperturbed windows for every pulse of a cell."""

    windows: np.ndarray  # candidate unperturbed windows of each pulse; 0 where not valid
    sources: np.ndarray  # the stride each window is from; strides are what is resampled
    valid: np.ndarray  # which windows there are
    block: int = 1  # strides are resampled in runs of so many neighbours

    @property
    def codes(self) -> list[str]:
        """``""`` for each pulse that has a baseline, else ``no_baseline``."""
        there = np.asarray(self.valid.any(axis=1)).tolist()
        return ["" if any_valid else Exclusion.NO_BASELINE.value for any_valid in there]

    @property
    def n_sources(self) -> int:
        """How many strides there are to draw from."""
        return int(self.sources.max(initial=-1)) + 1

    @property
    def own(self) -> bool:
        """Whether each pulse is its own baseline: then there is nothing to draw."""
        return bool(self.sources.shape[1] == 1)

    def mean(self) -> np.ndarray:
        """Return the mean window of each pulse, (n_pulse, 4, n)."""
        counts = np.maximum(self.valid.sum(axis=1), 1)
        return np.asarray(self.windows.sum(axis=1) / counts[:, None, None])

    def weights(self, draws: np.ndarray) -> np.ndarray:
        """Return the weight of every window in its pulse's mean, under resampled strides.

        A draw that holds none of a pulse's strides falls back to all of them.
        """
        weights = draws[:, self.sources] * self.valid
        totals = weights.sum(axis=2, keepdims=True)
        weights = np.where(totals > 0, weights, self.valid)
        return np.asarray(weights / np.maximum(weights.sum(axis=2, keepdims=True), 1e-300))

    def take(self, pulses: np.ndarray) -> "Baseline":
        """Return the baseline of some of the pulses."""
        return replace(
            self,
            windows=self.windows[pulses],
            sources=self.sources[pulses],
            valid=self.valid[pulses],
        )


@dataclass(frozen=True, slots=True)
class StridePool:
    """Unperturbed strides to learn from: where each begins, in which recording."""

    recordings: tuple[Conditioned, ...]
    starts_s: tuple[np.ndarray, ...]  # heel strikes (or starts of a bench trial) in each
    # pulses in each, in order: a window that reaches into one is not valid
    onsets_s: tuple[np.ndarray, ...]

    @property
    def size(self) -> int:
        """How many strides there are."""
        return sum(len(s) for s in self.starts_s)

    def windows(
        self, elapsed_s: Sequence[float], *, window_s: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Cut one window a stride and elapsed time."""
        elapsed = np.asarray(elapsed_s, dtype=float)
        parts = []
        for recording, starts in zip(self.recordings, self.starts_s, strict=True):
            moments = (elapsed[:, None] + starts[None, :]).ravel()
            cut, _ = recording.cut(moments, before_s=0.0, after_s=window_s)
            parts.append(cut.reshape(elapsed.size, len(starts), *cut.shape[1:]))
        windows = np.concatenate(parts, axis=1)
        valid = ~np.isnan(windows[:, :, 0, 0]) & self.undisturbed(elapsed + window_s)
        return np.where(valid[:, :, None, None], windows, 0.0), valid

    def undisturbed(self, until_s: np.ndarray) -> np.ndarray:
        """Tell where no pulse begins between a stride's start and the end of a window."""
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
    sources = np.broadcast_to(np.arange(pool.size), valid.shape)
    return Baseline(windows, sources, valid, STRIDE_BLOCK)


def matched_strides(
    pool: StridePool,
    onsets_s: np.ndarray,
    elapsed_s: Sequence[float],
    before: np.ndarray,
    *,
    window_s: float,
) -> Baseline:
    """Return the unperturbed strides most alike before the onset, among those nearby.

    Alike means the smallest root mean square difference of angle. The angle
    alone is compared: torque is near zero between pulses. Only the
    :data:`N_NEIGHBOURS` strides nearest in time are looked at: posture and
    sensors drift over half an hour of walking.
    """
    (recording,), (starts,) = pool.recordings, pool.starts_s
    every = max(1, int(recording.rate_hz / _MATCH_HZ))
    undisturbed = pool.undisturbed(np.asarray(elapsed_s) + window_s)
    best = np.zeros((len(before), min(N_MATCHES, starts.size)), dtype=int)
    moments = np.zeros(best.shape)
    for i, (onset, elapsed, own) in enumerate(zip(onsets_s, elapsed_s, before, strict=True)):
        near = np.sort(np.argsort(np.abs(starts - onset), kind="stable")[:N_NEIGHBOURS])
        others, _ = recording.cut(
            starts[near] + elapsed, before_s=MATCH_S, after_s=0.0, rows=_ANGLE_ONLY, every=every
        )
        distance = ((others[:, 0] - own[::every]) ** 2).mean(axis=1)
        distance[~undisturbed[i, near]] = np.nan
        best[i] = near[np.argsort(distance, kind="stable")[: best.shape[1]]]  # NaN comes last
        moments[i] = starts[best[i]] + elapsed
    windows, _ = recording.cut(moments.ravel(), before_s=MATCH_S, after_s=window_s)
    windows = windows[:, :, before.shape[1] :].reshape(*best.shape, 4, -1)
    valid = np.isfinite(windows[:, :, 0, 0]) & np.take_along_axis(undisturbed, best, axis=1)
    valid &= valid.sum(axis=1, keepdims=True) >= _FEWEST_MATCHES
    return Baseline(np.where(valid[:, :, None, None], windows, 0.0), best, valid)


def pre_pulse(before: np.ndarray, *, n_samples: int) -> Baseline:
    """Return each pulse's own level before its onset, held over the window."""
    level = before.mean(axis=2, keepdims=True)
    windows = np.repeat(level, n_samples, axis=2)[:, None]
    valid = np.isfinite(windows[:, :, 0, 0])
    sources = np.arange(len(before))[:, None]
    return Baseline(np.where(valid[:, :, None, None], windows, 0.0), sources, valid)
