"""A table as it is printed: on paper, in a spreadsheet and in LaTeX."""

from dataclasses import dataclass
from typing import Final

import pandas as pd

from jointz.report.latex import MARKS, latex_table

#: Where no value is given; the note below a table says why.
NO_VALUE: Final = "\N{EM DASH}"
#: Column that says in words what marks and the notes below a table say.
NOTE: Final = "Note"


@dataclass(frozen=True, slots=True)
class Table:
    """A table as it is printed."""

    caption: str  # what it shows: unit, interval, n and method
    head: tuple[str, ...]  # names of the columns, with units
    rows: tuple[tuple[str, ...], ...]  # cells as people read them
    notes: tuple[str, ...] = ()  # below it: what dashes and limits mean

    def to_frame(self) -> pd.DataFrame:
        """Return the cells as they are printed, for a csv file, which has no notes below."""
        rows = [[cell.rstrip(MARKS) for cell in row] for row in self.rows]
        return pd.DataFrame(rows, columns=list(self.head))

    def to_latex(self, name: str) -> str:
        """Return the table as LaTeX."""
        # The notes below say what the column of notes does, and a page is narrow.
        kept = [k for k, name in enumerate(self.head) if name != NOTE]
        return latex_table(
            [self.head[k] for k in kept],
            [[row[k] for k in kept] for row in self.rows],
            caption=self.caption,
            label=f"tab:{name}",
            notes=self.notes,
            wide=("Meaning",),
        )
