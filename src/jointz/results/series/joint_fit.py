"""The fit of one time series of a joint: stiffness, damping, inertia."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import pandas as pd

from jointz.results.base import Fit, parameter_frame, parameter_label, parameter_line
from jointz.results.estimates import ParameterEstimate
from jointz.results.series.second_order_verdict import SecondOrderCheck

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_AXIS_LABELS = {"torque": "torque (N*m)", "angle": "angle (rad)"}


@dataclass(frozen=True, slots=True)
class FitSeries:
    """A readable stretch of the record beside the model, offsets removed."""

    time_s: tuple[float, ...] = ()  # time of the record
    # low-passed measurement and model; N*m or rad, see ``JointFit.vaf_of``
    measured: tuple[float, ...] = ()
    modelled: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, repr=False)
class JointFit(Fit):
    """Impedance of a joint out of one time series.

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

    model: str
    estimator: str
    input: str
    parameters: tuple[ParameterEstimate, ...]
    vaf_pct: float
    vaf_of: str
    status: str
    n_samples: int
    rate_hz: float
    cutoff_hz: float
    condition_number: float
    covariance: tuple[tuple[float, ...], ...]
    residual_correlation_time_s: float
    ci_method: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    check: SecondOrderCheck = field(default_factory=SecondOrderCheck)
    series: FitSeries = field(default_factory=FitSeries)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a parameter."""
        return parameter_frame(
            self.parameters,
            vaf_pct=self.vaf_pct,
            n_samples=self.n_samples,
            model=self.model,
            estimator=self.estimator,
        )

    def summary(self) -> str:
        """Return a short text: parameters, intervals, quality, warnings."""
        seconds = self.n_samples / self.rate_hz
        lines = [
            f"Joint impedance, estimator {self.estimator}, {self.input} perturbed: {self.status}",
            f"  {seconds:.1f} s at {self.rate_hz:.6g} Hz, low-pass {self.cutoff_hz:g} Hz",
            *(f"  {parameter_line(p)}" for p in self.parameters),
            f"  VAF of the {self.vaf_of} {self.vaf_pct:.1f} %; intervals: {self.ci_method}",
            f"  Check: {self.check.sentence()}",
            *(f"  Note: {warning}" for warning in self.warnings),
        ]
        return "\n".join(lines)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw measured and modelled signal over a readable stretch.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
            The axes drawn on.
        """
        import matplotlib.pyplot as plt

        axes = ax if ax is not None else plt.subplots(figsize=(8.0, 4.0), layout="constrained")[1]
        axes.plot(self.series.time_s, self.series.measured, label="measured", linewidth=1.5)
        axes.plot(self.series.time_s, self.series.modelled, label="model", linestyle="--")
        axes.set_xlabel("time (s)")
        axes.set_ylabel(_AXIS_LABELS[self.vaf_of])
        drawn = ", ".join(parameter_label(p) for p in self.parameters)
        axes.set_title(f"{drawn}\nVAF of the {self.vaf_of} {self.vaf_pct:.1f} %", fontsize="medium")
        axes.legend()
        return axes
