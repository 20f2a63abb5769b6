"""Impedance from pairs of runs along one reference, without and with perturbations."""

from dataclasses import dataclass, field
from typing import ClassVar

import pandas as pd

from jointz.results.base import Axes, record_frame, summary_text
from jointz.results.fit import Fit, parameter_label, parameter_line


@dataclass(frozen=True, slots=True)
class PairedPulse:
    """One pulse by itself, by least squares without bounds (2.2.3)."""

    pair: int  # number of the pair of runs, from 1
    onset_s: float  # s: onset on the clock of the perturbed run
    sign: int  # +1 or -1: sign of the pulse's torque
    stiffness: float  # N*m/rad
    damping: float  # N*m*s/rad
    inertia: float  # kg*m^2
    vaf_pct: float  # variance of the torque accounted for (2.7), %


@dataclass(frozen=True, slots=True)
class MeanResponse:
    """Response to a positive pulse: the mean, negative ones turned."""

    time_s: tuple[float, ...] = ()  # time from the onset
    measured: tuple[float, ...] = ()  # measured torque, perturbed minus unperturbed, N*m
    modelled: tuple[float, ...] = ()  # torque of the model, N*m


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class PairedRunsFit(Fit):
    """Impedance from the differences of perturbed and unperturbed runs.

    Parameters
    ----------
    parameters : tuple of ParameterEstimate
        ``stiffness``, ``damping``, ``inertia`` over all pulses.
    pulses : tuple of PairedPulse
        Every pulse by itself.
    left_out : tuple of str
        Every pulse that was left out, and why.
    shifts_s : tuple of float
        How much later than its perturbed run each unperturbed run began the reference, s.
    vaf_pct : float
        Variance of the torque responses that the model accounts for (2.7), %.
    rate_hz, cutoff_hz, window_s : float
        Sampling rate, low-pass of angle and torque, length of a response.
    condition_number : float
        Of the scaled regressors.
    ci_method : str
        How the intervals were made.
    settings : mapping
        Everything that was chosen, and the version of jointz.
    warnings : tuple of str
        What a reader of the numbers must know.
    response : MeanResponse
        For the figure.
    """

    SCHEMA: ClassVar[str] = "jointz.PairedRunsFit/1"
    COLUMNS: ClassVar[tuple[str, ...]] = ("vaf_pct", "n_pulses")
    FIGURE_SIZE: ClassVar[tuple[float, float]] = (6.0, 4.0)

    pulses: tuple[PairedPulse, ...]
    left_out: tuple[str, ...]
    shifts_s: tuple[float, ...]
    rate_hz: float
    cutoff_hz: float
    window_s: float
    condition_number: float
    ci_method: str
    response: MeanResponse = field(default_factory=MeanResponse)

    @property
    def n_pulses(self) -> int:
        """Pulses used."""
        return len(self.pulses)

    @property
    def status(self) -> str:
        """``ok``, or ``undecided`` where a parameter is."""
        return next((p.status for p in self.parameters if p.status != "ok"), "ok")

    def pulses_frame(self) -> pd.DataFrame:
        """Return one row a pulse."""
        return record_frame(self.pulses, PairedPulse.__slots__)

    def summary(self) -> str:
        """Return a short text: parameters, intervals, quality, what was left out."""
        lines = [
            f"{self.n_pulses} pulses, {1000.0 * self.window_s:g} ms each, "
            f"low-pass {self.cutoff_hz:g} Hz, {self.rate_hz:.6g} Hz",
            *map(parameter_line, self.parameters),
            f"VAF of the torque {self.vaf_pct:.2f} %; intervals: {self.ci_method}",
            *(f"Left out: {reason}" for reason in self.left_out),
        ]
        title = f"Impedance out of {len(self.shifts_s)} pair(s) of runs: {self.status}"
        return summary_text(title, lines, self.warnings)

    def _draw(self, axes: "Axes") -> None:
        """Draw the mean torque response and the model's."""
        axes.plot(self.response.time_s, self.response.measured, label="perturbed - unperturbed")
        axes.plot(self.response.time_s, self.response.modelled, linestyle="--", label="model")
        axes.set(xlabel="time from the onset (s)", ylabel="torque (N*m)")
        axes.set_title(", ".join(parameter_label(p) for p in self.parameters), fontsize="medium")
        axes.legend()
