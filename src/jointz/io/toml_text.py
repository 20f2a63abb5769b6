"""TOML as text: its statements with their places, and values as they are written."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

_QUOTES = ('"""', "'''", '"', "'")


@dataclass(frozen=True, slots=True)
class Statement:
    """A header or a key with its value, as it stands in a text."""

    start: int  # index of its first character in the text
    end: int  # index after its last character; a comment and the line end come after it
    text: str  # its characters, from ``start`` to ``end``

    @property
    def is_header(self) -> bool:
        """Whether it is ``[table]`` or ``[[list of tables]]``."""
        return self.text.startswith("[")


def statements(text: str) -> Iterator[Statement]:
    r"""Yield the statements of a valid TOML text, in order."""
    at = start = end = depth = 0
    while at < len(text):
        letter = text[at]
        if letter == "\n" and depth == 0:
            if text[start:end].strip():
                yield _statement(text, start, end)
            at += 1
            start = end = at
        elif letter == "#":
            newline = text.find("\n", at)
            at = len(text) if newline < 0 else newline
        else:
            after = _behind_text(text, at) if letter in "\"'" else at + 1
            depth += (letter in "[{") - (letter in "]}")
            end = end if letter.isspace() or letter == "\ufeff" else after
            at = after
    if text[start:end].strip():
        yield _statement(text, start, end)


def _statement(text: str, start: int, end: int) -> Statement:
    content = text[start:end].lstrip("\ufeff \t\r\n")
    return Statement(end - len(content), end, content)


def _behind_text(text: str, at: int) -> int:
    """Return where a quoted text that begins here is over."""
    quote = next(q for q in _QUOTES if text.startswith(q, at))
    at += len(quote)
    while not text.startswith(quote, at):
        at += 2 if text[at] == "\\" and quote[0] == '"' else 1
    at += len(quote)
    # A text of three quotes may end in up to two of its own.
    while len(quote) == 3 and text.startswith(quote[0], at):
        at += 1
    return at


def written_key(name: str) -> str:
    """Return a key as it is written, quoted where it must be."""
    plain = name.replace("_", "a").replace("-", "a").isalnum() and name.isascii()
    return name if plain else written_text(name)


def written_text(value: str) -> str:
    """Return a text as it is written; JSON's escapes are a part of TOML's."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def written_comment(text: str) -> str:
    r"""Return a text as it may stand behind ``#``: one line, without control characters."""
    return "".join(" " if letter < " " or letter == "\x7f" else letter for letter in text)


def written_table(values: Mapping[str, Any]) -> str:
    """Return an inline table of numbers, texts and inline tables."""
    parts = (f"{written_key(name)} = {written_value(value)}" for name, value in values.items())
    return "{ " + ", ".join(parts) + " }"


def written_value(value: Any) -> str:
    """Return a value as it is written."""
    if isinstance(value, Mapping):
        return written_table(value)
    return repr(float(value)) if isinstance(value, int | float) else written_text(str(value))
