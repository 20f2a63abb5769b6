"""Published numbers, each with its source, as they are printed.

Nothing here is computed or corrected; what is wrong with a printed number stands in its note.
"""

from dataclasses import dataclass


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
