"""Test of a difference between curves, node by node, with the differences not ruled out."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import pandas as pd

from jointz.results.base import Axes, PlottedResult, summary_text

_CURVES = ("t", "difference", "ci_low", "ci_high", "p")
_TITLES = {"random_field": "Statistical parametric mapping", "sign_flip": "Sign-flip max-t test"}


@dataclass(frozen=True, slots=True)
class WaveformCluster:
    """Neighbouring nodes where the curves differ, all in one direction."""

    # start, counted from 0; between nodes where the line between them crosses the threshold
    start_node: float
    end_node: float  # end, counted likewise
    extent_resels: float | None  # width in resolution elements of the field; None for sign flips
    peak_node: int  # node of the t farthest from zero
    peak_t: float  # t at ``peak_node``; positive where the first curves are larger
    # two-tailed. Random fields: probability of a cluster as wide anywhere on the curve. Sign flips:
    # probability of a t as far from zero anywhere on the curve
    p: float


@dataclass(frozen=True, slots=True, repr=False)
class WaveformTest(PlottedResult):
    """Two sets of curves compared node by node, errors held over the whole curve.

    Parameters
    ----------
    method : str
        ``random_field`` or ``sign_flip``.
    design : str
        ``paired`` or ``unpaired``.
    n_a, n_b : int
        Participants; the same ones where paired.
    df : float
        Degrees of freedom of t.
    alpha : float
        Chance of any false finding on the curve, two-tailed.
    threshold : float
        The t to exceed, on either side of zero.
    threshold_from : str
        How it was found.
    t : tuple of float
        Student's t at each node; 0 at ``untested_nodes``.
    difference : tuple of float
        Mean of the first curves minus mean of the second.
    ci_low, ci_high : tuple of float
        Band that holds the true difference at all nodes at once with probability
        ``1 - alpha``.
    p : tuple of float
        At each node, adjusted for all: chance of a t as far from zero anywhere.
    clusters : tuple of WaveformCluster
        Where the curves differ, from left to right.
    p_set : float or None
        Chance of as many clusters as wide as the narrowest; None without clusters and of
        sign flips.
    fwhm_nodes, resels : float or None
        Width of the field and resolution elements; None of sign flips.
    equivalence_margin : float or None
        Largest difference of no importance, in the unit of the curves; None where none was
        stated.
    untested_nodes : tuple of int
        Nodes where everybody's difference is zero.
    settings : mapping
        What was chosen, and the version of jointz.
    warnings : tuple of str
        What a reader of the numbers must know.

    Notes
    -----
    A node without a difference found is not a node without a difference: the band says what is
    left open. Where the band is inside the margin, curves are equivalent there, by two
    one-sided tests of alpha / 2 each, held over all nodes at once; it is stricter than the
    usual two tests of alpha at one node.
    """

    SCHEMA: ClassVar[str] = "jointz.WaveformTest/1"

    method: str
    design: str
    n_a: int
    n_b: int
    df: float
    alpha: float
    threshold: float
    threshold_from: str
    t: tuple[float, ...]
    difference: tuple[float, ...]
    ci_low: tuple[float, ...]
    ci_high: tuple[float, ...]
    p: tuple[float, ...]
    clusters: tuple[WaveformCluster, ...] = ()
    p_set: float | None = None
    fwhm_nodes: float | None = None
    resels: float | None = None
    equivalence_margin: float | None = None
    untested_nodes: tuple[int, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def p_value(self) -> float:
        """Chance, without any effect, of a t as far from zero anywhere as the farthest here."""
        return min(self.p)

    @property
    def different(self) -> tuple[bool, ...]:
        """Whether the curves differ, at each node."""
        return tuple(abs(t) > self.threshold for t in self.t)

    @property
    def largest_open_difference(self) -> float:
        """The smallest margin that would make the curves equivalent at every node."""
        return max(max(-low, high) for low, high in zip(self.ci_low, self.ci_high, strict=True))

    @property
    def equivalent(self) -> tuple[bool, ...] | None:
        """Whether the curves are equivalent, at each node; None without a margin."""
        margin = self.equivalence_margin
        if margin is None:
            return None
        ends = zip(self.ci_low, self.ci_high, strict=True)
        return tuple(-margin < low and high < margin for low, high in ends)

    @property
    def verdict(self) -> str:
        """``different``, ``equivalent`` or ``undecided``, of the curve as a whole.

        Different where any node is; equivalent only with a margin that holds the band at
        every node. Curves may also differ by less than the margin: see :attr:`equivalent`.
        """
        if self.clusters:
            return "different"
        equivalent = self.equivalent
        return "equivalent" if equivalent is not None and all(equivalent) else "undecided"

    def to_frame(self) -> pd.DataFrame:
        """Return one row a node."""
        columns = {name: getattr(self, name) for name in _CURVES}
        table = pd.DataFrame({"node": range(len(self.t))} | columns)
        table["different"] = list(self.different)
        if self.equivalent is not None:
            table["equivalent"] = list(self.equivalent)
        return table

    def summary(self) -> str:
        """Return a short text: threshold, clusters, what differences are left open."""
        people = f"{self.n_a}" if self.design == "paired" else f"{self.n_a} and {self.n_b}"
        title = (
            f"{_TITLES[self.method]}, {self.design} t, two-tailed, {people} participants, "
            f"{len(self.t)} nodes: {self.verdict}"
        )
        lines = [
            f"|t| > {self.threshold:.4g} at alpha {self.alpha:g} ({self.threshold_from}); "
            f"p {self.p_value:.3g}"
        ]
        if self.fwhm_nodes is not None:
            lines.append(f"width {self.fwhm_nodes:.4g} nodes, {self.resels:.4g} resels")
        lines += [*map(_cluster_line, self.clusters), self._open_line()]
        return summary_text(title, lines, self.warnings)

    def _open_line(self) -> str:
        band = f"{1.0 - self.alpha:.3g} band over all nodes at once"
        text = f"{band}: no difference beyond {self.largest_open_difference:.4g} anywhere"
        if self.equivalent is None:
            return f"{text}; where none is found there may be one: state a margin to rule it out"
        share = f"{sum(self.equivalent)} of {len(self.equivalent)} nodes"
        return f"{text}; equivalent within {self.equivalence_margin:.4g} at {share}"

    def _draw(self, axes: "Axes") -> None:
        """Draw the difference with its band, clusters shaded."""
        nodes = range(len(self.t))
        label = f"{1.0 - self.alpha:.3g} band, all nodes at once"
        axes.fill_between(nodes, self.ci_low, self.ci_high, alpha=0.25, label=label)
        axes.plot(nodes, self.difference, label="mean difference")
        axes.axhline(0.0, color="0.4", linewidth=0.8)
        if self.equivalence_margin is not None:
            for side in (-1.0, 1.0):
                axes.axhline(side * self.equivalence_margin, color="0.4", linestyle=":")
        for cluster in self.clusters:
            axes.axvspan(cluster.start_node, cluster.end_node, color="C1", alpha=0.2)
        axes.set(xlabel="node", ylabel="difference")
        title = f"{self.verdict}: |t| > {self.threshold:.4g}, p {self.p_value:.3g}"
        axes.set_title(title, fontsize="medium")
        axes.legend(fontsize="small")


def _cluster_line(cluster: WaveformCluster) -> str:
    return (
        f"nodes {cluster.start_node:.1f} to {cluster.end_node:.1f}: "
        f"t {cluster.peak_t:.3g} at {cluster.peak_node}, p {cluster.p:.3g}"
    )
