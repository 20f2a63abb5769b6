"""Signals of one record of a joint, low-passed and differentiated for the estimators."""

from typing import Literal

import numpy as np

from jointz.core.errors import DataError
from jointz.identify.record.block_regression import t_factor
from jointz.identify.record.joint_estimators import JointSignals
from jointz.identify.record.joint_record import JointRecord, refuse_constant
from jointz.kernels.derivatives import derivative
from jointz.kernels.filtering import lowpass_zero_phase
from jointz.results.series.frequency_response_curve import ResponseCurve

EstimatorName = Literal[
    "least_squares", "bounded_least_squares", "admittance", "instrumental_variable"
]

FILTER_ORDER = 4
#: Periods of the cutoff dropped at each end, and least kept between. The filter's slowest
#: transient falls to 9 % in one period, to 0.07 % in three.
EDGE_PERIODS = 3.0
_SHORTEST_PERIODS = 10.0


def default_estimator(input: str, *, has_command: bool) -> EstimatorName:
    """Choose by the perturbed signal, and by whether a device may have reacted to the joint.

    A device with an impedance of its own closes a loop in which only the
    command is free of the joint's noise.
    """
    if input == "angle":
        return "least_squares"
    return "instrumental_variable" if has_command else "admittance"


def prepare_signals(
    record: JointRecord, cutoff_hz: float, torque_acts_on: str = "joint"
) -> JointSignals:
    """Remove offsets, filter, differentiate, and only then drop the edges."""
    _check_length(record, cutoff_hz)
    refuse_constant(record)
    rate = record.rate_hz
    smooth = {
        name: lowpass_zero_phase(values - values.mean(), cutoff_hz=cutoff_hz, rate_hz=rate)
        for name, values in record.channels.items()
    }
    smooth["velocity"] = derivative(smooth["angle"], rate_hz=rate)
    smooth["acceleration"] = derivative(smooth["velocity"], rate_hz=rate)
    edge = int(np.ceil(EDGE_PERIODS / cutoff_hz * rate))
    kept = {name: values[edge:-edge] for name, values in smooth.items()}
    kept["angle"] = kept["angle"] - kept["angle"].mean()
    kept["torque"] = kept["torque"] - kept["torque"].mean()
    if torque_acts_on == "device":
        kept["torque"] = -kept["torque"]
    return JointSignals(rate_hz=rate, time=record.time[edge:-edge], **kept)


def _check_length(record: JointRecord, cutoff_hz: float) -> None:
    half = record.rate_hz / 2.0
    if not 0.0 < cutoff_hz < half:
        raise DataError(
            f"identify_joint: expected 0 < cutoff_hz < {half:.6g} (half the sampling rate), got "
            f"{cutoff_hz:g}. Lower cutoff_hz."
        )
    seconds = record.time.size / record.rate_hz
    needed = (_SHORTEST_PERIODS + 2 * EDGE_PERIODS) / cutoff_hz
    if seconds < needed:
        raise DataError(
            f"identify_joint: the record lasts {seconds:.4g} s, at least {needed:.4g} s are needed "
            f"with cutoff_hz {cutoff_hz:g}. Give a longer record."
        )


#: Where nothing is coherent the band is cut off here, so that files hold no infinities.
_WIDEST_BAND = 1e3


def response_curve(
    frequency_hz: np.ndarray,
    response: np.ndarray,
    *,
    relative_sd: np.ndarray,
    coherence: np.ndarray,
    n_averages: float,
    ci_level: float,
    fitted: np.ndarray | None = None,
) -> ResponseCurve:
    """Return gain, phase and a pointwise band of a response, and of a fitted model."""
    gain = np.abs(response)
    wide = t_factor(ci_level, max(2.0 * n_averages - 2.0, 1.0))
    reach = np.minimum(np.exp(np.minimum(wide * relative_sd, np.log(_WIDEST_BAND))), _WIDEST_BAND)
    columns = {
        "frequency_hz": frequency_hz,
        "gain": gain,
        "phase_rad": np.unwrap(np.angle(response)),
        "gain_low": gain / reach,
        "gain_high": gain * reach,
        "phase_sd_rad": np.minimum(relative_sd, np.pi),
        "coherence": coherence,
    }
    if fitted is not None:
        columns |= {"fitted_gain": np.abs(fitted), "fitted_phase_rad": np.unwrap(np.angle(fitted))}
    return ResponseCurve(**{name: tuple(v.tolist()) for name, v in columns.items()})
