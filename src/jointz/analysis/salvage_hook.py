"""Recovery of damaged recordings, by whatever recorded them.

Modules register by entry points of the group ``jointz.salvage``. Each has ``salvage_recordings``,
which makes damaged recordings of a study again, and ``salvage_advice``, which says how to go on.
"""

import os
from collections.abc import Iterator
from contextlib import suppress
from importlib.metadata import EntryPoint

from jointz.core.entry_points import registered
from jointz.core.errors import DataError

GROUP = "jointz.salvage"
#: Entry points of jointz; pyproject.toml registers the same.
BUILT_IN = {"sessions": "jointz.session.salvage"}


def salvage_recordings(study: str | os.PathLike[str]) -> list[str]:
    """Make damaged recordings of a study again; return a sentence for each."""
    sentences: list[str] = []
    for entry in _entries():
        try:
            salvage = entry.load().salvage_recordings
        except (ImportError, AttributeError) as exc:
            raise DataError(
                f"{GROUP}: {entry.name} = {entry.value} cannot be loaded ({exc}). Correct or "
                "remove the package that registers it."
            ) from exc
        sentences += salvage(study)
    return sentences


def salvage_advice(study: str | os.PathLike[str], message: str) -> str:
    """Return how to go on with a study that cannot be read, "" where nothing can be salvaged."""
    advice = []
    for entry in _entries():
        with suppress(ImportError, AttributeError):  # the study's own error matters more
            advice.append(entry.load().salvage_advice(study, message))
    return " ".join(filter(None, advice))


def _entries() -> Iterator[EntryPoint]:
    return iter(registered(GROUP, BUILT_IN).values())
