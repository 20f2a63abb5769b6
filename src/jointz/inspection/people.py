"""Body mass, height and leg of people: from a table of participants, or single values of a file."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from jointz.inspection.guess import InspectedColumn
from jointz.inspection.names import word_set, words_of

_MASS: Final = word_set("mass weight bodymass bodyweight masse gewicht masa peso massa")
_HEIGHT: Final = word_set("height stature bodyheight taille grosse groesse altura altezza lengte")
_PERSON: Final = word_set("participant subject proband vp id sujet sujeto soggetto person name")
_SIDE: Final = word_set(
    "side leg tested limb seite bein cote jambe lado pierna gamba been"  # codespell:ignore bein
)
_MASSES_KG, _HEIGHTS_M = (20.0, 250.0), (0.8, 2.5)
_CM_OF_M = 100.0


@dataclass(frozen=True, slots=True)
class Person:
    """What files state of a person; None and "" where they do not."""

    mass_kg: float | None = None
    height_m: float | None = None
    side: str = ""


def people_of(columns: Sequence[InspectedColumn]) -> dict[str, Person]:
    """Return the people of a table with a row for each; none of another table."""
    ids = next((c for c in columns if c.words.found & _PERSON), None)
    about = {
        key: next((c for c in columns if c.words.found & words), None)
        for key, words in (("mass", _MASS), ("height", _HEIGHT), ("side", _SIDE))
    }
    if ids is None or (about["mass"] is None and about["height"] is None):
        return {}
    found = {}
    for k, name in enumerate(map(label_of, ids.column.values)):
        row = {key: c.column.values[k] for key, c in about.items() if c is not None}
        found[name] = _person(row)
    return found


def person_of(singles: Mapping[str, str]) -> Person:
    """Return what single values of a file state of its person."""
    row: dict[str, object] = {}
    for name, value in singles.items():
        words = words_of(name.rpartition(".")[2]).found
        for key, known in (("mass", _MASS), ("height", _HEIGHT), ("side", _SIDE)):
            if words & known:
                row.setdefault(key, value)
    return _person(row)


def named(people: Mapping[str, Person], participant: str) -> Person:
    """Return the person of a name, or the only one of the same number."""
    if (same := people.get(participant)) is not None:
        return same
    number = digits_of(participant)
    alike = [p for name, p in people.items() if number and digits_of(name) == number]
    return alike[0] if len(alike) == 1 else Person()


def _person(row: Mapping[str, object]) -> Person:
    mass, height = _size(row.get("mass"), _MASSES_KG), _size(row.get("height"), _HEIGHTS_M)
    if height is None and (cm := _size(row.get("height"), tuple(_CM_OF_M * h for h in _HEIGHTS_M))):
        height = cm / _CM_OF_M
    text = str(row.get("side", "")).strip()
    return Person(mass, height, words_of(f"{text} ").side)


def _size(value: object, span: tuple[float, ...]) -> float | None:
    try:
        number = float(str(value).replace(",", "."))
    except ValueError:
        return None
    return number if np.isfinite(number) and span[0] <= number <= span[1] else None


def label_of(value: object) -> str:
    """Return a cell as the name of a person; numbers of people are whole."""
    return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)


def digits_of(name: str) -> str:
    """Return the number in a name, without zeros before it."""
    return re.sub(r"\D", "", name).lstrip("0")
