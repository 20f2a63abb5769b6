"""Names that MATLAB takes for fields, and the value of MATLAB's own kinds for ours."""

import re
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from jointz.io.text.column_names import unique_names

#: namelengthmax of MATLAB; scipy writes no longer field.
LONGEST_NAME = 63
_NO_LETTER = re.compile(r"\W", re.ASCII)
_KEYWORDS = frozenset(
    (
        *("break", "case", "catch", "classdef", "continue", "else", "elseif", "end", "for"),
        *("function", "global", "if", "otherwise", "parfor", "persistent", "return", "spmd"),
        *("switch", "try", "while"),
    )
)


def field_names(names: Sequence[str]) -> list[str]:
    """Return a field name of MATLAB for each name; they differ where the names do not."""
    # The number of a repeated name may not make it too long.
    cut = LONGEST_NAME - len(f"_{len(names) + 1}")
    return unique_names([_identifier(name, cut) for name in names])


def column(values: np.ndarray) -> np.ndarray:
    """Return samples as MATLAB has them: a column of doubles, or a cell array of text."""
    return values.reshape(-1, 1)


def cells(texts: Iterable[str]) -> np.ndarray:
    """Return a column of cells with a text each."""
    found = list(texts)
    array = np.empty((len(found), 1), dtype=object)
    array[:, 0] = found
    return array


def number_or_empty(value: float | None) -> Any:
    """Return a number, or ``[]`` where there is none."""
    return np.empty((0, 0)) if value is None else float(value)


def _identifier(name: str, longest: int) -> str:
    word = _NO_LETTER.sub("_", name)
    if not word[:1].isalpha():
        word = f"x{word}"
    return f"{word}_" if word in _KEYWORDS else word[:longest]
