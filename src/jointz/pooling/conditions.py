"""Conditions of results folders, from ``conditions.csv``."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from math import isfinite
from pathlib import Path
from typing import Any

from jointz.core.errors import DataError

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
    for line, row in _rows(file, problems):
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
                "the path, or name the folder in the command."
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


def _rows(file: Path, problems: list[str]) -> list[tuple[int, dict[str, str]]]:
    """Return the rows with their numbers; without any if the columns are not as expected."""
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, ValueError) as exc:
        raise DataError(
            f"{file}: cannot be read ({exc}). Name a table with the columns {', '.join(COLUMNS)}.",
            path=str(file),
        ) from exc
    is_semicolon = bool(lines) and ";" in lines[0]
    table = list(csv.reader(lines, delimiter=";" if is_semicolon else ","))
    header = [name.strip() for name in table[0]] if table else []
    wrong = sorted({name for name in header if name not in COLUMNS or header.count(name) > 1})
    if wrong or "results" not in header:
        problems.append(
            f"{file}, row 1: expected the column results and any of {', '.join(COLUMNS[1:])}, "
            f"each once; found {', '.join(header) or 'nothing'}. Correct "
            f"{', '.join(map(repr, wrong)) or 'the header'}."
        )
        return []
    rows = []
    for line, cells in enumerate(table[1:], start=2):
        if len(cells) > len(header):
            problems.append(
                f"{file}, row {line}: expected {len(header)} cells, found {len(cells)}. Quote a "
                "cell that holds a comma."
            )
        elif any(cell.strip() for cell in cells):
            rows.append((line, dict(zip(header, map(str.strip, cells), strict=False))))
    return rows


def _condition(
    where: str, row: dict[str, str], default: Condition, problems: list[str]
) -> Condition:
    stated: dict[str, Any] = {k: v for k, v in row.items() if v and k not in ("results", *_NUMBERS)}
    for name in _NUMBERS:
        if not (text := row.get(name, "")):
            continue
        try:
            number = float(text.replace(",", "."))
        except ValueError:
            number = float("nan")
        if not isfinite(number) or (name == _NUMBERS[0] and number < 0.0):
            problems.append(
                f"{where}, column {name}: expected a number such as 1.2; found {text!r}. Correct "
                "it, or leave it empty."
            )
            continue
        stated[name] = number + 0.0  # -0 is level, too
    return replace(default, **stated)
