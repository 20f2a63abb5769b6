"""Tables of a chapter: numbers, statements and participants, printed beside ours."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

import pandas as pd

#: What became of a printed statement. ``not shown``: the test comes out as printed, and what the
#: text makes of it does not follow, as likeness from a test that did not reject.
Verdict = Literal[
    "reproduced",
    "not reproduced",
    "not shown",
    "only with replicates as people",
    "contradiction",
    "not possible",
    "ambiguous",
    "worth knowing",
    "not tested",
]


@dataclass(frozen=True, slots=True)
class Compared:
    """One quantity: as printed, by the dissertation's method, by the recommended one."""

    quantity: str  # what is compared; the unit of all numbers, empty for a count
    unit: str = ""
    # as printed; by the dissertation's method and by the recommended one on the simulated bench;
    # the simulation's truth. None where there is none
    printed: float | None = None
    dissertation: float | None = None
    recommended: float | None = None
    truth: float | None = None
    printed_sd: float | None = None  # what stands after the plus-minus sign
    dissertation_sd: float | None = None
    recommended_low: float | None = None  # 95 % interval
    recommended_high: float | None = None
    note: str = ""  # what a reader should know


@dataclass(frozen=True, slots=True)
class ComparedTable:
    """A table of a chapter."""

    name: str  # for files: letters, digits and ``_``
    title: str  # heading, and what stands below it
    caption: str
    rows: tuple[Compared, ...]

    def frame(self) -> pd.DataFrame:
        """Return one row a quantity."""
        return pd.DataFrame([asdict(row) for row in self.rows], columns=list(Compared.__slots__))


@dataclass(frozen=True, slots=True)
class Claim:
    """One printed statement beside what comes out here."""

    where: str  # table, section or figure of the dissertation
    claim: str  # what the statement is about
    # the statement, and what comes out, each with its unit; ``ours`` is empty where nothing can be
    # computed
    printed: str
    ours: str
    verdict: Verdict  # see :data:`Verdict`
    remark: str = ""  # what follows


@dataclass(frozen=True, slots=True)
class ClaimTable:
    """Printed statements with what became of them."""

    name: str  # as of :class:`ComparedTable`
    title: str
    caption: str
    rows: tuple[Claim, ...]

    def frame(self) -> pd.DataFrame:
        """Return one row a statement."""
        return pd.DataFrame([asdict(row) for row in self.rows], columns=list(Claim.__slots__))


@dataclass(frozen=True, slots=True)
class GridBlock:
    """Values of all participants from one source."""

    label: str  # the source, such as ``printed``
    # timing point -> a value of every participant, None where undecided
    cells: Mapping[str, tuple[float | None, ...]]
    # timing point -> the mean over participants with a value; as printed where it is printed
    average: Mapping[str, float | None]


@dataclass(frozen=True, slots=True)
class ParticipantGrid:
    """Timing points by participants, as tables 4.1 to 4.4 are printed."""

    name: str  # as of :class:`ComparedTable`
    title: str
    caption: str
    unit: str  # of all values
    participants: tuple[str, ...]  # heads of the columns
    blocks: tuple[GridBlock, ...]  # one below the other

    def frame(self) -> pd.DataFrame:
        """Return one row a source and timing point, a column a participant, and the average."""
        return pd.DataFrame(
            [
                {
                    "source": block.label,
                    "timing_point": point,
                    "unit": self.unit,
                    **dict(zip(self.participants, row, strict=True)),
                    "average": block.average[point],
                }
                for block in self.blocks
                for point, row in block.cells.items()
            ]
        )


Table = ComparedTable | ClaimTable | ParticipantGrid


def table_to_dict(table: Table) -> dict[str, Any]:
    """Return a table as plain values, ready for JSON."""
    return {"kind": type(table).__name__, **asdict(table)}


def table_from_dict(data: Mapping[str, Any]) -> Table:
    """Rebuild a table from :func:`table_to_dict`."""
    values = {name: value for name, value in data.items() if name != "kind"}
    kind = data.get("kind")
    if kind == "ComparedTable":
        return ComparedTable(**values | {"rows": tuple(Compared(**r) for r in values["rows"])})
    if kind == "ClaimTable":
        return ClaimTable(**values | {"rows": tuple(Claim(**r) for r in values["rows"])})
    if kind == "ParticipantGrid":
        blocks = tuple(_block(block) for block in values["blocks"])
        people = tuple(values["participants"])
        return ParticipantGrid(**values | {"participants": people, "blocks": blocks})
    raise ValueError(f"expected a ComparedTable, ClaimTable or ParticipantGrid, got {kind!r}")


def _block(data: Mapping[str, Any]) -> GridBlock:
    cells = {point: tuple(row) for point, row in data["cells"].items()}
    return GridBlock(data["label"], cells, dict(data["average"]))
