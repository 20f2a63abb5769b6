"""Why a step of a calibration has no value: stable codes, each with what to do."""

from enum import StrEnum


class CalibrationFailure(StrEnum):
    """Why a calibration step has no value; written as ``failed:CODE``."""

    TOO_SHORT = "too_short"
    NOT_FINITE = "not_finite"
    NOT_STILL = "not_still"
    DRIFT = "drift"
    NO_MOTION = "no_motion"
    NO_TORQUE = "no_torque"
    ONE_DIRECTION = "one_direction"
    ONE_LEVEL = "one_level"
    OVERLAPPING_LEVELS = "overlapping_levels"
    INVERTED_LEVELS = "inverted_levels"
    OPPOSITE_SIGN = "opposite_sign"
    SWAPPED_CHANNELS = "swapped_channels"
    GAIN_OUT_OF_RANGE = "gain_out_of_range"
    LAG_OUT_OF_RANGE = "lag_out_of_range"
    CLIPPED = "clipped"
    PLAY = "play"
    SLIP = "slip"
    NOT_RIGID = "not_rigid"
    NOT_LINEAR = "not_linear"
    JOINT_MOVED = "joint_moved"
    TOO_FEW_PULSES = "too_few_pulses"
    NOT_AT_REST = "not_at_rest"
    MODEL_MISFIT = "model_misfit"

    @property
    def status(self) -> str:
        """The status as it stands in a result."""
        return f"failed:{self.value}"

    @property
    def meaning(self) -> str:
        """One sentence: what is wrong, and what to do."""
        return _MEANING[self]


_MEANING = {
    CalibrationFailure.TOO_SHORT: "the record is too short for an interval: record for longer",
    CalibrationFailure.NOT_FINITE: "samples without a number: look at the sensor, record again",
    CalibrationFailure.NOT_STILL: "the joint moved: hold it still and record again",
    CalibrationFailure.DRIFT: "the angle drifts: let the sensor warm up, look how it is fixed",
    CalibrationFailure.NO_MOTION: "a channel hardly moves: a dead sensor, or no motion was made",
    CalibrationFailure.NO_TORQUE: "the torque hardly changes: no torque was given",
    CalibrationFailure.ONE_DIRECTION: "torque or motion in one direction only: give both",
    CalibrationFailure.ONE_LEVEL: "the switch shows one level only: it is never loaded or never "
    "free, or not connected",
    CalibrationFailure.OVERLAPPING_LEVELS: "the two levels run into each other: no threshold "
    "tells them apart; look at switch, cable and supply",
    CalibrationFailure.INVERTED_LEVELS: "volts are low for most of the stride: the switch is wired "
    "the other way round, or sits where there is little contact",
    CalibrationFailure.OPPOSITE_SIGN: "the two channels move against each other: a sign is wrong",
    CalibrationFailure.SWAPPED_CHANNELS: "the encoder comes after the angle: are the channels "
    "swapped, or is the encoder's clock late?",
    CalibrationFailure.GAIN_OUT_OF_RANGE: "the gain is beyond what a sensor can be wrong by: look "
    "at units and at what is connected",
    CalibrationFailure.LAG_OUT_OF_RANGE: "the lag is beyond what a sensor can have: look at the "
    "clocks",
    CalibrationFailure.CLIPPED: "the angle stands at its largest value while the encoder goes on: "
    "the sensor is at its end",
    CalibrationFailure.PLAY: "the angle depends on the direction of the motion: play or friction "
    "between goniometer and hinge",
    CalibrationFailure.SLIP: "the angle steps against the encoder: the goniometer slips",
    CalibrationFailure.NOT_RIGID: "angle and encoder differ by more than a rigid hinge can",
    CalibrationFailure.NOT_LINEAR: "one direction is answered unlike the other: slack, an end "
    "stop, or torque at its limit",
    CalibrationFailure.JOINT_MOVED: "the encoder moves more than the angle, the other way: the "
    "joint is not locked, or a sign is wrong",
    CalibrationFailure.TOO_FEW_PULSES: "too few pulses from rest: at least four of each direction",
    CalibrationFailure.NOT_AT_REST: "pulses begin before the motion has died away: longer pauses",
    CalibrationFailure.MODEL_MISFIT: "no joint behind a late sensor explains the responses",
}
