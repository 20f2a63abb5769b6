"""Recovery of damaged recordings, by whatever recorded them.

Modules register by entry points of the group ``jointz.salvage``. Each has ``salvage_recordings``,
which makes damaged recordings of a study again, and ``salvage_advice``, which says how to go on.
"""

import os
from collections.abc import Iterable
from importlib.metadata import EntryPoint
from typing import Any

from jointz.core.entry_points import registered
from jointz.core.errors import DataError

GROUP = "jointz.salvage"
#: Entry points of jointz; pyproject.toml registers the same.
BUILT_IN = {"sessions": "jointz.session.salvage"}


def salvage_recordings(study: str | os.PathLike[str]) -> list[str]:
    """Make damaged recordings of a study again; return a sentence for each."""
    modules = [_loaded(entry) for entry in _entries()]  # all, before any file is touched
    return [sentence for module in modules for sentence in module.salvage_recordings(study)]


def salvage_advice(study: str | os.PathLike[str], message: str) -> str:
    """Return how to go on with a study that cannot be read, "" where nothing can be salvaged."""
    advice = []
    for entry in _entries():
        try:
            module = _loaded(entry)
        except DataError:  # the study's own error matters more
            continue
        advice.append(module.salvage_advice(study, message))
    return " ".join(filter(None, advice))


def _entries() -> Iterable[EntryPoint]:
    return registered(GROUP, BUILT_IN).values()


def _loaded(entry: EntryPoint) -> Any:
    try:
        return entry.load()
    except (ImportError, AttributeError) as exc:
        raise DataError(
            f"{GROUP}: {entry.name} = {entry.value} cannot be loaded ({exc}). Correct or remove "
            "the package that registers it."
        ) from exc
