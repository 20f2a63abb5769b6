"""A chapter of the dissertation, printed beside ours."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

from jointz.core.provenance import now, software
from jointz.results.base import Result
from reproduction.chapter_tables import table_lines
from reproduction.reproduction_tables import ComparedTable, Table, tally, texts


@dataclass(frozen=True, slots=True, repr=False)
class Reproduction(Result):
    """A chapter reproduced."""

    SCHEMA: ClassVar[str] = "jointz.Reproduction/3"
    JSON_PROPERTIES: ClassVar[tuple[str, ...]] = ("evidence",)

    chapter: int  # number of the chapter
    title: str  # short title
    tables: tuple[Table, ...]  # in the order of the page
    # name -> data of the figures, as plain values
    curves: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()  # remarks for the reader
    provenance: Mapping[str, Any] = field(default_factory=dict)  # versions, seed, settings

    @classmethod
    def of_chapter(
        cls,
        chapter: int,
        tables: Iterable[Table],
        curves: Mapping[str, Any],
        *,
        seed: int,
        preset: str,
        notes: Iterable[str] = (),
    ) -> Self:
        """Return a chapter under its title, with its notes and all that is needed to repeat it."""
        text = texts()[f"chapter{chapter}"]
        settings = {"chapter": chapter, "seed": seed, "preset": preset}
        provenance = {**software(), "created": now(), "settings": settings}
        notes = (*text["notes"], *notes)
        return cls(chapter, text["title"], tuple(tables), curves, notes, provenance)

    def table(self, name: str) -> Table:
        """Return a table by name."""
        for table in self.tables:
            if table.name == name:
                return table
        raise KeyError(f"no table {name!r}; there are {', '.join(t.name for t in self.tables)}")

    @property
    def evidence(self) -> Mapping[str, int]:
        """How many printed numbers and statements are built in, measured here, contradicted."""
        return tally(self.tables)

    @property
    def compared(self) -> tuple[ComparedTable, ...]:
        """The tables that set number beside number."""
        return tuple(table for table in self.tables if isinstance(table, ComparedTable))

    def summary(self) -> str:
        """Return the tables as text; long ones are left to their files."""
        lines = [f"Chapter {self.chapter}: {self.title}"]
        for table in self.tables:
            lines += ["", *table_lines(table)]
        lines += ["", *(f"Note: {note}" for note in self.notes)] if self.notes else []
        return "\n".join(lines)
