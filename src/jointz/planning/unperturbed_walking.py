"""Unperturbed walking at the timing points of a plan: how well it can be predicted.

Of the lab's own walking, errors of the estimator's prediction at virtual onsets; without any,
those of a walker whose acceleration changes at random.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import convolve1d

from jointz.core.errors import DataError
from jointz.core.events import PulseRecord
from jointz.identify.prediction.unperturbed_prediction import (
    FEWEST_STRIDES,
    LEAD_SAMPLES,
    UnperturbedPredictor,
    quiet_strides,
)
from jointz.identify.preparation.assignment import Candidate
from jointz.identify.preparation.pulses import Pulse
from jointz.identify.preparation.raw_signals import ENCODER, TORQUE_ROWS, raw_signals
from jointz.identify.preparation.sensor_agreement import choose_sensors
from jointz.identify.preparation.sources import (
    ParticipantSettings,
    RecordingInput,
    Source,
    prepare_sources,
)
from jointz.identify.walking.responses import GONIOMETER, data_length_s, smooth_velocity
from jointz.reference.published_knee import published_angle

_VIRTUAL_S = 0.1
#: Errors of the prediction are slower than this; what is faster is noise of the goniometer.
_SMOOTH_S = 0.03
#: Error of the predicted angle 0.1 s after the onset, of a recorded walker (.7 to .9 degrees at
#: six points): it grows with time to the power 1.5, .3 degrees after 50 ms and 1.5 after 150.
_ERROR_RAD, _ERROR_S = np.deg2rad(0.8), 0.1
_ONSETS = 400


@dataclass(frozen=True, slots=True, eq=False)
class PointWalking:
    """Unperturbed walking about a timing point."""

    phase: float  # of the onset, cycles
    stride_s: float
    period_s: float  # between samples
    channels: tuple[str, ...]  # goniometer first
    velocity: np.ndarray  # (n,) rad/s, of the unperturbed joint
    # (virtual onset, channel, n) rad or rad/s: errors of the prediction
    prediction_errors: np.ndarray
    torque_prediction_errors: np.ndarray  # (virtual onset, n) N*m
    n_strides: int  # from which the prediction will be learned
    n_recorded: int = 0  # unperturbed strides that ``prediction_errors`` are from; 0 if stored

    @property
    def n_samples(self) -> int:
        """Samples of a window."""
        return int(self.velocity.size)


def stored_walking(
    timing_points: Mapping[str, float],
    noise: Mapping[str, float],
    *,
    window_s: float,
    rate_hz: float,
    stride_s: float,
    n_strides: int,
) -> dict[str, PointWalking]:
    """Return walking as published, with the variability of a recorded walker.

    ``noise`` is the white noise of each channel, SI.
    """
    n = round(data_length_s(window_s) * rate_hz) + 1 + LEAD_SAMPLES
    since = (np.arange(n) - LEAD_SAMPLES) / rate_hz
    rng = np.random.default_rng(1)
    walking = {}
    for label, pct in timing_points.items():
        steps = rng.standard_normal((_ONSETS, n)) * (since > 0.0)
        velocity = np.cumsum(steps, axis=1)
        angle = np.cumsum(velocity, axis=1) / rate_hz
        size = _ERROR_RAD / angle[:, round(_ERROR_S * rate_hz) + LEAD_SAMPLES].std()
        of_angle = (GONIOMETER, ENCODER)
        prediction_errors = np.stack(
            [
                size * (angle if name in of_angle else velocity)
                + sd * rng.standard_normal(angle.shape)
                for name, sd in noise.items()
            ],
            axis=1,
        )
        knee = published_angle((pct + 100.0 * since / stride_s) % 100.0)
        walking[label] = PointWalking(
            phase=pct / 100.0,
            stride_s=stride_s,
            period_s=1.0 / rate_hz,
            channels=tuple(noise),
            velocity=np.gradient(knee, 1.0 / rate_hz),
            prediction_errors=prediction_errors,
            torque_prediction_errors=np.zeros((_ONSETS, n)),
            n_strides=n_strides,
        )
    return walking


def recorded_walking(
    recordings: Sequence[RecordingInput],
    settings: ParticipantSettings,
    *,
    who: str,
    timing_points: Mapping[str, float],
    window_s: float,
    n_strides: int,
) -> dict[str, PointWalking]:
    """Return a person's own walking, from unperturbed strides.

    Without unperturbed recordings, the strides between the pulses of perturbed ones.
    """
    unperturbed = [r for r in recordings if r.condition == "unperturbed"]
    perturbed = [r for r in recordings if r.condition == "perturbed"]
    sources = prepare_sources(unperturbed or perturbed, settings)
    sources = [s for s in sources if quiet_strides(s).size >= FEWEST_STRIDES]
    if not sources:
        raise DataError(
            f"pilot: expected a recording of {who} with the device on and at least "
            f"{FEWEST_STRIDES} unperturbed strides, found none. Record three to five minutes."
        )
    source = max(sources, key=lambda s: quiet_strides(s).size)
    sensors = choose_sensors([source]).used
    signals = raw_signals(source, sensors=sensors)
    predictor = UnperturbedPredictor(
        source, signals, window_s=data_length_s(window_s), sensors=sensors
    )
    walking = {}
    for label, pct in timing_points.items():
        candidates = list(_virtual_pulses(source, label, pct))
        predicted = predictor.predict(candidates)
        errors = predicted.prediction_errors
        if not len(errors):
            raise DataError(f"pilot: no unperturbed stride could be predicted at {label}.")
        walking[label] = PointWalking(
            phase=pct / 100.0,
            stride_s=_stride_s(source),
            period_s=1.0 / predictor.rate_hz,
            channels=(GONIOMETER, *sensors),
            velocity=smooth_velocity(predicted.unperturbed_rad, 1.0 / predictor.rate_hz),
            prediction_errors=np.delete(errors, TORQUE_ROWS, axis=1),
            torque_prediction_errors=errors[:, TORQUE_ROWS].sum(axis=1),
            n_strides=n_strides,
            n_recorded=predicted.n_strides,
        )
    return walking


def _stride_s(source: Source) -> float:
    """Return the usual duration of a stride."""
    return np.nan if source.strides is None else float(np.median(source.strides.duration_s))


def _virtual_pulses(source: Source, label: str, pct: float) -> Iterator[Candidate]:
    """Yield pulses of no torque at a timing point of every quiet stride."""
    strides = source.strides
    if strides is None:
        return
    file, after_s = source.input.file, pct / 100.0 * _stride_s(source)
    for k in quiet_strides(source):
        onset_s = float(strides.start_s[k]) + after_s
        record = PulseRecord("", file, onset_s, _VIRTUAL_S, 0.0, label)
        yield Candidate(0, Pulse(onset_s, _VIRTUAL_S, 1.0), record, 0.0)


def with_channels(at: PointWalking, noise: Mapping[str, float]) -> PointWalking:
    """Return walking as other sensors show it.

    ``noise`` is the white noise of each channel, SI. A channel that was not recorded gets the
    error of the goniometer's prediction, smoothed, or its rate, and its own noise.
    """
    rng = np.random.default_rng(2)
    width = max(3, round(_SMOOTH_S / at.period_s))
    kernel = np.hanning(width + 2)[1:-1] / np.hanning(width + 2).sum()
    motion = convolve1d(at.prediction_errors[:, 0], kernel, axis=1, mode="nearest")
    parts = []
    for name, sd in noise.items():
        if name in at.channels:
            parts.append(at.prediction_errors[:, at.channels.index(name)])
            continue
        shown = motion if name == ENCODER else np.gradient(motion, at.period_s, axis=1)
        parts.append(shown + sd * rng.standard_normal(motion.shape))
    return replace(at, channels=tuple(noise), prediction_errors=np.stack(parts, axis=1))
