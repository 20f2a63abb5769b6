"""Expected errors of a study, from simulated people who walk its protocol."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from jointz.core.channels import PARAMETER_UNITS
from jointz.core.gait_phases import ALL_POINTS
from jointz.results.base import Axes, PlottedResult, record_frame, summary_text

PARAMETERS = ("stiffness", "damping", "inertia")
_DECIDED = ("ok", "at_bound")
_LEVEL = 0.95
#: A truth below this share of what is usual of its parameter has no error in % of it.
_SMALL = 0.1


@dataclass(frozen=True, slots=True)
class Statistic:
    """A statistic by which the study's people are compared with the simulated ones."""

    title: str
    unit: str
    above: str  # what follows where the study's is larger than those of the simulated people
    below: str  # what follows where it is smaller


_LARGER = "errors can be larger than stated"
_OTHER = "the stated errors are of other joints"
#: What a study is compared by; chosen before any comparison was made.
STATISTICS: Mapping[str, Statistic] = {
    "unexplained_pct": Statistic(
        "unexplained variance",
        "%",
        f"The fit explains less of your responses than of the simulated ones: {_LARGER}",
        "The fit explains more of your responses than of the simulated ones: errors are "
        "probably smaller than stated",
    ),
    "misfit": Statistic(
        "misfit over the noise of the average response",
        "",
        f"Your responses have a form that the model does not explain: {_LARGER}",
        "The fit leaves less than the noise of the simulated people explains: noise or "
        f"number of pulses is unlike the simulated one, and {_LARGER}",
    ),
    "unpredictability_deg": Statistic(
        "unpredictability of a stride",
        "deg",
        f"Your strides are less predictable than the simulated ones: {_LARGER}",
        "Your strides are more predictable than the simulated ones: errors are probably "
        "smaller than stated",
    ),
    "displacement_deg": Statistic(
        "displacement by a pulse",
        "deg",
        f"Your pulses move the joint further than the simulated ones: {_OTHER}",
        f"Your pulses move the joint less than the simulated ones: {_LARGER}",
    ),
    "natural_frequency_hz": Statistic(
        "natural frequency",
        "Hz",
        f"Your joints are stiffer or lighter than the simulated ones: {_OTHER}",
        f"Your joints are softer or heavier than the simulated ones: {_OTHER}",
    ),
    "damping_ratio": Statistic(
        "damping ratio",
        "",
        f"Your joints are more damped than the simulated ones: {_OTHER}",
        f"Your joints are less damped than the simulated ones: {_OTHER}",
    ),
    "without_value_pct": Statistic(
        "estimates without a value",
        "%",
        f"More of your estimates are undecided, doubted or failed: {_LARGER}",
        "Fewer of your estimates are undecided, doubted or failed: the method sees less "
        "uncertainty than in the simulated people, which can be wrong",
    ),
}


@dataclass(frozen=True, slots=True)
class VirtualEstimate:
    """One parameter of a simulated person at a timing point, and its estimate."""

    participant: str  # the simulated person
    timing_point: str
    parameter: str  # estimated parameter
    truth: float  # true value of the quantity that the method estimates, SI
    value: float | None  # estimate, SI; None where undecided
    ci_low: float | None  # lower end of the interval, SI; None where undecided
    ci_high: float | None  # upper end of the interval, SI; None where undecided
    status: str  # as in :class:`jointz.results.estimates.ParameterEstimate`

    @property
    def decided(self) -> bool:
        """Whether there is a value to use."""
        return self.status in _DECIDED and self.value is not None


@dataclass(frozen=True, slots=True)
class ExpectedError:
    """Error to expect of one parameter, at a timing point or over all."""

    parameter: str
    timing_point: str  # ``all`` for all timing points together
    n: int  # number of virtual estimates
    undecided_pct: float  # share of the virtual estimates without a value
    # mean of estimate / truth - 1 over decided estimates whose truth is not small; None without any
    bias_pct: float | None
    # root mean square of estimate / truth - 1 over the same estimates; None without any
    rmse_pct: float | None
    rmse_sd_pct: float | None  # standard deviation of ``rmse_pct`` from so many people
    rmse: float | None  # root mean square error over all decided estimates, SI
    # share of the 95 % intervals that contain the truth, over all decided estimates
    coverage: float | None
    coverage_sd: float | None  # standard deviation of ``coverage`` from so many people
    # median width of the intervals, % of the truth, where the truth is not small
    width_pct: float | None
    # number of decided estimates whose truth is too small for an error in %; see
    # :func:`expected_errors`
    n_small: int = 0

    @property
    def unit(self) -> str:
        """The unit of ``rmse``."""
        return PARAMETER_UNITS[self.parameter]


@dataclass(frozen=True, slots=True)
class ComparedStatistic:
    """One statistic of the study's people beside that of simulated ones, medians over people."""

    name: str  # key of :data:`STATISTICS`
    study: float  # of the study's people
    simulated: float  # of the simulated people
    low: float  # limits of the median of equally many simulated people
    high: float

    @property
    def differs(self) -> bool:
        """True if the study is outside the limits."""
        return not self.low <= self.study <= self.high

    @property
    def sentence(self) -> str:
        """How the study differs, and what follows."""
        statistic = STATISTICS[self.name]
        text = statistic.above if self.study > self.high else statistic.below
        return (
            f"{text} ({statistic.title} {self.study:.3g} {statistic.unit}; simulated "
            f"{self.low:.3g} to {self.high:.3g})"
        )


@dataclass(frozen=True, slots=True, repr=False)
class Certificate(PlottedResult):
    """Error and coverage to expect in a study, from simulated people in its own protocol.

    Parameters
    ----------
    method : str
        The method that analysed the study and the simulated people.
    errors : tuple of ExpectedError
        For each parameter, over all timing points and at each.
    estimates : tuple of VirtualEstimate
        Every estimate of the simulated people with its truth.
    n_participants : int
        Number of simulated people.
    comparisons : tuple of ComparedStatistic
        Statistics of the study's people beside those of the simulated ones.
    world : str
        Preset of the simulated people.
    protocol : str
        What they walked, in words.
    left_out : mapping of str to str
        Simulated people without a result, and why.
    settings : mapping
        Window, seed.
    """

    SCHEMA: ClassVar[str] = "jointz.Certificate/1"
    FIGURE_SIZE: ClassVar[tuple[float, float]] = (7.0, 4.0)
    JSON_PROPERTIES: ClassVar[tuple[str, ...]] = ("status",)

    method: str
    errors: tuple[ExpectedError, ...]
    estimates: tuple[VirtualEstimate, ...] = ()
    n_participants: int = 0
    comparisons: tuple[ComparedStatistic, ...] = ()
    world: str = ""
    protocol: str = ""
    left_out: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def status(self) -> str:
        """``promised``, or ``cannot_promise`` where the study is unlike the simulated people."""
        return "cannot_promise" if self.reasons else "promised"

    @property
    def reasons(self) -> tuple[str, ...]:
        """Sentences that say why the errors cannot be promised; empty if they are."""
        if not self.comparisons:
            return ("Too few simulated people have a result to compare the study with",)
        differences = tuple(row.sentence for row in self.comparisons if row.differs)
        if not any(estimate.decided for estimate in self.estimates):
            return ("The protocol decides no value of the simulated people", *differences)
        return differences

    def error(self, parameter: str, timing_point: str = ALL_POINTS) -> ExpectedError:
        """Return the error to expect of a parameter; KeyError if nobody was perturbed there."""
        for row in self.errors:
            if (row.parameter, row.timing_point) == (parameter, timing_point):
                return row
        known = ", ".join(f"{r.parameter} at {r.timing_point}" for r in self.errors)
        raise KeyError(f"no error of {parameter!r} at {timing_point!r}; there is: {known}")

    def to_frame(self) -> pd.DataFrame:
        """Return the errors to expect, one row a parameter and timing point."""
        table = record_frame(self.errors, ExpectedError.__slots__)
        table.insert(list(table).index("rmse") + 1, "unit", [row.unit for row in self.errors])
        return table.assign(status=self.status, reasons="; ".join(self.reasons))

    def comparison_frame(self) -> pd.DataFrame:
        """Return the statistics of the study beside those of the simulated people."""
        columns = ("name", "study", "simulated", "low", "high", "differs")
        return record_frame(self.comparisons, columns)

    def summary(self) -> str:
        """Return a short text: what error to expect of K, B and J, and how often it is decided."""
        title = (
            f"Certificate of {self.method}: {self.n_participants} simulated people "
            f"({self.world}) in the protocol of the study."
        )
        lines = [f"Cannot promise: {reason}." for reason in self.reasons]
        lines += [_line(row) for row in self.errors if row.timing_point == ALL_POINTS]
        lines += [f"Protocol: {self.protocol}"] if self.protocol else []
        lines += [f"Left out: {who}: {why}" for who, why in self.left_out.items()]
        return summary_text(title, lines)

    def _draw(self, axes: "Axes") -> None:
        """Draw bias and RMSE at the timing points."""
        points = list(dict.fromkeys(row.timing_point for row in self.errors))
        for k, parameter in enumerate(PARAMETERS):
            rows = [r for r in self.errors if r.parameter == parameter and r.rmse_pct is not None]
            at = [points.index(r.timing_point) + 0.25 * (k - 1) for r in rows]
            rmse = [r.rmse_pct or 0.0 for r in rows]
            bars = axes.bar(at, rmse, width=0.22, label=f"{parameter}: RMSE")
            colour = bars.patches[0].get_facecolor() if rows else "none"
            bias = [r.bias_pct or 0.0 for r in rows]
            axes.plot(at, bias, "o", color=colour, markeredgecolor="black", linestyle="none")
        axes.axhline(0.0, color="black", linewidth=0.8)
        axes.set_xticks(range(len(points)), points)
        axes.set_ylabel("RMSE (bars), bias (dots), % of the truth")
        axes.legend()


def expected_errors(estimates: Sequence[VirtualEstimate]) -> tuple[ExpectedError, ...]:
    """Return the error to expect of every parameter, over all timing points and at each.

    Standard deviations are those of a ratio of sums over simulated people (Cochran,
    Sampling Techniques, 6.3): what a participant's timing points share counts once.

    An error in % of nearly nothing says nothing: a truth below a tenth of the median of its
    parameter, or of its RMSE, over all timing points, counts in ``rmse``, ``coverage`` and
    ``undecided_pct`` only. The truth decides which these are, not the estimate.
    """
    points = [ALL_POINTS, *dict.fromkeys(e.timing_point for e in estimates)]
    rows = []
    for name in PARAMETERS:
        of_parameter = [e for e in estimates if e.parameter == name]
        least = _least_truth(of_parameter)
        for point in points:
            at_point = [e for e in of_parameter if point in (ALL_POINTS, e.timing_point)]
            if at_point:
                rows.append(_expected(name, point, at_point, least=least))
    return tuple(rows)


def _least_truth(estimates: Sequence[VirtualEstimate]) -> float:
    """Return the least truth that errors of a parameter are told in % of, SI."""
    if not estimates:
        return 0.0
    decided = [e for e in estimates if e.decided]
    usual = float(np.median([e.truth for e in estimates]))
    return _SMALL * max(usual, _rmse(decided) if decided else 0.0)


def _expected(
    parameter: str, timing_point: str, estimates: Sequence[VirtualEstimate], *, least: float
) -> ExpectedError:
    decided = [e for e in estimates if e.decided]
    undecided = 100.0 * (1.0 - len(decided) / len(estimates))
    if not decided:
        no_numbers: dict[str, Any] = dict.fromkeys(ExpectedError.__slots__[4:-1])
        return ExpectedError(parameter, timing_point, len(estimates), undecided, **no_numbers)
    relative = [e for e in decided if e.truth > 0.0 and e.truth >= least]
    truth = _column(e.truth for e in decided)
    low, high = _column(e.ci_low for e in decided), _column(e.ci_high for e in decided)
    inside = ((low <= truth) & (truth <= high)).astype(float)
    coverage, coverage_sd = _mean(inside, _people(decided))
    return ExpectedError(
        parameter=parameter,
        timing_point=timing_point,
        n=len(estimates),
        undecided_pct=undecided,
        **_relative(relative),
        rmse=_rmse(decided),
        coverage=coverage,
        coverage_sd=coverage_sd,
        n_small=len(decided) - len(relative),
    )


def _relative(estimates: Sequence[VirtualEstimate]) -> dict[str, float | None]:
    """Return the errors in % of the truth."""
    if not estimates:
        return dict.fromkeys(("bias_pct", "rmse_pct", "rmse_sd_pct", "width_pct"))
    truth = _column(e.truth for e in estimates)
    relative = _column(e.value for e in estimates) / truth - 1.0
    width = _column(e.ci_high for e in estimates) - _column(e.ci_low for e in estimates)
    square, square_sd = _mean(relative**2, _people(estimates))
    rmse = float(np.sqrt(square))
    return {
        "bias_pct": 100.0 * float(relative.mean()),
        "rmse_pct": 100.0 * rmse,
        "rmse_sd_pct": None if square_sd is None else 100.0 * square_sd / (2.0 * max(rmse, 1e-12)),
        "width_pct": 100.0 * float(np.median(width / truth)),
    }


def _rmse(estimates: Sequence[VirtualEstimate]) -> float:
    errors = _column(e.value for e in estimates) - _column(e.truth for e in estimates)
    return float(np.sqrt((errors**2).mean()))


def _people(estimates: Sequence[VirtualEstimate]) -> list[str]:
    return [e.participant for e in estimates]


def _column(values: Iterable[float | None]) -> np.ndarray:
    return np.array(list(values), dtype=float)


def _mean(values: np.ndarray, clusters: Sequence[Any]) -> tuple[float, float | None]:
    """Return a mean and its standard deviation, None from a single cluster."""
    mean = float(values.mean())
    names = dict.fromkeys(clusters)
    if len(names) < 2:
        return mean, None
    sums = dict.fromkeys(names, 0.0)
    for name, value in zip(clusters, values, strict=True):
        sums[name] += float(value) - mean
    off = np.array(list(sums.values()))
    variance = len(off) / (len(off) - 1) * float(off @ off) / values.size**2
    return mean, float(np.sqrt(variance))


def _line(row: ExpectedError) -> str:
    if row.rmse is None or row.coverage is None:
        return f"{row.parameter:<10} never decided, {row.n} estimates"
    size = f"RMSE {row.rmse:.3g} {row.unit}"
    if row.rmse_pct is not None:
        about = "" if row.rmse_sd_pct is None else f" +- {row.rmse_sd_pct:.1f}"
        size = f"RMSE {row.rmse_pct:.1f}{about} %, bias {row.bias_pct:+.1f} %"
    small = f", {row.n_small} of {row.n} too small for errors in %" if row.n_small else ""
    return (
        f"{row.parameter:<10} {size}, {_LEVEL:.0%} intervals hold {row.coverage:.0%}, "
        f"undecided {row.undecided_pct:.0f} %{small}"
    )
