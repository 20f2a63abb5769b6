"""Events of a recording: strides, pulses, gaps, with the reasons for exclusion."""

from dataclasses import dataclass


def row_label(participant: str, session: str = "", side: str = "") -> str:
    """Return what tables and figures call a participant's session and side."""
    return ", ".join(filter(None, (participant, session, side)))


@dataclass(frozen=True, slots=True)
class StrideRecord:
    """A stride, from one heel strike to the next."""

    participant: str
    recording: str  # file of the recording, as the study names it
    condition: str
    start_s: float  # heel strike at the start of the stride
    duration_s: float  # time to the next heel strike
    # ``""`` for an accepted stride, else a code of :class:`jointz.core.codes.Exclusion`
    code: str = ""
    detail: str = ""  # more about the code
    session: str = ""  # session of the recording; "" if the study does not state it, and on a bench
    side: str = ""  # side of the recording; "" if the study does not state it, and on a bench


@dataclass(frozen=True, slots=True)
class PulseRecord:
    """A perturbation pulse, used or excluded."""

    participant: str
    recording: str  # file of the recording, as the study names it
    onset_s: float  # commanded onset; for a step of the angle, the start of its velocity
    duration_s: float | None  # commanded duration; None if unknown
    # signed; N*m, or rad for steps of the angle and pulses of a reference angle; None if unknown
    amplitude: float | None
    timing_point: str  # name of timing point, case, trial or group
    target_pct: float | None = None  # planned onset, % of the gait cycle; None if not planned
    # measured onset, % of the gait cycle: time since the heel strike over the duration of the same
    # stride; None outside accepted strides
    measured_pct: float | None = None
    code: str = ""  # ``""`` for a pulse used, else a code of :class:`jointz.core.codes.Exclusion`
    detail: str = ""  # more about the code
    session: str = ""  # session of the recording; "" if the study does not state it, and on a bench
    side: str = ""  # side of the recording; "" if the study does not state it, and on a bench

    @property
    def label(self) -> str:
        """The participant with session and side: ``S01, day 2, left``."""
        return row_label(self.participant, self.session, self.side)


@dataclass(frozen=True, slots=True)
class GapRecord:
    """A hole in the time stamps of a recording."""

    participant: str
    recording: str  # file of the recording, as the study names it
    start_s: float  # time of the last sample before the hole
    duration_s: float  # time from there to the next sample


@dataclass(frozen=True, slots=True)
class SamplingRecord:
    """The sampling rate of a recording."""

    participant: str
    recording: str  # file of the recording, as the study names it
    condition: str
    rate_hz: float  # from the time stamps


@dataclass(frozen=True, slots=True)
class PulseEstimate:
    """Impedance estimated from a single pulse on a bench (2.2.3)."""

    participant: str  # participant or load
    timing_point: str  # case or reference
    recording: str  # file of the recording, as the study names it
    trial: str  # trial of the recording
    onset_s: float  # commanded onset
    sign: int  # sign of its torque: +1 or -1
    # direction to the reference at its onset: ``with`` or ``against``; "" if not recorded
    direction: str
    stiffness: float  # N*m/rad; intrinsic impedance included
    damping: float  # N*m*s/rad; intrinsic impedance included
    inertia: float  # kg*m^2; intrinsic impedance included
    vaf_pct: float  # variance accounted for (2.7), %
    # ``dissertation``: least squares without bounds on the response; ``pulse_likelihood``: errors
    # in variables on the raw signals
    method: str = "dissertation"
