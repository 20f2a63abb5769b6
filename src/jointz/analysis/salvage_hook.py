"""Recovery of damaged recordings, by whatever recorded them.

Modules register by entry points of the group ``jointz.salvage``. Each has ``salvage_recordings``,
which makes damaged recordings of a study again, and ``salvage_advice``, which says how to go on.
"""

import os
from collections.abc import Iterator
from typing import Any

from jointz.core.entry_points import registered

GROUP = "jointz.salvage"
#: Entry points of jointz; pyproject.toml registers the same.
BUILT_IN = {"sessions": "jointz.session.salvage"}


def salvage_recordings(study: str | os.PathLike[str]) -> list[str]:
    """Make damaged recordings of a study again; return a sentence for each."""
    return [sentence for one in _modules() for sentence in one.salvage_recordings(study)]


def salvage_advice(study: str | os.PathLike[str], message: str) -> str:
    """Return how to go on with a study that cannot be read, "" where nothing can be salvaged."""
    return " ".join(filter(None, (one.salvage_advice(study, message) for one in _modules())))


def _modules() -> Iterator[Any]:
    return (entry.load() for entry in registered(GROUP, BUILT_IN).values())
