"""The stiffness of a bench: torque over angle, standing nearly still or under a dither."""

from dataclasses import dataclass, field
from typing import ClassVar

from jointz.results.base import Axes, summary_text
from jointz.results.fit import Fit, parameter_line

_TITLES = {
    "static": "Static stiffness (3.2.2), slope of torque over angle",
    "dither": "Dither stiffness (3.2.3), at one frequency",
}


@dataclass(frozen=True, slots=True)
class LoopSeries:
    """Torque over angle, thinned to what a figure can show, offsets removed."""

    angle: tuple[float, ...] = ()  # rad
    measured: tuple[float, ...] = ()  # measured torque, N*m
    modelled: tuple[float, ...] = ()  # torque of the fit, N*m


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class StiffnessFit(Fit):
    """Stiffness of a bench from one record of angle and torque.

    Parameters
    ----------
    method : str
        ``static`` or ``dither``.
    parameters : tuple of ParameterEstimate
        ``stiffness``; of a dither ``damping`` too; of a static record with a direction
        ``coulomb_friction`` (N*m) and ``load_friction`` (share of the torque).
    vaf_pct : float
        Variance of the torque that the fit accounts for (2.7), offset removed, %. Of a
        dither that includes whatever else moves in the record, which the fit leaves out.
    frequency_hz : float or None
        Of the dither.
    excursion_rad : float
        Largest minus smallest angle of a static record; amplitude of a dither.
    n_samples : int
        Samples that entered the fit.
    rate_hz : float
        Sampling rate.
    ci_method : str
        How the intervals were made.
    settings : mapping
        Everything that was chosen, and the version of jointz.
    warnings : tuple of str
        What a reader of the numbers must know.
    series : LoopSeries
        For the figure.
    """

    SCHEMA: ClassVar[str] = "jointz.StiffnessFit/1"
    COLUMNS: ClassVar[tuple[str, ...]] = ("vaf_pct", "n_samples", "method")
    FIGURE_SIZE: ClassVar[tuple[float, float]] = (6.0, 4.5)

    method: str
    frequency_hz: float | None
    excursion_rad: float
    n_samples: int
    rate_hz: float
    ci_method: str
    series: LoopSeries = field(default_factory=LoopSeries)

    @property
    def status(self) -> str:
        """That of the stiffness: ``ok`` or ``undecided``."""
        return self.stiffness.status

    def summary(self) -> str:
        """Return a short text: parameters, intervals, quality, warnings."""
        seconds = self.n_samples / self.rate_hz
        at = "" if self.frequency_hz is None else f" of {self.frequency_hz:.4g} Hz"
        lines = [
            f"{seconds:.1f} s at {self.rate_hz:.6g} Hz, excursion{at} "
            f"{1000.0 * self.excursion_rad:.4g} mrad",
            *map(parameter_line, self.parameters),
            f"VAF of the torque {self.vaf_pct:.2f} %; intervals: {self.ci_method}",
        ]
        return summary_text(f"{_TITLES[self.method]}: {self.status}", lines, self.warnings)

    def _draw(self, axes: "Axes") -> None:
        """Draw torque over angle."""
        angle = self.series.angle
        axes.plot(angle, self.series.measured, ".", markersize=2.0, label="measured")
        axes.plot(angle, self.series.modelled, linewidth=1.5, label="model")
        axes.set(xlabel="angle (rad)", ylabel="torque (N*m)")
        axes.set_title(parameter_line(self.stiffness), fontsize="medium")
        axes.legend()
