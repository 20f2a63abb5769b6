"""Names for the channels of files that label them not at all, or two of them alike."""

from collections.abc import Sequence

from jointz.io.text.column_names import unique_names


def distinct_names(labels: Sequence[str], count: int, kind: str) -> list[str]:
    """Return one name each: a second ``Fx`` is ``Fx#2``, a channel without label is counted."""
    plain = [label or f"{kind} {i}" for i, label in enumerate(filled(labels, count), start=1)]
    return unique_names(plain, sign="#")


def filled(texts: Sequence[str], count: int) -> list[str]:
    """Return as many texts as wanted, "" where there are fewer."""
    return [*texts[:count], *[""] * (count - len(texts))]
