"""The fit of one time series of a joint: stiffness, damping, inertia."""

from dataclasses import dataclass, field
from typing import ClassVar

from jointz.results.base import Axes, summary_text
from jointz.results.fit import RecordFit, parameter_label, parameter_line
from jointz.results.series.second_order_verdict import SecondOrderCheck

_AXIS_LABELS = {"torque": "torque (N*m)", "angle": "angle (rad)"}


@dataclass(frozen=True, slots=True)
class FitSeries:
    """A readable stretch of the record beside the model, offsets removed."""

    time_s: tuple[float, ...] = ()  # time of the record
    measured: tuple[float, ...] = ()  # low-passed measurement, N*m or rad, see ``JointFit.vaf_of``
    modelled: tuple[float, ...] = ()  # model, N*m or rad, see ``JointFit.vaf_of``

    def draw(self, axes: "Axes") -> None:
        """Draw measurement and model over time."""
        axes.plot(self.time_s, self.measured, label="measured", linewidth=1.5)
        axes.plot(self.time_s, self.modelled, label="model", linestyle="--")
        axes.set_xlabel("time (s)")


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class JointFit(RecordFit):
    """Impedance of a joint from one time series.

    Parameters
    ----------
    model : str
        ``kbj``: torque = K*angle + B*velocity + J*acceleration + offset.
    estimator : str
        How the parameters were found.
    input : str
        What was perturbed: ``torque`` or ``angle``.
    parameters : tuple of ParameterEstimate
        ``stiffness``, ``damping``, ``inertia``.
    vaf_pct : float
        Variance accounted for (2.7), %, offsets removed.
    vaf_of : str
        The signal that ``vaf_pct`` and ``series`` are about.
    status : str
        ``ok``, ``at_bound`` or ``undecided``: the weakest of the parameters.
    n_samples : int
        Samples that entered the fit.
    rate_hz, cutoff_hz : float
        Sampling rate, and the low-pass filter on every signal.
    condition_number : float
        Of the scaled regressors.
    covariance : tuple of tuple of float
        (3, 3) of K, B, J; empty where no interval could be made.
    residual_correlation_time_s : float
        Integral correlation time of the residuals.
    ci_method : str
        How covariance and intervals were made.
    settings : mapping
        Everything that was chosen, and the version of jointz.
    warnings : tuple of str
        What a reader of the numbers must know.
    check : SecondOrderCheck
        Whether the residual refutes a second-order joint.
    series : FitSeries
        Measured and modelled signal, for the figure.
    """

    SCHEMA: ClassVar[str] = "jointz.JointFit/1"

    residual_correlation_time_s: float
    check: SecondOrderCheck = field(default_factory=SecondOrderCheck)
    series: FitSeries = field(default_factory=FitSeries)

    def summary(self) -> str:
        """Return a short text: parameters, intervals, quality, warnings."""
        seconds = self.n_samples / self.rate_hz
        lines = [
            f"{seconds:.1f} s at {self.rate_hz:.6g} Hz, low-pass {self.cutoff_hz:g} Hz",
            *map(parameter_line, self.parameters),
            f"VAF of the {self.vaf_of} {self.vaf_pct:.1f} %; intervals: {self.ci_method}",
            f"Check: {self.check.sentence()}",
        ]
        title = (
            f"Joint impedance, estimator {self.estimator}, {self.input} perturbed: {self.status}"
        )
        return summary_text(title, lines, self.warnings)

    def _draw(self, axes: "Axes") -> None:
        """Draw measured and modelled signal over a readable stretch."""
        self.series.draw(axes)
        axes.set_ylabel(_AXIS_LABELS[self.vaf_of])
        drawn = ", ".join(parameter_label(p) for p in self.parameters)
        axes.set_title(f"{drawn}\nVAF of the {self.vaf_of} {self.vaf_pct:.1f} %", fontsize="medium")
        axes.legend()
