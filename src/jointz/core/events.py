"""Events of a recording: strides, pulses, gaps, with the reasons for exclusion."""

from dataclasses import dataclass


def row_label(participant: str, session: str = "", side: str = "") -> str:
    """Return what tables and figures call a participant's session and side."""
    return ", ".join(filter(None, (participant, session, side)))


@dataclass(frozen=True, slots=True)
class StrideRecord:
    """A stride, from one heel strike to the next."""

    participant: str  # where it was found
    recording: str
    condition: str
    start_s: float  # s: the heel strike that begins it and its length
    duration_s: float  # s
    # ``""`` for an accepted stride, else a code of :class:`jointz.core.codes.Exclusion`
    code: str = ""
    detail: str = ""  # more about the code
    session: str = ""  # of the recording; "" where the study does not state them, and on a bench
    side: str = ""


@dataclass(frozen=True, slots=True)
class PulseRecord:
    """A perturbation pulse, used or excluded."""

    participant: str  # where it was found
    recording: str
    onset_s: float  # s: commanded onset; of a step of the angle where its speed begins
    duration_s: float | None  # s: commanded length, where it is known
    # N*m, or rad for steps of the angle and pulses of a reference that is an angle; signed
    amplitude: float | None
    timing_point: str  # timing point, case, trial or group
    # planned and measured onset, % of the gait cycle. The measured one is the time since the heel
    # strike over the duration of the same stride; None outside accepted strides
    target_pct: float | None = None
    measured_pct: float | None = None
    code: str = ""  # ``""`` for a pulse used, else a code of :class:`jointz.core.codes.Exclusion`
    detail: str = ""  # more about the code
    session: str = ""  # of the recording; "" where the study does not state them, and on a bench
    side: str = ""

    @property
    def label(self) -> str:
        """The participant with session and side: ``S01, day 2, left``."""
        return row_label(self.participant, self.session, self.side)


@dataclass(frozen=True, slots=True)
class GapRecord:
    """A hole in the time stamps of a recording."""

    participant: str  # where it was found
    recording: str
    start_s: float  # s: the last sample before the hole and the time to the next
    duration_s: float  # s


@dataclass(frozen=True, slots=True)
class SamplingRecord:
    """The sampling rate of a recording."""

    participant: str
    recording: str
    condition: str
    rate_hz: float  # samples a second, from its time stamps


@dataclass(frozen=True, slots=True)
class PulseEstimate:
    """Impedance estimated from a single pulse on a bench (2.2.3)."""

    participant: str  # load, and case or reference
    timing_point: str
    recording: str  # where it was found
    trial: str
    onset_s: float  # s: commanded onset
    sign: int  # +1 or -1, of its torque
    # ``with`` or ``against`` the reference at its onset; ``""`` where that is not recorded
    direction: str
    stiffness: float  # N*m/rad, N*m*s/rad, kg*m^2; the intrinsic impedance is not subtracted
    damping: float
    inertia: float
    vaf_pct: float  # variance accounted for (2.7), %
    # ``dissertation``: least squares without bounds on the response; ``pulse_likelihood``: errors
    # in variables on the raw signals
    method: str = "dissertation"
