"""Results of the bench estimators: impedance of a load, and the lag of its torque record."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from jointz.results.base import Axes, summary_text
from jointz.results.estimates import ParameterEstimate
from jointz.results.fit import SYMBOLS, Fit, parameter_label, parameter_line
from jointz.results.impedance_limits import without_negative
from jointz.results.series.joint_fit import FitSeries


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
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
        Time constant of the first-order filter within the lag; the rest is delay.
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
    COLUMNS: ClassVar[tuple[str, ...]] = ("vaf_pct", "n_samples", "lag_model")
    TITLE: ClassVar[str] = "Bench"

    lag_model: str
    filter_time_s: float
    residual_sd_nm: float
    n_samples: int
    rate_hz: float
    condition_number: float
    covariance: tuple[tuple[float, ...], ...] = ()
    series: FitSeries = field(default_factory=FitSeries)

    @property
    def status(self) -> str:
        """``ok``, or ``undecided`` where stiffness or inertia is."""
        needed = [self.stiffness, self.inertia]
        return next((p.status for p in needed if p.status != "ok"), "ok")

    def summary(self) -> str:
        """Return a short text: parameters, intervals, quality, warnings."""
        seconds = self.n_samples / self.rate_hz
        parameters = (
            parameter_line(p, name=p.name.replace("_", " "), width=16, digits=5)
            for p in self.parameters
        )
        lines = [
            f"{seconds:.2f} s used at {self.rate_hz:.6g} Hz; lag of the torque: {self.lag_model}",
            *parameters,
            f"VAF of the torque {self.vaf_pct:.2f} %, residual sd {self.residual_sd_nm:.3g} N*m",
        ]
        return summary_text(f"{self.TITLE}: {self.status}", lines, self.warnings)

    def _draw(self, axes: "Axes") -> None:
        """Draw measured and modelled torque."""
        self.series.draw(axes)
        axes.set_ylabel("torque (N*m)")
        labels = (parameter_label(p, digits=4) for p in self.parameters if p.name in SYMBOLS)
        axes.set_title(
            f"{', '.join(labels)}\nVAF of the torque {self.vaf_pct:.2f} %", fontsize="medium"
        )
        axes.legend()


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

    Stiffness, damping and inertia of a load are positive. Friction and lag may be zero and need a
    finite sd only.
    """
    half = t_factor * sd
    if not np.isfinite(half):
        return ParameterEstimate(name, None, None, None, "undecided", **common)
    return without_negative(
        ParameterEstimate(name, value, value - half, value + half, "ok", **common)
    )
