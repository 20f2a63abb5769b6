r"""Impedance of the exoskeleton's own frame, hanging alone.

:math:`\tau + f\,\tau_f = K\sin x + B\dot x + J\ddot x` on average responses, the encoder's motion
being as good as free of noise: what is left is the actuator's torque error, which pulses average
out, and which is told from pulse to pulse.
"""

import numpy as np
from scipy.stats import t as student_t

from jointz.core.study import Calibrated, CalibrationSpec
from jointz.identify.calibration.pulse_averages import PulseAverage, PulsedRecord, average_pulses
from jointz.identify.calibration.steady_fit import RefusedError, thinned
from jointz.kernels.derivatives import derivative
from jointz.kernels.filtering import lowpass_zero_phase
from jointz.results.bench.calibration_failure import CalibrationFailure
from jointz.results.bench.calibration_fit import (
    CalibrationEntry,
    CalibrationFit,
    CalibrationSeries,
    decided,
    failed,
)
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


def fit_frame(record: PulsedRecord, *, known: CalibrationSpec | None = None) -> CalibrationFit:
    """Find stiffness, damping and inertia of what moves beyond the place of the torque.

    The inertia of the rotor is in the torque already. Samples slower than 0.15 rad/s are left
    out: at rest, friction is whatever it needs to be. The gain of the friction is a nuisance
    with a prior, 1 +- 0.2 where nothing is known.
    """
    known = known or CalibrationSpec()
    try:
        average = average_pulses(record, lead_s=_LEAD_S, length_s=_LENGTH_S, name="pulses")
        return _fitted(average, known)
    except RefusedError as refused:
        return CalibrationFit("frame", failed(_NAMES, refused.code, refused.detail))


def _fitted(average: PulseAverage, known: CalibrationSpec) -> CalibrationFit:
    rate = 1.0 / average.period_s
    angle, driving, friction = (
        lowpass_zero_phase(rows, cutoff_hz=_CUTOFF_HZ, rate_hz=rate)
        for rows in (average.motor_angle, average.driving, average.friction)
    )
    velocity = derivative(angle, rate_hz=rate)
    bend = derivative(velocity, rate_hz=rate)
    motion = np.stack([np.sin(angle), velocity, bend, -friction], axis=-1)
    inside = (average.time_s > 0.0) & (average.time_s < _LENGTH_S - _EDGE_S)
    inside &= np.abs(velocity.mean(axis=0)) > _SLOW_RAD_S
    values, noise = _regressed(driving[:, inside], motion[:, inside])
    prior = known.friction_gain or _FRICTION_GAIN
    values, covariance, from_prior = _with_prior(values, noise, prior)
    gain = known.torque_gain or _TORQUE_GAIN
    entries = tuple(_entry(i, values, (covariance, from_prior), gain) for i in range(3))
    shown = (motion.mean(axis=0) @ values)[inside]
    return CalibrationFit(
        step="frame",
        entries=entries,
        reported=(decided("friction_gain", values[3], {"noise": np.sqrt(covariance[3, 3])}),),
        method=_METHOD,
        n_samples=int(inside.sum()) * average.count,
        notes=_notes(average),
        settings={"cutoff_hz": _CUTOFF_HZ, "n_pulses": average.count},
        series=CalibrationSeries(
            x=thinned(average.time_s[inside]),
            measured=thinned(driving.mean(axis=0)[inside]),
            modelled=thinned(shown),
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
    """Return values and covariance with the gain of friction drawn to what is known of it.

    The third is the part of the covariance that the prior's sd makes.
    """
    variance = prior.sd**2
    gain = covariance[:, 3] / (covariance[3, 3] + variance)
    drawn = values + gain * (prior.value - values[3])
    left = covariance - np.outer(gain, covariance[3])
    return drawn, left, np.outer(gain, gain) * variance


def _entry(
    i: int,
    values: np.ndarray,
    covariances: tuple[np.ndarray, np.ndarray],
    gain: Calibrated,
) -> CalibrationEntry:
    covariance, from_prior = covariances
    of_friction = min(float(from_prior[i, i]), float(covariance[i, i]))
    value = float(values[i]) / gain.value
    parts = {
        "noise": float(np.sqrt(covariance[i, i] - of_friction)) / gain.value,
        "friction": float(np.sqrt(of_friction)) / gain.value,
        "torque_gain": abs(value) * gain.sd / gain.value,
    }
    return decided(_NAMES[i], value, parts)


def _notes(average: PulseAverage) -> tuple[str, ...]:
    if average.n_left_out == 0:
        return ()
    return (f"{average.n_left_out} pulses left out: not from rest, or at the record's ends.",)
