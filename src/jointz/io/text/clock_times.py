"""Times of day as text, as ``13:59:41,250``."""

from collections.abc import Iterable

import numpy as np
import pandas as pd

#: The unit of such a column in a study.
CLOCK_TEXT = "hh:mm:ss"
_CLOCK = r"^(?:.*[\sT])?(?:(\d{1,2}):)?(\d{2}):(\d{2}(?:[.,]\d+)?)(?:Z|[+-]\d{2}:?\d{2})?$"
_DAY_S = 86_400.0


def seconds_of_clock(cells: Iterable[str]) -> np.ndarray:
    """Return times of day in s, rising over midnight; NaN where a text is none."""
    parts = pd.Series(list(cells), dtype=object).str.strip().str.extract(_CLOCK)
    parts[0] = parts[0].fillna("0").where(parts[1].notna())  # minutes and seconds only
    numbers = parts.apply(lambda part: part.str.replace(",", ".").astype(float)).to_numpy()
    seconds = numbers @ np.array([3600.0, 60.0, 1.0])
    midnights = np.cumsum(np.diff(seconds, prepend=seconds[:1]) < -_DAY_S / 2)
    return np.asarray(seconds + _DAY_S * midnights)
