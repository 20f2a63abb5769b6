"""Tests of the sign and direction of pulses on the estimates."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product
from math import isfinite
from typing import ClassVar

import pandas as pd

from jointz.core.codes import Code
from jointz.results.base import (
    Axes,
    PlottedResult,
    Result,
    record_frame,
    summary_text,
)

_RESPONSE_SYMBOLS = {"stiffness": "K", "inertia": "J"}
_EFFECT_MARKERS = {"type": "o", "direction": "s", "type:direction": "^", "joint": "D"}
_RESPONSE_COLOURS = {"stiffness": "C0", "inertia": "C1"}
_SMALLEST_DRAWN_P = 1e-16


class Undecided(Code):
    """Why a test of pulses has no answer; part of the file format."""

    TOO_FEW_PULSES = "too_few_pulses", "fewer pulses with a finite estimate than the test needs"
    ONE_LEVEL = "one_level", "every pulse has the same level: nothing to compare"
    NO_VARIATION = "no_variation", "the estimates do not vary, or not inside the trials"
    CONFOUNDED = "confounded", "type and direction go together: only their joint effect can be told"
    MISSING_COMBINATION = "missing_combination", "a combination of type and direction has no pulse"
    TOO_FEW_TRIALS = (
        "too_few_trials",
        "too few trials to tell the effects from differences between trials",
    )


@dataclass(frozen=True, slots=True)
class PulseTest:
    """One test of one effect on one parameter, in one case and trajectory."""

    case: str  # name of the load
    trajectory: str  # name of the reference trajectory
    response: str  # ``stiffness`` or ``inertia``
    # ``type`` (sign of the pulse), ``direction`` (with or against the trajectory),
    # ``type:direction``, or ``joint``: any of them, where they are confounded
    effect: str
    # ``one_way``: the printed analysis, with pulses as independent; ``mixed``: trial as a random
    # factor
    analysis: str
    statistic: float | None  # F; None where undecided, or where F is infinite (then p = 0)
    df_num: float | None  # numerator degrees of freedom; None where undecided
    df_den: float | None  # denominator degrees of freedom; None where undecided
    p: float | None  # p of F; None where undecided
    # p by Holm's correction over the family of the analysis, see :class:`PulseEffects`
    p_holm: float | None
    # positive minus negative, or with minus against, N*m/rad or kg*m^2; None for effects that are
    # not one difference
    difference: float | None
    # lower end of the interval of ``difference`` by the mixed model, level 1 - ``alpha``
    ci_low: float | None
    # upper end of the interval of ``difference`` by the mixed model, level 1 - ``alpha``
    ci_high: float | None
    n_pulses: int  # pulses of the test
    n_trials: int  # trials of the test
    status: str = "ok"  # ``ok`` or ``undecided``
    code: str = ""  # code of :class:`Undecided`; empty where ``ok``


@dataclass(frozen=True, slots=True)
class PulseMeans:
    """Means of one parameter in one case and trajectory."""

    case: str  # name of the load
    trajectory: str  # name of the reference trajectory
    response: str  # ``stiffness`` or ``inertia``
    positive: float | None  # mean over positive pulses, N*m/rad or kg*m^2; None without any
    negative: float | None  # mean over negative pulses, N*m/rad or kg*m^2; None without any
    along: float | None  # mean over pulses with the trajectory, N*m/rad or kg*m^2; None without any
    # mean over pulses against the trajectory, N*m/rad or kg*m^2; None without any
    against: float | None
    n_used: int  # number of pulses used
    n_excluded: int  # number of pulses without a finite estimate, a sign or a direction
    trial_sd: float | None  # sd between trials by the mixed model, N*m/rad or kg*m^2
    residual_sd: float | None  # sd inside trials by the mixed model, N*m/rad or kg*m^2
    # correlation of type and direction over the pulses, -1..1; None without variation of one of
    # them
    confounding: float | None


@dataclass(frozen=True, slots=True)
class PulseCount(Result):
    """A count as section 2.4.2 of the dissertation gives them.

    Parameters
    ----------
    claim : str
        ``significant`` (p < alpha), ``positive_larger`` or ``with_larger``.
    analysis : str
        ``one_way`` or ``mixed`` for tests, ``means`` for comparisons of means.
    response, effect : str
        What it is about; ``all`` over both parameters or effects.
    count, of : int
        How many of how many; undecided ones count in neither.
    """

    JSON_PROPERTIES: ClassVar[tuple[str, ...]] = ("share_pct",)

    claim: str
    analysis: str
    response: str
    effect: str
    count: int
    of: int

    @property
    def share_pct(self) -> float | None:
        """``count`` in percent of ``of``; None of none."""
        return 100.0 * self.count / self.of if self.of else None


@dataclass(frozen=True, slots=True, repr=False)
class PulseEffects(PlottedResult):
    """Effects of pulse type and direction over the cases and trajectories of a study.

    Parameters
    ----------
    tests : tuple of PulseTest
        Both analyses, undecided tests included. Holm's correction runs over two families:
        all decided ``one_way`` tests of the study, and all decided ``mixed`` ones.
    means : tuple of PulseMeans
        One a case, trajectory and parameter.
    alpha : float
        Level of the counts and, as ``1 - alpha``, of the intervals.
    notes : tuple of str
        What a reader must know, such as the confounded trajectories.
    """

    SCHEMA: ClassVar[str] = "jointz.PulseEffects/1"
    JSON_PROPERTIES: ClassVar[tuple[str, ...]] = ("counts",)

    tests: tuple[PulseTest, ...]
    means: tuple[PulseMeans, ...]
    alpha: float = 0.05
    notes: tuple[str, ...] = ()

    @property
    def counts(self) -> tuple[PulseCount, ...]:
        """The counts of 2.4.2, for each analysis, parameter and effect."""
        return (*self._significant(), *self._larger())

    def count(self, claim: str, analysis: str, response: str, effect: str) -> PulseCount:
        """Return one of :attr:`counts`; KeyError if there is none."""
        key = (claim, analysis, response, effect)
        for c in self.counts:
            if (c.claim, c.analysis, c.response, c.effect) == key:
                return c
        raise KeyError(f"no count {key}; PulseEffects.counts lists them")

    def _significant(self) -> Iterable[PulseCount]:
        analyses, responses = ("one_way", "mixed"), ("stiffness", "inertia", "all")
        every = ("type", "direction", "all", "joint", "type:direction")
        for analysis, effect, response in product(analyses, every, responses):
            effects = ("type", "direction") if effect == "all" else (effect,)
            p = [
                t.p
                for t in self.tests
                if t.analysis == analysis
                and t.effect in effects
                and response in (t.response, "all")
                and t.p is not None
            ]
            if p or effect in ("type", "direction", "all"):
                n = sum(value < self.alpha for value in p)
                yield PulseCount("significant", analysis, response, effect, n, len(p))

    def _larger(self) -> Iterable[PulseCount]:
        for response in _RESPONSE_SYMBOLS:
            means = [m for m in self.means if m.response == response]
            for claim, effect, pairs in (
                ("positive_larger", "type", [(m.positive, m.negative) for m in means]),
                ("with_larger", "direction", [(m.along, m.against) for m in means]),
            ):
                known = [(a, b) for a, b in pairs if a is not None and b is not None]
                larger = sum(a > b for a, b in known)
                yield PulseCount(claim, "means", response, effect, larger, len(known))

    def to_frame(self) -> pd.DataFrame:
        """Return the tests as a table, one row a test."""
        return record_frame(self.tests, PulseTest.__slots__)

    def summary(self) -> str:
        """Return a short text: the counts of both analyses, and the notes."""
        cells = {(m.case, m.trajectory) for m in self.means}
        title = f"Pulse type and direction in {len(cells)} case-trajectory pairs"
        lines = [_sentence(c, self.alpha) for c in self.counts if c.of]
        undecided = sum(t.status != "ok" for t in self.tests)
        lines.append(f"{undecided} of {len(self.tests)} tests undecided")
        return summary_text(title, lines, self.notes)

    def _draw(self, axes: "Axes") -> None:
        """Draw the p-values of the mixed model, one column a case and trajectory."""
        names = list(dict.fromkeys(f"{m.case}{m.trajectory}" for m in self.means))
        for effect, marker in _EFFECT_MARKERS.items():
            for response, symbol in _RESPONSE_SYMBOLS.items():
                shown = [
                    (names.index(f"{t.case}{t.trajectory}"), max(t.p, _SMALLEST_DRAWN_P))
                    for t in self.tests
                    if t.analysis == "mixed"
                    and t.p is not None
                    and (t.effect, t.response) == (effect, response)
                ]
                if shown:
                    x, p = zip(*shown, strict=True)
                    label, colour = f"{symbol}, {effect}", _RESPONSE_COLOURS[response]
                    axes.plot(x, p, marker, color=colour, label=label, alpha=0.8)
        axes.axhline(self.alpha, color="0.4", linestyle=":", label=f"{self.alpha:g}")
        axes.set_yscale("log")
        axes.set_xticks(range(len(names)), names)
        axes.set(xlabel="case and trajectory", ylabel="p, trial as a random factor")
        axes.legend(fontsize="small", ncols=2)


def finite_or_none(value: float) -> float | None:
    """Return a plain float, None for one that JSON cannot hold."""
    return float(value) if isfinite(value) else None


def _sentence(c: PulseCount, alpha: float) -> str:
    share = f"{c.count} of {c.of} ({c.share_pct:.1f} %)"
    if c.claim == "significant":
        what = "type or direction" if c.effect == "all" else c.effect
        where = "stiffness and inertia" if c.response == "all" else c.response
        return f"{c.analysis}: {what} has p < {alpha:g} for {where} in {share}"
    first, second = {
        "positive_larger": ("positive", "negative"),
        "with_larger": ("with the trajectory", "against it"),
    }[c.claim]
    return f"mean {c.response} of pulses {first} larger than {second} in {share}"
