"""Participant, session, side and condition in the name of a file and of its folder."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from jointz.inspection.guess import guessed_condition
from jointz.inspection.names import words_of

_PEOPLE = (
    "participant participante partecipante deelnemer teilnehmer tn proband probandin prob versuch"
    "sperson vp vpn pp subject subj sub sujeto sujet suj soggetto sogg patient patiente paziente "
    "paciente pt person s p"
)
_PERSON = re.compile(
    rf"(?<![A-Za-z])((?:{'|'.join(_PEOPLE.split())})[-_ ]?\d+)(?!\d)", re.IGNORECASE
)
_NUMBERED = re.compile(r"^([A-Za-z]{1,4}[-_ ]?\d{1,4})(?![\dA-Za-z])")
_SESSION = re.compile(
    r"(?<![A-Za-z])((?:ses|sess|session|sessione|sessie|sesion|seance|sitzung|tag|day|dag|jour|dia|"
    r"giorno|visit|besuch|visite)[-_ ]?\d+)(?!\d)",
    re.IGNORECASE,
)
_DIGITS = re.compile(r"\d+")
_NOT_PEOPLE = re.compile(r"(?:trial|run|test|take|rec|walk|gait|block|day|tag|ses)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class FileLabels:
    """What a name says of a recording; "" where it says nothing."""

    participant: str = ""
    session: str = ""
    side: str = ""
    condition: str = ""


def labels_of(file: str, part: str = "", inside: Sequence[str] = ()) -> FileLabels:
    """Return what the name of a file, its folder and a part of it say.

    ``inside`` are names in the file that hold for all its parts.
    """
    path = Path(file)
    stem = path.name.split(".")[0]
    texts = [part, *inside, stem, path.parent.name]
    sides = (words_of(text).side for text in (part, stem))
    # A number in a name counts something: it is no level of a column of conditions.
    words = (_DIGITS.sub(" ", text) for text in (part, stem, *inside, path.parent.name))
    conditions = (guessed_condition(text) for text in words)
    return FileLabels(
        participant=next(filter(None, map(_person, texts)), ""),
        session=next((found[1] for text in texts if (found := _SESSION.search(_spaced(text)))), ""),
        side=next(filter(None, sides), ""),
        condition=next(filter(None, conditions), ""),
    )


def _person(text: str) -> str:
    spaced = _spaced(text)
    found = _PERSON.search(spaced) or _NUMBERED.search(spaced)
    if found is None or _NOT_PEOPLE.match(found[1]):
        return ""
    return found[1].replace(" ", "")


def _spaced(text: str) -> str:
    return text.replace("_", " ")
