"""What the bench estimators find: impedance of a load, and the lag of its torque record."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pandas as pd

from jointz.results.base import Fit, parameter_frame
from jointz.results.estimates import ParameterEstimate
from jointz.results.series.joint_fit import FitSeries

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SYMBOLS = {"stiffness": "K", "damping": "B", "inertia": "J"}


@dataclass(frozen=True, slots=True, repr=False)
class BenchFit(Fit):
    """Impedance of one load on a bench; base of :class:`FullRecordFit` and :class:`PulseFit`.

    Parameters
    ----------
    parameters : tuple of ParameterEstimate
        ``stiffness``, ``damping``, ``inertia``, ``torque_lag`` (s, positive where the
        torque record is late) and, from a full record, ``coulomb_friction`` (N*m).
    lag_model : str
        ``delay``, ``first_order``, ``mixed`` (a delay and a first-order filter) or ``given``.
    filter_time_s : float
        Share of the lag that is a first-order filter; the rest is delay.
    vaf_pct : float
        Variance of the torque that the model accounts for (2.7), offsets removed, %.
    residual_sd_nm : float
        Sd of what is left of the torque, N*m.
    n_samples : int
        Samples that entered the fit.
    rate_hz : float
        Sampling rate.
    condition_number : float
        Of the scaled regressors, nuisances included.
    covariance : tuple of tuple of float
        In the order of ``parameters``; empty where none could be made.
    settings : mapping
        Everything that was chosen.
    warnings : tuple of str
        What a reader of the numbers must know.
    series : FitSeries
        Measured and modelled torque over a readable stretch, offsets removed.
    """

    SCHEMA: ClassVar[str] = "jointz.BenchFit/1"
    TITLE: ClassVar[str] = "Bench"

    parameters: tuple[ParameterEstimate, ...]
    lag_model: str
    filter_time_s: float
    vaf_pct: float
    residual_sd_nm: float
    n_samples: int
    rate_hz: float
    condition_number: float
    covariance: tuple[tuple[float, ...], ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    series: FitSeries = field(default_factory=FitSeries)

    @property
    def status(self) -> str:
        """``ok``, or ``undecided`` where stiffness or inertia is."""
        needed = [self.parameter("stiffness"), self.parameter("inertia")]
        return next((p.status for p in needed if p.status != "ok"), "ok")

    def to_frame(self) -> pd.DataFrame:
        """Return one row a parameter."""
        return parameter_frame(
            self.parameters,
            vaf_pct=self.vaf_pct,
            n_samples=self.n_samples,
            lag_model=self.lag_model,
        )

    def summary(self) -> str:
        """Return a short text: parameters, intervals, quality, warnings."""
        seconds = self.n_samples / self.rate_hz
        lines = [
            f"{self.TITLE}: {self.status}",
            f"  {seconds:.2f} s used at {self.rate_hz:.6g} Hz; lag of the torque: {self.lag_model}",
            *(f"  {_sentence(p)}" for p in self.parameters),
            f"  VAF of the torque {self.vaf_pct:.2f} %, residual sd {self.residual_sd_nm:.3g} N*m",
            *(f"  Note: {warning}" for warning in self.warnings),
        ]
        return "\n".join(lines)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw measured and modelled torque.

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
        axes.set_ylabel("torque (N*m)")
        drawn = ", ".join(_figure(p) for p in self.parameters if p.name in _SYMBOLS)
        axes.set_title(f"{drawn}\nVAF of the torque {self.vaf_pct:.2f} %", fontsize="medium")
        axes.legend()
        return axes


class FullRecordFit(BenchFit):
    """Impedance of one load from whole trials; fields as in :class:`BenchFit`."""

    __slots__ = ()
    SCHEMA: ClassVar[str] = "jointz.FullRecordFit/1"
    TITLE: ClassVar[str] = "Load from its full record"


class PulseFit(BenchFit):
    """Impedance of one load from one pulse; fields as in :class:`BenchFit`."""

    __slots__ = ()
    SCHEMA: ClassVar[str] = "jointz.PulseFit/1"
    TITLE: ClassVar[str] = "Load from one pulse"


def estimate(
    name: str, value: float, sd: float, *, t_factor: float, common: Mapping[str, Any]
) -> ParameterEstimate:
    """Return a parameter with a symmetric interval; undecided where the data do not decide.

    Stiffness and inertia of a load are positive: one whose interval reaches zero, or that
    has no finite sd, is ``undecided`` and has no value. Damping, friction and lag may be
    zero and need a finite sd only.
    """
    half = t_factor * sd
    reaches_zero = name in ("stiffness", "inertia") and value - half <= 0.0
    if not np.isfinite(half) or reaches_zero:
        return ParameterEstimate(name, None, None, None, "undecided", **common)
    return ParameterEstimate(name, value, value - half, value + half, "ok", **common)


def _sentence(parameter: ParameterEstimate) -> str:
    name = parameter.name.replace("_", " ")
    if parameter.value is None:
        return f"{name:<16} {parameter.status}"
    interval = f"{parameter.ci_low:.5g} to {parameter.ci_high:.5g}"
    measure = f"{name:<16} {parameter.value:.5g} {parameter.unit}"
    return f"{measure} ({parameter.ci_level:.0%} interval {interval}; {parameter.status})"


def _figure(parameter: ParameterEstimate) -> str:
    symbol = _SYMBOLS[parameter.name]
    if parameter.value is None:
        return f"{symbol} {parameter.status}"
    return f"{symbol} = {parameter.value:.4g} {parameter.unit}"
