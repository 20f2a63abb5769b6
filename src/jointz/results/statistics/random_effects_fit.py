"""Random-effects means over studies."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, ClassVar

import numpy as np
import pandas as pd
from pydantic import BeforeValidator, InstanceOf
from scipy.special import stdtrit

from jointz.kernels.statistics.between_study_variance import RandomEffectsFit
from jointz.results.base import Axes, Result, summary_text
from jointz.results.figure_style import axes_or_new, in_figure_style
from jointz.results.series.frequency_response_curve import INK, MODEL


def _rebuilt(kind: type, value: Any) -> Any:
    if not isinstance(value, Mapping):
        return value
    return kind(**{k: np.asarray(v, float) if isinstance(v, list) else v for k, v in value.items()})


_UnivariateFit = Annotated[
    InstanceOf[RandomEffectsFit], BeforeValidator(partial(_rebuilt, RandomEffectsFit))
]


@dataclass(frozen=True, slots=True)
class StudyMean:
    """The mean over the people of a study."""

    study: str  # name in tables and figures
    value: float  # mean over the people, SI
    se: float  # standard error of the mean, SI
    n_people: int  # number of people behind the mean
    ci_level: float = 0.95  # level of the interval

    @property
    def interval(self) -> tuple[float, float]:
        """Student's interval over the people of this study alone."""
        reach = float(stdtrit(self.n_people - 1, 0.5 + self.ci_level / 2.0)) * self.se
        return self.value - reach, self.value + reach


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RandomEffects(Result):
    """One parameter over studies."""

    SCHEMA: ClassVar[str] = "jointz.RandomEffects/1"

    parameter: str
    unit: str
    studies: tuple[StudyMean, ...]  # pooled studies
    fit: _UnivariateFit  # mean, intervals, spread between studies, weights
    ci_level: float = 0.95  # of all intervals

    def to_frame(self) -> pd.DataFrame:
        """Return one row a study: ``study, value, se, ci_low, ci_high, n_people, weight_pct``."""
        rows = [
            (s.study, s.value, s.se, *s.interval, s.n_people, 100.0 * weight)
            for s, weight in zip(self.studies, self.fit.weights.tolist(), strict=True)
        ]
        names = ["study", "value", "se", "ci_low", "ci_high", "n_people", "weight_pct"]
        return pd.DataFrame(rows, columns=names)

    def summary(self) -> str:
        """Return mean, interval, and how much studies differ."""
        f, people = self.fit, sum(s.n_people for s in self.studies)
        level = f"{100 * self.ci_level:g} %"
        title = (
            f"{self.parameter}: {f.mean:.4g} {self.unit}, {level} interval {f.low:.4g} to "
            f"{f.high:.4g} ({len(self.studies)} studies, {people} people)"
        )
        lines = [
            f"another study: {f.prediction_low:.4g} to {f.prediction_high:.4g}",
            f"between studies: sd {np.sqrt(f.tau2):.3g} ({np.sqrt(f.tau2_low):.3g} to "
            f"{np.sqrt(f.tau2_high):.3g}), I2 {f.i2_pct:.0f} %, Q {f.q:.3g} (p {f.q_p:.2g})",
        ]
        return summary_text(title, lines)

    @in_figure_style
    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw a forest plot: the studies, their mean below them."""
        f = self.fit
        mean = {"value": f.mean, "ci_low": f.low, "ci_high": f.high}
        mean |= {"prediction_low": f.prediction_low, "prediction_high": f.prediction_high}
        axes = draw_forest(self.to_frame().to_dict("records"), mean, ax)
        axes.set_xlabel(f"{self.parameter} ({self.unit}), {100 * self.ci_level:g} % intervals")
        return axes


def draw_forest(
    studies: Sequence[Mapping[Any, Any]], mean: Mapping[Any, Any], ax: "Axes | None" = None
) -> "Axes":
    """Draw a forest plot: the studies, their mean below them."""
    axes = axes_or_new(ax, (6.0, 4.0))
    at, below = np.arange(len(studies)), len(studies) + 0.3
    values = np.array([s["value"] for s in studies])
    axes.hlines(at, [s["ci_low"] for s in studies], [s["ci_high"] for s in studies], color="0.4")
    sizes = [20.0 + 3.0 * s["weight_pct"] for s in studies]
    axes.scatter(values, at, s=sizes, marker="s", color=INK, zorder=2.5)
    axes.hlines(below, mean["prediction_low"], mean["prediction_high"], color=MODEL, lw=1)
    across = [mean["ci_low"], mean["value"], mean["ci_high"], mean["value"]]
    axes.fill(across, [below, below - 0.25, below, below + 0.25], color=MODEL)
    labels = [f"{s['study']} ({int(s['n_people'])})" for s in studies]
    axes.set_yticks([*at, below], [*labels, "mean over studies"])
    axes.invert_yaxis()
    axes.set_ylabel("study (people)")
    return axes
