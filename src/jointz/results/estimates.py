"""Estimates of one cell: a participant at a timing point."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from jointz.core.channels import PARAMETER_UNITS
from jointz.core.events import row_label
from jointz.results.base import Array, Result

#: Sd from the middle to the ends of a 95 % interval of a normal error.
REACH_95 = 1.959963984540054
#: Sd to a one-sided 95 % limit.
ONE_SIDED_95 = 1.6448536269514722
#: An interval that reaches further from its value than this share of it decides nothing.
WIDEST = 0.5
#: Pulses without which nothing is estimated, and people without whom nothing is averaged.
FEWEST_PULSES, FEWEST_PEOPLE = 3, 3


def relative_half_width(sd: float) -> float:
    """Return half of the 95 % interval over the value, of the sd of a logarithm."""
    return float(np.sinh(REACH_95 * sd))


def decides(value: float, reach: float) -> bool:
    """Return whether an interval of this half-width is narrow enough to decide a value."""
    return reach <= WIDEST * abs(value)


@dataclass(frozen=True, slots=True)
class ParameterEstimate:
    """One estimated parameter with its interval and how it was made.

    Parameters
    ----------
    name : str
        ``stiffness``, ``damping``, ``inertia``, ``stiffness_per_mass`` or
        ``damping_per_mass``; of some methods also ``stiffness_onset`` and ``damping_onset``, for
        small displacements at the onset of the pulse.
    value : float or None
        The estimate, SI; None where there is none.
    ci_low, ci_high : float or None
        Ends of the interval. Under status ``at_bound`` the interval is
        one-sided: ``ci_low`` is the bound, ``ci_high`` the upper limit.
    status : str
        ``ok``, ``at_bound``, ``undecided`` or ``failed:CODE``.
    ci_level : float
        Level of the interval.
    ci_method : str
        How the interval was made.
    share_at_bound : float
        Share of the replicates whose value stood at the bound, 0..1.
    unbounded : float or None
        The estimate without bounds.
    """

    name: str
    value: float | None
    ci_low: float | None
    ci_high: float | None
    status: str
    ci_level: float = 0.95
    ci_method: str = ""
    share_at_bound: float = 0.0
    unbounded: float | None = None

    @property
    def unit(self) -> str:
        """The unit of value and interval."""
        return PARAMETER_UNITS[self.name]

    @property
    def ci(self) -> tuple[float | None, float | None]:
        """Ends of the interval, low and high."""
        return self.ci_low, self.ci_high

    @property
    def available(self) -> bool:
        """Whether there is a value to use."""
        return self.status in ("ok", "at_bound")


@dataclass(frozen=True, slots=True, eq=False)
class Response(Result):
    """The average response of a cell to its pulses, baseline removed."""

    time_s: Array  # time from the onset
    angle: Array  # average angle response, rad
    torque: Array  # average torque response, N*m
    # torque of the fitted model, N*m; the measured one where the angle was fitted
    fitted_torque: Array
    fitted_angle: Array | None = None  # angle of the fitted model, rad, where the angle was fitted
    n_pulses: int | None = None  # pulses averaged, where they are not all that the cell used

    def __eq__(self, other: object) -> bool:
        # The one of dataclasses compares tuples of arrays, which have no single truth.
        if not isinstance(other, Response):
            return NotImplemented
        pairs = [(getattr(self, f.name), getattr(other, f.name)) for f in fields(self)]
        return all(
            a is b or (a is not None and b is not None and np.array_equal(a, b, equal_nan=True))
            for a, b in pairs
        )


@dataclass(frozen=True, slots=True, eq=False)
class PulseExample(Result):
    """One pulse as measured, with its baseline: the pulse of median distance from the average."""

    recording: str  # file of the recording
    onset_s: float  # time of the onset in the recording, s
    time_s: Array  # time from the onset
    angle: Array  # measured angle, raw or filtered, as the method uses it, rad
    torque: Array  # measured torque, raw or filtered, as the method uses it, N*m
    baseline_angle: Array  # angle without the pulse, rad
    baseline_torque: Array  # torque without the pulse, N*m
    # measured minus baseline of the signal that is fitted, with the sign and the corrections of
    # the average response: rad or N*m
    response: Array
    n_averaged: int  # number of pulses in the average response that is fitted


@dataclass(frozen=True, slots=True, repr=False)
class CellEstimate(Result):
    """Impedance of one participant at one timing point, case or group.

    Parameters
    ----------
    participant : str
        The participant's id.
    timing_point : str
        Timing point, or the case, trial or group of a bench study.
    onset_gait_pct : float or None
        Mean measured onset of the pulses used, % of the gait cycle.
    parameters : tuple of ParameterEstimate
        The parameters.
    vaf_pct : float or None
        Variance accounted for on the average response (2.7), %.
    n_used, n_excluded : int
        Pulses used and left out; together all pulses at this timing point.
    method : str
        Name of the method.
    baseline : str
        What was subtracted as unperturbed motion.
    condition_number : float or None
        Of the scaled regressors.
    displacement_rad : float or None
        Largest angle response inside the window.
    response : Response or None
        The average response, for figures; of pulses of several shapes, sizes or signs, that of
        the most frequent ones.
    other_shapes : tuple of Response
        The average responses to the other shapes, sizes and signs, as signed.
    nuisance : tuple of ParameterEstimate
        What had to be estimated beside the impedance: friction, lag of a record.
    centre_gait_pct : float or None
        Mean phase at which the response depends on the stiffness, % of the gait cycle.
    gravity_corrected : ParameterEstimate or None
        The stiffness without the part by gravity, where that part is known.
    budget : mapping of str to mapping
        Parameter -> source of error -> standard deviation, SI.
    through_instruments : mapping of str to mapping
        Parameter -> property of the instruments, such as ``lag`` -> standard deviation, SI, of the
        part of the error that would vanish if the property were known exactly; ``pulses``: with
        twice as many. These parts overlap with the sources of the budget.
    covariance : tuple of tuple of float, or None
        (3, 3), SI: of the errors of K, B and J without bounds, calibration included; None for
        methods without it.
    prior_effects : mapping of str to tuple of float
        Parameter -> shift of the value, and reduction of the variance of its error, by the priors
        of K, B and J, SI; empty for methods without priors.
    session, side : str
        Of the perturbed recordings; "" where the study does not state them, and on a bench.
    example : PulseExample or None
        One of the pulses, for figures.
    """

    participant: str
    timing_point: str
    onset_gait_pct: float | None
    parameters: tuple[ParameterEstimate, ...]
    vaf_pct: float | None
    n_used: int
    n_excluded: int
    method: str
    baseline: str = ""
    condition_number: float | None = None
    displacement_rad: float | None = None
    response: Response | None = None
    nuisance: tuple[ParameterEstimate, ...] = ()
    centre_gait_pct: float | None = None
    gravity_corrected: ParameterEstimate | None = None
    budget: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    covariance: tuple[tuple[float, ...], ...] | None = None
    through_instruments: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    prior_effects: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    session: str = ""
    side: str = ""
    example: PulseExample | None = None
    other_shapes: tuple[Response, ...] = ()

    @property
    def responses(self) -> tuple[Response, ...]:
        """The average responses to all shapes of pulse, the most frequent first."""
        return () if self.response is None else (self.response, *self.other_shapes)

    @property
    def label(self) -> str:
        """The participant with session and side: ``S01, day 2, left``."""
        return row_label(self.participant, self.session, self.side)

    def parameter(self, name: str) -> ParameterEstimate | None:
        """Return a parameter by name, None if the cell does not have it."""
        return next((p for p in self.parameters if p.name == name), None)

    @property
    def stiffness(self) -> ParameterEstimate | None:
        """The stiffness K."""
        return self.parameter("stiffness")

    @property
    def damping(self) -> ParameterEstimate | None:
        """The damping B."""
        return self.parameter("damping")

    @property
    def inertia(self) -> ParameterEstimate | None:
        """The inertia J."""
        return self.parameter("inertia")

    def rows(self) -> list[dict[str, Any]]:
        """Return one row a parameter, in the columns of ``estimates.csv``."""
        columns = {"parameter": "name"}
        return [
            {
                name: getattr(p if name in _OF_PARAMETER else self, columns.get(name, name))
                for name in ESTIMATE_COLUMNS
            }
            for p in self.parameters
        ]


#: Columns of ``estimates.csv`` and ``comparison.csv``.
ESTIMATE_COLUMNS = (
    "participant",
    "timing_point",
    "onset_gait_pct",
    "parameter",
    "value",
    "unit",
    "ci_low",
    "ci_high",
    "ci_level",
    "vaf_pct",
    "n_used",
    "n_excluded",
    "method",
    "status",
    "session",
    "side",
)
_OF_PARAMETER = ("parameter", "value", "unit", "ci_low", "ci_high", "ci_level", "status")
