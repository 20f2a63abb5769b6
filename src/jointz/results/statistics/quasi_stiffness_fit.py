"""Quasi-stiffness over the gait cycle, and beside the stiffness of perturbations."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import pandas as pd

from jointz.core.codes import Code
from jointz.results.base import Axes, PlottedResult, record_frame, summary_text

#: Slope over the phase; slope over a window about the timing point; moment over angle.
MEASURES = ("slope", "local_slope", "secant")
#: The curve enters a regression by interpolated values this far apart, % of the cycle.
STEP_PCT = 0.25
#: Width of the window of a local slope, % of the cycle.
WINDOW_PCT = 6.0

_DEGREE = 57.29577951308232


class QuasiStiffnessDoubt(Code):
    """Why a quasi-stiffness is not to be relied on; part of the file format."""

    ANGLE_TURNS = "angle_turns", "the angle turns here, so one angle has two moments"
    SMALL_RANGE = "small_range", "the angle moves less than a degree here"
    NOT_A_LINE = "not_a_line", "less than half of the moment's variation follows the angle"
    SMALL_ANGLE = "small_angle", "the angle is within a degree of its zero"
    TOO_FEW_NODES = "too_few_nodes", "fewer than three nodes of the curve lie here"
    NO_RANGE = "no_range", "the angle does not move here, or is zero"


@dataclass(frozen=True, slots=True)
class QuasiStiffnessEstimate:
    """One quasi-stiffness at one timing point."""

    timing_point: str  # such as ``LRE``
    onset_gait_pct: float  # onset of the timing point, % of the gait cycle
    measure: str  # one of :data:`MEASURES`
    value: float | None  # moment over angle, in ``QuasiStiffness.unit``; None where there is none
    start_gait_pct: float  # start of the range used, % of the gait cycle
    # end of the range used, % of the gait cycle; equal to the start for the secant
    end_gait_pct: float
    # share of the moment's variance explained by the line; None for the secant and for a constant
    # moment
    r_squared: float | None
    angle_range_rad: float | None  # range of the angle under the line; None for the secant
    # share of the angle's travel in the minor direction, 0 (monotone) to 0.5; None for the secant
    backtrack: float | None
    # ``ok``, ``ill_conditioned`` (a value with doubts) or ``undecided`` (no value)
    status: str = "ok"
    doubts: tuple[str, ...] = ()  # see :class:`QuasiStiffnessDoubt`


@dataclass(frozen=True, slots=True, repr=False)
class QuasiStiffness(PlottedResult):
    """Quasi-stiffness of a mean stride: how moment goes with angle in unperturbed gait.

    Parameters
    ----------
    estimates : tuple of QuasiStiffnessEstimate
        Every measure at every timing point.
    unit : str
        ``N*m/rad`` or ``N*m/rad/kg``.
    gait_pct, angle, moment : tuple of float
        The curve as it was given: % of the gait cycle, rad, N*m or N*m/kg.
    settings : mapping
        Everything that was chosen, and the version of jointz.
    notes : tuple of str
        What a reader of the numbers must know.
    """

    SCHEMA: ClassVar[str] = "jointz.QuasiStiffness/1"
    FIGURE_SIZE: ClassVar[tuple[float, float]] = (6.0, 4.5)

    estimates: tuple[QuasiStiffnessEstimate, ...]
    unit: str
    gait_pct: tuple[float, ...]
    angle: tuple[float, ...]
    moment: tuple[float, ...]
    settings: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def estimate(self, timing_point: str, measure: str = "slope") -> QuasiStiffnessEstimate:
        """Return one estimate, of one of :data:`MEASURES`; KeyError if there is none."""
        for estimate in self.estimates:
            if (estimate.timing_point, estimate.measure) == (timing_point, measure):
                return estimate
        points = ", ".join(dict.fromkeys(e.timing_point for e in self.estimates))
        raise KeyError(
            f"no {measure!r} at {timing_point!r}: expected one of {', '.join(MEASURES)} at one of "
            f"{points}"
        )

    def values(self, measure: str = "slope") -> dict[str, float]:
        """Return the values of one of :data:`MEASURES` by timing point, where there are any."""
        if measure not in MEASURES:
            raise KeyError(f"expected one of {', '.join(MEASURES)}; got {measure!r}")
        return {
            e.timing_point: e.value
            for e in self.estimates
            if e.measure == measure and e.value is not None
        }

    def to_frame(self) -> pd.DataFrame:
        """Return one row a timing point and measure."""
        table = record_frame(self.estimates, QuasiStiffnessEstimate.__slots__)
        table["doubts"] = [";".join(e.doubts) for e in self.estimates]
        table.insert(list(table.columns).index("value") + 1, "unit", self.unit)
        return table

    def summary(self) -> str:
        """Return a short text: every measure at every timing point, doubts, notes."""
        lines = []
        for e in self.estimates:
            value = "undecided" if e.value is None else f"{e.value:.3g}"
            why = (
                f" ({'; '.join(QuasiStiffnessDoubt(d).meaning for d in e.doubts)})"
                if e.doubts
                else ""
            )
            where = f"{e.timing_point:<4} {e.onset_gait_pct:>5g} %"
            lines.append(f"{where}  {e.measure:<11} {value:>9}{why}")
        return summary_text(f"Quasi-stiffness, {self.unit}", lines, self.notes)

    def _draw(self, axes: "Axes") -> None:
        """Draw moment over angle, with the line of every phase; dashed where ill-conditioned."""
        axes.plot([_DEGREE * a for a in self.angle], self.moment, color="0.6", linewidth=1.0)
        for colour, e in enumerate(e for e in self.estimates if e.measure == "slope"):
            inside = [
                (angle, moment)
                for pct, angle, moment in zip(self.gait_pct, self.angle, self.moment, strict=True)
                if e.start_gait_pct <= pct <= e.end_gait_pct
            ]
            if e.value is None or not inside:
                continue
            angles, moments = zip(*inside, strict=True)
            middle = sum(angles) / len(angles), sum(moments) / len(moments)
            ends = (min(angles), max(angles))
            axes.plot(
                [_DEGREE * a for a in ends],
                [middle[1] + e.value * (a - middle[0]) for a in ends],
                color=f"C{colour}",
                linestyle="-" if e.status == "ok" else "--",
                label=f"{e.timing_point} {e.value:.2f}",
            )
        axes.set(xlabel="angle (deg)", ylabel=f"moment ({self.unit.replace('/rad', '')})")
        if axes.get_legend_handles_labels()[0]:
            axes.legend(title=self.unit, fontsize="small")


@dataclass(frozen=True, slots=True)
class ComparedPoint:
    """Quasi-stiffness and stiffness at one timing point."""

    timing_point: str  # such as ``LRE``
    quasi_stiffness: float  # in the unit of the comparison
    stiffness: float  # in the unit of the comparison
    difference_pct: float | None  # 100 (Q - K) / K, as published; None where K is 0


@dataclass(frozen=True, slots=True, repr=False)
class QuasiStiffnessComparison(PlottedResult):
    """Quasi-stiffness beside stiffness, as section 4.3.2.3 compares them.

    Parameters
    ----------
    points : tuple of ComparedPoint
        Every timing point.
    unit : str
        ``N*m/rad`` or ``N*m/rad/kg``.
    statistic, df, p : float
        Welch's unpaired t, its degrees of freedom, two-sided p.
    difference, ci_low, ci_high : float
        Mean quasi-stiffness minus mean stiffness, and its interval at ``1 - alpha``.
    n : int
        Timing points; the test takes n values of each kind.
    alpha : float
        Level of the interval.
    notes : tuple of str
        What a reader of the numbers must know.
    """

    SCHEMA: ClassVar[str] = "jointz.QuasiStiffnessComparison/1"
    FIGURE_SIZE: ClassVar[tuple[float, float]] = (6.0, 4.0)

    points: tuple[ComparedPoint, ...]
    unit: str
    statistic: float
    df: float
    p: float
    difference: float
    ci_low: float
    ci_high: float
    n: int
    alpha: float = 0.05
    notes: tuple[str, ...] = ()

    def to_frame(self) -> pd.DataFrame:
        """Return one row a timing point."""
        return record_frame(self.points, ComparedPoint.__slots__).assign(unit=self.unit)

    def summary(self) -> str:
        """Return a short text: percent differences, the test with its n, the interval."""
        lines = []
        for point in self.points:
            apart = point.difference_pct
            shown = "no percentage: K is 0" if apart is None else f"{apart:+.2f} %"
            values = f"{point.quasi_stiffness:>8.3f} {point.stiffness:>8.3f}"
            lines.append(f"{point.timing_point:<4} {values}  {shown}")
        lines += [
            f"Welch's unpaired t = {self.statistic:.3f}, df {self.df:.2f}, p = {self.p:.4f}, "
            f"n = {self.n} and {self.n}",
            f"mean difference {self.difference:.3f} ({1 - self.alpha:.0%} interval "
            f"{self.ci_low:.3f} to {self.ci_high:.3f})",
        ]
        return summary_text(f"Quasi-stiffness and stiffness, {self.unit}", lines, self.notes)

    def _draw(self, axes: "Axes") -> None:
        """Draw both at every timing point."""
        places = range(len(self.points))
        axes.axhline(0.0, color="0.8", linewidth=0.8)
        axes.plot(places, [p.stiffness for p in self.points], "o", label="stiffness")
        axes.plot(places, [p.quasi_stiffness for p in self.points], "D", label="quasi-stiffness")
        axes.set_xticks(list(places), [p.timing_point for p in self.points])
        axes.set_ylabel(f"stiffness ({self.unit})")
        axes.set_title(f"Welch's t: p = {self.p:.3g}, n = {self.n} and {self.n}", fontsize="medium")
        axes.legend()
