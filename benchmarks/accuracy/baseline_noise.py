"""What a pulse's unperturbed motion is but for: prediction from its own past, at virtual onsets.

Written for the bound alone, by ordinary regression, so that it shares nothing with the methods
that it judges.
"""

from dataclasses import dataclass

import numpy as np

PAST_S, PAST_STEP_S = 0.3, 0.01
#: After a pulse began the leg is not its own for so long; a window needs so much room.
RECOVERED_S, ROOM_S = 1.1, 0.2
LEAST_STRIDES = 200
_STRIDES = 3
_RIDGE = 1e-3  # of the predictors' variance


@dataclass(frozen=True, slots=True)
class Walked:
    """Signals of a walk and what is known of its strides.

    Parameters
    ----------
    signals : (n_signal, n) float
        The first two predict; all are predicted.
    step_s : float, s
        Between samples.
    strikes_s, pulses_s : (m,) float, s
        Heel strikes and onsets of all pulses.
    """

    signals: np.ndarray
    step_s: float
    strikes_s: np.ndarray
    pulses_s: np.ndarray

    @property
    def durations_s(self) -> np.ndarray:
        """Duration of every stride but the last."""
        return np.diff(self.strikes_s)

    def free(self, at_s: np.ndarray) -> np.ndarray:
        """Tell which moments are far from every pulse and from the end.

        Parameters
        ----------
        at_s : (k,) float, s
            Moments.
        """
        following = np.searchsorted(self.pulses_s, at_s)
        padded = np.concatenate([[-np.inf], self.pulses_s, [np.inf]])
        alone = (at_s - padded[following] > RECOVERED_S) & (padded[following + 1] - at_s > ROOM_S)
        end_s = (self.signals.shape[1] - 1) * self.step_s
        return np.asarray(alone & (at_s + ROOM_S < end_s))

    def cut(self, at_s: np.ndarray, n_time: int) -> np.ndarray:
        """Return the signals from each moment on, (n_signal, k, n_time).

        Parameters
        ----------
        at_s : (k,) float, s
            Moments.
        n_time : int
            Samples.
        """
        first = np.round(at_s / self.step_s).astype(int)
        return np.asarray(self.signals[:, first[:, None] + np.arange(n_time)])

    def predictors(self, at_s: np.ndarray, stride: np.ndarray) -> np.ndarray:
        """Return the first two signals before each moment, and the strides before, (k, n).

        Parameters
        ----------
        at_s : (k,) float, s
            Moments.
        stride : (k,) int
            The stride that each is in.
        """
        every = round(PAST_STEP_S / self.step_s)
        first = np.round(at_s / self.step_s).astype(int)
        begin = first[:, None] - every * np.arange(1, round(PAST_S / PAST_STEP_S) + 1)
        # The mean of each step: white noise of the sensor is averaged down.
        past = self.signals[:2, begin[..., None] + np.arange(every)].mean(axis=-1)
        before = self.durations_s[stride[:, None] - np.arange(1, _STRIDES + 1)]
        return np.hstack([past[0], past[1], before])


@dataclass(frozen=True, slots=True)
class Surprise:
    """What prediction leaves of the signals behind onsets.

    Parameters
    ----------
    virtual : (n_signal, n_virtual, n_time) float
        At the onsets of unperturbed strides, each left out of its own prediction.
    pulses : (n_signal, n_time) float
        Mean over the pulses.
    """

    virtual: np.ndarray
    pulses: np.ndarray


def surprises(learnt: Walked, asked: Walked, onsets_s: np.ndarray, n_time: int) -> Surprise:
    """Predict what follows onsets from what was before, and return what is left.

    Parameters
    ----------
    learnt : Walked
        Whose strides without pulses teach the prediction.
    asked : Walked
        Where the pulses are; may be the same.
    onsets_s : (k,) float, s
        Pulses of one timing point.
    n_time : int
        Samples from the onset on.

    Raises
    ------
    ValueError
        When too few strides are left to learn from.
    """
    stride = np.searchsorted(asked.strikes_s, onsets_s, side="right") - 1
    place = np.median((onsets_s - asked.strikes_s[stride]) / asked.durations_s[stride])
    index = np.arange(_STRIDES + 1, learnt.durations_s.size)
    at_s = learnt.strikes_s[index] + place * learnt.durations_s[index]
    index, at_s = index[learnt.free(at_s)], at_s[learnt.free(at_s)]
    if at_s.size < LEAST_STRIDES:
        raise ValueError(f"expected {LEAST_STRIDES} unperturbed strides, got {at_s.size}.")
    virtual = learnt.cut(at_s, n_time)
    predictors = learnt.predictors(at_s, index)
    mean, spread = predictors.mean(axis=0), _spread(predictors)
    known = _with_one((predictors - mean) / spread)
    penalty = _RIDGE * len(known) * np.diag([0.0, *np.ones(known.shape[1] - 1)])
    solve = np.linalg.solve(known.T @ known + penalty, known.T)
    leverage = np.einsum("ij,ji->i", known, solve)
    new = _with_one((asked.predictors(onsets_s, stride) - mean) / spread)
    fired = asked.cut(onsets_s, n_time)
    left, pulses = [], []
    for here, there in zip(virtual, fired, strict=True):
        weights = solve @ here
        left.append((here - known @ weights) / (1.0 - leverage)[:, None])
        pulses.append((there - new @ weights).mean(axis=0))
    return Surprise(np.array(left), np.array(pulses))


def _spread(predictors: np.ndarray) -> np.ndarray:
    """Return a scale of every predictor, the same for all moments of a signal.

    Friction that never changes at one moment of the past would else count as much as any.
    """
    n_past = (predictors.shape[1] - _STRIDES) // 2
    blocks = np.repeat([0, 1, 2], [n_past, n_past, _STRIDES])
    variances = np.bincount(blocks, predictors.var(axis=0)) / np.bincount(blocks)
    return np.asarray(np.sqrt(np.where(variances > 0.0, variances, 1.0))[blocks])


def _with_one(columns: np.ndarray) -> np.ndarray:
    return np.hstack([np.ones((len(columns), 1)), columns])
