"""The frequency response of a joint, and the second-order joint fitted to it."""

from dataclasses import dataclass, field
from typing import ClassVar

from jointz.results.base import Axes, summary_text
from jointz.results.fit import RecordFit, parameter_label, parameter_line
from jointz.results.series.frequency_response_curve import INK, ResponseCurve, draw_gain, draw_phase
from jointz.results.series.second_order_verdict import SecondOrderCheck


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class FrequencyResponseFit(RecordFit):
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
    FIGURE_SIZE: ClassVar[tuple[float, float]] = (7.0, 6.0)

    response: ResponseCurve
    resolution_hz: float
    n_averages: float
    check: SecondOrderCheck = field(default_factory=SecondOrderCheck)

    def summary(self) -> str:
        """Return a short text: parameters, intervals, resolution, warnings."""
        seconds = self.n_samples / self.rate_hz
        lines = [
            f"{seconds:.1f} s at {self.rate_hz:.6g} Hz, band to {self.cutoff_hz:.4g} Hz, "
            f"resolution {self.resolution_hz:.3g} Hz, {self.n_averages:.0f} averages",
            *map(parameter_line, self.parameters),
            f"VAF of the {self.vaf_of} {self.vaf_pct:.2f} %; {self.estimator}",
            f"intervals: {self.ci_method}",
            f"Check: {self.check.sentence()}",
        ]
        title = f"Frequency response of a joint, {self.input} perturbed: {self.status}"
        return summary_text(title, lines, self.warnings)

    def _draw(self, axes: "Axes") -> None:
        """Draw gain, phase and coherence with the band, and the second-order joint."""
        axes.axis("off")
        axes.set_ylabel("impedance")
        gain, phase, coherence = (
            axes.inset_axes((0.1, low, 0.88, height))
            for low, height in ((0.56, 0.36), (0.27, 0.24), (0.08, 0.14))
        )
        draw_gain(gain, self.response, label="N·m/rad")
        draw_phase(phase, self.response)
        coherence.plot(self.response.frequency_hz, self.response.coherence, color=INK)
        coherence.set(ylim=(0.0, 1.05), ylabel="coherence", xlabel="frequency (Hz)")
        for part in (gain, phase, coherence):
            part.set_xscale("log")
            part.label_outer()
        drawn = ", ".join(parameter_label(p) for p in self.parameters)
        vaf = f"VAF of the {self.vaf_of} {self.vaf_pct:.2f} %"
        gain.set_title(f"{drawn}\n{vaf}, resolution {self.resolution_hz:.2g} Hz", fontsize="medium")
        gain.legend()
