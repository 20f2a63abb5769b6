"""Conditions of results folders, from ``conditions.csv``."""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from io import StringIO
from pathlib import Path
from typing import Any

from jointz.core.errors import DataError
from jointz.io.small_files import file_content

_NUMBER = re.compile(r"[+-]?[0-9]+([.,][0-9]+)?")
_NUMBERS = ("walking_speed_m_s", "slope_deg")


@dataclass(frozen=True, slots=True)
class Condition:
    """Study and condition of a results folder; what is not stated is empty or None."""

    study: str
    condition: str = ""
    walking_speed_m_s: float | None = None
    slope_deg: float | None = None  # uphill is positive
    surface: str = ""
    group: str = ""


#: Columns that tell conditions apart.
CONDITION_COLUMNS = tuple(field.name for field in fields(Condition))[1:]
COLUMNS = ("results", "study", *CONDITION_COLUMNS)


def read_conditions(
    file: Path, paths: Sequence[Path], names: Sequence[str], problems: list[str]
) -> list[Condition]:
    """Return the condition of each folder; problems of the file are added to the list."""
    conditions = [Condition(name) for name in names]
    stated: dict[int, int] = {}
    rows = _rows(file, problems)
    if rows is None:
        return conditions
    for line, row in rows:
        where = f"{file}, row {line}"
        results = row.get("results", "")
        place = (file.parent / results).resolve()
        by_path = [k for k, path in enumerate(paths) if path.resolve() == place]
        matches = by_path or [k for k, path in enumerate(paths) if path.resolve().name == results]
        if len(matches) != 1:
            found = f"{results!r}, which is " + (
                "the name of several" if matches else "none of those to pool"
            )
            problems.append(
                f"{where}: expected a results folder by its path or name; found {found}. Correct "
                f"the path (relative to {file.name}), or name the folder in the command."
            )
            continue
        folder = matches[0]
        if folder in stated:
            problems.append(
                f"{where}: a second row of {names[folder]}, after row {stated[folder]}. Keep one."
            )
        stated[folder] = line
        conditions[folder] = _condition(where, row, conditions[folder], problems)
    problems += [
        f"{file}: no row of {name}. Add one, with at least results."
        for k, name in enumerate(names)
        if k not in stated
    ]
    return conditions


def _rows(file: Path, problems: list[str]) -> list[tuple[int, dict[str, str]]] | None:
    """Return the rows with their numbers; None if the columns are not as expected."""
    try:
        text = file_content(file, absent=f"{file}: no such file.").decode("utf-8-sig")
    except ValueError as exc:
        raise DataError(
            f"{file}: cannot be read ({exc}). Name a table with the columns {', '.join(COLUMNS)}.",
            path=str(file),
        ) from exc
    first = text.partition("\n")[0]
    delimiter = next((sign for sign in ";\t" if sign in first), ",")
    table = [
        [cell.strip() for cell in row] for row in csv.reader(StringIO(text), delimiter=delimiter)
    ]
    header = table[0] if table else []
    while header and not header[-1]:  # a delimiter at the end of each line
        header = header[:-1]
    wrong = sorted({name for name in header if name not in COLUMNS or header.count(name) > 1})
    if wrong or "results" not in header:
        problems.append(
            f"{file}, row 1: expected the column results and any of {', '.join(COLUMNS[1:])}, "
            f"each once; found {', '.join(header) or 'nothing'}. Correct "
            f"{', '.join(map(repr, wrong)) or 'the header'}."
        )
        return None
    rows = []
    for line, cells in enumerate(table[1:], start=2):
        if any(cells[len(header) :]):
            problems.append(
                f"{file}, row {line}: expected {len(header)} cells, found {len(cells)}. Quote a "
                "cell that holds a comma."
            )
        elif any("\n" in cell for cell in cells):
            problems.append(f"{file}, row {line}: a cell holds a line break. Remove it.")
        elif any(cells):
            rows.append((line, dict(zip(header, cells, strict=False))))
    return rows


def _condition(
    where: str, row: dict[str, str], default: Condition, problems: list[str]
) -> Condition:
    stated: dict[str, Any] = {k: v for k, v in row.items() if v and k not in ("results", *_NUMBERS)}
    for name in _NUMBERS:
        if not (text := row.get(name, "")):
            continue
        is_number = _NUMBER.fullmatch(text) is not None
        number = float(text.replace(",", ".")) if is_number else 0.0
        if not is_number or (name == _NUMBERS[0] and number < 0.0):
            problems.append(
                f"{where}, column {name}: expected a number such as 1.2; found {text!r}. Correct "
                "it, or leave it empty."
            )
            continue
        stated[name] = number + 0.0  # -0 is level, too
    return replace(default, **stated)
