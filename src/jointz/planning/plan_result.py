"""Result of ``jointz plan``: expected half-widths, and measures that make them smaller."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from jointz.report.wording import ABSOLUTE, SYMBOLS
from jointz.results.base import PlottedResult, record_frame
from jointz.results.estimates import WIDEST
from jointz.results.figure_style import BLUE, INK, MUTED, VERMILION, Axes

#: Wider intervals are undecided; wider ones still are not drawn in full.
_DECIDED_PCT, _WIDEST_PCT = 100.0 * WIDEST, 150.0
#: Parameters and their symbols.
LETTERS: Mapping[str, str] = dict(zip(ABSOLUTE, SYMBOLS, strict=True))


@dataclass(frozen=True, slots=True)
class PlannedEstimate:
    """Expected half-width of K, B or J at a timing point.

    Parameters
    ----------
    timing_point : str
        Its name.
    gait_pct : float
        Onset of the pulses, % of the gait cycle.
    parameter : str
        ``stiffness``, ``damping`` or ``inertia``.
    pulses : int
        Pulses of a participant at the timing point.
    half_width_pct : float
        Half of the 95 % interval of a typical leg, % of the value.
    assured_pct : float
        Half-width that the wanted share of legs does not exceed, %.
    decided_share : float
        Share of legs in which the value is decided.
    endless_pct : float
        Half-width of a typical leg with any number of pulses, %: errors other than noise.
    decidable : bool
        Whether any number of pulses decides the value of a typical leg.
    reflex_bias_pct : float
        Bias of an estimator without a reflex, of a typical leg, %.
    """

    timing_point: str
    gait_pct: float
    parameter: str
    pulses: int
    half_width_pct: float
    assured_pct: float
    decided_share: float
    endless_pct: float
    decidable: bool
    reflex_bias_pct: float


@dataclass(frozen=True, slots=True)
class PlannedShape:
    """Pulses that were compared.

    Parameters
    ----------
    name : str
        Of the pulses.
    text : str
        Shapes, sizes and directions in words.
    peak_deg : float
        Motion of the joint that 9 of 10 legs do not exceed, degrees.
    stiffness_pct, damping_pct, inertia_pct : float
        Half-width of a typical leg, median over timing points, %, for the same number of pulses.
    chosen : bool
        Whether the plan has them.
    why_not : str
        Why they cannot be chosen; "" if they can.
    """

    name: str
    text: str
    peak_deg: float
    stiffness_pct: float
    damping_pct: float
    inertia_pct: float
    chosen: bool = False
    why_not: str = ""


@dataclass(frozen=True, slots=True)
class PlannedMeasure:
    """Half-widths with another sensor, calibration or number of pulses.

    Parameters
    ----------
    what : str
        What would be measured.
    stiffness_pct, damping_pct, inertia_pct : float
        Half-width of a typical leg with it, median over timing points, %.
    """

    what: str
    stiffness_pct: float
    damping_pct: float
    inertia_pct: float


@dataclass(frozen=True, slots=True)
class PlannedPeople:
    """Half-widths and smallest differences for a number of people.

    Parameters
    ----------
    participants : int
        People; for groups, in each.
    parameter : str
        ``stiffness``, ``damping`` or ``inertia``.
    mean_pct : float
        Half-width of the mean, median over timing points, %.
    paired_pct, groups_pct : float
        Smallest difference between two conditions of the same people, and between two groups, that
        is found with the wanted power, median over timing points, %.
    difference_half_width_pct : float
        Half-width of a difference between two conditions of the same people, %.
    """

    participants: int
    parameter: str
    mean_pct: float
    paired_pct: float
    groups_pct: float
    difference_half_width_pct: float


@dataclass(frozen=True, slots=True)
class PlannedCourse:
    """Commanded torque of a pulse.

    Parameters
    ----------
    name : str
        Of the shape; "" for the only one.
    times_s : tuple of float, s
        From the onset.
    shares : tuple of float
        Torque over the amplitude at these times, with two values at a step.
    amplitudes_nm : tuple of float, N*m
        Sizes.
    signs : tuple of float
        Directions that take turns.
    """

    name: str
    times_s: tuple[float, ...]
    shares: tuple[float, ...]
    amplitudes_nm: tuple[float, ...]
    signs: tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Plan(PlottedResult):
    """A plan of a perturbation experiment; made by :func:`jointz.plan`.

    Parameters
    ----------
    protocol : str
        Name of the protocol that was planned.
    pulses : str
        Shapes, sizes and directions of the pulses.
    window_s : float, s
        Window of the analysis.
    sensors : tuple of str
        Sensors of the joint's motion.
    walking : str
        Where the variability of walking is from.
    estimates : tuple of PlannedEstimate
        By timing point and parameter.
    shapes : tuple of PlannedShape
        Pulses that were compared.
    measures : tuple of PlannedMeasure
        Half-widths with other sensors and calibrations.
    people : tuple of PlannedPeople
        Half-widths and detectable differences by number of people.
    participants : int
        Participants of the plan.
    minutes : float
        Walking of a participant, min.
    peak_deg : float
        Motion of the joint that 9 of 10 legs do not exceed, degrees.
    wishes : mapping
        Wanted half-widths, differences and limits.
    refused : tuple of str
        Wishes that cannot be kept, each with the nearest one that can; empty if all are kept.
    notes : tuple of str
        Notes for the reader.
    sources : mapping
        Parameter -> source of error -> share of the variance of a typical leg that it explains.
    courses : tuple of PlannedCourse
        Torque of the pulses over time.
    recorded : bool
        Whether this is a study that was recorded already.
    reached : mapping
        Of a recorded study: parameter -> timing point -> median half-width, %.
    aborted_share : float or None
        Share of the pulses that the limit of displacement is expected to abort; None without one.
    protocol_text : str
        Protocol file, which ``jointz run`` takes; "" if wishes were refused, or for a recorded
        study.
    provenance : mapping
        Versions, seed and files.
    """

    SCHEMA: ClassVar[str] = "jointz.Plan/1"
    FIGURE_SIZE: ClassVar[tuple[float, float]] = (8.0, 3.6)

    protocol: str
    pulses: str
    window_s: float
    sensors: tuple[str, ...]
    walking: str
    estimates: tuple[PlannedEstimate, ...]
    shapes: tuple[PlannedShape, ...]
    measures: tuple[PlannedMeasure, ...]
    people: tuple[PlannedPeople, ...]
    participants: int
    minutes: float
    peak_deg: float
    wishes: Mapping[str, Any] = field(default_factory=dict)
    refused: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    sources: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    courses: tuple[PlannedCourse, ...] = ()
    recorded: bool = False
    reached: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    aborted_share: float | None = None
    protocol_text: str = ""
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def timing_points(self) -> tuple[str, ...]:
        """Timing points in the order of the gait cycle."""
        return tuple(dict.fromkeys(e.timing_point for e in self.estimates))

    @property
    def undecidable(self) -> tuple[PlannedEstimate, ...]:
        """Estimates of a typical leg that no number of pulses decides."""
        return tuple(e for e in self.estimates if not e.decidable)

    def estimate(self, timing_point: str, parameter: str) -> PlannedEstimate:
        """Return what is expected of a parameter at a timing point; KeyError if there is none."""
        for estimate in self.estimates:
            if (estimate.timing_point, estimate.parameter) == (timing_point, parameter):
                return estimate
        raise KeyError(f"no {parameter} at {timing_point} in this plan")

    def to_frame(self) -> pd.DataFrame:
        """Return one row for each timing point and parameter."""
        return record_frame(self.estimates, PlannedEstimate.__dataclass_fields__)

    def summary(self) -> str:
        """Return a short text."""
        counts = {e.timing_point: e.pulses for e in self.estimates}
        lines = [
            f"{self.protocol}: {self.pulses}",
            f"  {self.participants} participants, {self.minutes:.0f} min of walking each; pulses: "
            + ", ".join(f"{point} {n}" for point, n in counts.items()),
        ]
        for name, letter in LETTERS.items():
            half_widths = ", ".join(
                f"{e.timing_point} {e.half_width_pct:.0f}"
                for e in self.estimates
                if e.parameter == name
            )
            lines.append(f"  {letter}, half-width of a typical leg (%): {half_widths}")
        if self.undecidable:
            cells = (f"{LETTERS[e.parameter]} at {e.timing_point}" for e in self.undecidable)
            lines.append(f"  No number of pulses decides {', '.join(cells)}.")
        lines[1:1] = [f"  Refused: {text}" for text in self.refused]
        return "\n".join(lines)

    def _draw(self, axes: "Axes") -> None:
        points = self.timing_points
        at = np.arange(len(points), dtype=float)
        for k, (name, colour) in enumerate(zip(LETTERS, (BLUE, VERMILION, MUTED), strict=True)):
            estimates = [self.estimate(point, name) for point in points]
            x = at + 0.22 * (k - 1)
            endless = [e.endless_pct for e in estimates]
            assured = [e.assured_pct for e in estimates]
            half_widths = [e.half_width_pct for e in estimates]
            axes.vlines(x, endless, assured, color=colour, linewidth=4.0, alpha=0.35)
            axes.plot(x, half_widths, "o", color=colour, label=LETTERS[name])
        axes.axhline(_DECIDED_PCT, color=INK, linewidth=0.8, linestyle=":")
        axes.set_xticks(at, points)
        widest = max(e.assured_pct for e in self.estimates)
        axes.set_ylim(0.0, min(max(1.1 * widest, 1.1 * _DECIDED_PCT), _WIDEST_PCT))
        axes.set_ylabel("half-width (%)")
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False)
        axes.set_title("undecided above the dotted line", loc="right", fontsize="small")
