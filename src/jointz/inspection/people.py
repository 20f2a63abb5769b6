"""Body mass, height and leg of people: from a table of participants, or single values of a file."""

import csv
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import pandas as pd

from jointz.core.errors import UnitError
from jointz.core.units import conversion
from jointz.inspection.content import Column
from jointz.inspection.guess import InspectedColumn, inspect_column
from jointz.inspection.names import word_set, words_of

_MASS: Final = word_set("mass weight bodymass bodyweight masse gewicht masa peso massa")
_HEIGHT: Final = word_set("height stature bodyheight taille grosse groesse altura altezza lengte")
_PERSON: Final = word_set(
    "participant subject proband vp id sujet sujeto soggetto person name demographics patient"
)
_SIDE: Final = word_set(
    "side leg tested limb seite bein cote jambe lado pierna gamba been"  # codespell:ignore bein
)
_ABOUT: Final = {"mass": _MASS, "height": _HEIGHT, "side": _SIDE}
_NOT_MEASURED: Final = word_set("dominant dominance other contralateral exo device robot")
_TABLES, _LARGEST_BYTES = (".csv", ".tsv", ".txt"), 100_000
_MASSES_KG, _HEIGHTS_M = (20.0, 250.0), (0.8, 2.5)


@dataclass(frozen=True, slots=True)
class Person:
    """Body mass, height and leg of a person; None and "" where no file states them."""

    mass_kg: float | None = None
    height_m: float | None = None
    side: str = ""


def people_of(columns: Sequence[InspectedColumn]) -> dict[str, Person]:
    """Return the people of a table with a row for each; none of another table."""
    ids = next((c for c in columns if c.words.found & _PERSON), None)
    about = {
        k: next((c for c in columns if c.words.found & words), None) for k, words in _ABOUT.items()
    }
    if ids is None or (about["mass"] is None and about["height"] is None):
        return {}
    known = {key: c for key, c in about.items() if c is not None}
    people = {}
    for k, name in enumerate(map(label_of, ids.column.values)):
        row = {key: (c.column.values[k], c.words.unit) for key, c in known.items()}  # noqa: PD011
        people[name] = _person(row)
    return people


def people_in(file: Path) -> dict[str, Person]:
    """Return the people of a table of text with a short row for each; none of another file."""
    if file.suffix.lower() not in _TABLES or file.stat().st_size > _LARGEST_BYTES:
        return {}
    try:
        table = pd.read_csv(file, sep=None, engine="python", dtype=str, keep_default_na=False)
    except (ValueError, csv.Error):  # no table, or no text
        return {}
    columns = [
        inspect_column(Column("", str(name), "", table[name].to_numpy(dtype=object)))
        for name in table
    ]
    return people_of(columns)


def person_of(singles: Mapping[str, str], part: str = "", others: Sequence[str] = ()) -> Person:
    """Return what single values of a file state of the person of a part.

    They stand at the top, in a struct about a person, or in that of the part. What is stated twice
    differently is not known.
    """
    found: dict[str, set[tuple[str, str]]] = {}
    for name, value in singles.items():
        *above, last = name.split(".")
        words = words_of(last)
        if set(above) & set(others) or words.found & _NOT_MEASURED:
            continue
        is_own = not above or part in above or words_of(".".join(above)).found & _PERSON
        for key, known in _ABOUT.items():
            if is_own and words.found & known:
                found.setdefault(key, set()).add((value, words.unit))
    row = {key: next(iter(values)) for key, values in found.items() if len(values) == 1}
    return _person(row)


def find_person(people: Mapping[str, Person], participant: str, others: Collection[str]) -> Person:
    """Return the person of a name, or the only one of the same number that has no other's name."""
    if (same := people.get(participant)) is not None:
        return same
    number = digits_of(participant)
    rivals = [name for name in others if name != participant and digits_of(name) == number]
    alike = [person for name, person in people.items() if number and digits_of(name) == number]
    return alike[0] if len(alike) == 1 and not rivals else Person()


def _person(row: Mapping[str, tuple[object, str]]) -> Person:
    """Return a person by values and their units."""
    mass = _size(row.get("mass"), "kg", _MASSES_KG)
    height = _size(row.get("height"), "m", _HEIGHTS_M)
    if height is None and row.get("height", ("", "?"))[1] == "":
        height = _size((row["height"][0], "cm"), "m", _HEIGHTS_M)
    text = str(row.get("side", ("", ""))[0]).strip()
    return Person(mass, height, words_of(f"{text} ").side)


def _size(stated: tuple[object, str] | None, si: str, span: tuple[float, float]) -> float | None:
    if stated is None:
        return None
    value, unit = stated
    try:
        factor, _ = conversion(unit or si, si)
        number = factor * float(str(value).replace(",", "."))
    except (ValueError, UnitError):
        return None
    return round(number, 3) if span[0] <= number <= span[1] else None


def label_of(value: object) -> str:
    """Return a cell as the name of a person; numbers of people are whole."""
    return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)


def digits_of(name: str) -> str:
    """Return the number in a name, without zeros before it."""
    return re.sub(r"\D", "", name).lstrip("0")
