"""Signals of one record of a joint, low-passed and differentiated for the estimators."""

from typing import Literal

import numpy as np

from jointz.core.errors import DataError
from jointz.identify.record.joint_estimators import JointSignals
from jointz.identify.record.joint_record import JointRecord, refuse_constant
from jointz.kernels.derivatives import derivative
from jointz.kernels.filtering import lowpass_zero_phase

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
