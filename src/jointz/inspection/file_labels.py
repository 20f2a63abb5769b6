"""Participant, session, side and condition in the name of a file and of its folder."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from jointz.inspection.guess import guessed_condition
from jointz.inspection.names import word_set, words_of

#: Words before the number of a person; the ones that are most surely so first.
_PEOPLE = (
    "participant participante partecipante deelnemer teilnehmer proband probandin prob versuch"
    "sperson subject subj sub sujeto sujet suj soggetto sogg patient patiente paziente paciente "
    "person vpn vp tn pp pt",
    "p",
    "s",
)
_PERSONS = tuple(
    re.compile(rf"(?<![A-Za-z])((?:{'|'.join(words.split())})[-_ ]?\d+)(?!\d)", re.IGNORECASE)
    for words in _PEOPLE
)
_NUMBERED = re.compile(r"^([A-Za-z]{1,4})[-_ ]?\d{1,4}(?![\dA-Za-z])")
_SESSION = re.compile(
    r"(?<![A-Za-z])((?:ses|sess|session|sessione|sessie|sesion|seance|sitzung|tag|day|dag|jour|dia|"
    r"giorno|visit|besuch|visite)[-_ ]?\d+)(?!\d)",
    re.IGNORECASE,
)
_DIGITS = re.compile(r"\d+")
#: Words before numbers that count something else than people.
_COUNTED = word_set(
    "trial run test take rec walk gait block day tag ses data file step v ver set exp log part"
)


@dataclass(frozen=True, slots=True)
class FileLabels:
    """Labels of a recording in the name of its file; "" for none."""

    participant: str = ""
    session: str = ""
    side: str = ""
    condition: str = ""
    folder_condition: str = ""  # only where the file says none


def labels_of(
    file: str, part: str = "", inside: Sequence[str] = (), folders: Sequence[str] = ()
) -> FileLabels:
    """Return what the name of a file, its part and its folders say, the nearest first.

    ``inside`` are names in the file that hold for all its parts.
    """
    stem = Path(file).name.split(".")[0]
    texts = [part, *inside, stem, *folders]
    sides = (words_of(text).side for text in (part, stem, *folders))
    return FileLabels(
        participant=next(filter(None, map(_person, texts)), ""),
        session=next((found[1] for text in texts if (found := _SESSION.search(_spaced(text)))), ""),
        side=next(filter(None, sides), ""),
        condition=next(filter(None, map(_condition, (part, stem, *inside))), ""),
        folder_condition=next(filter(None, map(_condition, folders)), ""),
    )


def _condition(text: str) -> str:
    # A number in a name counts something: it is no level of a column of conditions.
    return guessed_condition(_DIGITS.sub(" ", text))


def _person(text: str) -> str:
    spaced = _spaced(text)
    for pattern in _PERSONS:
        if found := pattern.search(spaced):
            return found[1].replace(" ", "")
    numbered = _NUMBERED.search(spaced)
    return "" if numbered is None or _has_a_meaning(numbered[1]) else numbered[0].replace(" ", "")


def _has_a_meaning(word: str) -> bool:
    """Return whether a word before a number is a joint, a side, a condition or a counter."""
    words = words_of(word)
    return bool(words.joint or words.side or _condition(word) or words.found & _COUNTED)


def _spaced(text: str) -> str:
    return text.replace("_", " ")


def agree(pairs: Iterable[tuple[str, str]]) -> bool:
    """Return whether no pair of labels differs, where both are known."""
    return all(not a or not b or a.casefold() == b.casefold() for a, b in pairs)
