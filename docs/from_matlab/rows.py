"""The rows of the page: read from the toml files beside this one."""

import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent
#: Topics in the order of the page; each is a file.
TOPICS = ("dissertation", "signals", "identification", "nlid", "statistics", "spm1d", "language")


@dataclass(frozen=True, slots=True)
class Row:
    """A step, their call and ours.

    Parameters
    ----------
    id : str
        Name of the row, unique on the page.
    step : str
        What is done.
    call, equivalent : str
        The call in MATLAB and the one in Python, as the page shows them; a row without them is in
        the file of programs only.
    caution : str
        Difference that changes numbers, in a few words.
    matlab : str
        Their program.
    python : str
        Our program; ``""`` if jointz has none.
    theirs, ours : str
        Expressions that are compared.
    rtol : float
        How far each number may be from theirs, as a share of it.
    octave, r, spm1d : str
        What the program runs instead of ``matlab``.
    formula : bool
        Whether ``octave`` writes out the published formula of a function that Octave lacks.
    note : str
        What to mind.
    untested : str
        Why there is no test; ``""`` where there is one.
    """

    id: str
    step: str
    matlab: str
    call: str = ""
    equivalent: str = ""
    caution: str = ""
    python: str = ""
    theirs: str = ""
    ours: str = ""
    rtol: float = 1e-10
    octave: str = ""
    r: str = ""
    spm1d: str = ""
    formula: bool = False
    note: str = ""
    untested: str = ""

    @property
    def program(self) -> str:
        """The program that the stored value comes from; ``""`` without a test."""
        if self.untested:
            return ""
        return "R" if self.r else "spm1d" if self.spm1d else "Octave"

    @property
    def code(self) -> str:
        """What that program runs."""
        return (self.r or self.spm1d or self.octave or self.matlab).strip()


@dataclass(frozen=True, slots=True)
class Topic:
    """A section of the page.

    Parameters
    ----------
    name : str
        Name of its file of rows.
    title : str
        Its heading.
    text : str
        Paragraph above the table.
    rows : tuple of Row
        The table.
    """

    name: str
    title: str
    text: str
    rows: tuple[Row, ...] = field(default=())


def topics() -> tuple[Topic, ...]:
    """Return the sections of the page in order."""
    return tuple(_topic(FOLDER / f"{name}.toml") for name in TOPICS)


def all_rows() -> tuple[Row, ...]:
    """Return the rows of all sections."""
    return tuple(row for topic in topics() for row in topic.rows)


def _topic(path: Path) -> Topic:
    content: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    rows = tuple(Row(**{k: _tidy(v) for k, v in row.items()}) for row in content["row"])
    return Topic(path.stem, content["title"], _tidy(content["text"]), rows)


def _tidy(value: Any) -> Any:
    return value.strip() if isinstance(value, str) else value
