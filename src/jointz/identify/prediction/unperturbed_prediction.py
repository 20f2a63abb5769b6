"""Prediction of angle and torque without a pulse from the preceding motion.

The predictor is a ridge regression learned at virtual onsets in the unperturbed strides of the
same recording: features are the angle before the onset and what is known of the stride's timing,
targets are angle and torque after it. Its errors at virtual onsets that were left out of the
learning are the noise of an estimate, with all correlations.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from zlib import crc32

import numpy as np

from jointz.core.codes import Exclusion
from jointz.gait.phase import gait_phase
from jointz.identify.preparation.assignment import Candidate
from jointz.identify.preparation.conditioning import Conditioned
from jointz.identify.preparation.raw_signals import COMMAND, ENCODER, RAW_ANGLE, SENSOR_ROWS
from jointz.identify.preparation.sources import Source
from jointz.kernels.blocked_ridge import BlockedRidge, fit_blocked_ridge
from jointz.kernels.robust_spread import robust_moments, robust_sd

#: Predicted rows: angle, torque without friction, friction.
PREDICTED_ROWS = slice(RAW_ANGLE, COMMAND)
_BIN_S, _BINS = 0.02, 15
_COARSE_S, _COARSE = 0.05, 4
_PAST_S = _BIN_S * _BINS + _COARSE_S * _COARSE
#: Number of leading directions of the features whose squares and products are features, too.
_CURVED = 4
#: Virtual onsets for each stride, spread like the pulses' onsets, and the least sd, cycles.
_COPIES = 2
_LEAST_SPREAD = 0.004
_WIDENED = 1.2
_BLOCKS = 10
#: Columns of the features: time since the strike, expected stride.
_ELAPSED, _EXPECTED = -3, -2
#: Fewest unperturbed strides for a prediction.
FEWEST_STRIDES = 12
#: Fewest strides of a regression for each feature.
_STRIDES_PER_FEATURE = 5
#: Windows begin so many samples before the onset, so that the joint is at rest at first even if the
#: torque has begun to rise between two samples.
LEAD_SAMPLES = 2
#: Largest distance of strides and pulses from the median, robust sds.
_FARTHEST_STRIDE, _FARTHEST_PULSE = 6.0, 8.0
_STRIDE_BAND = 0.15
#: A spread below this is negligible, rad or s.
_ROUNDING = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class Predicted:
    """Responses of the pulses of a cell, and errors of the prediction without pulses."""

    # (m, 3 + sensors, n) measured minus predicted, from :data:`LEAD_SAMPLES` before the onset:
    # angle (rad), torque without friction (N*m), friction (N*m), then what further sensors show
    # (rad, rad/s)
    responses: np.ndarray
    signs: np.ndarray  # (m,) sign of each pulse, 1 or -1
    # (v, 3 + sensors, n) the same at virtual onsets of strides left out of the learning
    prediction_errors: np.ndarray
    strides: np.ndarray  # (v,) number of the stride of each virtual onset
    codes: tuple[str, ...]  # one for each pulse; ``responses`` has a row for each ``""``
    posture_rad: float  # mean unperturbed angle over the window
    unperturbed_rad: np.ndarray  # (n,) unperturbed angle over the window, less a constant

    @property
    def sign_aligned(self) -> np.ndarray:
        """The responses times the sign of their pulse, for averages over both signs."""
        return np.asarray(self.signs[:, None, None] * self.responses)

    def of(self, pulses: np.ndarray) -> "Predicted":
        """Return the same with the responses of some pulses, by their places or a mask."""
        return replace(self, responses=self.responses[pulses], signs=self.signs[pulses])

    @property
    def n_strides(self) -> int:
        """Number of unperturbed strides for the learning."""
        return int(np.unique(self.strides).size)


def join_predictions(parts: Sequence[Predicted]) -> Predicted:
    """Join the pulses of several recordings; their strides keep different numbers."""
    codes = tuple(code for part in parts for code in part.codes)
    parts = [part for part in parts if len(part.responses)]
    return Predicted(
        responses=np.concatenate([part.responses for part in parts]),
        signs=np.concatenate([part.signs for part in parts]),
        prediction_errors=np.concatenate([part.prediction_errors for part in parts]),
        strides=_apart([part.strides for part in parts]),
        codes=codes,
        posture_rad=float(np.mean([part.posture_rad for part in parts])),
        unperturbed_rad=np.mean([part.unperturbed_rad for part in parts], axis=0),
    )


def _apart(strides: Sequence[np.ndarray]) -> np.ndarray:
    """Return the strides of several recordings with different numbers."""
    first = np.cumsum([0, *(int(part.max(initial=-1)) + 1 for part in strides)])
    return np.concatenate([part + n for part, n in zip(strides, first, strict=False)])


class UnperturbedPredictor:
    """Predicts the unperturbed windows of one recording."""

    def __init__(
        self,
        source: Source,
        signals: Conditioned,
        *,
        window_s: float,
        others: Sequence[tuple[Source, Conditioned]] = (),
        sensors: Sequence[str] = (),
    ) -> None:
        self.signals = signals
        self._window_s = window_s
        self._relative = bool(others)
        # Of the windows; angles of several recordings are relative to their levels.
        first = len(range(COMMAND)[PREDICTED_ROWS])
        self._angles = [RAW_ANGLE, *(first + k for k, s in enumerate(sensors) if s == ENCODER)]
        rows = [*range(COMMAND)[PREDICTED_ROWS], *(SENSOR_ROWS + k for k in range(len(sensors)))]
        self._n_rows = len(rows)
        lessons = [(source, signals), *others]
        self._lessons = [_TrainingRecording(*lesson, window_s, rows) for lesson in lessons]
        self._recording = self._lessons[0]

    @property
    def rate_hz(self) -> float:
        """Sampling rate of the prediction."""
        return self.signals.rate_hz

    def predict(self, candidates: Sequence[Candidate]) -> Predicted:
        """Predict the windows of the pulses of one cell."""
        lead_s = LEAD_SAMPLES / self.signals.rate_hz
        pulses = self._recording.moments(np.array([c.pulse.onset_s - lead_s for c in candidates]))
        usable = pulses.valid & np.isfinite(pulses.ratio)
        middle = _middle(pulses.ratio[usable])
        pulses = pulses.unwrapped(middle)
        codes = pulses.codes
        codes[(codes == "") & ~usable] = Exclusion.NO_BASELINE.value
        # Angles relative to the level before the onset do not include the posture.
        levels_rad = pulses.features[usable, 0] if self._relative else np.zeros(1)
        pulses = pulses.relative(self._angles) if self._relative else pulses
        n = round(self._window_s * self.signals.rate_hz) + 1 + LEAD_SAMPLES
        virtual = self._virtual(
            pulses.ratio[usable], middle, label=candidates[0].record.timing_point
        )
        if virtual is None:
            codes[codes == ""] = Exclusion.NO_BASELINE.value
            none = np.empty((0, self._n_rows, n))
            return Predicted(
                none, np.empty(0), none, np.empty(0, int), tuple(codes), np.nan, np.empty(0)
            )
        unusual = _distance(pulses.features, virtual.features) > _FARTHEST_PULSE
        codes[(codes == "") & unusual] = Exclusion.UNUSUAL_GAIT.value
        used = codes == ""
        curve = _Curve(virtual.features)
        ridge = _learned(virtual, curve, n)
        flat = (int(used.sum()), self._n_rows * n)
        predicted = ridge.predict(curve.features(pulses.features[used], like=ridge))
        responses = pulses.windows[used].reshape(flat) - predicted
        return Predicted(
            responses=responses.reshape(-1, self._n_rows, n),
            signs=np.array([c.pulse.sign for c in candidates])[used],
            prediction_errors=ridge.left_out.reshape(-1, self._n_rows, n),
            strides=virtual.strides,
            codes=tuple(codes),
            posture_rad=float(np.median(levels_rad) + virtual.windows[:, RAW_ANGLE].mean()),
            unperturbed_rad=virtual.windows[:, RAW_ANGLE].mean(axis=0),
        )

    def _virtual(self, ratio: np.ndarray, middle: float, *, label: str) -> "_Moments | None":
        """Return virtual onsets spread over the cycle like the pulses, None if too few."""
        if ratio.size == 0:
            return None
        spread = _WIDENED * float(robust_sd(ratio))
        rng = np.random.default_rng(crc32(label.encode()))
        parts = [
            lesson.virtual(middle, max(spread, _LEAST_SPREAD), rng)
            for lesson in self._lessons
            if lesson.quiet.size
        ]
        if not parts:
            return None
        virtual = _joined(parts)
        virtual = virtual.relative(self._angles) if self._relative else virtual
        if virtual.strides.size == 0:
            return None
        virtual = virtual.take(_distance(virtual.features, virtual.features) < _FARTHEST_STRIDE)
        return virtual if np.unique(virtual.strides).size >= FEWEST_STRIDES else None


class _TrainingRecording:
    """A recording from which unperturbed walking is learned."""

    def __init__(
        self, source: Source, signals: Conditioned, window_s: float, rows: Sequence[int]
    ) -> None:
        self._signals = signals
        self._rows = rows
        self._strides = source.strides
        self._onsets = np.array([p.onset_s for p in source.pulses])
        self._window_s = window_s
        self.quiet = quiet_strides(source)

    def virtual(self, middle: float, spread: float, rng: np.random.Generator) -> "_Moments":
        """Return virtual onsets about a point of the cycle, in quiet strides of usual length."""
        strides, quiet = self._strides, self.quiet
        if strides is None:
            raise ValueError("A recording without strides teaches nothing; see quiet.")
        share = middle + spread * rng.standard_normal((_COPIES, quiet.size))
        starts = strides.start_s[quiet]
        expected = gait_phase(starts, strides).mean_stride_s
        virtual = self.moments((starts + share * expected).ravel()).unwrapped(middle)
        virtual = replace(virtual, strides=np.tile(quiet, _COPIES))
        durations = strides.duration_s[quiet[:, None] - np.arange(3)]
        even = np.abs(durations / np.median(strides.duration_s) - 1.0) < _STRIDE_BAND
        reach_s = self._window_s + LEAD_SAMPLES / self._signals.rate_hz
        first = np.searchsorted(self._onsets, virtual.onsets_s - _PAST_S)
        without_pulse = first == np.searchsorted(self._onsets, virtual.onsets_s + reach_s)
        return virtual.take(virtual.valid & without_pulse & np.tile(even.all(axis=1), _COPIES))

    def moments(self, onsets_s: np.ndarray) -> "_Moments":
        """Return past, window and position in the stride of onsets."""
        signals, strides = self._signals, self._strides
        n = round(self._window_s * signals.rate_hz) + 1 + LEAD_SAMPLES
        after_s = n / signals.rate_hz
        past, _ = signals.cut(
            onsets_s, before_s=_PAST_S, after_s=0.0, rows=slice(RAW_ANGLE, RAW_ANGLE + 1)
        )
        windows, codes = signals.cut(onsets_s, before_s=0.0, after_s=after_s, rows=self._rows)
        code_of = np.array(codes, dtype=object)
        if strides is None or strides.start_s.size == 0:
            unknown = np.full(onsets_s.size, np.nan)
            features = np.zeros((onsets_s.size, 1))
            return _Moments(onsets_s, features, windows, unknown, code_of, unknown)
        phase = gait_phase(onsets_s, strides)
        before = np.clip(np.searchsorted(strides.end_s, onsets_s, side="right") - 1, 0, None)
        timing = [phase.elapsed_s, phase.mean_stride_s, strides.duration_s[before]]
        features = np.column_stack([_binned(past[:, 0], signals.rate_hz), *timing])
        ratio = np.where(phase.mean_stride_s > 0, phase.elapsed_s / phase.mean_stride_s, np.nan)
        return _Moments(onsets_s, features, windows, ratio, code_of, before)


@dataclass(frozen=True, slots=True, eq=False)
class _Moments:
    onsets_s: np.ndarray
    features: np.ndarray  # past angles (rad), then the timing of the stride (s)
    windows: np.ndarray  # (m, row, n) angle (rad), torques (N*m), further sensors
    ratio: np.ndarray  # time since the heel strike over the expected duration of the stride
    codes: np.ndarray
    strides: np.ndarray  # number of the stride before each onset

    @property
    def valid(self) -> np.ndarray:
        whole = np.isfinite(self.windows).all(axis=(1, 2))
        return np.asarray(whole & np.isfinite(self.features).all(axis=1))

    def unwrapped(self, middle: float) -> "_Moments":
        """Return moments with the time since the heel strike nearest to a point of the cycle.

        Pulses just before a heel strike come a whole stride after the last one; their time is
        counted from the next one.
        """
        whole = np.round(middle - self.ratio)
        features = self.features.copy()
        features[:, _ELAPSED] += np.nan_to_num(whole) * features[:, _EXPECTED]
        return replace(self, features=features, ratio=self.ratio + whole)

    def relative(self, angles: Sequence[int]) -> "_Moments":
        """Return moments with angles, rows of the windows, relative to the level at the onset."""
        level = self.features[:, :1]
        features, windows = self.features.copy(), self.windows.copy()
        features[:, : _BINS + _COARSE] -= level
        for row in angles:
            before = windows[:, row, :LEAD_SAMPLES].mean(axis=1, keepdims=True)
            windows[:, row] -= level if row == RAW_ANGLE else before
        return replace(self, features=features, windows=windows)

    def take(self, chosen: np.ndarray) -> "_Moments":
        return _Moments(*(getattr(self, field.name)[chosen] for field in fields(self)))


def _joined(parts: Sequence[_Moments]) -> _Moments:
    """Join moments of several recordings; their strides keep different numbers."""
    joined = {
        field.name: np.concatenate([getattr(part, field.name) for part in parts])
        for field in fields(_Moments)
    }
    return _Moments(**joined | {"strides": _apart([part.strides for part in parts])})


class _Curve:
    """Features and, with enough strides, products of their leading directions.

    Posture changes the timing of the following motion, which is not linear: the products reduce
    the error in swing by a third.
    """

    def __init__(self, features: np.ndarray) -> None:
        self._centre = features.mean(axis=0)
        _, size, directions = np.linalg.svd(features - self._centre, full_matrices=False)
        kept = min(_CURVED, directions.shape[0])
        self._directions = directions[:kept].T
        spread = size[:kept] / np.sqrt(len(features))
        self._spread = np.where(spread > 0.0, spread, 1.0)

    def sets(self, features: np.ndarray) -> list[np.ndarray]:
        """Return alternative feature matrices, the largest first."""
        return [self._curved(features), features, _coarse(features)]

    def features(self, features: np.ndarray, *, like: BlockedRidge) -> np.ndarray:
        """Return the features of the set that a regression was fitted to."""
        width = like.centre.size
        return next(matrix for matrix in self.sets(features) if matrix.shape[1] == width)

    def _curved(self, features: np.ndarray) -> np.ndarray:
        along = (features - self._centre) @ self._directions / self._spread
        i, j = np.triu_indices(along.shape[1])
        return np.hstack([features, along[:, i] * along[:, j]])


def _coarse(features: np.ndarray) -> np.ndarray:
    """Return level, slope and curvature of the angle before the onset, and the timing."""
    bins = features[:, :_BINS]
    third = _BINS // 3
    near, middle, far = (bins[:, k * third : (k + 1) * third].mean(axis=1) for k in range(3))
    return np.column_stack([near, near - middle, near - 2.0 * middle + far, features[:, -3:-1]])


def _learned(virtual: _Moments, curve: _Curve, n: int) -> BlockedRidge:
    """Fit the feature matrix that predicts the angle best."""
    targets = virtual.windows.reshape(len(virtual.windows), -1)
    names, order = np.unique(virtual.strides, return_inverse=True)
    blocks = order * _BLOCKS // names.size
    sets = [
        matrix
        for matrix in curve.sets(virtual.features)
        if matrix.shape[1] * _STRIDES_PER_FEATURE <= names.size
    ]
    sets = sets or [_coarse(virtual.features)]
    angles, judged = targets[:, :n], slice(0, n, 4)
    fits = [fit_blocked_ridge(matrix, angles, blocks, judged=judged) for matrix in sets]
    errors = [float(np.median((fit.left_out**2).mean(axis=1))) for fit in fits]
    best = int(np.argmin(errors))
    return fit_blocked_ridge(sets[best], targets, blocks, penalties=(fits[best].penalty,))


def _middle(ratio: np.ndarray) -> float:
    """Return the median point of the cycle, on a circle."""
    if ratio.size == 0:
        return np.nan
    centre = float(np.angle(np.exp(2j * np.pi * ratio).mean()) / (2.0 * np.pi)) % 1.0
    # More than a stride may have passed if a heel strike is late.
    return float(np.median(ratio + np.round(centre - ratio)))


def _binned(past: np.ndarray, rate: float) -> np.ndarray:
    """Average the angle before the onset in bins, the nearest first."""
    edges_s = np.concatenate(
        [np.arange(_BINS) * _BIN_S, _BIN_S * _BINS + np.arange(_COARSE + 1) * _COARSE_S]
    )
    n = past.shape[1]
    edges = n - np.round(edges_s * rate).astype(int).clip(0, n)
    bins = [past[:, min(low, high - 1) : high].mean(axis=1) for high, low in pairwise(edges)]
    return np.column_stack(bins)


def quiet_strides(source: Source) -> np.ndarray:
    """Return the strides without a pulse, not after one, and with three accepted ones before."""
    strides = source.strides
    if strides is None:
        return np.empty(0, int)
    quiet = source.undisturbed.copy()
    quiet[1:] &= source.undisturbed[:-1]
    quiet[: int(np.searchsorted(np.cumsum(strides.accepted), 3)) + 1] = False
    return np.flatnonzero(quiet)


def _distance(features: np.ndarray, learned: np.ndarray) -> np.ndarray:
    """Return the largest robust distance of any feature from the learned ones, in sds."""
    centre, spread = robust_moments(learned)
    return np.asarray(np.abs((features - centre) / (spread + _ROUNDING)).max(axis=1))
