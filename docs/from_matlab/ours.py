"""Run our side of a row."""

from typing import Any

import numpy as np
import pandas as pd
from from_matlab.given import Arrays
from from_matlab.rows import Row


def value(row: Row, arrays: Arrays) -> np.ndarray:
    """Return what our snippet gives, column by column, of complex numbers first the real parts.

    Parameters
    ----------
    row : Row
        A row with a Python snippet.
    arrays : dict
        As :func:`from_matlab.given.given` makes them.
    """
    names: dict[str, Any] = {name: array.copy() for name, array in arrays.items()}
    names |= {"np": np, "pd": pd, "rate": float(arrays["rate"][0])}
    # The snippets are the page's own text: that they run as printed is the point.
    exec(compile(row.python, row.id, "exec"), names)
    found = np.asarray(eval(row.ours, names))
    flat = found.ravel(order="F")
    if np.iscomplexobj(flat):
        flat = np.concatenate([flat.real, flat.imag])
    return flat.astype(float)
