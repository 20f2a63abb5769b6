"""A chapter printed beside ours, for a terminal: aligned tables, long ones left to their files."""

from typing import Any

from jointz.report.wording import MINUS, pretty_unit
from jointz.reproduction.chapter_tables import claim_cells, compared_cells, grid_cells
from jointz.reproduction.reproduction_result import Reproduction
from jointz.reproduction.reproduction_tables import (
    ClaimTable,
    ComparedTable,
    ParticipantGrid,
    Table,
)

_GAP = "  "


def chapter_text(reproduction: Reproduction) -> str:
    """Write the tables of a chapter as text."""
    lines = [f"Chapter {reproduction.chapter}: {reproduction.title}"]
    for table in reproduction.tables:
        lines += ["", *_table_lines(table)]
    lines += ["", *(f"Note: {note}" for note in reproduction.notes)] if reproduction.notes else []
    return "\n".join(lines)


def _table_lines(table: Table) -> list[str]:
    if isinstance(table, ComparedTable):
        return _compared_lines(table)
    return _claim_lines(table) if isinstance(table, ClaimTable) else _grid_lines(table)


def _claim_lines(table: ClaimTable) -> list[str]:
    cells = claim_cells(table.rows)
    counts = ", ".join(f"{count} {verdict}" for verdict, count in cells["counts"].items())
    if cells["folded"]:
        return [table.title, f"{_GAP}{counts}: tables/{table.name}.csv"]
    rows = [["Where", "Statement", "Printed", "Here", "Verdict"]]
    rows += [[r.where, r.claim, r.printed, r.ours, r.verdict] for r in table.rows]
    return [table.title, *_aligned(rows)]


def _grid_lines(table: ParticipantGrid) -> list[str]:
    cells = grid_cells(table)
    lines = [f"{table.title}, {pretty_unit(table.unit)}"]
    for block in cells["blocks"]:
        rows = [[block["label"], *table.participants, "Average"]]
        rows += [[row["point"], *row["cells"], row["average"]] for row in block["rows"]]
        lines += _aligned(rows)
    return lines


def _compared_lines(table: ComparedTable) -> list[str]:
    cells = compared_cells(table.rows)
    if cells["folded"]:
        return [table.title, f"{_GAP}{len(table.rows)} rows: tables/{table.name}.csv"]
    head = ["Quantity", "Unit", *(column["head"] for column in cells["columns"])]
    head += ["Note"] if cells["noted"] else []
    rows = [head, *(_row(row, cells) for row in cells["rows"])]
    return [table.title, *_aligned(rows)]


def _aligned(rows: list[list[str]]) -> list[str]:
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return [_line(row, widths) for row in rows]


def _row(row: dict[str, Any], cells: dict[str, Any]) -> list[str]:
    texts = [row["quantity"], pretty_unit(row["unit"])]
    for column in cells["columns"]:
        cell = row["cells"][column["key"]]
        outside = " (outside the interval)" if cell["outside"] else ""
        texts.append(f"{cell['value']} {cell['spread']}".rstrip() + outside)
    return [*texts, row["note"]] if cells["noted"] else texts


def _line(row: list[str], widths: list[int]) -> str:
    padded = (text.ljust(width) for text, width in zip(row, widths, strict=True))
    plain = _GAP + _GAP.join(padded).rstrip()
    # Terminals without a minus sign are more common than tables with dashes for it.
    return plain.replace(MINUS, "-").replace("\N{RIGHT SINGLE QUOTATION MARK}", "'")
