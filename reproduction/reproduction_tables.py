"""Tables of a chapter: numbers, statements and participants, printed beside ours."""

import math
import re
import tomllib
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from importlib.resources import files
from typing import Annotated, Any, Final, Literal, get_args

import pandas as pd
from pydantic import Field

from jointz.reference import Printed
from jointz.results.estimates import ParameterEstimate
from reproduction.audit import audit
from reproduction.literature import OtherDevice

#: What became of a printed statement. ``not shown``: the test comes out as printed, and what the
#: text makes of it does not follow, as likeness from a test that did not reject.
Verdict = Literal[
    "reproduced", "not reproduced", "not shown", "only with replicates as people",
    "contradiction", "not possible", "ambiguous", "worth knowing", "not tested",
]  # fmt: skip
#: ``built in``: the simulation was given it, or a setting that it follows from; ``measured here``:
#: agrees or is left open; ``contradicted``: another outcome here, or by the print itself.
Evidence = Literal["built in", "measured here", "contradicted", "not judged"]
#: Largest difference from a printed number without an SD that counts as agreement, share of it.
_AGREES_WITHIN: Final = 0.05


@dataclass(frozen=True, slots=True)
class Compared:
    """One quantity: as printed, by the dissertation's method, by the recommended one."""

    quantity: str  # compared quantity
    unit: str = ""  # unit of all numbers of the row; empty for a count
    printed: float | None = None  # printed value; None where there is none
    # value by the dissertation's method on the simulated bench; None where there is none
    dissertation: float | None = None
    # value by the recommended method on the simulated bench; None where there is none
    recommended: float | None = None
    truth: float | None = None  # true value in the simulation; None where there is none
    printed_sd: float | None = None  # printed standard deviation
    dissertation_sd: float | None = None  # standard deviation of ``dissertation``
    recommended_low: float | None = None  # lower end of the 95 % interval
    recommended_high: float | None = None  # upper end of the 95 % interval
    note: str = ""  # remark for the reader
    built_in: str = ""  # setting of the simulation that the outcome follows from; empty if none

    @property
    def evidence(self) -> Evidence:
        """Return the evidence behind the comparison, by the method of the print."""
        ours = self.recommended if self.dissertation is None else self.dissertation
        if self.printed is None or ours is None or math.isnan(ours):
            return "not judged"
        if self.built_in:
            return "built in"
        spread = (self.printed_sd or 0.0) + (self.dissertation_sd or 0.0)
        half_digit = 0.5 * 10.0 ** -len(str(self.printed).partition(".")[2])
        allowed = spread or max(_AGREES_WITHIN * abs(self.printed), half_digit)
        return "measured here" if abs(ours - self.printed) <= allowed else "contradicted"

    @property
    def holds_truth(self) -> bool | None:
        """Whether the interval holds the truth, None where the row lacks either."""
        if self.truth is None or self.recommended_low is None or self.recommended_high is None:
            return None
        return self.recommended_low <= self.truth <= self.recommended_high


#: A value alone, with its standard deviation, or with the limits of its interval.
Number = float | None | tuple[float | None, ...]


def compare(
    quantity: str,
    unit: str = "",
    printed: Printed | None = None,
    dissertation: Number = None,
    recommended: Number | ParameterEstimate = None,
    *,
    truth: float | None = None,
    note: str | None = None,
    built_in: str = "",
) -> Compared:
    """Set a printed number beside ours: mean and SD; value, lower and upper limit.

    The note is that of the printed number where none is given.
    """
    if isinstance(recommended, ParameterEstimate):
        recommended = recommended.value, recommended.ci_low, recommended.ci_high
    mean, sd = dissertation if isinstance(dissertation, tuple) else (dissertation, None)
    interval = recommended if isinstance(recommended, tuple) else (recommended, None, None)
    value, low, high = interval
    return Compared(
        quantity,
        unit,
        printed.value if printed else None,
        mean,
        value,
        truth,
        printed.sd if printed else None,
        sd,
        low,
        high,
        note if note is not None else printed.note if printed else "",
        built_in,
    )


@dataclass(frozen=True, slots=True)
class ComparedTable:
    """A table that sets number beside number."""

    name: str  # name for files: letters, digits and ``_``
    title: str
    caption: str
    rows: tuple[Compared, ...]
    kind: Literal["ComparedTable"] = "ComparedTable"

    def frame(self) -> pd.DataFrame:
        """Return one row a quantity."""
        return pd.DataFrame([asdict(row) for row in self.rows], columns=list(Compared.__slots__))


@dataclass(frozen=True, slots=True)
class Claim:
    """One printed statement beside what comes out here."""

    where: str  # table, section or figure of the dissertation
    claim: str  # subject of the statement
    printed: str  # statement with its unit
    ours: str  # result here with its unit; empty where none can be computed
    verdict: Verdict
    remark: str = ""  # consequence
    built_in: str = ""  # setting of the simulation that the outcome follows from; empty if none

    @property
    def evidence(self) -> Evidence:
        """Return the evidence behind the verdict: built in, measured here or contradicted."""
        if self.verdict in ("ambiguous", "worth knowing", "not tested"):
            return "not judged"
        agrees = self.verdict in ("reproduced", "not shown")
        return "built in" if self.built_in else "measured here" if agrees else "contradicted"


@dataclass(frozen=True, slots=True)
class ClaimTable:
    """Printed statements with their verdicts."""

    name: str
    title: str
    caption: str
    rows: tuple[Claim, ...]
    kind: Literal["ClaimTable"] = "ClaimTable"

    def frame(self) -> pd.DataFrame:
        """Return one row a statement."""
        return pd.DataFrame([asdict(row) for row in self.rows], columns=list(Claim.__slots__))


@dataclass(frozen=True, slots=True)
class GridBlock:
    """Values of all participants from one source."""

    label: str  # name of the source, such as ``printed``
    # timing point -> one value for each participant, None where undecided
    cells: Mapping[str, tuple[float | None, ...]]
    # timing point -> mean over the participants with a value; the printed mean for ``printed``
    average: Mapping[str, float | None]


@dataclass(frozen=True, slots=True)
class ParticipantGrid:
    """Timing points by participants, as tables 4.1 to 4.4 are printed."""

    name: str
    title: str
    caption: str
    unit: str  # of all values
    participants: tuple[str, ...]  # headings of the columns
    blocks: tuple[GridBlock, ...]  # from top to bottom
    kind: Literal["ParticipantGrid"] = "ParticipantGrid"

    def frame(self) -> pd.DataFrame:
        """Return one row a source and timing point, a column a participant, and the average."""
        return pd.DataFrame(
            [
                {"source": block.label, "timing_point": point, "unit": self.unit}
                | dict(zip(self.participants, row, strict=True))
                | {"average": block.average[point]}
                for block in self.blocks
                for point, row in block.cells.items()
            ]
        )


Table = Annotated[ComparedTable | ClaimTable | ParticipantGrid, Field(discriminator="kind")]


# --- sentences -----------------------------------------------------------------------------------


@cache
def texts() -> dict[str, Any]:
    """Return all sentences: of ``figures``, and of a chapter by the name of its table."""
    file = files("reproduction").joinpath("texts.toml")
    return tomllib.loads(file.read_text(encoding="utf-8"))


def heading(chapter: int, name: str, /, **values: Any) -> tuple[str, str, str]:
    """Return name, title and caption of a table, with values filled in."""
    text = texts()[f"chapter{chapter}"][name]
    return name, text["title"], text["caption"].format(**values)


def compared_table(
    chapter: int, name: str, rows: Iterable[Compared], **values: Any
) -> ComparedTable:
    """Return a table of numbers under its title and caption."""
    return ComparedTable(*heading(chapter, name, **values), tuple(rows))


def claim_table(chapter: int, name: str, rows: Iterable[Claim], **values: Any) -> ClaimTable:
    """Return a table of statements under its title and caption."""
    return ClaimTable(*heading(chapter, name, **values), tuple(rows))


def stated_claims(name: str, /, **values: Any) -> list[Claim]:
    """Return statements of chapter 4, with values filled in."""
    stated = texts()["chapter4"][name]["claims"]
    return [Claim(**{key: text.format(**values) for key, text in one.items()}) for one in stated]


def device_table(chapter: int, devices: Iterable[OtherDevice]) -> ComparedTable:
    """Return the errors of other devices that a chapter prints."""
    rows = []
    for device in devices:
        citations = ", ".join(map(str, device.citations))
        quantity = f"{device.quantity} [{citations}]"
        rows.append(Compared(quantity, device.unit, device.high, note=device.note))
    return compared_table(chapter, "other_devices", rows)


def audit_claims(chapter: int) -> ClaimTable:
    """Return the contradictions of a chapter's text, but for statements that other tables judge."""
    elsewhere = ("effect of", "timing points whose", "quasi-stiffness and")
    rows = [
        Claim(found.where, found.what, found.printed, found.recomputed, found.kind, found.remark)
        for found in audit()
        if re.findall(r"\d", found.where)[0] == str(chapter)
        and not found.what.startswith(elsewhere)
    ]
    return claim_table(4, "audit", rows)


def tally(tables: Iterable[Table]) -> dict[str, int]:
    """Return how many printed numbers and statements rest on what."""
    rows = [row for t in tables if not isinstance(t, ParticipantGrid) for row in t.rows]
    # A number without one of ours beside it is no comparison.
    told = Counter(r.evidence for r in rows if isinstance(r, Claim) or r.evidence != "not judged")
    return {kind: told[kind] for kind in get_args(Evidence)}


def tally_text(counts: Mapping[str, int]) -> str:
    """Say what printed numbers and statements rest on."""
    text: str = texts()["evidence"]["sentence"]
    return text.format(sum(counts.values()), *counts.values())
