"""Comparison of controllers in the test bed: scores of runs, means over people, differences."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np
import pandas as pd
from scipy.stats import spearmanr, t

from jointz.control.testbed.bed_laws import REFERENCE
from jointz.control.testbed.scores import PLAIN, SCORES, TESTS
from jointz.results.base import Array, PlottedResult, record_frame, summary_text
from jointz.results.figure_style import BLUE, FAINT

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LEVEL: Final = 0.95
#: Fewer people have no interval.
_LEAST_PEOPLE: Final = 3
#: Fewer controllers have no rank correlation.
_LEAST_CONTROLLERS: Final = 4
#: Stands where a trace's controller could, for the intact gait.
INTACT: Final = "intact"
PUSHES: Final = ("push_stance", "push_swing")


@dataclass(frozen=True, slots=True)
class BedRun:
    """Scores of a run; None where there is none, such as work where all strides have a fall."""

    participant: str
    controller: str
    test: str
    seed: int
    scores: Mapping[str, float | None]


@dataclass(frozen=True, slots=True)
class BedMean:
    """Mean over people of a score, or of its differences to the reference."""

    controller: str
    test: str
    score: str
    unit: str
    mean: float | None
    ci_low: float | None
    ci_high: float | None
    n: int  # people


@dataclass(frozen=True, slots=True)
class BedCorrelation:
    """Rank correlation over controllers of a score with tracking in plain walking."""

    test: str
    score: str
    rho: float | None  # mean over people
    ci_low: float | None
    ci_high: float | None
    n: int  # people


@dataclass(frozen=True, slots=True, eq=False)
class BedTrace:
    """Curves of the first person and seed."""

    controller: str
    test: str  # plain: angle over the cycle; a push: deviation over the time since
    x: Array  # % of the cycle, or s; until it falls
    y: Array  # deg


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class BedComparison(PlottedResult):
    """Scores of controllers in the test bed.

    Parameters
    ----------
    participants : tuple of str
        Whose profiles were compared.
    runs : tuple of BedRun
        Scores of each person, controller, test and seed.
    means : tuple of BedMean
        Means over people, each the mean of a person's seeds, with t interval from three people on.
    differences : tuple of BedMean
        The same of paired differences to ``impedance_continuous``.
    correlations : tuple of BedCorrelation
        Spearman's rank correlation over controllers with tracking in plain walking.
    traces : tuple of BedTrace
        Angle over the cycle and deviation after a push of the first person.
    settings : mapping
        Seeds and others.
    ci_level : float
        Level of the intervals.
    provenance : mapping
        Versions and time.
    """

    SCHEMA: ClassVar[str] = "jointz.BedComparison/1"
    FIGURE_SIZE: ClassVar[tuple[float, float]] = (7.0, 3.2)

    participants: tuple[str, ...]
    runs: tuple[BedRun, ...]
    means: tuple[BedMean, ...]
    differences: tuple[BedMean, ...]
    correlations: tuple[BedCorrelation, ...]
    traces: tuple[BedTrace, ...]
    settings: Mapping[str, Any]
    ci_level: float = LEVEL
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def controllers(self) -> tuple[str, ...]:
        """Names of the controllers, in the order of the tables."""
        return tuple(dict.fromkeys(mean.controller for mean in self.means))

    def to_frame(self) -> pd.DataFrame:
        """Return one row a person, controller, test and seed, one column a score."""
        return runs_frame(self.runs)

    def means_frame(self) -> pd.DataFrame:
        """Return one row a controller, test and score, with the difference to the reference."""
        ends = ("mean", "ci_low", "ci_high", "n")
        means = record_frame(self.means, BedMean.__dataclass_fields__)
        away = record_frame(self.differences, ("controller", "test", "score", *ends))
        away = away.rename(columns={end: f"difference_{end}" for end in ends})
        return means.merge(away, how="left", on=["controller", "test", "score"])

    def mean(self, controller: str, test: str, score: str) -> BedMean:
        """Return a mean; raise KeyError if there is none."""
        for mean in self.means:
            if (mean.controller, mean.test, mean.score) == (controller, test, score):
                return mean
        raise KeyError(f"no {score} of {controller} in {test}")

    def summary(self) -> str:
        """Return a short text: tracking and falls of each controller in plain walking."""
        width = max(map(len, self.controllers))
        lines = []
        for name in self.controllers:
            tracking, falls, push = (
                bed_text(self.mean(name, test, score))
                for test, score in (
                    (PLAIN, "tracking"),
                    (PLAIN, "fallen_strides"),
                    ("push_stance", "push_deviation"),
                )
            )
            lines.append(f"{name:<{width}}  {tracking} deg; {falls}; push {push} deg")
        title = (
            f"{len(self.controllers)} controllers, {people_text(len(self.participants))}: "
            "deviation from the intact angle, share of strides with a fall, deviation by a push "
            "in stance"
        )
        interval = f"[{self.ci_level:.0%} t interval over people]"
        notes = () if len(self.participants) >= _LEAST_PEOPLE else ("no interval: under 3 people.",)
        return summary_text(f"{title} {interval}", lines, notes)

    def _draw(self, axes: "Axes") -> None:
        """Draw tracking in plain walking."""
        draw_score(axes, self, PLAIN, "tracking")
        axes.set_yticks(range(len(self.controllers)), self.controllers)
        axes.set_xlabel("RMS deviation from the intact angle (deg)")
        axes.set_ylabel("controller")


def draw_score(axes: "Axes", found: BedComparison, test: str, score: str) -> None:
    """Draw a score, controllers in rows: dots with intervals."""
    for row, name in enumerate(found.controllers):
        mean = found.mean(name, test, score)
        if mean.mean is None:
            continue
        colour = BLUE if name == REFERENCE else "black"
        if mean.ci_low is not None and mean.ci_high is not None:
            axes.hlines(row, mean.ci_low, mean.ci_high, color=colour, linewidth=1.0)
        axes.plot(mean.mean, row, "o", color=colour, markersize=3.5)
    axes.set_ylim(len(found.controllers) - 0.5, -0.5)
    axes.grid(axis="y", color=FAINT, linewidth=0.3)


def people_text(count: int) -> str:
    """Return a number of people in words."""
    return f"{count} {'person' if count == 1 else 'people'}"


def bed_text(mean: BedMean) -> str:
    """Return a mean with its interval."""
    if mean.mean is None:
        return "none"
    if mean.ci_low is None or mean.ci_high is None:
        return f"{mean.mean:.3g}"
    return f"{mean.mean:.3g} [{mean.ci_low:.3g}, {mean.ci_high:.3g}]"


# --- statistics ----------------------------------------------------------------------------------


def runs_frame(runs: tuple[BedRun, ...]) -> pd.DataFrame:
    """Return one row a run, one column a score."""
    frame = record_frame(runs, ("participant", "controller", "test", "seed"))
    for score in SCORES:
        frame[score] = [np.nan if (v := run.scores.get(score)) is None else v for run in runs]
    return frame


def bed_means(runs: tuple[BedRun, ...], reference: str | None = None) -> tuple[BedMean, ...]:
    """Return means over people, or those of paired differences to a reference."""
    frame = runs_frame(runs)
    keys = ["participant", "controller", "test"]
    people = frame.groupby(keys, sort=False)[list(SCORES)].mean()
    means = []
    for test in TESTS:
        table = people.xs(test, level="test")
        for name in frame["controller"].unique():
            own = table.xs(name, level="controller")
            if reference is not None:
                own = own - table.xs(reference, level="controller")
            if name != reference:
                scores = (s for s in SCORES if test in PUSHES or not _of_pushes(s))
                least = 0.0 if reference is None else -1.0  # of shares
                means += [_mean(name, test, s, own[s].dropna().to_numpy(), least) for s in scores]
    return tuple(means)


def _of_pushes(score: str) -> bool:
    return score in ("push_deviation", "return_time")


def _mean(controller: str, test: str, score: str, values: np.ndarray, least: float) -> BedMean:
    mean, low, high = _student(values)
    if SCORES[score][1] == "1" and low is not None and high is not None:
        low, high = max(low, least), min(high, 1.0)
    return BedMean(controller, test, score, SCORES[score][1], mean, low, high, values.size)


def _student(values: np.ndarray) -> tuple[float | None, float | None, float | None]:
    """Return mean and t interval; no interval for fewer than three values."""
    if not values.size:
        return None, None, None
    mean = float(values.mean())
    if values.size < _LEAST_PEOPLE:
        return mean, None, None
    reach = t.ppf(0.5 + 0.5 * LEVEL, values.size - 1) * values.std(ddof=1) / np.sqrt(values.size)
    return mean, float(mean - reach), float(mean + reach)


def bed_correlations(runs: tuple[BedRun, ...]) -> tuple[BedCorrelation, ...]:
    """Return how each score ranks controllers as tracking in plain walking does."""
    frame = runs_frame(runs)
    tables = {
        (test, score): own.pivot_table(score, "participant", "controller", dropna=False)
        for test, own in frame.groupby("test", sort=False)
        for score in SCORES
        if test in PUSHES or not _of_pushes(score)
    }
    tracking = tables.pop((PLAIN, "tracking"))
    found = []
    for (test, score), table in tables.items():
        rhos = np.array([_rank(tracking.loc[who], table.loc[who]) for who in table.index])
        rhos = rhos[np.isfinite(rhos)]
        found.append(BedCorrelation(str(test), score, *_student(rhos), rhos.size))
    return tuple(found)


def _rank(tracking: pd.Series, score: pd.Series) -> float:
    """Return Spearman's correlation, nan without enough different values."""
    both = pd.concat([tracking, score], axis=1).dropna().to_numpy()
    if len(both) < _LEAST_CONTROLLERS or np.ptp(both[:, 0]) == 0.0 or np.ptp(both[:, 1]) == 0.0:
        return np.nan
    return float(spearmanr(both[:, 0], both[:, 1]).statistic)
