"""Published numbers, each with its source, as they are printed.

Nothing in the chapters is corrected: what is wrong with a printed number stands in its note. Only
digits that the copy of the text damaged, or that cannot be meant, are repaired, and the note
says so. :mod:`jointz.reference.audit` computes what the printed numbers give.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from statistics import fmean
from typing import Literal

Kind = Literal["contradiction", "not possible", "ambiguous", "not reproduced", "worth knowing"]


@dataclass(frozen=True, slots=True)
class Printed:
    """One printed number.

    Parameters
    ----------
    value : float
        As printed, in ``unit``.
    sd : float or None
        What stands after the plus-minus sign.
    unit : str
        As :mod:`jointz` writes units, ``%`` among them; empty for a count or a p-value.
    source : str
        Table, section or figure of the dissertation.
    note : str
        What the text says around the number, or what our audit found.
    """

    value: float
    sd: float | None = None
    unit: str = ""
    source: str = ""
    note: str = ""


@dataclass(frozen=True, slots=True)
class OtherDevice:
    """What the dissertation prints about another device.

    Parameters
    ----------
    quantity : str
        What was estimated.
    low, high : float
        Range of the printed error; equal for a single number.
    unit : str
        Of both.
    citations : tuple of int
        The dissertation's own citation numbers.
    source : str
        Section of the dissertation.
    note : str
        What the text says around the number.
    """

    quantity: str
    low: float
    high: float
    unit: str
    citations: tuple[int, ...]
    source: str
    note: str = ""


@dataclass(frozen=True, slots=True)
class Finding:
    """One printed statement beside what the printed numbers give.

    Parameters
    ----------
    where : str
        Table, section or figure of the dissertation.
    what : str
        What the statement is about.
    printed : str
        The statement, with its unit.
    recomputed : str
        What the printed tables and numbers give, with its unit; empty where nothing can be
        computed.
    kind : str
        ``contradiction``: two printed numbers exclude each other; ``not possible``: no data
        give the number; ``ambiguous``: it can be read in several ways; ``not reproduced``:
        one value a participant and timing point does not give it; ``worth knowing``.
    remark : str
        What follows, and how it is settled here.
    """

    where: str
    what: str
    printed: str
    recomputed: str
    kind: Kind
    remark: str


def row_mean(row: Mapping[str, Printed]) -> float:
    """Return the mean of the numbers of a printed row.

    Parameters
    ----------
    row : mapping of str to Printed
        A row of a table.
    """
    return fmean(cell.value for cell in row.values())
