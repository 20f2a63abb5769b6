"""Impedance of a joint over the gait cycle, from continuous random perturbation."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from jointz.core.channels import PARAMETER_UNITS
from jointz.results.base import Axes, ParameterResult, summary_text
from jointz.results.series.frequency_response_curve import INK, MODEL


@dataclass(frozen=True, slots=True)
class ParameterCurve:
    """One parameter over the gait cycle, an entry a phase."""

    name: str  # ``stiffness``, ``damping`` or ``inertia``
    value: tuple[float | None, ...]  # estimates, SI; None where there is none
    ci_low: tuple[float | None, ...]  # lower ends of the pointwise intervals, SI
    ci_high: tuple[float | None, ...]  # upper ends of the pointwise intervals, SI
    status: tuple[str, ...]  # ``ok``, ``undecided`` or ``failed:CODE``
    # estimates, SI, undecided ones included: for inspection, not for use
    raw: tuple[float | None, ...]

    @property
    def unit(self) -> str:
        """Unit of values and intervals."""
        return PARAMETER_UNITS[self.name]

    @property
    def ci(self) -> tuple[tuple[float | None, float | None], ...]:
        """The pointwise intervals, ends (low, high), a phase each."""
        return tuple(zip(self.ci_low, self.ci_high, strict=True))

    @property
    def n_decided(self) -> int:
        """Phases with an estimate."""
        return sum(v is not None for v in self.value)


@dataclass(frozen=True, slots=True)
class PhaseResponses:
    """Impulse responses over the cycle."""

    lag_s: tuple[float, ...] = ()  # lags; negative where the output comes before the input
    # one row for each phase, rad/(N*m*s) or N*m/(rad*s); empty rows where there is none
    response: tuple[tuple[float, ...], ...] = ()
    # sds of ``response`` by the scatter between strides, in its unit
    sd: tuple[tuple[float, ...], ...] = ()
    n_kept: tuple[int, ...] = ()  # number of inverted directions of the input, for each phase


@dataclass(frozen=True, slots=True, repr=False)
class TimeVaryingFit(ParameterResult[ParameterCurve]):
    """Impulse response and K, B, J of a joint at phases of the gait cycle.

    Parameters
    ----------
    estimator : str
        ``instrumental_variable`` or ``least_squares``, over short segments.
    input : str
        What was perturbed: ``torque`` or ``angle``.
    gait_pct : tuple of float
        Centre of each segment, % of the gait cycle.
    parameters : tuple of ParameterCurve
        ``stiffness``, ``damping``, ``inertia``.
    response_of : str
        ``admittance`` (one-sided, angle after torque) or ``impedance``
        (two-sided, torque about angle).
    responses : PhaseResponses
        Impulse responses.
    vaf_pct : tuple of float or None
        Of the impulse response (2.7), ensemble mean removed, %, a phase each.
    second_order_vaf_pct : tuple of float or None
        Of the torque by K, B, J, weighted as in the fit, %.
    status : str
        ``ok``, or ``undecided`` where any phase lacks an estimate.
    n_used, n_excluded : int
        Strides.
    excluded : mapping of str to int
        Why strides were left out, by code.
    stride_s : float
        Mean duration of the strides used.
    segment_s : float
        Length of the segments.
    cutoff_hz : float
        Low-pass filter on every signal: the end of the band.
    rate_hz : float
        Sampling rate of the record.
    ci_level : float
        Level of the intervals.
    ci_method : str
        How they were made.
    settings : mapping
        Everything that was chosen, and the version of jointz.
    warnings : tuple of str
        What a reader of the numbers must know.
    """

    SCHEMA: ClassVar[str] = "jointz.TimeVaryingFit/1"
    FIGURE_SIZE: ClassVar[tuple[float, float]] = (7.0, 4.0)

    estimator: str
    input: str
    gait_pct: tuple[float, ...]
    parameters: tuple[ParameterCurve, ...]
    response_of: str
    responses: PhaseResponses
    vaf_pct: tuple[float | None, ...]
    second_order_vaf_pct: tuple[float | None, ...]
    status: str
    n_used: int
    n_excluded: int
    excluded: Mapping[str, int]
    stride_s: float
    segment_s: float
    cutoff_hz: float
    rate_hz: float
    ci_level: float
    ci_method: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def resolution_pct(self) -> float:
        """Length of a segment in % of the mean stride: finer detail runs together."""
        return 100.0 * self.segment_s / self.stride_s

    def to_frame(self) -> pd.DataFrame:
        """Return one row a parameter and phase; the responses are ``responses``."""
        tables = [
            pd.DataFrame(
                {
                    "gait_pct": self.gait_pct,
                    "parameter": curve.name,
                    "value": np.array(curve.value, dtype=float),
                    "unit": curve.unit,
                    "ci_low": np.array(curve.ci_low, dtype=float),
                    "ci_high": np.array(curve.ci_high, dtype=float),
                    "ci_level": self.ci_level,
                    "vaf_pct": np.array(self.vaf_pct, dtype=float),
                    "n_used": self.n_used,
                    "n_excluded": self.n_excluded,
                    "estimator": self.estimator,
                    "status": curve.status,
                }
            )
            for curve in self.parameters
        ]
        return pd.concat(tables, ignore_index=True)

    def summary(self) -> str:
        """Return a short text: strides, resolution, ranges of K, B, J, warnings."""
        left_out = ", ".join(f"{n} {code}" for code, n in self.excluded.items())
        title = (
            f"Impedance over the gait cycle, {self.estimator}, {self.input} perturbed: "
            f"{self.status}"
        )
        lines = [
            f"{self.n_used} strides of {self.stride_s:.3g} s"
            + (f"; left out: {left_out}" if left_out else ""),
            f"segments of {self.segment_s:.3g} s, a resolution of {self.resolution_pct:.3g} % of "
            f"the cycle; low-pass {self.cutoff_hz:g} Hz",
            *(_range(curve, self.gait_pct) for curve in self.parameters),
            f"intervals: {self.ci_level:.0%}, pointwise, {self.ci_method}",
        ]
        return summary_text(title, lines, self.warnings)

    def _draw(self, axes: "Axes") -> None:
        """Draw stiffness, and damping on a second axis, over the cycle with their bands."""
        right = axes.twinx()
        lines = []
        for on, name, style in ((axes, "stiffness", INK), (right, "damping", MODEL)):
            curve = self.parameter(name)
            low, high = (np.array(ends, dtype=float) for ends in (curve.ci_low, curve.ci_high))
            on.fill_between(self.gait_pct, low, high, color=style, alpha=0.25, linewidth=0.0)
            alone = _alone(low)
            on.vlines(np.array(self.gait_pct)[alone], low[alone], high[alone], style, alpha=0.25)
            value = np.array(curve.value, dtype=float)
            dash = "-" if name == "stiffness" else "--"
            lines += on.plot(
                self.gait_pct, value, color=style, linestyle=dash, marker=".", label=name
            )
            on.set_ylabel(f"{name} ({curve.unit})", color=style)
            if curve.n_decided:
                on.set_ylim(min(0.0, 1.1 * float(np.nanmin(low))), 1.15 * float(np.nanmax(high)))
        axes.set(xlim=(0.0, 100.0), xlabel="gait cycle (%)")
        text = f"{self.n_used} strides, resolution {self.resolution_pct:.2g} % of the cycle"
        axes.set_title(f"{text}, {self.ci_level:.0%} bands", fontsize="medium")
        axes.legend(handles=lines, loc="upper right", ncols=2, frameon=False)


def _alone(values: np.ndarray) -> np.ndarray:
    """Return which values have no neighbour, so that no band can be drawn through them."""
    there = np.pad(np.isfinite(values), 1)
    alone: np.ndarray = there[1:-1] & ~there[:-2] & ~there[2:]
    return alone


def _range(curve: ParameterCurve, gait_pct: tuple[float, ...]) -> str:
    """Return a line: smallest and largest estimate, where they are, how many are decided."""
    estimates = [(v, pct) for v, pct in zip(curve.value, gait_pct, strict=True) if v is not None]
    decided = f"decided at {len(estimates)} of {len(gait_pct)} phases"
    if not estimates:
        return f"{curve.name:<10} {decided}"
    (low, low_at), (high, high_at) = min(estimates), max(estimates)
    low_end, high_end = (np.array(ends, dtype=float) for ends in (curve.ci_low, curve.ci_high))
    half_width = 0.5 * float(np.nanmedian(high_end - low_end))
    return (
        f"{curve.name:<10} {low:.4g} (at {low_at:.3g} %) to {high:.4g} {curve.unit} (at "
        f"{high_at:.3g} %), median interval +-{half_width:.2g}; {decided}"
    )
