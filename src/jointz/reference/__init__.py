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

    value: float  # printed value, in ``unit``
    sd: float | None = None  # printed standard deviation, in ``unit``
    unit: str = ""  # in the notation of :mod:`jointz`, or ``%``; empty for a count or a p-value
    source: str = ""  # table, section or figure of the dissertation
    note: str = ""  # context in the text, or a finding of our audit


@dataclass(frozen=True, slots=True)
class OtherDevice:
    """What the dissertation prints about another device."""

    quantity: str  # estimated quantity, or its error
    low: float  # lower end of the printed error, in ``unit``
    high: float  # upper end of the printed error, in ``unit``; equal to ``low`` for a single number
    unit: str  # unit of ``low`` and ``high``
    citations: tuple[int, ...]  # the dissertation's own citation numbers
    source: str  # section of the dissertation
    note: str = ""  # context in the text


@dataclass(frozen=True, slots=True)
class Finding:
    """One printed statement beside what the printed numbers give."""

    where: str  # table, section or figure of the dissertation
    what: str  # subject of the statement
    printed: str  # statement with its unit
    # value by the printed tables and numbers, with its unit; empty where none can be computed
    recomputed: str
    # ``contradiction``: two printed numbers exclude each other; ``not possible``: no data give the
    # number; ``ambiguous``: it can be read in several ways; ``not reproduced``: one value a
    # participant and timing point does not give it; ``worth knowing``
    kind: Kind
    remark: str  # consequence, and how it is settled here


def row_mean(row: Mapping[str, Printed]) -> float:
    """Return the mean of the numbers of a printed row.

    Parameters
    ----------
    row : mapping of str to Printed
        A row of a table.
    """
    return fmean(cell.value for cell in row.values())
