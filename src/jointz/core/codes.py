"""Stable codes: why something was left out, and why an estimate failed.

Codes are part of the file format (``excluded.csv``, ``estimates.csv``): they
are added to, never renamed.
"""

from enum import StrEnum


class Exclusion(StrEnum):
    """Why a stride or a pulse was left out of the analysis."""

    GAP = "gap"
    DAMAGED_LOG = "damaged_log"
    NOT_FINITE = "not_finite"
    MISSING_STRIKE = "missing_strike"
    SPURIOUS_STRIKE = "spurious_strike"
    PULSE_IN_STRIDE = "pulse_in_stride"
    NO_RECENT_STRIDES = "no_recent_strides"
    NO_HEEL_STRIKES = "no_heel_strikes"
    EDGE_OF_RECORD = "edge_of_record"
    OVERLAPPING_PULSE = "overlapping_pulse"
    NO_BASELINE = "no_baseline"
    OUTSIDE_GROUPS = "outside_groups"
    LONE_PULSE = "lone_pulse"
    UNUSUAL_GAIT = "unusual_gait"
    UNUSUAL_RESPONSE = "unusual_response"
    CONSTANT_ANGLE = "constant_angle"
    CONSTANT_TORQUE = "constant_torque"
    COPIED_PULSE = "copied_pulse"
    NO_TORQUE = "no_torque"
    NO_RESPONSE = "no_response"
    USER = "user"

    @property
    def meaning(self) -> str:
        """One sentence for tables and tooltips."""
        return _EXCLUSION_MEANING[self]


class Failure(StrEnum):
    """Why a cell has no estimate; written as ``failed:CODE``."""

    NO_PULSES = "no_pulses"
    TOO_FEW_PULSES = "too_few_pulses"
    ALL_PULSES_EXCLUDED = "all_pulses_excluded"
    NO_HEEL_STRIKES = "no_heel_strikes"
    NO_PERTURBED_RECORDING = "no_perturbed_recording"
    NO_UNPERTURBED_RECORDING = "no_unperturbed_recording"
    NO_UNPERTURBED_STRIDES = "no_unperturbed_strides"
    CONSTANT_ANGLE = "constant_angle"
    CONSTANT_TORQUE = "constant_torque"
    ILL_CONDITIONED = "ill_conditioned"
    CONSTANT_CURRENT = "constant_current"
    CONSTANT_COMMAND = "constant_command"
    NO_COMMAND = "no_command"
    TOO_FEW_SAMPLES = "too_few_samples"
    NOT_COHERENT = "not_coherent"
    BELOW_RESOLUTION = "below_resolution"
    ABOVE_BAND = "above_band"
    MASS_MISSING = "mass_missing"
    TOO_FEW_PARTICIPANTS = "too_few_participants"
    TOO_FEW_STUDIES = "too_few_studies"
    TORQUE_SATURATED = "torque_saturated"
    OPPOSITE_SIGN = "opposite_sign"
    ANGLE_OUT_OF_RANGE = "angle_out_of_range"
    LAG_OUT_OF_RANGE = "lag_out_of_range"
    OUT_OF_STEP = "out_of_step"
    OUTSIDE_RANGE = "outside_range"
    MODEL_MISFIT = "model_misfit"
    BELOW_ZERO = "below_zero"
    WINDOW_TOO_LONG = "window_too_long"
    ANALYSIS_BROKE = "analysis_broke"

    @property
    def meaning(self) -> str:
        """One sentence for tables and tooltips."""
        return _FAILURE_MEANING[self]

    @property
    def status(self) -> str:
        """The status as it stands in ``estimates.csv``."""
        return f"failed:{self.value}"


class NotPooled(StrEnum):
    """Why the mean of a study is not pooled with others; the status in ``studies.csv``."""

    ONE_PERSON = "one_person"
    NO_VALUE = "no_value"
    NO_SD = "no_sd"
    NO_SPREAD = "no_spread"

    @property
    def meaning(self) -> str:
        """One sentence for tables and notes."""
        return _NOT_POOLED_MEANING[self]


class Doubt(StrEnum):
    """What speaks against a joint that is linear, where its estimates still stand."""

    RESPONSES_DIFFER_WITH_DIRECTION = "responses_differ_with_direction"
    RESPONSES_NOT_PROPORTIONAL = "responses_not_proportional"
    STEEP_CHANGE = "steep_change"
    LAG_UNLIKELY = "lag_unlikely"

    @property
    def meaning(self) -> str:
        """One sentence for tables and notes."""
        return _DOUBT_MEANING[self]


_EXCLUSION_MEANING = {
    Exclusion.GAP: "a gap in the time stamps lies inside it",
    Exclusion.DAMAGED_LOG: "damaged records of the session's log were left out inside it",
    Exclusion.NOT_FINITE: "samples without a number lie inside it",
    Exclusion.MISSING_STRIKE: "no heel strike where one was due: longer than the accepted band",
    Exclusion.SPURIOUS_STRIKE: "a heel strike too soon after the last: shorter than the band",
    Exclusion.PULSE_IN_STRIDE: "a pulse, or its aftermath, lies in a stride used as unperturbed",
    Exclusion.NO_RECENT_STRIDES: "fewer than three accepted strides before it: no gait phase",
    Exclusion.NO_HEEL_STRIKES: "the recording has no heel strike",
    Exclusion.EDGE_OF_RECORD: "its window runs past the beginning or end of the recording",
    Exclusion.OVERLAPPING_PULSE: "another pulse begins inside its window",
    Exclusion.NO_BASELINE: "no unperturbed data to subtract at this point of the cycle",
    Exclusion.OUTSIDE_GROUPS: "its group channel lies outside all edges",
    Exclusion.LONE_PULSE: "the only pulse at its timing point: nothing to resample",
    Exclusion.UNUSUAL_GAIT: "the walker moved before it as in no unperturbed stride",
    Exclusion.UNUSUAL_RESPONSE: "the response is far from that of all other pulses here",
    Exclusion.CONSTANT_ANGLE: "the measured angle stands still in its window: a dead sensor",
    Exclusion.CONSTANT_TORQUE: "the measured torque stands still in its window: a dead sensor",
    Exclusion.COPIED_PULSE: "its samples are those of an earlier pulse: a copy",
    Exclusion.NO_TORQUE: "the measured torque does not follow the command: no pulse was given",
    Exclusion.NO_RESPONSE: "torque never reached the joint: it did not move as in the others",
    Exclusion.USER: "left out by the study's exclusions.csv",
}

_FAILURE_MEANING = {
    Failure.NO_PULSES: "no pulse at this timing point",
    Failure.ANALYSIS_BROKE: "this participant's analysis broke off; a note says why",
    Failure.TOO_FEW_PULSES: "one pulse only: no interval can be made",
    Failure.ALL_PULSES_EXCLUDED: "every pulse was left out; excluded.csv says why",
    Failure.NO_HEEL_STRIKES: "no heel strikes in the perturbed recording",
    Failure.NO_PERTURBED_RECORDING: "the participant has no perturbed recording",
    Failure.NO_UNPERTURBED_RECORDING: "the baseline needs an unperturbed recording",
    Failure.NO_UNPERTURBED_STRIDES: "too few accepted unperturbed strides to make a baseline of",
    Failure.CONSTANT_ANGLE: "the angle does not move in response to the pulses",
    Failure.CONSTANT_TORQUE: "the torque does not change during the pulses",
    Failure.ILL_CONDITIONED: "the responses cannot tell stiffness, damping and inertia apart",
    Failure.CONSTANT_CURRENT: "the motor current does not change: it cannot tell the constant",
    Failure.CONSTANT_COMMAND: "the commanded torque does not change",
    Failure.TOO_FEW_SAMPLES: "the window holds too few samples for the method",
    Failure.NO_COMMAND: "the method needs the commanded torque, and none is recorded",
    Failure.NOT_COHERENT: "command and torque have nothing in common where it matters",
    Failure.BELOW_RESOLUTION: "the bandwidth lies below what the record can resolve",
    Failure.ABOVE_BAND: "the gain has not fallen where the command still excites",
    Failure.MASS_MISSING: "values per kg need the participant's mass_kg in study.toml",
    Failure.TOO_FEW_PARTICIPANTS: "an interval over people needs at least two of them",
    Failure.TOO_FEW_STUDIES: "no study has a mean with an error: one person, or no value, in each",
    Failure.TORQUE_SATURATED: "the torque stands at one largest value below the command: a clipped "
    "sensor (nothing to be done), or a motor at its limit (give the torque it reached as "
    "amplitude_nm in the pulse table)",
    Failure.OPPOSITE_SIGN: "the joint moves against the torque: a sign is wrong (torque_acts_on)",
    Failure.ANGLE_OUT_OF_RANGE: "the angle spans more than half a turn: degrees taken for rad?",
    Failure.LAG_OUT_OF_RANGE: "the angle is later than 30 ms, or not as late as calibrated",
    Failure.OUT_OF_STEP: "torque out of step: motion comes before it, or it comes without command",
    Failure.OUTSIDE_RANGE: "K, B or J beyond what any joint has: wrong units, or no contact",
    Failure.MODEL_MISFIT: "no joint behind a late sensor explains the response within its noise",
    Failure.BELOW_ZERO: "below zero by more than its error: the intrinsic impedance or another "
    "calibration contradicts the data",
    Failure.WINDOW_TOO_LONG: "K and B change in a window of more than 0.12 s in ways that the "
    "recommended method does not follow: shorten window_s",
}

_NOT_POOLED_MEANING = {
    NotPooled.ONE_PERSON: "one person: the mean has no error of its own",
    NotPooled.NO_VALUE: "no value: undecided or failed",
    NotPooled.NO_SD: "printed without standard deviation or number of people",
    NotPooled.NO_SPREAD: "its people do not differ at all",
}

_DOUBT_MEANING = {
    Doubt.RESPONSES_DIFFER_WITH_DIRECTION: "pulses of the two directions are answered differently: "
    "a reflex, a contact or friction unlike its model may be why; intervals are widened by what "
    "that does to the average of both",
    Doubt.RESPONSES_NOT_PROPORTIONAL: "larger pulses are not answered in proportion: stiffness "
    "that changes with the displacement, a contact or a reflex may be why; the values are those "
    "of the average size",
    Doubt.STEEP_CHANGE: "K seems to change steeply inside the window of a timing point whose "
    "neighbour is near: K and B are undecided there, and a shorter window hardly helps; "
    "phase_curve shows how far they may be off",
    Doubt.LAG_UNLIKELY: "the responses speak against the calibrated lag by more than 100 to "
    "1: a lag that is 5 ms off changes J by a third",
}
