"""Labels that are not the same but look it: S01 and s1."""

import re
from collections.abc import Iterable

_ZEROS = re.compile(r"(?<![\d.])0+(?=\d)")


def label_key(label: str) -> str:
    """Return what labels share that a reader takes for one.

    Parameters
    ----------
    label : str
        As it is written.

    Examples
    --------
    >>> label_key("S01") == label_key("s1"), label_key("1.0") == label_key("1")
    (True, True)
    >>> label_key("S10") == label_key("S1"), label_key("1234567") == label_key("1234568")
    (False, False)
    """
    text = _ZEROS.sub("", label.strip().casefold())
    try:
        number = float(text)
    except ValueError:
        return text
    return repr(number) if abs(number) < float("inf") else text


def alike_labels(labels: Iterable[str]) -> list[tuple[str, ...]]:
    """Return the labels that differ only by case, by leading zeros or as numbers are written.

    Parameters
    ----------
    labels : iterable of str
        As they are written.

    Examples
    --------
    >>> alike_labels(["S01", "S02", "s1", "1", "1.0"])
    [('S01', 's1'), ('1', '1.0')]
    """
    groups: dict[str, list[str]] = {}
    for label in dict.fromkeys(labels):
        groups.setdefault(label_key(label), []).append(label)
    return [tuple(group) for group in groups.values() if len(group) > 1]
