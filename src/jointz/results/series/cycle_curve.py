"""Stiffness and damping as curves over the gait cycle, with bands."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from jointz.core.channels import PARAMETER_UNITS
from jointz.results.base import Axes, Result, summary_text
from jointz.results.figure_style import axes_or_new, in_figure_style
from jointz.results.series.frequency_response_curve import INK

#: Whose curve the one over people is.
MEAN = "mean over people"


@dataclass(frozen=True, slots=True)
class CurvePoint:
    """An estimate behind a curve."""

    timing_point: str  # name of the timing point, or of the group of measured phases
    gait_pct: float  # centre of the window (values at the onset: the onset), % of the gait cycle
    value: float  # estimate without bounds, SI
    ci_low: float  # lower end of the interval, SI
    ci_high: float  # upper end of the interval, SI
    decided: bool  # whether the estimate is decided; a curve uses undecided ones too


@dataclass(frozen=True, slots=True)
class ParameterBand:
    """One parameter of one person, or of the mean over people, over the cycle."""

    participant: str  # the id, or ``mean over people``
    parameter: str  # such as ``stiffness``
    value: tuple[float, ...]  # median of the curve at each phase, SI
    ci_low: tuple[float, ...]  # lower end of the pointwise interval at each phase, SI
    ci_high: tuple[float, ...]  # upper end of the pointwise interval at each phase, SI
    scale: str  # of the posterior: ``logarithmic`` or ``asinh``; of the mean: ``linear``
    # share of the prior variance between timing points that follows one curve over the cycle
    cycle_share: float
    points: tuple[CurvePoint, ...]  # estimates behind the curve

    @property
    def unit(self) -> str:
        """Unit of values and intervals."""
        return PARAMETER_UNITS[self.parameter]


@dataclass(frozen=True, slots=True, repr=False)
class PhaseCurve(Result):
    """K and B over the gait cycle, of participants and of their mean.

    Parameters
    ----------
    gait_pct : tuple of float
        Phases of the curves, % of the gait cycle.
    bands : tuple of ParameterBand
        A curve a participant and parameter.
    ci_level : float
        Level of the pointwise intervals.
    ci_method : str
        How they were made.
    settings : mapping
        Method, window and version.
    warnings : tuple of str
        Whose curve is missing, and what a reader must know.
    """

    SCHEMA: ClassVar[str] = "jointz.PhaseCurve/1"

    gait_pct: tuple[float, ...]
    bands: tuple[ParameterBand, ...]
    ci_level: float
    ci_method: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    def band(self, parameter: str, participant: str = MEAN) -> ParameterBand:
        """Return one curve, by default the mean over people; KeyError if there is none."""
        for band in self.bands:
            if (band.parameter, band.participant) == (parameter, participant):
                return band
        known = ", ".join(f"{b.parameter} of {b.participant}" for b in self.bands)
        raise KeyError(f"no curve of {parameter!r} of {participant!r}; there are: {known}")

    def to_frame(self) -> pd.DataFrame:
        """Return one row for each curve and phase."""
        columns = ["participant", "parameter", "gait_pct", "value", "unit", "ci_low", "ci_high"]
        rows = [
            (band.participant, band.parameter, at, value, band.unit, low, high)
            for band in self.bands
            for at, value, low, high in zip(
                self.gait_pct, band.value, band.ci_low, band.ci_high, strict=True
            )
        ]
        return pd.DataFrame(rows, columns=columns).assign(ci_level=self.ci_level)

    def summary(self) -> str:
        """Return a short text: range and width of every curve."""
        title = (
            f"Impedance over the gait cycle, {len(self.bands)} curve(s), {self.ci_level:.0%} "
            f"pointwise bands: {self.ci_method}"
        )
        return summary_text(title, (_range(b, self.gait_pct) for b in self.bands), self.warnings)

    @in_figure_style
    def plot(self, ax: "Axes | None" = None, *, parameter: str = "stiffness") -> "Axes":
        """Draw the curves of one parameter over the cycle, with band and estimates."""
        axes = axes_or_new(ax, (7.0, 4.0))
        bands = [band for band in self.bands if band.parameter == parameter]
        # The mean stands out; people are thin lines beside it.
        main = next((b for b in bands if b.participant == MEAN), bands[0] if bands else None)
        for band in bands:
            if band is not main:
                axes.plot(self.gait_pct, band.value, color="0.7", linewidth=0.8)
        if main is not None:
            axes.fill_between(self.gait_pct, main.ci_low, main.ci_high, color=INK, alpha=0.25)
            axes.plot(self.gait_pct, main.value, color=INK, label=main.participant)
            _draw_points(axes, main.points)
            axes.legend(loc="upper right", frameon=False)
        axes.set(xlim=(0.0, 100.0), xlabel="gait cycle (%)")
        axes.set_ylabel(f"{parameter} ({PARAMETER_UNITS[parameter]})")
        return axes


def _range(band: ParameterBand, gait_pct: tuple[float, ...]) -> str:
    """Return a line: smallest and largest value, where they are, how wide the band is."""
    low, high = int(np.argmin(band.value)), int(np.argmax(band.value))
    widths = 0.5 * (np.array(band.ci_high) - np.array(band.ci_low))
    return (
        f"{band.parameter:<20} {band.participant}: {band.value[low]:.4g} (at {gait_pct[low]:g} %) "
        f"to {band.value[high]:.4g} {band.unit} (at {gait_pct[high]:g} %), median band "
        f"+-{float(np.median(widths)):.2g}, from {len(band.points)} phases; "
        f"{band.cycle_share:.0%} of the prior's changes follow the cycle"
    )


def _draw_points(axes: "Axes", points: tuple[CurvePoint, ...]) -> None:
    for decided, face in ((True, INK), (False, "white")):
        shown = [point for point in points if point.decided is decided]
        if not shown:
            continue
        value = np.array([point.value for point in shown])
        ends = np.array([[p.value - p.ci_low, p.ci_high - p.value] for p in shown]).T
        axes.errorbar(
            [point.gait_pct for point in shown],
            value,
            yerr=ends,
            fmt="o",
            color=INK,
            markerfacecolor=face,
            label=None if decided else "undecided",
        )
