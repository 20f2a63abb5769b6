"""Objects that jointz and other packages register by entry points."""

from collections.abc import Mapping
from importlib.metadata import EntryPoint, entry_points


def registered(group: str, built_in: Mapping[str, str]) -> dict[str, EntryPoint]:
    """Return the entry points of a group by name; nothing is loaded.

    The built-in ones come from a table of dotted names, whatever the installed metadata say; other
    packages cannot replace them.
    """
    own = {name: EntryPoint(name, place, group) for name, place in built_in.items()}
    return {entry.name.lower(): entry for entry in entry_points(group=group)} | own
