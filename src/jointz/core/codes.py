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
    DAMAGED_LOG = (
        "damaged_log",
        "damaged records of the session's log inside it were discarded",
    )
    NOT_FINITE = (
        "not_finite",
        "it contains samples without a number",
    )
    MISSING_STRIKE = (
        "missing_strike",
        "a heel strike is missing: longer than the accepted band",
    )
    SPURIOUS_STRIKE = (
        "spurious_strike",
        "a heel strike too soon after the last: shorter than the band",
    )
    PULSE_IN_STRIDE = (
        "pulse_in_stride",
        "the unperturbed stride contains a pulse or its aftermath",
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
        "its onset is more than 10 % of the gait cycle from its timing point in the table",
    )
    LONE_PULSE = "lone_pulse", "the only pulse at its timing point: nothing to resample"
    UNUSUAL_GAIT = (
        "unusual_gait",
        "the gait before it is unlike that of all unperturbed strides",
    )
    UNUSUAL_RESPONSE = (
        "unusual_response",
        "the response is far from all others at this timing point",
    )
    CONSTANT_ANGLE = (
        "constant_angle",
        "the measured angle is constant in its window: a dead sensor",
    )
    CONSTANT_TORQUE = (
        "constant_torque",
        "the measured torque is constant in its window: a dead sensor",
    )
    COPIED_PULSE = (
        "copied_pulse",
        "its samples are a copy of an earlier pulse",
    )
    NO_TORQUE = "no_torque", "the measured torque does not follow the command: no pulse was given"
    NO_RESPONSE = (
        "no_response",
        "the joint did not move as in the other pulses: torque did not reach it",
    )
    USER = (
        "user",
        "excluded by the study's exclusions.csv",
    )
    # ``jointz run`` writes the meaning as the reason in ``exclusions.csv``, by which it is known.
    ABORTED = "aborted", "broken off during the run and done again"


#: Codes of the lines of ``exclusions.csv``.
LISTED = (Exclusion.USER, Exclusion.ABORTED)


class Failure(FailureCode):
    """Why a cell has no estimate; written as ``failed:CODE``."""

    NO_PULSES = "no_pulses", "no pulse at this timing point"
    TOO_FEW_PULSES = (
        "too_few_pulses",
        "fewer than three pulses allow no interval",
    )
    ALL_PULSES_EXCLUDED = (
        "all_pulses_excluded",
        "all pulses are excluded; excluded.csv gives the reasons",
    )
    NO_HEEL_STRIKES = "no_heel_strikes", "no heel strikes in the perturbed recording"
    NO_PERTURBED_RECORDING = "no_perturbed_recording", "the participant has no perturbed recording"
    NO_UNPERTURBED_RECORDING = (
        "no_unperturbed_recording",
        "the baseline needs an unperturbed recording",
    )
    NO_UNPERTURBED_STRIDES = (
        "no_unperturbed_strides",
        "too few accepted unperturbed strides for a baseline",
    )
    CONSTANT_ANGLE = "constant_angle", "the angle does not move in response to the pulses"
    CONSTANT_TORQUE = "constant_torque", "the torque does not change during the pulses"
    ILL_CONDITIONED = (
        "ill_conditioned",
        "the responses do not separate stiffness, damping and inertia",
    )
    CONSTANT_CURRENT = (
        "constant_current",
        "the motor current is constant: the torque constant is not identifiable",
    )
    CONSTANT_COMMAND = "constant_command", "the commanded torque does not change"
    NO_COMMAND = (
        "no_command",
        "the method needs a commanded torque; none is recorded",
    )
    TOO_FEW_SAMPLES = (
        "too_few_samples",
        "the window has too few samples for the method",
    )
    NOT_COHERENT = (
        "not_coherent",
        "command and torque are not coherent at the frequencies that matter",
    )
    BELOW_RESOLUTION = (
        "below_resolution",
        "the bandwidth is below the frequency resolution of the record",
    )
    ABOVE_BAND = (
        "above_band",
        "the gain does not drop within the frequencies of the command",
    )
    MASS_MISSING = "mass_missing", "values per kg need the participant's mass_kg in study.toml"
    MASS_UNLIKELY = (
        "mass_unlikely",
        "mass_kg contradicts height, inertia or the usual mass of people: check its unit",
    )
    TOO_FEW_PARTICIPANTS = (
        "too_few_participants",
        "a mean over people needs at least three",
    )
    TOO_FEW_STUDIES = (
        "too_few_studies",
        "no study has a mean with a standard error: each has one person or no value",
    )
    TORQUE_SATURATED = (
        "torque_saturated",
        "the torque stays at one largest value below the command: a clipped sensor (no "
        "remedy) or a motor at its limit (give the torque it reached as amplitude_nm in "
        "the pulse table)",
    )
    OPPOSITE_SIGN = (
        "opposite_sign",
        "the joint moves against the torque: a sign is wrong (torque_acts_on)",
    )
    PULSE_SHAPE = (
        "pulse_shape",
        "the pulses differ in shape or direction, but the method needs one shape and one direction",
    )
    ANGLE_OUT_OF_RANGE = (
        "angle_out_of_range",
        "the angle spans more than half a turn or exceeds 50 rad/s: degrees declared as rad?",
    )
    TORQUE_HELD = (
        "torque_held",
        "the torque repeats each value for more than 10 ms: sampled too slowly for B and J",
    )
    LAG_OUT_OF_RANGE = (
        "lag_out_of_range",
        "the angle is later than 30 ms, or not as late as calibrated",
    )
    OUT_OF_STEP = (
        "out_of_step",
        "motion precedes torque, or torque comes without command",
    )
    SENSORS_DISAGREE = (
        "sensors_disagree",
        "the sensors of the motion show walking with gains that differ by more than 40 %; it "
        "is unknown which one is wrong; it may be the angle",
    )
    CLOCKS_DRIFT = "clocks_drift", "the clocks of angle and torque drift apart"
    OUTSIDE_RANGE = (
        "outside_range",
        "K, B or J is impossible for a joint: wrong units, or no contact",
    )
    MODEL_MISFIT = (
        "model_misfit",
        "the fitted joint, device and sensors do not explain the response within its noise",
    )
    BELOW_ZERO = (
        "below_zero",
        "below zero by more than its error: the intrinsic impedance or another calibration "
        "is wrong",
    )
    TORQUE_UNLIKE_COMMAND = (
        "torque_unlike_command",
        "over the pulses the torque is less than 0.7 or more than 1.4 times its command: check "
        "units and gains of both",
    )
    NOT_ONE_LOAD = (
        "not_one_load",
        "one linear load explains less than 95 % of the torque of whole trials: torque and "
        "angle may not share a clock; if the load moves by itself, use the method "
        "dissertation",
    )
    WINDOW_TOO_LONG = (
        "window_too_long",
        "the window exceeds 0.25 s, in which K and B change too much for the method: shorten "
        "window_s",
    )
    ANALYSIS_BROKE = (
        "analysis_broke",
        "this participant's analysis stopped with an error; a note gives the cause",
    )


class NotPooled(Code):
    """Why the mean of a study is not pooled with others; the status in ``studies.csv``."""

    ONE_PERSON = "one_person", "one person: the mean has no error of its own"
    NO_VALUE = "no_value", "no value: undecided or failed"
    NO_SPREAD = "no_spread", "its people do not differ at all"


class Doubt(Code):
    """What speaks against a linear joint whose estimates are available all the same."""

    RESPONSES_DIFFER_WITH_DIRECTION = (
        "responses_differ_with_direction",
        "responses to pulses of the two directions differ: perhaps a reflex, a contact or "
        "wrong friction; intervals are widened by the effect on the average",
    )
    RESPONSES_NOT_PROPORTIONAL = (
        "responses_not_proportional",
        "responses are not proportional to the pulses: perhaps stiffness changes with the "
        "displacement, or a contact or a reflex; values are those of the average size",
    )
    STEEP_CHANGE = (
        "steep_change",
        "K seems to change steeply inside the window of a timing point close to another: K "
        "and B are undecided there, a shorter window hardly helps",
    )
    LAG_UNLIKELY = (
        "lag_unlikely",
        "the responses contradict the calibrated lag by 3.5 sds: a lag error of 5 ms changes J by "
        "a third",
    )
    INERTIA_UNLIKE_BODY = (
        "inertia_unlike_body",
        "the inertia differs by more than 2 prior sds from a leg of this mass and height: "
        "mass, height or units may be wrong, or the device is not strapped to soft tissue; "
        "K, B and J are undecided",
    )
    INERTIA_UNLIKE_AT_POINT = (
        "inertia_unlike_at_point",
        "the inertia fits a leg of this mass and height at the other timing points, but "
        "not at this one; K and B are undecided there",
    )
    INSTRUMENTS_UNLIKELY = (
        "instruments_unlikely",
        "the responses need a sensor, strap or reflex too far from the usual (more than 2.5 prior "
        "sds; with several sensors 3.5, or all together beyond 99.9 %): a signal may be late or "
        "wrong, or the coupling is not the stated one; K, B and J are undecided; a note "
        "names the parameter",
    )
    SENSORS_CONTRADICT = (
        "sensors_contradict",
        "one sensor of the motion contradicts the others, or the model of all sensors is unlikely "
        "and that of fewer is not: values are those of the others, which agree; a note names it",
    )
    HELD_TORQUE = (
        "held_torque",
        "the pulses hold one torque throughout the window, so that stiffness and damping cannot "
        "be separated from softening and drift: K and B are undecided, with limits; use "
        "doublets, or short pulses of several sizes",
    )
    RESPONSES_UNLIKE_SIZE = (
        "responses_unlike_size",
        "the responses do not grow with the recorded torque of the pulses: the motor may "
        "have given less than was recorded; K, B and J are undecided",
    )
    RESPONSES_MISFIT = (
        "responses_misfit",
        "the model of leg and device does not explain the responses within their noise; K and B "
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
