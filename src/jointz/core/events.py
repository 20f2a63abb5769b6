"""What happened in a recording: strides, pulses, and what was left out."""

from dataclasses import dataclass

from jointz.core.person_estimates import row_label


@dataclass(frozen=True, slots=True)
class StrideRecord:
    """A stride, from one heel strike to the next.

    Parameters
    ----------
    participant, recording, condition : str
        Where it was found.
    start_s, duration_s : float, s
        The heel strike that begins it and its length.
    code : str
        ``""`` for an accepted stride, else a code of
        :class:`jointz.core.codes.Exclusion`.
    detail : str
        More about the code.
    session, side : str
        Of the recording; "" where the study does not state them, and on a bench.
    """

    participant: str
    recording: str
    condition: str
    start_s: float
    duration_s: float
    code: str = ""
    detail: str = ""
    session: str = ""
    side: str = ""


@dataclass(frozen=True, slots=True)
class PulseRecord:
    """A perturbation pulse and what became of it.

    Parameters
    ----------
    participant, recording : str
        Where it was found.
    onset_s : float, s
        Commanded onset; of a step of the angle where its speed begins.
    duration_s : float or None, s
        Commanded length, where it is known.
    amplitude : float or None
        N*m, or rad for steps of the angle and pulses of a reference that is an angle; signed.
    timing_point : str
        Timing point, case, trial or group.
    target_pct, measured_pct : float or None
        Planned and measured onset, % of the gait cycle. The measured one is the time since the
        heel strike over the duration of the same stride; None outside accepted strides.
    code : str
        ``""`` for a pulse used, else a code of
        :class:`jointz.core.codes.Exclusion`.
    detail : str
        More about the code.
    session, side : str
        Of the recording; "" where the study does not state them, and on a bench.
    """

    participant: str
    recording: str
    onset_s: float
    duration_s: float | None
    amplitude: float | None
    timing_point: str
    target_pct: float | None = None
    measured_pct: float | None = None
    code: str = ""
    detail: str = ""
    session: str = ""
    side: str = ""

    @property
    def label(self) -> str:
        """The participant with session and side: ``S01, day 2, left``."""
        return row_label(self.participant, self.session, self.side)


@dataclass(frozen=True, slots=True)
class GapRecord:
    """A hole in the time stamps of a recording.

    Parameters
    ----------
    participant, recording : str
        Where it was found.
    start_s, duration_s : float, s
        The last sample before the hole and the time to the next.
    """

    participant: str
    recording: str
    start_s: float
    duration_s: float


@dataclass(frozen=True, slots=True)
class SamplingRecord:
    """How fast a recording was sampled.

    Parameters
    ----------
    participant, recording, condition : str
        Which recording.
    rate_hz : float
        Samples a second, from its time stamps.
    """

    participant: str
    recording: str
    condition: str
    rate_hz: float


@dataclass(frozen=True, slots=True)
class PulseEstimate:
    """Impedance from one pulse on a bench by itself (2.2.3).

    Parameters
    ----------
    participant, timing_point : str
        Load, and case or reference.
    recording, trial : str
        Where it was found.
    onset_s : float, s
        Commanded onset.
    sign : int
        +1 or -1, of its torque.
    direction : str
        ``with`` or ``against`` the reference at its onset; ``""`` where that is not recorded.
    stiffness, damping, inertia : float
        N*m/rad, N*m*s/rad, kg*m^2; the intrinsic impedance is not subtracted.
    vaf_pct : float
        Variance accounted for (2.7), %.
    method : str
        ``dissertation``: least squares without bounds on the response; ``pulse_likelihood``:
        errors in variables on the raw signals.
    """

    participant: str
    timing_point: str
    recording: str
    trial: str
    onset_s: float
    sign: int
    direction: str
    stiffness: float
    damping: float
    inertia: float
    vaf_pct: float
    method: str = "dissertation"
