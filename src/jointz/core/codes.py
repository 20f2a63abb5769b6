"""Stable codes: why something was left out, an estimate failed, or a trial was stopped.

Codes are part of the file format (``excluded.csv``, ``estimates.csv``): they
are added to, never renamed.
"""

from enum import StrEnum


class Code(StrEnum):
    """Base of stable codes; a member is its code and its meaning."""

    _value_: str
    meaning: str  # one sentence for tables, messages and tooltips

    def __new__(cls, code: str, meaning: str = "") -> "Code":  # noqa: D102
        member = str.__new__(cls, code)
        member._value_ = code
        member.meaning = meaning
        return member


class FailureCode(Code):
    """Base of the codes of what has no value."""

    @property
    def status(self) -> str:
        """The status as it stands in ``estimates.csv`` and in results."""
        return f"failed:{self.value}"


class Exclusion(Code):
    """Why a stride or a pulse was left out of the analysis."""

    GAP = "gap", "a gap in the time stamps lies inside it"
    DAMAGED_LOG = "damaged_log", "damaged records of the session's log were left out inside it"
    NOT_FINITE = "not_finite", "samples without a number lie inside it"
    MISSING_STRIKE = (
        "missing_strike",
        "no heel strike where one was due: longer than the accepted band",
    )
    SPURIOUS_STRIKE = (
        "spurious_strike",
        "a heel strike too soon after the last: shorter than the band",
    )
    PULSE_IN_STRIDE = (
        "pulse_in_stride",
        "a pulse, or its aftermath, lies in a stride used as unperturbed",
    )
    NO_RECENT_STRIDES = (
        "no_recent_strides",
        "fewer than three accepted strides before it: no gait phase",
    )
    NO_HEEL_STRIKES = "no_heel_strikes", "the recording has no heel strike"
    EDGE_OF_RECORD = "edge_of_record", "its window runs past the beginning or end of the recording"
    OVERLAPPING_PULSE = "overlapping_pulse", "another pulse begins inside its window"
    NO_BASELINE = "no_baseline", "no unperturbed data to subtract at this point of the cycle"
    OUTSIDE_GROUPS = "outside_groups", "its group channel lies outside all edges"
    LABEL_CONTRADICTS_PHASE = (
        "label_contradicts_phase",
        "its onset is more than 10 % of the gait cycle from the timing point that its table names",
    )
    LONE_PULSE = "lone_pulse", "the only pulse at its timing point: nothing to resample"
    UNUSUAL_GAIT = "unusual_gait", "the walker moved before it as in no unperturbed stride"
    UNUSUAL_RESPONSE = "unusual_response", "the response is far from that of all other pulses here"
    CONSTANT_ANGLE = (
        "constant_angle",
        "the measured angle stands still in its window: a dead sensor",
    )
    CONSTANT_TORQUE = (
        "constant_torque",
        "the measured torque stands still in its window: a dead sensor",
    )
    COPIED_PULSE = "copied_pulse", "its samples are those of an earlier pulse: a copy"
    NO_TORQUE = "no_torque", "the measured torque does not follow the command: no pulse was given"
    NO_RESPONSE = "no_response", "torque never reached the joint: it did not move as in the others"
    USER = "user", "left out by the study's exclusions.csv"


class Failure(FailureCode):
    """Why a cell has no estimate; written as ``failed:CODE``."""

    NO_PULSES = "no_pulses", "no pulse at this timing point"
    TOO_FEW_PULSES = "too_few_pulses", "one pulse only: no interval can be made"
    ALL_PULSES_EXCLUDED = "all_pulses_excluded", "every pulse was left out; excluded.csv says why"
    NO_HEEL_STRIKES = "no_heel_strikes", "no heel strikes in the perturbed recording"
    NO_PERTURBED_RECORDING = "no_perturbed_recording", "the participant has no perturbed recording"
    NO_UNPERTURBED_RECORDING = (
        "no_unperturbed_recording",
        "the baseline needs an unperturbed recording",
    )
    NO_UNPERTURBED_STRIDES = (
        "no_unperturbed_strides",
        "too few accepted unperturbed strides to make a baseline of",
    )
    CONSTANT_ANGLE = "constant_angle", "the angle does not move in response to the pulses"
    CONSTANT_TORQUE = "constant_torque", "the torque does not change during the pulses"
    ILL_CONDITIONED = (
        "ill_conditioned",
        "the responses cannot tell stiffness, damping and inertia apart",
    )
    CONSTANT_CURRENT = (
        "constant_current",
        "the motor current does not change: it cannot tell the constant",
    )
    CONSTANT_COMMAND = "constant_command", "the commanded torque does not change"
    NO_COMMAND = "no_command", "the method needs the commanded torque, and none is recorded"
    TOO_FEW_SAMPLES = "too_few_samples", "the window holds too few samples for the method"
    NOT_COHERENT = "not_coherent", "command and torque have nothing in common where it matters"
    BELOW_RESOLUTION = "below_resolution", "the bandwidth lies below what the record can resolve"
    ABOVE_BAND = "above_band", "the gain has not fallen where the command still excites"
    MASS_MISSING = "mass_missing", "values per kg need the participant's mass_kg in study.toml"
    MASS_UNLIKELY = (
        "mass_unlikely",
        "mass_kg contradicts height, inertia or what people weigh: is its unit right? A note asks",
    )
    TOO_FEW_PARTICIPANTS = (
        "too_few_participants",
        "an interval over people needs at least two of them",
    )
    TOO_FEW_STUDIES = (
        "too_few_studies",
        "no study has a mean with an error: one person, or no value, in each",
    )
    TORQUE_SATURATED = (
        "torque_saturated",
        "the torque stands at one largest value below the command: a clipped sensor (nothing "
        "to be done), or a motor at its limit (give the torque it reached as amplitude_nm in "
        "the pulse table)",
    )
    OPPOSITE_SIGN = (
        "opposite_sign",
        "the joint moves against the torque: a sign is wrong (torque_acts_on)",
    )
    PULSE_SHAPE = (
        "pulse_shape",
        "the pulses differ in shape, or push both ways: this method is for pulses of one shape "
        "that push one way",
    )
    ANGLE_OUT_OF_RANGE = (
        "angle_out_of_range",
        "the angle spans more than half a turn, or turns faster than 50 rad/s: degrees taken for "
        "rad?",
    )
    TORQUE_HELD = (
        "torque_held",
        "the torque keeps each value for more than 10 ms: it was sampled too slowly, and B and J "
        "follow from the steps",
    )
    LAG_OUT_OF_RANGE = (
        "lag_out_of_range",
        "the angle is later than 30 ms, or not as late as calibrated",
    )
    OUT_OF_STEP = (
        "out_of_step",
        "torque out of step: motion comes before it, or it comes without command",
    )
    OUTSIDE_RANGE = (
        "outside_range",
        "K, B or J beyond what any joint has: wrong units, or no contact",
    )
    MODEL_MISFIT = (
        "model_misfit",
        "no joint behind a late sensor explains the response within its noise",
    )
    BELOW_ZERO = (
        "below_zero",
        "below zero by more than its error: the intrinsic impedance or another calibration "
        "contradicts the data",
    )
    TORQUE_UNLIKE_COMMAND = (
        "torque_unlike_command",
        "the torque is more than three times its command, or on a bench less than a third: is a "
        "unit wrong, or the gain of the torque?",
    )
    NOT_ONE_LOAD = (
        "not_one_load",
        "one linear load explains less than 95 % of the torque of the whole trials: torque and "
        "angle may not share a clock; if the load moves by itself, ask for the method dissertation",
    )
    WINDOW_TOO_LONG = (
        "window_too_long",
        "K and B change in a window of more than 0.12 s (method strapped: 0.25 s) in ways that "
        "the method does not follow: shorten window_s",
    )
    ANALYSIS_BROKE = "analysis_broke", "this participant's analysis broke off; a note says why"


class NotPooled(Code):
    """Why the mean of a study is not pooled with others; the status in ``studies.csv``."""

    ONE_PERSON = "one_person", "one person: the mean has no error of its own"
    NO_VALUE = "no_value", "no value: undecided or failed"
    NO_SD = "no_sd", "printed without standard deviation or number of people"
    NO_SPREAD = "no_spread", "its people do not differ at all"


class Doubt(Code):
    """What speaks against a linear joint whose estimates are available all the same."""

    RESPONSES_DIFFER_WITH_DIRECTION = (
        "responses_differ_with_direction",
        "pulses of the two directions are answered differently: a reflex, a contact or "
        "friction unlike its model may be why; intervals are widened by what that does to the"
        " average of both",
    )
    RESPONSES_NOT_PROPORTIONAL = (
        "responses_not_proportional",
        "larger pulses are not answered in proportion: stiffness that changes with the "
        "displacement, a contact or a reflex may be why; the values are those of the average "
        "size",
    )
    STEEP_CHANGE = (
        "steep_change",
        "K seems to change steeply inside the window of a timing point whose neighbour is "
        "near: K and B are undecided there, and a shorter window hardly helps; phase_curve "
        "shows how far they may be off",
    )
    LAG_UNLIKELY = (
        "lag_unlikely",
        "the responses speak against the calibrated lag by more than 100 to 1: a lag that is "
        "5 ms off changes J by a third",
    )
    INERTIA_UNLIKE_BODY = (
        "inertia_unlike_body",
        "the inertia differs from that of a leg of this mass and height by more than 2 prior "
        "sds: mass, height or units may be wrong, or the device is not strapped to soft tissue;"
        " K, B and J are undecided",
    )
    INERTIA_UNLIKE_AT_POINT = (
        "inertia_unlike_at_point",
        "the inertia at a timing point is not that of a leg of this mass and height, though that "
        "of the other points is; K and B are undecided there",
    )
    INSTRUMENTS_UNLIKELY = (
        "instruments_unlikely",
        "the responses need a sensor, strap or reflex more than 2.5 prior sds from what is usual: "
        "a signal may be late or wrong, or the device is not strapped to soft tissue; K, B and J "
        "are undecided",
    )
    HELD_TORQUE = (
        "held_torque",
        "the pulses hold one torque for as long as data are used, which does not tell the "
        "stiffness of a leg from its softening and drift: K is undecided, with limits; use "
        "doublets, or short pulses of several sizes",
    )
    RESPONSES_UNLIKE_SIZE = (
        "responses_unlike_size",
        "the responses grow with the size of the pulses much more or less than the recorded torque "
        "does: the motor may have given less than was recorded; K, B and J are undecided",
    )
    RESPONSES_MISFIT = (
        "responses_misfit",
        "the model of a strapped leg does not explain the responses within their noise; K and B "
        "are undecided",
    )


class Trip(Code):
    """Why the safety gate ended a trial; codes are added to, never renamed."""

    REQUEST_NOT_FINITE = "request_not_finite", "the controller asked for a torque that is no number"
    SENSOR_NOT_FINITE = "sensor_not_finite", "a sensor gave samples that are no numbers"
    SENSOR_STALE = "sensor_stale", "a sensor gave no new sample for too long"
    SENSOR_FROZEN = (
        "sensor_frozen",
        "a sensor repeats one value while the joint moves, or its clock stops",
    )
    POSTURE = "posture", "the joint left the range of angles it may have"
    VELOCITY = "velocity", "the joint moved faster than it may"
    TEMPERATURE = "temperature", "the motor is too hot"
    DEVICE_FAULT = "device_fault", "the device reported a fault of its own"
    OVERRUN = "overrun", "the loop missed too many slots in a row"
    PULSE_COUNT = "pulse_count", "more pulses than the wearer may be given"
    BROKEN_OFF = "broken_off", "pulse after pulse was broken off and none done"
    NO_STRIDES = "no_strides", "no accepted stride for too long"
