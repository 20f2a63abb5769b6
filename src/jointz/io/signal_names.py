"""Names for the channels of files that label them not at all, or two of them alike."""

from collections.abc import Sequence

from jointz.io.column_names import unique_names


def distinct_names(labels: Sequence[str], count: int, kind: str) -> list[str]:
    """Return one name each: a second ``Fx`` is ``Fx#2``, a channel without label is counted.

    Parameters
    ----------
    labels : sequence of str
        What the file calls them; more than needed are left, missing ones are "".
    count : int
        How many names are wanted.
    kind : str
        What they are called where they have no label: ``analog`` gives ``analog 3``.

    Examples
    --------
    >>> distinct_names(["Fx", "Fx", ""], 4, "analog")
    ['Fx', 'Fx#2', 'analog 3', 'analog 4']
    """
    plain = [label or f"{kind} {i}" for i, label in enumerate(filled(labels, count), start=1)]
    return unique_names(plain, sign="#")


def filled(texts: Sequence[str], count: int) -> list[str]:
    """Return as many texts as wanted, "" where there are fewer.

    Parameters
    ----------
    texts : sequence of str
        What there is.
    count : int
        How many are wanted.
    """
    return [*texts[:count], *[""] * (count - len(texts))]
