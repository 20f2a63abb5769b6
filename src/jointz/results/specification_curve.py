"""Specification curve: the same pulses analysed under every set of choices."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import pandas as pd

from jointz.core.channels import PARAMETER_UNITS
from jointz.core.codes import Failure
from jointz.results.base import Result, columns_with, record_frame, summary_text
from jointz.results.figure_style import MM_PER_INCH, WIDTH_MM, in_figure_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes


#: What is chosen; columns of the table, and rows of dots of the figure.
CHOICES = ("method", "baseline", "window_s", "cutoff_hz", "inertia_model", "assumption")
_PARAMETERS = ("stiffness", "damping", "inertia")
_DECIDED = ("ok", "at_bound")
_FAILED = "failed:"


@dataclass(frozen=True, slots=True)
class SpecificationEstimate:
    """One parameter under one set of choices."""

    timing_point: str  # estimated timing point
    parameter: str  # estimated parameter
    method: str  # name of the method
    baseline: str  # subtracted baseline
    window_s: float  # s: length of the window from the onset
    cutoff_hz: float | None  # low-pass of the filtering method; None for others
    # ``one`` inertia for all timing points, ``free``: one for each, ``pooled``: weighted by the
    # data; None for the method ``strapped``
    inertia_model: str | None
    value: float | None  # estimate, SI; None where there is none
    ci_low: float | None  # lower end of the interval, SI; None where there is none
    ci_high: float | None  # upper end of the interval, SI; None where there is none
    status: str  # as in :class:`jointz.results.estimates.ParameterEstimate`
    # assumption that is changed in the method ``strapped``, ``standard`` if none; None for others
    assumption: str | None = None

    @property
    def unit(self) -> str:
        """The unit of value and interval."""
        return PARAMETER_UNITS[self.parameter]

    @property
    def available(self) -> bool:
        """Whether there is a value to use."""
        return self.status in _DECIDED and self.value is not None


@dataclass(frozen=True, slots=True, repr=False)
class SpecificationCurve(Result):
    """A participant's estimates under every set of choices.

    Parameters
    ----------
    participant : str
        The id.
    estimates : tuple of SpecificationEstimate
        A parameter, timing point and set of choices each.
    settings : mapping
        The choices that were combined.
    """

    SCHEMA: ClassVar[str] = "jointz.SpecificationCurve/1"

    participant: str
    estimates: tuple[SpecificationEstimate, ...]
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def timing_points(self) -> tuple[str, ...]:
        """The timing points, in the order of the study."""
        return tuple(dict.fromkeys(e.timing_point for e in self.estimates))

    def of(self, parameter: str, timing_point: str) -> tuple[SpecificationEstimate, ...]:
        """Return the estimates of a parameter that stand, from small to large.

        Parameters
        ----------
        parameter : str
            ``stiffness``, ``damping`` or ``inertia``.
        timing_point : str
            Where.
        """
        estimates = [
            e
            for e in self.estimates
            if e.parameter == parameter and e.timing_point == timing_point and e.available
        ]
        return tuple(sorted(estimates, key=lambda e: e.value or 0.0))

    def to_frame(self) -> pd.DataFrame:
        """Return one row an estimate, its choices beside it."""
        columns = columns_with(SpecificationEstimate, "unit", after="value")
        return record_frame(self.estimates, columns)

    def summary(self) -> str:
        """Return a short text: how far the choices move each parameter, and what failed."""
        n = len({tuple(getattr(e, name) for name in CHOICES) for e in self.estimates})
        lines = []
        for point in self.timing_points:
            for name in _PARAMETERS:
                estimates = self.of(name, point)
                if not estimates:
                    lines.append(f"{point:<6} {name:<10} never decided")
                    continue
                middle = estimates[len(estimates) // 2]
                lines.append(
                    f"{point:<6} {name:<10} {estimates[0].value:.4g} to {estimates[-1].value:.4g} "
                    f"{middle.unit}, median {middle.value:.4g} ({len(estimates)} decided)"
                )
        failed = Counter(e.status for e in self.estimates if e.status.startswith(_FAILED))
        lines += [
            f"{count} of {len(self.estimates)} rows {status}: "
            f"{Failure(status.removeprefix(_FAILED)).meaning}"
            for status, count in failed.most_common()
        ]
        title = f"Specification curve of {self.participant}: {n} sets of choices."
        return summary_text(title, lines)

    @in_figure_style
    def plot(
        self,
        ax: "Axes | None" = None,
        *,
        parameter: str = "stiffness",
        timing_point: str | None = None,
    ) -> "Axes":
        """Draw the sorted estimates, and below each the choices that led to it.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default. It is made lower: choices stand below it.
        parameter : str
            Which parameter.
        timing_point : str, optional
            Where; the first by default.

        Returns
        -------
        matplotlib.axes.Axes
            The axes of the estimates.

        Notes
        -----
        Simonsohn, Simmons and Nelson (2020), Specification curve analysis, Nature Human
        Behaviour 4, 1208-1214, figure 2.
        """
        import matplotlib.pyplot as plt

        room = {"left": 0.22, "right": 0.97}
        size = (WIDTH_MM / MM_PER_INCH, 6.0)
        axes = ax if ax is not None else plt.subplots(figsize=size, gridspec_kw=room)[1]
        points = self.timing_points
        point = timing_point or (points[0] if points else "")
        estimates = self.of(parameter, point)
        box = axes.get_position()
        axes.set_position((box.x0, box.y0 + 0.55 * box.height, box.width, 0.45 * box.height))
        for k, e in enumerate(estimates):
            if e.ci_low is not None and e.ci_high is not None:
                axes.plot([k, k], [e.ci_low, e.ci_high], color="0.7", linewidth=1.5)
        values = [e.value for e in estimates if e.value is not None]
        axes.plot(values, "o", color="black", markersize=3.0)
        axes.set_ylabel(f"{parameter} ({PARAMETER_UNITS[parameter]})")
        axes.set_title(f"{self.participant} {point}: {len(estimates)} sets of choices")
        axes.tick_params(labelbottom=False)
        _draw_choices(axes, estimates)
        return axes


def _draw_choices(axes: "Axes", estimates: Sequence[SpecificationEstimate]) -> None:
    below = axes.inset_axes((0.0, -1.2, 1.0, 1.15), sharex=axes)
    labels: list[str] = []
    for name in CHOICES:
        values = {getattr(e, name) for e in estimates if getattr(e, name) is not None}
        for value in sorted(values, key=lambda v: (isinstance(v, str), v)):
            at = [k for k, e in enumerate(estimates) if getattr(e, name) == value]
            below.plot(at, [len(labels)] * len(at), "|", color="black", markersize=4.0)
            labels.append(_label(name, value))
    below.set_yticks(range(len(labels)), labels, fontsize="small")
    below.invert_yaxis()
    below.set_xlabel("sets of choices, by their estimate")


def _label(name: str, value: Any) -> str:
    if name == "window_s":
        return f"window {1000.0 * value:g} ms"
    if name == "cutoff_hz":
        return f"cut-off {value:g} Hz"
    if name == "assumption":
        return str(value).replace("_", " ")
    return f"inertia {value}" if name == "inertia_model" else str(value)
