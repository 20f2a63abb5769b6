"""Recovery of recordings and certificates, which other packages provide by entry points.

``jointz.salvage``: modules with ``salvage_recordings``, which makes damaged recordings of a study
again, and ``salvage_advice``, which says how to go on. ``jointz.certificates``: a module with
``check_certifiable`` and ``certificate_of``.
"""

import os
from importlib.metadata import EntryPoint
from typing import Any

from jointz.core.entry_points import registered
from jointz.core.errors import DataError

#: Group -> its entry points of jointz; pyproject.toml registers the same.
BUILT_IN = {
    "jointz.salvage": {"sessions": "jointz.rig.session.salvage"},
    "jointz.certificates": {"simulated_people": "jointz.rig.certificate.certificate_step"},
}


def salvage_recordings(study: str | os.PathLike[str]) -> list[str]:
    """Make damaged recordings of a study again; return a sentence for each."""
    # All are loaded before any file is touched.
    modules = [_loaded(entry) for entry in _entries("jointz.salvage").values()]
    return [sentence for module in modules for sentence in module.salvage_recordings(study)]


def salvage_advice(study: str | os.PathLike[str], message: str) -> str:
    """Return how to go on with a study that cannot be read, "" where nothing can be salvaged."""
    advice = []
    for entry in _entries("jointz.salvage").values():
        try:
            module = _loaded(entry)
        except DataError:  # the study's own error matters more
            continue
        advice.append(module.salvage_advice(study, message))
    return " ".join(filter(None, advice))


def certificates() -> Any:
    """Return the module that makes certificates."""
    return _loaded(_entries("jointz.certificates")["simulated_people"])


def _entries(group: str) -> dict[str, EntryPoint]:
    return registered(group, BUILT_IN[group])


def _loaded(entry: EntryPoint) -> Any:
    try:
        return entry.load()
    except (ImportError, AttributeError) as exc:
        raise DataError(
            f"{entry.group}: {entry.name} = {entry.value} cannot be loaded ({exc}). Correct or "
            "remove the package that registers it."
        ) from exc
