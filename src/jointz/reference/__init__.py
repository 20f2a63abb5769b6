"""Published numbers, each with its source, as they are printed.

Nothing in the chapters is corrected: the note of a number states its errors. Only digits that the
copy of the text damaged, or that cannot be meant, are repaired, and the note says so.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from statistics import fmean

__all__ = ["row_mean"]


@dataclass(frozen=True, slots=True)
class Printed:
    """One printed number."""

    value: float  # printed value, in ``unit``
    sd: float | None = None  # printed standard deviation, in ``unit``
    unit: str = ""  # in the notation of :mod:`jointz`, or ``%``; empty for a count or a p-value
    source: str = ""  # table, section or figure of the dissertation
    note: str = ""  # context in the text, or a finding of our audit


def row_mean(row: Mapping[str, Printed]) -> float:
    """Return the mean of the numbers of a printed row.

    Parameters
    ----------
    row : mapping of str to Printed
        A row of a table.
    """
    return fmean(cell.value for cell in row.values())
