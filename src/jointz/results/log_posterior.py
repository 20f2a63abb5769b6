"""Joint posterior of a person's impedance at all timing points, beside its prior."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from jointz.core.events import row_label
from jointz.results.base import Array, Axes, PlottedResult
from jointz.results.estimates import REACH_95
from jointz.results.unlikely_parameter import UnlikelyParameter
from jointz.results.value_scale import ValueScale, shares_at

#: Columns of ``log_posterior.csv``.
LOG_POSTERIOR_COLUMNS = (
    "participant",
    "timing_point",
    "parameter",
    "log_mean",
    "log_sd",
    "prior_log_mean",
    "prior_log_sd",
    "session",
    "side",
    "scale_unit",
)
#: Parameters of one timing point are drawn side by side within this width.
_DODGE = 0.6
#: Of the prior's median: the axis is linear below, logarithmic above.
_LINEAR_BELOW = 0.1


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LogPosterior(PlottedResult):
    """Normal posterior of the logarithms of a person's impedance, beside its prior.

    The arrays have one element for each parameter and timing point: the stiffness of all points,
    then the damping of all points and so on: inertia, then stiffness and damping at the onset
    (not in results that were written before them). Logarithms are natural and
    those of values in SI. A parameter with a unit in ``scale_units`` has ``asinh(value / unit)``
    in place of the logarithm: it may be zero.

    Parameters
    ----------
    participant : str
        The participant's id.
    parameters : tuple of str
        Parameter of each element.
    timing_points : tuple of str
        Timing point of each element.
    mean, covariance : ndarray
        (n,) and (n, n): posterior of the logarithms.
    prior_mean, prior_covariance : ndarray
        (n,) and (n, n): prior of the same logarithms.
    session, side : str
        Of the perturbed recordings; "" if the study does not state them.
    doubts : tuple of str
        Codes of :class:`~jointz.core.codes.Doubt`: why some values are undecided.
    unlikely : tuple of UnlikelyParameter
        Parameters from which doubts about instruments and lag follow.
    doubted : tuple of bool
        Whether a doubt speaks against each element; empty for none.
    intrinsic : tuple of (str, float)
        The device's own part of a parameter, SI, which the elements include and ``estimates.csv``
        does not.
    gain_sd : float
        Relative sd of the gains, which the covariance does not include.
    scale_units : tuple of (str, float)
        Unit of a parameter, SI, that is not estimated as a logarithm.

    Notes
    -----
    Dividing the posterior by the prior gives the likelihood of the person's data. Its precision
    is the difference of the inverse covariances, and its precision times its mean is the
    difference of both precisions times their means. The posterior is widened for errors of its
    approximation and may mix hypotheses: negative eigenvalues of the difference are none. A mean
    over people needs the likelihoods: combining the posteriors would count the prior once per
    person.
    """

    SCHEMA: ClassVar[str] = "jointz.LogPosterior/1"

    participant: str
    parameters: tuple[str, ...]
    timing_points: tuple[str, ...]
    mean: Array
    covariance: Array
    prior_mean: Array
    prior_covariance: Array
    session: str = ""
    side: str = ""
    doubts: tuple[str, ...] = ()
    unlikely: tuple[UnlikelyParameter, ...] = ()
    doubted: tuple[bool, ...] = ()
    intrinsic: tuple[tuple[str, float], ...] = ()
    gain_sd: float = 0.0
    scale_units: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        n = len(self.parameters)
        arrays = (self.mean, self.covariance, self.prior_mean, self.prior_covariance)
        shapes, expected = [a.shape for a in arrays], [(n,), (n, n), (n,), (n, n)]
        if not n or len(self.timing_points) != n or shapes != expected:
            raise ValueError(
                f"log posterior: expected a timing point and arrays {expected} for {n} "
                f"parameters (at least one), got {len(self.timing_points)} and {shapes}."
            )

    @property
    def label(self) -> str:
        """The participant with session and side: ``S01, day 2, left``."""
        return row_label(self.participant, self.session, self.side)

    @property
    def sd(self) -> np.ndarray:
        """Standard deviations of the posterior, (n,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def prior_sd(self) -> np.ndarray:
        """Standard deviations of the prior, (n,)."""
        return np.asarray(np.sqrt(np.diag(self.prior_covariance)))

    def scale(self, name: str) -> ValueScale:
        """Return the scale of a parameter."""
        return ValueScale(dict(self.scale_units).get(name, 0.0))

    @property
    def shares(self) -> np.ndarray:
        """Sd of each element over the relative sd of its value, (n,): 1 for a logarithm."""
        return shares_at(map(self.scale, self.parameters), self.mean)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON; without ``scale_units`` if there are none."""
        values = PlottedResult.to_dict(self)
        return {k: v for k, v in values.items() if v or k != "scale_units"}

    def rows(self) -> list[tuple[Any, ...]]:
        """Return one row for each element, in the columns of ``log_posterior.csv``."""
        units = {name: self.scale(name).unit or np.nan for name in self.parameters}
        numbers = np.column_stack([self.mean, self.sd, self.prior_mean, self.prior_sd]).tolist()
        return [
            (self.participant, point, parameter, *row, self.session, self.side, units[parameter])
            for point, parameter, row in zip(
                self.timing_points, self.parameters, numbers, strict=True
            )
        ]

    def to_frame(self) -> pd.DataFrame:
        """Return means and standard deviations, one row for each parameter and timing point."""
        return pd.DataFrame(self.rows(), columns=list(LOG_POSTERIOR_COLUMNS))

    def summary(self) -> str:
        """Return a short text: what the posterior holds, and its width beside the prior's."""
        names, points = dict.fromkeys(self.parameters), dict.fromkeys(self.timing_points)
        scales = "logarithms or asinh" if self.scale_units else "logarithms"
        share = float(np.median(self.sd / self.prior_sd))
        return (
            f"Posterior of {self.label}: {scales} of {', '.join(names)} at {len(points)} timing "
            f"point(s). Its standard deviations are {share:.2g} times the prior's (median)."
        )

    def _draw(self, axes: "Axes") -> None:
        """Draw each value with its 95 % interval, relative to the prior's median."""
        points = list(dict.fromkeys(self.timing_points))
        names = list(dict.fromkeys(self.parameters))
        place = {name: k for k, name in enumerate(points)}
        for k, name in enumerate(names):
            own = np.array([p == name for p in self.parameters])
            at = np.array([place[t] for t in self.timing_points])[own]
            x = at + _DODGE * ((k + 0.5) / len(names) - 0.5)
            scale, reach = self.scale(name), np.array([[-REACH_95], [0.0], [REACH_95]])
            median = scale.value(self.prior_mean[own])
            prior = scale.value(self.prior_mean[own] + reach * self.prior_sd[own]) / median
            low, middle, high = scale.value(self.mean[own] + reach * self.sd[own]) / median
            (line,) = axes.plot(x, middle, "o", label=name)
            colour = line.get_color()
            axes.vlines(x, prior[0], prior[2], colour, lw=6.0, alpha=0.2)
            axes.vlines(x, low, high, colour)
        axes.axhline(1.0, color="black", linewidth=0.8)
        axes.set_yscale("symlog", linthresh=_LINEAR_BELOW)  # values may be zero
        axes.yaxis.set_major_formatter("{x:g}")
        axes.set_xticks(range(len(points)), points)
        axes.set_ylabel("value / median of the prior")
        axes.set_title("Lines: 95 % intervals; wide pale lines: those of the prior")
        axes.legend(frameon=False)
