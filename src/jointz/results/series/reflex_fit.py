"""The fit of an intrinsic and a reflex path to one time series of a joint."""

from dataclasses import dataclass, field
from typing import ClassVar

from jointz.results.base import Axes, summary_text
from jointz.results.fit import RecordFit, parameter_label, parameter_line
from jointz.results.series.frequency_response_curve import INK, MODEL

_REFLEX = "#009e73"
_INTRINSIC = "0.55"


@dataclass(frozen=True, slots=True)
class ReflexSeries:
    """A readable stretch of the record beside both paths, slow torque removed."""

    time_s: tuple[float, ...] = ()  # time of the record
    measured: tuple[float, ...] = ()  # measured torque, N*m
    modelled: tuple[float, ...] = ()  # torque of both paths together, N*m
    intrinsic: tuple[float, ...] = ()  # torque of the intrinsic path, N*m
    reflex: tuple[float, ...] = ()  # torque of the reflex path, N*m


@dataclass(frozen=True, slots=True)
class ReflexPath:
    """The shape of the reflex path; numbers are None where no reflex was found."""

    stretch: str = ""  # direction of the angle that stretches: ``positive``, ``negative`` or ``""``
    threshold_rad_s: float | None = None  # velocity above which the path responds
    frequency_hz: float | None = None  # natural frequency of its second-order low-pass
    damping_ratio: float | None = None  # of its second-order low-pass
    p_value: float = 1.0  # probability of as large a response in records without a reflex


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class ReflexFit(RecordFit):
    """Intrinsic and reflex impedance of a joint from one time series.

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
        K of that fit, N*m/rad; it includes the effect of the reflex.
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

    intrinsic_vaf_pct: float
    reflex_vaf_pct: float
    linear_vaf_pct: float
    linear_stiffness: float
    path: ReflexPath
    fit_rate_hz: float
    series: ReflexSeries = field(default_factory=ReflexSeries)

    def summary(self) -> str:
        """Return a short text: both paths, intervals, quality, warnings."""
        seconds = self.n_samples / self.fit_rate_hz
        lines = [
            f"{seconds:.1f} s at {self.rate_hz:.6g} Hz, low-pass {self.cutoff_hz:g} Hz, fitted "
            f"at {self.fit_rate_hz:.4g} Hz",
            *map(parameter_line, self.parameters),
            self._reflex_line(),
            f"VAF of the torque {self.vaf_pct:.1f} %: intrinsic path {self.intrinsic_vaf_pct:.1f}"
            f" %, reflex path {self.reflex_vaf_pct:.1f} %",
            f"without a reflex path {self.linear_vaf_pct:.1f} % and stiffness "
            f"{self.linear_stiffness:.4g} N*m/rad",
            f"intervals: {self.ci_method}",
        ]
        title = f"Intrinsic and reflex impedance, {self.input} perturbed: {self.status}"
        return summary_text(title, lines, self.warnings)

    def _reflex_line(self) -> str:
        path = self.path
        if path.threshold_rad_s is None:
            return f"reflex not found (p {path.p_value:.2g})"
        return (
            f"reflex to {path.stretch} velocity above {path.threshold_rad_s:.2g} rad/s, low-pass "
            f"{path.frequency_hz:.2g} Hz with damping ratio {path.damping_ratio:.2g} "
            f"(p {path.p_value:.2g})"
        )

    def _draw(self, axes: "Axes") -> None:
        """Draw measured and modelled torque and both paths over a readable stretch."""
        for name, label, style in (
            ("measured", "measured", {"color": INK, "linewidth": 1.5}),
            ("modelled", "both paths", {"color": MODEL, "linestyle": "--"}),
            ("intrinsic", "intrinsic path", {"color": _INTRINSIC, "linewidth": 0.9}),
            ("reflex", "reflex path", {"color": _REFLEX, "linewidth": 1.2}),
        ):
            axes.plot(self.series.time_s, getattr(self.series, name), label=label, **style)
        axes.set(xlabel="time (s)", ylabel="torque less its slow part (N*m)")
        axes.set_title(self._title(), fontsize="medium")
        axes.legend(ncols=4, fontsize="small", loc="upper center", bbox_to_anchor=(0.5, -0.17))

    def _title(self) -> str:
        symbols = {"stiffness": "K", "reflex_gain": "reflex gain", "reflex_delay": "delay"}
        labels = (parameter_label(self.parameter(n), symbol=s) for n, s in symbols.items())
        return (
            f"{', '.join(labels)}\n"
            f"VAF {self.vaf_pct:.1f} %; intrinsic alone {self.intrinsic_vaf_pct:.1f} %, "
            f"without reflex path {self.linear_vaf_pct:.1f} %"
        )
