"""Studies together: the mean over studies of one parameter, or of several."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from jointz.kernels.statistics.between_study_variance import RandomEffectsFit
from jointz.kernels.statistics.multivariate_random_effects import MultivariateFit
from jointz.results.base import Result, checked_values
from jointz.results.series.frequency_response_curve import INK, MODEL

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCHEMA: Final = "jointz.RandomEffects/1"
JOINT_SCHEMA: Final = "jointz.JointRandomEffects/1"


@dataclass(frozen=True, slots=True)
class StudyMean:
    """The mean over the people of a study."""

    study: str  # as tables and figures call it
    value: float  # mean and its standard error, SI
    se: float
    n_people: int  # people it is of
    ci_level: float = 0.95  # of its own interval

    @property
    def interval(self) -> tuple[float, float]:
        """Student's interval over the people of this study alone."""
        reach = float(stdtrit(self.n_people - 1, 0.5 + self.ci_level / 2.0)) * self.se
        return self.value - reach, self.value + reach


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RandomEffects(Result):
    """One parameter over studies."""

    parameter: str
    unit: str
    studies: tuple[StudyMean, ...]  # what was pooled
    fit: RandomEffectsFit  # mean, intervals, spread between studies, weights
    ci_level: float = 0.95  # of all intervals

    def __eq__(self, other: object) -> bool:
        # Arrays have no single truth; their plain values do.
        if not isinstance(other, RandomEffects):
            return NotImplemented
        return self.to_dict() == other.to_dict()

    __hash__ = None  # type: ignore[assignment]

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
        return "\n".join(
            [
                f"{self.parameter}: {f.mean:.4g} {self.unit}, {level} interval {f.low:.4g} to "
                f"{f.high:.4g} ({len(self.studies)} studies, {people} people)",
                f"  another study: {f.prediction_low:.4g} to {f.prediction_high:.4g}",
                f"  between studies: sd {np.sqrt(f.tau2):.3g} ({np.sqrt(f.tau2_low):.3g} to "
                f"{np.sqrt(f.tau2_high):.3g}), I2 {f.i2_pct:.0f} %, Q {f.q:.3g} (p {f.q_p:.2g})",
            ]
        )

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw a forest plot: the studies, their mean below them."""
        f = self.fit
        mean = {"value": f.mean, "ci_low": f.low, "ci_high": f.high}
        mean |= {"prediction_low": f.prediction_low, "prediction_high": f.prediction_high}
        axes = draw_forest(self.to_frame().to_dict("records"), mean, ax)
        axes.set_xlabel(f"{self.parameter} ({self.unit}), {100 * self.ci_level:g} % intervals")
        return axes

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        return {
            "schema": SCHEMA,
            "parameter": self.parameter,
            "unit": self.unit,
            "studies": [asdict(s) for s in self.studies],
            "fit": _plain_fit(self.fit),
            "ci_level": self.ci_level,
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "RandomEffects":
        """Rebuild from :meth:`to_dict`."""
        values = checked_values(data, SCHEMA)
        values["studies"] = tuple(StudyMean(**s) for s in values["studies"])
        values["fit"] = RandomEffectsFit(**_arrays(values["fit"]))
        return cls(**values)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class JointRandomEffects(Result):
    """Several parameters over studies, their errors and their spread going together."""

    parameters: tuple[str, ...]  # of what, in the order of all arrays
    units: tuple[str, ...]
    studies: tuple[str, ...]  # what was pooled
    values: np.ndarray  # means over people; NaN where a study has none
    fit: MultivariateFit  # means, intervals, covariance between studies
    ci_level: float = 0.95  # of all intervals

    def __eq__(self, other: object) -> bool:
        # Arrays have no single truth; their plain values do.
        if not isinstance(other, JointRandomEffects):
            return NotImplemented
        return self.to_dict() == other.to_dict()

    __hash__ = None  # type: ignore[assignment]

    def to_frame(self) -> pd.DataFrame:
        """Return one row a parameter: mean, intervals, sd between studies, studies."""
        return pd.DataFrame(
            {
                "parameter": self.parameters,
                "unit": self.units,
                "value": self.fit.mean,
                "ci_low": self.fit.low,
                "ci_high": self.fit.high,
                "prediction_low": self.fit.prediction_low,
                "prediction_high": self.fit.prediction_high,
                "tau": np.sqrt(np.diag(self.fit.between)),
                "n_studies": np.isfinite(self.values).sum(axis=0),
            }
        )

    def summary(self) -> str:
        """Return a line for each parameter."""
        lines = [f"{len(self.studies)} studies, {', '.join(self.parameters)} together"]
        lines += [
            f"  {row.parameter}: {row.value:.4g} {row.unit}, {100 * self.ci_level:g} % interval "
            f"{row.ci_low:.4g} to {row.ci_high:.4g}; sd between studies {row.tau:.3g}"
            for row in self.to_frame().itertuples()
        ]
        return "\n".join(lines)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw every parameter as a share of its mean, with its intervals."""
        import matplotlib.pyplot as plt

        axes = ax if ax is not None else plt.subplots(figsize=(6.0, 3.0), layout="constrained")[1]
        f, size, at = self.fit, np.abs(self.fit.mean), np.arange(len(self.parameters))
        axes.hlines(at, f.prediction_low / size, f.prediction_high / size, lw=1.0, color=INK)
        axes.hlines(at, f.low / size, f.high / size, lw=3.0, color=INK)
        axes.plot(f.mean / size, at, "o", color=INK)
        axes.set_yticks(at, list(self.parameters))
        axes.set_ylabel("parameter")
        axes.set_xlabel("share of the mean: interval (thick), another study (thin)")
        return axes

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        rows = self.values.tolist()
        values = [[v if np.isfinite(v) else None for v in row] for row in rows]
        return {
            "schema": JOINT_SCHEMA,
            "parameters": list(self.parameters),
            "units": list(self.units),
            "studies": list(self.studies),
            "values": values,
            "fit": _plain_fit(self.fit),
            "ci_level": self.ci_level,
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "JointRandomEffects":
        """Rebuild from :meth:`to_dict`."""
        values = checked_values(data, JOINT_SCHEMA)
        for name in ("parameters", "units", "studies"):
            values[name] = tuple(values[name])
        values["values"] = np.asarray(values["values"], dtype=float)
        values["fit"] = MultivariateFit(**_arrays(values["fit"]))
        return cls(**values)


def draw_forest(
    studies: Sequence[Mapping[Any, Any]], mean: Mapping[Any, Any], ax: "Axes | None" = None
) -> "Axes":
    """Draw a forest plot: the studies, their mean below them."""
    import matplotlib.pyplot as plt

    axes = ax if ax is not None else plt.subplots(figsize=(6.0, 4.0), layout="constrained")[1]
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


def _plain_fit(fit: RandomEffectsFit | MultivariateFit) -> dict[str, Any]:
    held = {f.name: getattr(fit, f.name) for f in fields(fit)}
    return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in held.items()}


def _arrays(held: Mapping[str, Any]) -> dict[str, Any]:
    return {k: np.asarray(v, dtype=float) if isinstance(v, list) else v for k, v in held.items()}
