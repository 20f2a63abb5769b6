"""Checked curves of participants for tests over nodes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from jointz.core.errors import DataError
from jointz.core.provenance import own_version
from jointz.results.statistics.waveform_test import WaveformTest

_FEWEST_NODES = 5
_SMALLEST_ALPHA = 1e-6
#: Rounding units of the data below which a spread over participants is none.
_ROUNDING_UNITS = 16.0
#: Correlation of neighbours above which an axis holds nodes; between people there is hardly any.
_OF_NODES = 0.5


@dataclass(frozen=True, slots=True)
class ComparedCurves:
    """Mean difference of two sets of curves, its standard error, and the residuals."""

    difference: np.ndarray  # mean of the first curves minus mean of the second, in their unit
    se: np.ndarray  # standard error of ``difference``, in the same unit; 0 where not tested
    residuals: np.ndarray  # curves minus their means, in the same unit
    tested: np.ndarray  # bool: nodes where curves vary over participants
    df: float  # degrees of freedom
    n_a: int  # participants of the first curves
    n_b: int  # participants of the second curves

    @property
    def t(self) -> np.ndarray:
        """Student's t, (n_node,); 0 where not tested."""
        t = np.zeros_like(self.difference)
        np.divide(self.difference, self.se, out=t, where=self.tested)
        return t

    @property
    def untested_nodes(self) -> tuple[int, ...]:
        """Nodes that are not tested."""
        return tuple(np.flatnonzero(~self.tested).tolist())

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warning about untested nodes."""
        text = (
            f"{len(self.untested_nodes)} of {self.tested.size} nodes are not tested: there the "
            "curves do not differ in anybody"
        )
        return (text,) if self.untested_nodes else ()


def paired_differences(a: Any, b: Any, *, where: str, fewest: int) -> np.ndarray:
    """Return the differences of curves of the same participants."""
    first, second = _curves(a, "a", where, fewest), _curves(b, "b", where, fewest)
    if first.shape != second.shape:
        raise DataError(
            f"{where}: expected a and b of one shape, got {first.shape} and {second.shape}. "
            "Pair every participant; for different people use spm_unpaired_t."
        )
    if isinstance(a, pd.DataFrame) and isinstance(b, pd.DataFrame) and not a.index.equals(b.index):
        raise DataError(
            f"{where}: expected rows of a and b to name the same participants in the same order, "
            "found other names. Sort the rows of one like the other's."
        )
    differences: np.ndarray = first - second
    return differences


def compare_paired(differences: np.ndarray, *, scale: np.ndarray, where: str) -> ComparedCurves:
    """Return mean and error of differences of pairs."""
    n = differences.shape[0]
    mean = differences.mean(axis=0)
    residuals = differences - mean
    variance = np.einsum("ij,ij->j", residuals, residuals) / (n - 1)
    tested = _tested(mean, np.sqrt(variance), scale, where)
    se = np.sqrt(variance / n) * tested
    return ComparedCurves(mean * tested, se, residuals, tested, float(n - 1), n, n)


def compare_groups(a: Any, b: Any, *, where: str) -> ComparedCurves:
    """Return difference of the means of two groups, with pooled variance."""
    first, second = _curves(a, "a", where, 2), _curves(b, "b", where, 2)
    if first.shape[1] != second.shape[1]:
        raise DataError(
            f"{where}: expected a and b with the same nodes, got {first.shape[1]} and "
            f"{second.shape[1]}. Resample them to one number of nodes."
        )
    n_a, n_b = first.shape[0], second.shape[0]
    means = first.mean(axis=0), second.mean(axis=0)
    residuals = np.concatenate([first - means[0], second - means[1]])
    variance = np.einsum("ij,ij->j", residuals, residuals) / (n_a + n_b - 2)
    difference = means[0] - means[1]
    tested = _tested(difference, np.sqrt(variance), curve_scale(first, second), where)
    se = np.sqrt(variance * (1.0 / n_a + 1.0 / n_b)) * tested
    return ComparedCurves(
        difference * tested, se, residuals, tested, float(n_a + n_b - 2), n_a, n_b
    )


def curve_scale(a: Any, b: Any) -> np.ndarray:
    """Return the largest absolute value at each node."""
    sizes = [np.abs(np.asarray(curves, dtype=float)).max(axis=0) for curves in (a, b)]
    return np.asarray(np.maximum(*sizes))


def checked_level(alpha: float, equivalence_margin: float | None, where: str) -> None:
    """Raise if a level or a margin is out of range."""
    if not _SMALLEST_ALPHA <= alpha <= 0.5:
        raise DataError(f"{where}: expected alpha of {_SMALLEST_ALPHA:g} to 0.5, got {alpha!r}")
    if equivalence_margin is not None and not 0.0 < equivalence_margin < float("inf"):
        raise DataError(
            f"{where}: expected a positive equivalence_margin in the unit of the curves, got "
            f"{equivalence_margin!r}. Leave it out where no difference is known to be unimportant."
        )


def waveform_test(
    compared: ComparedCurves,
    half: np.ndarray,
    alpha: float,
    *,
    settings: Mapping[str, Any],
    warnings: Sequence[str],
    **fields: Any,
) -> WaveformTest:
    """Return a test of compared curves; the band is ``half`` to each side of the difference."""
    return WaveformTest(
        n_a=compared.n_a,
        n_b=compared.n_b,
        df=compared.df,
        alpha=float(alpha),
        t=tuple(compared.t.tolist()),
        difference=tuple(compared.difference.tolist()),
        ci_low=tuple((compared.difference - half).tolist()),
        ci_high=tuple((compared.difference + half).tolist()),
        untested_nodes=compared.untested_nodes,
        settings={"alpha": float(alpha), **settings, "jointz": own_version()},
        warnings=(*compared.warnings, *warnings),
        **fields,
    )


def _curves(values: Any, name: str, where: str, fewest: int) -> np.ndarray:
    try:
        curves = np.asarray(values, dtype=float, order="C")
    except (TypeError, ValueError) as exc:
        raise DataError(f"{where}: {name} is no array of numbers: {exc}") from exc
    if curves.ndim != 2:
        raise DataError(
            f"{where}: expected {name} as (participant, node), got {curves.ndim} dimensions. "
            "Give one row a participant."
        )
    n, nodes = curves.shape
    if n < fewest:
        raise DataError(
            f"{where}: expected at least {fewest} participants in {name}, got {n}. Strides or "
            "pulses of one person are no participants: give one mean curve a person."
        )
    if nodes < _FEWEST_NODES:
        raise DataError(
            f"{where}: expected curves of at least {_FEWEST_NODES} nodes in {name}, got {nodes}. "
            f"Test single values with a t test; if the nodes are in its rows, pass {name}.T."
        )
    bad = ~np.isfinite(curves)
    if bad.any():
        person, node = np.argwhere(bad)[0]
        raise DataError(
            f"{where}: expected finite values in {name}, found {int(bad.sum())} that are not, "
            f"first of row {person} at node {node}. Leave out the participant, or the nodes "
            f"({int(bad.any(axis=0).sum())}) in everybody."
        )
    along_rows, along_columns = _neighbour_correlation(curves.T), _neighbour_correlation(curves)
    more_rows = curves.shape[0] > curves.shape[1]  # than columns: fewer people than nodes are usual
    if more_rows and along_rows > _OF_NODES > along_columns:
        raise DataError(
            f"{where}: expected one row a participant in {name}, got {n} rows that resemble their "
            f"neighbours (r = {along_rows:.2f}), as nodes do. Pass {name}.T."
        )
    return curves


def _neighbour_correlation(curves: np.ndarray) -> float:
    """Return the correlation of neighbouring columns, without the means of rows and columns."""
    rest = curves - curves.mean(axis=0)
    rest -= rest.mean(axis=1, keepdims=True)
    power = float((rest**2).mean()) if rest.size else 0.0
    return float((rest[:, 1:] * rest[:, :-1]).mean()) / power if power > 0.0 else 1.0


def _tested(mean: np.ndarray, sd: np.ndarray, scale: np.ndarray, where: str) -> np.ndarray:
    rounding = _ROUNDING_UNITS * np.finfo(float).eps * scale
    varies = sd > rounding
    impossible = ~varies & (np.abs(mean) > rounding)
    if impossible.any():
        raise DataError(
            f"{where}: expected differences that vary over participants, found exactly the same "
            f"in all at {int(impossible.sum())} nodes, first at node {int(np.argmax(impossible))}. "
            "Look for copied or constant columns."
        )
    if not varies.any():
        raise DataError(f"{where}: expected curves that differ, found a and b the same everywhere.")
    return np.asarray(varies)
