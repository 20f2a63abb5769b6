"""Average responses of a participant by timing point and shape of pulse, and their errors."""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import toeplitz

from jointz.core.study import CalibrationSpec
from jointz.identify.prediction.predicted_cells import PredictedCell
from jointz.identify.prediction.pulse_shapes import pulse_shapes
from jointz.identify.prediction.unperturbed_prediction import FEWEST_STRIDES, LEAD_SAMPLES
from jointz.identify.preparation.calibration import twist_sd, value_of
from jointz.identify.preparation.raw_signals import DRIVING, FRICTION, RAW_ANGLE, TORQUE_ROWS
from jointz.identify.walking.coupling import STRAP, Coupling
from jointz.kernels.robust_spread import robust_sd

GONIOMETER = "goniometer"
#: Margin for lags after the data that are used.
_BEYOND_S = 0.012
#: A response is used until the joint has moved so far, and at least so long.
LARGEST_RAD, _LEAST_S = np.deg2rad(18.0), 0.05
#: Virtual onsets further from zero, in sds, do not count.
_OUTLIER_SD = 6.0
#: Data end so long before the next heel strike, which changes the leg to a closed chain; strides
#: differ in time.
_BEFORE_STRIKE_CYCLES = 0.05
#: Correlations of few strides are reduced by this share, for each sample and stride.
_LEAST_SHRINKAGE, _SHRINKAGE = 0.02, 0.05
_RESOLUTION = 2e-5  # rad, or rad/s
#: What several sensors show is averaged over this time: together they need no finer resolution.
_SEVERAL_S = 0.006
_SMOOTH_S = 0.04


@dataclass(frozen=True, slots=True, eq=False)
class ShapeAverage:
    """Average response to the pulses of one shape, as signed."""

    sensor_signals: np.ndarray  # (channel, n) by every sensor, rad or rad/s; first the goniometer
    torque: np.ndarray  # (n,) N*m
    n_pulses: float  # of a plan it may be a fraction
    used: np.ndarray  # (n,) samples before the joint has moved too far


@dataclass(frozen=True, slots=True, eq=False)
class PointResponse:
    """Average responses of one timing point."""

    label: str
    phase: float  # of the onset, cycles; NaN where unknown
    stride_s: float
    time_s: np.ndarray  # (n,) time from the onset
    shapes: tuple[ShapeAverage, ...]
    velocity: np.ndarray  # (n,) rad/s: velocity of the unperturbed motion
    prediction_errors: np.ndarray  # (virtual onset, channel, n), rad or rad/s
    torque_prediction_errors: np.ndarray  # (virtual onset, n), N*m
    n_strides: int
    twist_sd: float = 0.0  # rad/(N*m): sd of the angle shown per torque, by the calibration
    channels: tuple[str, ...] = (GONIOMETER,)  # sensors
    # (pulse,) place in ``shapes`` of each pulse that is used; empty if pulses are not known
    shape_of_pulse: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=int))

    @property
    def period_s(self) -> float:
        """Time between samples."""
        return float(self.time_s[1] - self.time_s[0])

    @property
    def by_frequency(self) -> np.ndarray:
        """Places of the shapes, that of the most pulses first."""
        return np.argsort([-s.n_pulses for s in self.shapes], kind="stable")

    @property
    def stacked(self) -> np.ndarray:
        """All responses, shape by shape and channel by channel."""
        return np.concatenate([s.sensor_signals.ravel() for s in self.shapes])

    def with_pulses(self, n_pulses: float) -> "PointResponse":
        """Return the same responses as averages of another number of pulses of every shape."""
        shapes = tuple(replace(shape, n_pulses=n_pulses) for shape in self.shapes)
        return replace(self, shapes=shapes)

    @property
    def averaged(self) -> int:
        """Number of neighbouring samples that are averaged for the fit."""
        return max(1, round(_SEVERAL_S / self.period_s)) if len(self.channels) > 1 else 1

    def blocks(self, values: np.ndarray) -> np.ndarray:
        """Average neighbouring samples along the last axis."""
        n = values.shape[-1] // self.averaged
        whole = values[..., : n * self.averaged]
        return np.asarray(whole.reshape(*values.shape[:-1], n, self.averaged).mean(axis=-1))

    def fitted(self, stacked: np.ndarray) -> np.ndarray:
        """Return what is fitted of stacked values (..., shapes * channels * n)."""
        lead = stacked.shape[:-1]
        blocks = self.blocks(stacked.reshape(*lead, -1, self.time_s.size)).reshape(*lead, -1)
        return np.asarray(blocks[..., self.used])

    @property
    def used(self) -> np.ndarray:
        """Mask of the stacked blocks that are used."""
        return np.concatenate(
            [np.tile(self.blocks(s.used) == 1.0, len(self.channels)) for s in self.shapes]
        )

    def stride_covariance(self, impulse_responses: np.ndarray) -> np.ndarray:
        """Return the covariance of one stride's prediction error by all channels.

        ``impulse_responses`` (channel, n) are those to one sample of torque: torque that was
        predicted wrongly moves the joint, which the measured torque explains.
        """
        n = self.time_s.size
        explained = [
            self.torque_prediction_errors @ toeplitz(one, np.zeros(n)).T
            for one in impulse_responses
        ]
        error = (
            self.prediction_errors[:, : len(impulse_responses)] - np.stack(explained, axis=1)
        ).reshape(len(self.prediction_errors), -1)
        usual = (np.abs(error) < _OUTLIER_SD * (robust_sd(error) + 1e-6)).all(axis=1)
        if usual.sum() < FEWEST_STRIDES:
            usual[:] = True
        sample = np.cov(error[usual].T)
        shrunk = min(1.0, max(_LEAST_SHRINKAGE, _SHRINKAGE * n / self.n_strides))
        covariance = (1.0 - shrunk) * sample + shrunk * np.diag(np.diag(sample))
        # The noise is estimated from so many strides: variance of Student's t.
        covariance *= (self.n_strides - 1) / (self.n_strides - 3)
        return np.asarray(covariance + _RESOLUTION**2 * np.eye(len(covariance)))


def point_response(
    cell: PredictedCell,
    *,
    window_s: float,
    known: CalibrationSpec,
    sensors: tuple[str, ...] = (),
    coupling: Coupling = STRAP,
) -> PointResponse:
    """Average the responses of a timing point, every shape by itself.

    ``sensors`` are those beside the goniometer, in the order of the predicted rows.
    """
    friction_gain = value_of(known.friction_gain, 1.0)
    n_all = cell.predicted.responses.shape[2]
    n = min(round(data_length_s(window_s, coupling) / cell.period_s) + 1 + LEAD_SAMPLES, n_all)
    responses = cell.predicted.responses[cell.kept][:, :, :n]
    errors = cell.predicted.prediction_errors[:, :, :n]
    shapes = pulse_shapes(responses[:, TORQUE_ROWS].sum(axis=1), [c.pulse for c in cell.used])
    numbers, places = np.unique(shapes, return_inverse=True)
    until_s = data_end_s(cell.phase, cell.stride_s)
    return PointResponse(
        label=cell.label,
        phase=cell.phase,
        stride_s=cell.stride_s,
        time_s=(np.arange(n) - LEAD_SAMPLES) * cell.period_s,
        shapes=tuple(
            _average(responses[shapes == k], cell.period_s, known, until_s=until_s) for k in numbers
        ),
        velocity=smooth_velocity(cell.predicted.unperturbed_rad[:n], cell.period_s),
        prediction_errors=np.delete(errors, TORQUE_ROWS, axis=1),
        torque_prediction_errors=errors[:, DRIVING] + friction_gain * errors[:, FRICTION],
        n_strides=cell.predicted.n_strides,
        twist_sd=twist_sd_of(known, coupling),
        channels=(GONIOMETER, *sensors),
        shape_of_pulse=places,
    )


def twist_sd_of(known: CalibrationSpec, coupling: Coupling) -> float:
    """Return the sd of the angle shown per torque, rad/(N*m)."""
    return coupling.twist_sd if known.angle_per_torque is None else twist_sd(known)


def data_length_s(window_s: float, coupling: Coupling = STRAP) -> float:
    """Return how long after the onset data are kept, margin for lags included."""
    return max(coupling.fit_s, window_s) + _BEYOND_S


def data_end_s(phase: float, stride_s: float) -> float:
    """Return the time from the onset until just before the next heel strike."""
    left = (1.0 - phase % 1.0 - _BEFORE_STRIKE_CYCLES) * stride_s
    return max(left, _LEAST_S) if np.isfinite(left) else np.inf


def _average(
    responses: np.ndarray, period_s: float, known: CalibrationSpec, *, until_s: float
) -> ShapeAverage:
    """Average the pulses of a shape, corrected for what is known of torque and angle."""
    average = responses.mean(axis=0)
    angle, torque = corrected(average, period_s, known)
    torque_lag_s = value_of(known.torque_lag_s, 0.0)
    time_s = np.arange(angle.size) * period_s
    # Beyond, the torque was recorded after the end of the window.
    known_torque = time_s + torque_lag_s <= time_s[-1] + 0.5 * period_s
    since_s = time_s - LEAD_SAMPLES * period_s
    return ShapeAverage(
        sensor_signals=np.stack([angle, *average[TORQUE_ROWS.stop :]]),
        torque=torque,
        n_pulses=len(responses),
        used=known_torque & (since_s <= until_s) & usable_samples(angle, since_s),
    )


def corrected(
    response: np.ndarray, period_s: float, known: CalibrationSpec
) -> tuple[np.ndarray, np.ndarray]:
    """Return angle and torque of a response (rows, n), corrected for what is known of both."""
    angle, driving, friction = response[RAW_ANGLE], response[DRIVING], response[FRICTION]
    time_s = np.arange(angle.size) * period_s
    recorded = driving + value_of(known.friction_gain, 1.0) * friction
    torque = np.interp(time_s + value_of(known.torque_lag_s, 0.0), time_s, recorded)
    # The sensor shows an angle in proportion to the torque that twists its mount.
    per_torque = value_of(known.angle_per_torque, 0.0) / value_of(known.angle_gain, 1.0)
    return angle - per_torque * torque, torque


def usable_samples(angle: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """Return which samples come before the joint has moved too far, (n,) bool."""
    far = np.flatnonzero((np.abs(angle) > LARGEST_RAD) & (time_s >= _LEAST_S))
    return np.asarray(np.arange(angle.size) < (far[0] if far.size else angle.size))


def smooth_velocity(angle: np.ndarray, period_s: float) -> np.ndarray:
    """Return the smoothed derivative of the mean unperturbed angle."""
    width = min(max(3, round(_SMOOTH_S / period_s)), angle.size // 2)
    kernel = np.hanning(width + 2)[1:-1]
    padded = np.pad(angle, width, mode="reflect", reflect_type="odd")
    smooth = np.convolve(padded, kernel / kernel.sum(), mode="same")[width:-width]
    return np.asarray(np.gradient(smooth, period_s))
