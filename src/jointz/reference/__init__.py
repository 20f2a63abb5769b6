"""Published numbers, each with its source, as they are printed.

Nothing in the chapters is corrected: what is wrong with a printed number stands in its note. Only
digits that the copy of the text damaged, or that cannot be meant, are repaired, and the note
says so. :mod:`jointz.reference.audit` computes what the printed numbers give.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from statistics import fmean
from typing import Literal

__all__ = ["row_mean"]

Kind = Literal["contradiction", "not possible", "ambiguous", "not reproduced", "worth knowing"]


@dataclass(frozen=True, slots=True)
class Printed:
    """One printed number."""

    value: float  # as printed, in ``unit``
    sd: float | None = None  # what stands after the plus-minus sign
    # as :mod:`jointz` writes units, ``%`` among them; empty for a count or a p-value
    unit: str = ""
    source: str = ""  # table, section or figure of the dissertation
    note: str = ""  # what the text says around the number, or what our audit found


@dataclass(frozen=True, slots=True)
class OtherDevice:
    """What the dissertation prints about another device."""

    quantity: str  # what was estimated
    low: float  # range of the printed error; equal for a single number
    high: float
    unit: str  # of both
    citations: tuple[int, ...]  # the dissertation's own citation numbers
    source: str  # section of the dissertation
    note: str = ""  # what the text says around the number


@dataclass(frozen=True, slots=True)
class Finding:
    """One printed statement beside what the printed numbers give."""

    where: str  # table, section or figure of the dissertation
    what: str  # what the statement is about
    printed: str  # the statement, with its unit
    # what the printed tables and numbers give, with its unit; empty where nothing can be computed
    recomputed: str
    # ``contradiction``: two printed numbers exclude each other; ``not possible``: no data give the
    # number; ``ambiguous``: it can be read in several ways; ``not reproduced``: one value a
    # participant and timing point does not give it; ``worth knowing``
    kind: Kind
    remark: str  # what follows, and how it is settled here


def row_mean(row: Mapping[str, Printed]) -> float:
    """Return the mean of the numbers of a printed row.

    Parameters
    ----------
    row : mapping of str to Printed
        A row of a table.
    """
    return fmean(cell.value for cell in row.values())
