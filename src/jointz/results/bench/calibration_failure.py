"""Why a step of a calibration has no value: stable codes, each with what to do."""

from jointz.core.codes import FailureCode


class CalibrationFailure(FailureCode):
    """Why a calibration step has no value; written as ``failed:CODE``."""

    TOO_SHORT = "too_short", "the record is too short for an interval: record for longer"
    NOT_FINITE = "not_finite", "samples without a number: look at the sensor, record again"
    NOT_STILL = "not_still", "the joint moved: hold it still and record again"
    DRIFT = "drift", "the angle drifts: let the sensor warm up, look how it is fixed"
    NO_MOTION = "no_motion", "a channel hardly moves: a dead sensor, or no motion was made"
    NO_TORQUE = "no_torque", "the torque hardly changes: no torque was given"
    ONE_DIRECTION = "one_direction", "torque or motion in one direction only: give both"
    ONE_LEVEL = (
        "one_level",
        "the switch shows one level only: it is never loaded or never free, or not connected",
    )
    OVERLAPPING_LEVELS = (
        "overlapping_levels",
        "the two levels run into each other: no threshold tells them apart; look at switch, "
        "cable and supply",
    )
    INVERTED_LEVELS = (
        "inverted_levels",
        "volts are low for most of the stride: the switch is wired the other way round, or "
        "sits where there is little contact",
    )
    OPPOSITE_SIGN = "opposite_sign", "the two channels move against each other: a sign is wrong"
    SWAPPED_CHANNELS = (
        "swapped_channels",
        "the encoder comes after the angle: are the channels swapped, or is the encoder's "
        "clock late?",
    )
    GAIN_OUT_OF_RANGE = (
        "gain_out_of_range",
        "the gain is beyond what a sensor can be wrong by: look at units and at what is connected",
    )
    LAG_OUT_OF_RANGE = (
        "lag_out_of_range",
        "the lag is beyond what a sensor can have: look at the clocks",
    )
    CLIPPED = (
        "clipped",
        "the angle stands at its largest value while the encoder goes on: the sensor is at its end",
    )
    PLAY = (
        "play",
        "the angle depends on the direction of the motion: play or friction between "
        "goniometer and hinge",
    )
    SLIP = "slip", "the angle steps against the encoder: the goniometer slips"
    NOT_RIGID = "not_rigid", "angle and encoder differ by more than a rigid hinge can"
    NOT_LINEAR = (
        "not_linear",
        "one direction is answered unlike the other: slack, an end stop, or torque at its limit",
    )
    JOINT_MOVED = (
        "joint_moved",
        "the encoder moves more than the angle, the other way: the joint is not locked, or a "
        "sign is wrong",
    )
    TOO_FEW_PULSES = "too_few_pulses", "too few pulses from rest: at least four of each direction"
    NOT_AT_REST = "not_at_rest", "pulses begin before the motion has died away: longer pauses"
    MODEL_MISFIT = "model_misfit", "no joint behind a late sensor explains the responses"
