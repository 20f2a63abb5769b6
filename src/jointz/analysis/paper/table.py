"""Printed tables, as csv and LaTeX."""

from dataclasses import dataclass
from typing import Final

import pandas as pd

from jointz.analysis.paper.latex import MARKS, latex_table

#: Cell without a value; the note below a table says why.
NO_VALUE: Final = "\N{EM DASH}"
#: Column with the notes in words, for files that have no notes below.
NOTE: Final = "Note"


@dataclass(frozen=True, slots=True)
class Table:
    """A printed table."""

    caption: str  # content, unit, interval, n and method
    head: tuple[str, ...]  # names of the columns, with units
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()  # below the table: meaning of dashes and limits

    def to_frame(self) -> pd.DataFrame:
        """Return the cells for a csv file, without marks of notes."""
        rows = [[cell.rstrip(MARKS) for cell in row] for row in self.rows]
        return pd.DataFrame(rows, columns=list(self.head))

    def to_latex(self, name: str) -> str:
        """Return the table as LaTeX."""
        # The notes below the table replace the column of notes, as a page is narrow.
        kept = [k for k, name in enumerate(self.head) if name != NOTE]
        return latex_table(
            [self.head[k] for k in kept],
            [[row[k] for k in kept] for row in self.rows],
            caption=self.caption,
            label=f"tab:{name}",
            notes=self.notes,
            wide=("Meaning",),
        )
