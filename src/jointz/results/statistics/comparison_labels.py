"""Detection of labels that differ only in spelling, such as S01 and s1."""

import re
from collections.abc import Iterable

from jointz.core.grouping import by_key

_ZEROS = re.compile(r"(?<![\d.])0+(?=\d)")


def label_key(label: str) -> str:
    """Return the key that labels share if they differ only in spelling."""
    text = _ZEROS.sub("", label.strip().casefold())
    try:
        number = float(text)
    except ValueError:
        return text
    return repr(number) if abs(number) < float("inf") else text


def alike_labels(labels: Iterable[str]) -> list[tuple[str, ...]]:
    """Return the labels that differ only by case, by leading zeros or as numbers are written."""
    groups = by_key((label_key(label), label) for label in dict.fromkeys(labels))
    return [tuple(group) for group in groups.values() if len(group) > 1]
