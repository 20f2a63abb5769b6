"""The frequency response of a joint, and the second-order joint fitted to it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import pandas as pd

from jointz.results.base import Fit, parameter_frame, parameter_label, parameter_line
from jointz.results.estimates import ParameterEstimate
from jointz.results.series.frequency_response_curve import INK, ResponseCurve, draw_gain, draw_phase
from jointz.results.series.second_order_verdict import SecondOrderCheck

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, slots=True, repr=False)
class FrequencyResponseFit(Fit):
    """Impedance of a joint over frequency (1.2), and K, B, J.

    Parameters
    ----------
    model : str
        ``frf``.
    estimator : str
        How the parameters were found.
    input : str
        What was perturbed: ``torque`` or ``angle``.
    parameters : tuple of ParameterEstimate
        ``stiffness``, ``damping``, ``inertia``.
    vaf_pct : float
        Of the second-order joint (2.7), %, inside the band, offsets removed.
    vaf_of : str
        The signal that ``vaf_pct`` is about: ``angle`` or ``torque``.
    status : str
        ``ok`` or ``undecided``: the weakest of the parameters.
    response : ResponseCurve
        Impedance, N*m/rad, torque over angle.
    resolution_hz : float
        Of the response: finer details are run together.
    n_averages : float
        Independent averages at each of its frequencies.
    n_samples : int
        Samples of the record.
    rate_hz, cutoff_hz : float
        Sampling rate; end of the band that was used.
    condition_number : float
        Of the scaled equations.
    covariance : tuple of tuple of float
        (3, 3) of K, B, J.
    ci_method : str
        How covariance and intervals were made.
    settings : mapping
        Everything that was chosen, and the version of jointz.
    warnings : tuple of str
        What a reader of the numbers must know.
    check : SecondOrderCheck
        Whether the residual refutes a second-order joint.
    """

    SCHEMA: ClassVar[str] = "jointz.FrequencyResponseFit/1"

    model: str
    estimator: str
    input: str
    parameters: tuple[ParameterEstimate, ...]
    vaf_pct: float
    vaf_of: str
    status: str
    response: ResponseCurve
    resolution_hz: float
    n_averages: float
    n_samples: int
    rate_hz: float
    cutoff_hz: float
    condition_number: float
    covariance: tuple[tuple[float, ...], ...]
    ci_method: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    check: SecondOrderCheck = field(default_factory=SecondOrderCheck)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a parameter; the curve is ``response.table()``."""
        return parameter_frame(
            self.parameters,
            vaf_pct=self.vaf_pct,
            n_samples=self.n_samples,
            model=self.model,
            estimator=self.estimator,
        )

    def summary(self) -> str:
        """Return a short text: parameters, intervals, resolution, warnings."""
        seconds = self.n_samples / self.rate_hz
        lines = [
            f"Frequency response of a joint, {self.input} perturbed: {self.status}",
            f"  {seconds:.1f} s at {self.rate_hz:.6g} Hz, band to {self.cutoff_hz:.4g} Hz, "
            f"resolution {self.resolution_hz:.3g} Hz, {self.n_averages:.0f} averages",
            *(f"  {parameter_line(p)}" for p in self.parameters),
            f"  VAF of the {self.vaf_of} {self.vaf_pct:.2f} %; {self.estimator}",
            f"  intervals: {self.ci_method}",
            f"  Check: {self.check.sentence()}",
            *(f"  Note: {warning}" for warning in self.warnings),
        ]
        return "\n".join(lines)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw gain, phase and coherence with the band, and the second-order joint.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw, its area is divided in three; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
            The axes drawn on.
        """
        import matplotlib.pyplot as plt

        axes = ax if ax is not None else plt.subplots(figsize=(7.0, 6.0), layout="constrained")[1]
        axes.axis("off")
        axes.set_ylabel("impedance")
        gain, phase, coherence = (
            axes.inset_axes((0.1, low, 0.88, height))
            for low, height in ((0.56, 0.36), (0.27, 0.24), (0.08, 0.14))
        )
        draw_gain(gain, self.response, label="N·m/rad")
        draw_phase(phase, self.response)
        coherence.plot(self.response.frequency_hz, self.response.coherence, color=INK)
        coherence.set_ylim(0.0, 1.05)
        coherence.set_ylabel("coherence")
        coherence.set_xlabel("frequency (Hz)")
        for part in (gain, phase, coherence):
            part.set_xscale("log")
            part.label_outer()
        drawn = ", ".join(parameter_label(p) for p in self.parameters)
        vaf = f"VAF of the {self.vaf_of} {self.vaf_pct:.2f} %"
        gain.set_title(f"{drawn}\n{vaf}, resolution {self.resolution_hz:.2g} Hz", fontsize="medium")
        gain.legend()
        return axes
