"""The fit of an intrinsic and a reflex path to one time series of a joint."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import pandas as pd

from jointz.results.base import Fit, parameter_frame, parameter_line
from jointz.results.estimates import ParameterEstimate
from jointz.results.series.frequency_response_curve import INK, MODEL

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_REFLEX = "#009e73"
_INTRINSIC = "0.55"


@dataclass(frozen=True, slots=True)
class ReflexSeries:
    """A readable stretch of the record beside both paths, slow torque removed."""

    time_s: tuple[float, ...] = ()  # time of the record
    measured: tuple[float, ...] = ()  # torque, N*m; ``modelled`` is the sum of the paths
    modelled: tuple[float, ...] = ()
    intrinsic: tuple[float, ...] = ()
    reflex: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class ReflexPath:
    """The shape of the reflex path; numbers are None where no reflex was found."""

    stretch: str = ""  # direction of the angle that stretches: ``positive``, ``negative`` or ``""``
    threshold_rad_s: float | None = None  # velocity above which the path answers
    frequency_hz: float | None = None  # of its second-order low-pass
    damping_ratio: float | None = None
    p_value: float = 1.0  # that records without a reflex answer as much


@dataclass(frozen=True, slots=True, repr=False)
class ReflexFit(Fit):
    """Intrinsic and reflex impedance of a joint out of one time series.

    Parameters
    ----------
    model : str
        ``reflex``.
    estimator : str
        ``parallel_cascade``.
    input : str
        What was perturbed: ``torque`` or ``angle``.
    parameters : tuple of ParameterEstimate
        ``stiffness``, ``damping``, ``inertia`` of the intrinsic path;
        ``reflex_gain`` (N*m*s/rad) and ``reflex_delay`` (s).
    vaf_pct : float
        Of both paths together (2.7), %, torque slower than 20 s removed.
    intrinsic_vaf_pct, reflex_vaf_pct : float
        Of each path alone.
    linear_vaf_pct : float
        Of K, B, J fitted without a reflex to the same samples.
    linear_stiffness : float
        K of that fit, N*m/rad: it holds the reflex.
    vaf_of : str
        ``torque``.
    status : str
        ``ok`` or ``undecided``: the weakest of the parameters.
    path : ReflexPath
        Shape of the reflex path.
    n_samples : int
        Samples that entered the fit.
    rate_hz, fit_rate_hz, cutoff_hz : float
        Sampling rate, the rate the record was thinned to, and the low-pass on every signal.
    condition_number : float
        Of the scaled sensitivities, shape of the path included.
    covariance : tuple of tuple of float
        (5, 5) of the parameters; (3, 3) where no reflex was found; empty where no
        interval could be made.
    ci_method : str
        How covariance and intervals were made.
    settings : mapping
        Everything that was chosen, and the version of jointz.
    warnings : tuple of str
        What a reader of the numbers must know.
    series : ReflexSeries
        Measured and modelled torque, for the figure.
    """

    SCHEMA: ClassVar[str] = "jointz.ReflexFit/1"

    model: str
    estimator: str
    input: str
    parameters: tuple[ParameterEstimate, ...]
    vaf_pct: float
    intrinsic_vaf_pct: float
    reflex_vaf_pct: float
    linear_vaf_pct: float
    linear_stiffness: float
    vaf_of: str
    status: str
    path: ReflexPath
    n_samples: int
    rate_hz: float
    fit_rate_hz: float
    cutoff_hz: float
    condition_number: float
    covariance: tuple[tuple[float, ...], ...]
    ci_method: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    series: ReflexSeries = field(default_factory=ReflexSeries)

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
        """Return a short text: both paths, intervals, quality, warnings."""
        seconds = self.n_samples / self.fit_rate_hz
        lines = [
            f"Intrinsic and reflex impedance, {self.input} perturbed: {self.status}",
            f"  {seconds:.1f} s at {self.rate_hz:.6g} Hz, low-pass {self.cutoff_hz:g} Hz, fitted "
            f"at {self.fit_rate_hz:.4g} Hz",
            *(f"  {parameter_line(p)}" for p in self.parameters),
            f"  {self._reflex_line()}",
            f"  VAF of the torque {self.vaf_pct:.1f} %: intrinsic path {self.intrinsic_vaf_pct:.1f}"
            f" %, reflex path {self.reflex_vaf_pct:.1f} %",
            f"  without a reflex path {self.linear_vaf_pct:.1f} % and stiffness "
            f"{self.linear_stiffness:.4g} N*m/rad",
            f"  intervals: {self.ci_method}",
            *(f"  Note: {warning}" for warning in self.warnings),
        ]
        return "\n".join(lines)

    def _reflex_line(self) -> str:
        path = self.path
        if path.threshold_rad_s is None:
            return f"reflex not found (p {path.p_value:.2g})"
        return (
            f"reflex to {path.stretch} velocity above {path.threshold_rad_s:.2g} rad/s, low-pass "
            f"{path.frequency_hz:.2g} Hz with damping ratio {path.damping_ratio:.2g} "
            f"(p {path.p_value:.2g})"
        )

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw measured and modelled torque and both paths over a readable stretch.

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
        shown = self.series
        axes.plot(shown.time_s, shown.measured, color=INK, linewidth=1.5, label="measured")
        axes.plot(shown.time_s, shown.modelled, color=MODEL, linestyle="--", label="both paths")
        axes.plot(
            shown.time_s, shown.intrinsic, color=_INTRINSIC, linewidth=0.9, label="intrinsic path"
        )
        axes.plot(shown.time_s, shown.reflex, color=_REFLEX, linewidth=1.2, label="reflex path")
        axes.set_xlabel("time (s)")
        axes.set_ylabel("torque less its slow part (N*m)")
        axes.set_title(self._title(), fontsize="medium")
        axes.legend(ncols=4, fontsize="small", loc="upper center", bbox_to_anchor=(0.5, -0.17))
        return axes

    def _title(self) -> str:
        symbols = {"stiffness": "K", "reflex_gain": "reflex gain", "reflex_delay": "delay"}
        drawn = ", ".join(
            f"{symbol} {p.status}" if p.value is None else f"{symbol} = {p.value:.3g} {p.unit}"
            for symbol, p in ((s, self.parameter(name)) for name, s in symbols.items())
        )
        return (
            f"{drawn}\nVAF {self.vaf_pct:.1f} %; intrinsic alone {self.intrinsic_vaf_pct:.1f} %, "
            f"without reflex path {self.linear_vaf_pct:.1f} %"
        )
