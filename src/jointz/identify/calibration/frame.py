r"""Impedance of the exoskeleton's own frame, hanging alone.

:math:`\tau + f\,\tau_f = K\sin x + B\dot x + J\ddot x` on average responses. The encoder's motion
is nearly free of noise: the error left is that of the actuator's torque, which pulses average
out, and whose size is estimated from pulse to pulse.
"""

import numpy as np
from scipy.stats import t as student_t

from jointz.core.study import Calibrated, CalibrationSpec
from jointz.identify.calibration.calibration_step import RefusedError, calibration_step, step_series
from jointz.identify.calibration.pulse_averages import PulsedRecord, average_pulses, left_out_notes
from jointz.kernels.derivatives import derivative
from jointz.kernels.filtering import lowpass_zero_phase
from jointz.results.bench.calibration_failure import CalibrationFailure
from jointz.results.bench.calibration_fit import CalibrationEntry, CalibrationFit, decided
from jointz.results.estimates import REACH_95

_NAMES = ("intrinsic_stiffness", "intrinsic_damping", "intrinsic_inertia")
_LEAD_S, _LENGTH_S = 0.15, 0.6
#: Both ends of the cut responses feel the filter.
_EDGE_S = 0.05
_CUTOFF_HZ = 30.0
#: Slower than this, friction is not known: at rest it takes any value.
_SLOW_RAD_S = 0.15
_FRICTION_GAIN = Calibrated(value=1.0, sd=0.2)
_TORQUE_GAIN = Calibrated(value=1.0, sd=0.0)
_FEWEST_SAMPLES = 30
_METHOD = (
    "regression of the torque on the encoder's motion, that of the other pulses as instrument; sd "
    "from pulse to pulse"
)


@calibration_step("frame", *_NAMES)
def fit_frame(record: PulsedRecord, *, known: CalibrationSpec | None = None) -> CalibrationFit:
    """Estimate stiffness, damping and inertia of the frame beyond the place of the torque.

    The inertia of the rotor is in the torque already. Samples slower than 0.15 rad/s are left
    out: at rest, static friction takes any value. The gain of the friction is a nuisance
    with a prior, 1 +- 0.2 where nothing is known.
    """
    known = known or CalibrationSpec()
    average = average_pulses(record, lead_s=_LEAD_S, length_s=_LENGTH_S, name="pulses")
    rate = 1.0 / average.period_s
    angle, driving, friction = (
        lowpass_zero_phase(rows, cutoff_hz=_CUTOFF_HZ, rate_hz=rate)
        for rows in (average.motor_angle, average.driving, average.friction)
    )
    velocity = derivative(angle, rate_hz=rate)
    acceleration = derivative(velocity, rate_hz=rate)
    motion = np.stack([np.sin(angle), velocity, acceleration, -friction], axis=-1)
    inside = (average.time_s > 0.0) & (average.time_s < _LENGTH_S - _EDGE_S)
    inside &= np.abs(velocity.mean(axis=0)) > _SLOW_RAD_S
    values, noise = _regressed(driving[:, inside], motion[:, inside])
    prior = known.friction_gain or _FRICTION_GAIN
    values, covariance, from_prior = _with_prior(values, noise, prior)
    gain = known.torque_gain or _TORQUE_GAIN
    variances = np.column_stack([np.diag(covariance), np.diag(from_prior)])
    entries = (
        _entry(name, float(value), row, gain)
        for name, value, row in zip(_NAMES, values[:3], variances[:3], strict=True)
    )
    return CalibrationFit(
        step="frame",
        entries=tuple(entries),
        reported=(decided("friction_gain", values[3], {"noise": np.sqrt(covariance[3, 3])}),),
        method=_METHOD,
        n_samples=int(inside.sum()) * average.count,
        notes=left_out_notes(average),
        settings={"cutoff_hz": _CUTOFF_HZ, "n_pulses": average.count},
        series=step_series(
            average.time_s[inside],
            driving.mean(axis=0)[inside],
            (motion.mean(axis=0) @ values)[inside],
            x_label="time after the onset (s)",
            y_label="torque by the current, without friction (N*m)",
        ),
    )


def _regressed(torque: np.ndarray, motion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return K, B, J and friction gain, and their covariance from pulse to pulse.

    The error of the torque moves the frame too, so that a pulse's own motion would lean towards
    it: the motion of all the other pulses is its instrument (Angrist, Imbens and Krueger 1999,
    doi:10.1002/(SICI)1099-1255(199901/02)14:1<57::AID-JAE501>3.0.CO;2-G).
    """
    m, n = torque.shape
    if n < _FEWEST_SAMPLES:
        detail = f"only {n} samples move faster than {_SLOW_RAD_S:g} rad/s"
        raise RefusedError(CalibrationFailure.NO_MOTION, detail)
    others = (m * motion.mean(axis=0) - motion) / (m - 1)
    inverse = np.linalg.pinv(np.einsum("mnp,mnq->pq", others, motion))  # friction may be none
    values = inverse @ np.einsum("mnp,mn->p", others, torque)
    each = inverse @ np.einsum("mnp,mn->pm", others, torque - motion @ values)
    widened = (float(student_t.ppf(0.975, m - 1)) / REACH_95) ** 2
    return values, each @ each.T * m / (m - 1) * widened


def _with_prior(
    values: np.ndarray, covariance: np.ndarray, prior: Calibrated
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return values and covariance with the gain of friction drawn to its prior.

    The third is the part of the covariance due to the prior's sd.
    """
    variance = prior.sd**2
    gain = covariance[:, 3] / (covariance[3, 3] + variance)
    drawn = values + gain * (prior.value - values[3])
    left = covariance - np.outer(gain, covariance[3])
    return drawn, left, np.outer(gain, gain) * variance


def _entry(name: str, value: float, variances: np.ndarray, gain: Calibrated) -> CalibrationEntry:
    """Return an entry; variances are in all, and by the prior of the friction."""
    total, of_friction = float(variances[0]), float(variances.min())
    value /= gain.value
    parts = {
        "noise": float(np.sqrt(total - of_friction)) / gain.value,
        "friction": float(np.sqrt(of_friction)) / gain.value,
        "torque_gain": abs(value) * gain.sd / gain.value,
    }
    return decided(name, value, parts)
