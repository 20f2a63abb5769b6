"""The impulse response of a joint, and the second-order joint behind it."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import pandas as pd

from jointz.results.base import Axes, summary_text
from jointz.results.fit import RecordFit, parameter_label, parameter_line
from jointz.results.series.frequency_response_curve import BAND, INK, MODEL
from jointz.results.series.second_order_verdict import SecondOrderCheck

#: Response -> its unit.
RESPONSE_UNITS = {"admittance": "rad/(N*m*s)", "impedance": "N*m/(rad*s)"}


@dataclass(frozen=True, slots=True)
class ImpulseCurve:
    """An impulse response with its bounds."""

    lag_s: tuple[float, ...] = ()  # lags; negative where the output comes before the input
    response: tuple[float, ...] = ()  # rad/(N*m*s) or N*m/(rad*s)
    # lower end of the pointwise interval by noise alone, unit of ``response``
    low: tuple[float, ...] = ()
    # upper end of the pointwise interval by noise alone, unit of ``response``
    high: tuple[float, ...] = ()
    # response of the second-order joint along the same directions, unit of ``response``
    fitted: tuple[float, ...] = ()

    def table(self) -> pd.DataFrame:
        """Return one row a lag."""
        return pd.DataFrame({name: list(getattr(self, name)) for name in self.__slots__})


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class ImpulseResponseFit(RecordFit):
    """Impulse response of a joint (1.3, 1.4), and K, B, J.

    Parameters
    ----------
    model : str
        ``irf``.
    estimator : str
        How K, B, J were found.
    input : str
        What was perturbed: ``torque`` or ``angle``.
    response_of : str
        ``admittance`` (one-sided, angle after torque) or ``impedance``
        (two-sided, torque about angle).
    parameters : tuple of ParameterEstimate
        ``stiffness``, ``damping``, ``inertia``.
    vaf_pct : float
        Of the impulse response (2.7), in time, %, offsets removed.
    second_order_vaf_pct : float
        Of the second-order joint on the same signal, inside the band, %.
    vaf_of : str
        The signal: ``angle`` or ``torque``.
    status : str
        ``ok`` or ``undecided``: the weakest of the parameters.
    curve : ImpulseCurve
        The response.
    n_kept : int
        Directions of the input that were inverted, out of as many as lags.
    step_s : float
        Step of the lags; the record was decimated to it.
    n_samples : int
        Samples of the record.
    rate_hz, cutoff_hz : float
        Sampling rate; end of the band of the second-order fit.
    condition_number : float
        Of the scaled equations of the second-order fit.
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

    SCHEMA: ClassVar[str] = "jointz.ImpulseResponseFit/1"
    FIGURE_SIZE: ClassVar[tuple[float, float]] = (7.0, 4.0)

    response_of: str
    second_order_vaf_pct: float
    curve: ImpulseCurve
    n_kept: int
    step_s: float
    check: SecondOrderCheck = field(default_factory=SecondOrderCheck)

    @property
    def unit(self) -> str:
        """Unit of the response."""
        return RESPONSE_UNITS[self.response_of]

    def summary(self) -> str:
        """Return a short text: the response, parameters, intervals, warnings."""
        seconds, lags = self.n_samples / self.rate_hz, self.curve.lag_s
        reach = f"{min(lags):.3g} to {max(lags):.3g} s" if lags else "no lags"
        lines = [
            f"{seconds:.1f} s at {self.rate_hz:.6g} Hz; lags {reach}, step {self.step_s:.3g} s, "
            f"{self.n_kept} of {len(lags)} directions",
            f"VAF of the {self.vaf_of} {self.vaf_pct:.2f} %, of a second-order joint "
            f"{self.second_order_vaf_pct:.2f} %",
            *map(parameter_line, self.parameters),
            f"{self.estimator}; intervals: {self.ci_method}",
            f"Check: {self.check.sentence()}",
        ]
        title = f"Impulse response ({self.response_of}), {self.input} perturbed: {self.status}"
        return summary_text(title, lines, self.warnings)

    def _draw(self, axes: "Axes") -> None:
        """Draw the impulse response with its bounds and the second-order joint's."""
        milliseconds = 1e3 * np.array(self.curve.lag_s)
        axes.fill_between(
            milliseconds, self.curve.low, self.curve.high, color=BAND, alpha=0.5, linewidth=0.0
        )
        axes.plot(milliseconds, self.curve.response, color=INK, marker=".", label="measured")
        axes.plot(
            milliseconds, self.curve.fitted, color=MODEL, linestyle="--", label="second order"
        )
        axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
        axes.set(xlabel="lag (ms)", ylabel=f"{self.response_of} impulse response ({self.unit})")
        drawn = ", ".join(parameter_label(p) for p in self.parameters)
        vaf = f"VAF of the {self.vaf_of} {self.vaf_pct:.2f} %"
        second = f"second order {self.second_order_vaf_pct:.2f} %"
        axes.set_title(f"{drawn}\n{vaf}, {second}", fontsize="medium")
        axes.legend()
