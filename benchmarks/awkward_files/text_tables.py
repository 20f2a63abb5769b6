"""Text tables as spreadsheet and acquisition programs export them."""

import codecs
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from benchmarks.awkward_files.truth import Array

Strings = Sequence[str]
BOMS = {"utf-8-sig": b"", "utf-16-le": codecs.BOM_UTF16_LE, "utf-16-be": codecs.BOM_UTF16_BE}


def numbers(values: Array, digits: int, decimal: str = ".") -> list[str]:
    """Return numbers with a fixed count of digits; NaN is an empty cell."""
    texts = (f"{v:.{digits}f}" if np.isfinite(v) else "" for v in values)
    return [text.replace(".", decimal) for text in texts]


def volts(contact: Array, rng: np.random.Generator) -> Array:
    """Return the voltage of a footswitch: 0.2 V in the air, 4.6 V on the ground."""
    return np.round(0.2 + 4.4 * contact + 0.04 * rng.standard_normal(contact.size), 3)


def write_table(
    path: Path,
    columns: Sequence[Strings],
    *,
    above: Strings = (),
    delimiter: str = ";",
    encoding: str = "utf-8",
    newline: str = "\r\n",
    end: str = "",
) -> None:
    """Write lines above the table, which include its names, and its columns."""
    rows = [delimiter.join(row) + end for row in zip(*columns, strict=True)]
    text = newline.join([*above, *rows]) + newline
    path.write_bytes(BOMS.get(encoding, b"") + text.encode(encoding))
