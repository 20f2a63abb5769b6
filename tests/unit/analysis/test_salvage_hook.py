"""Recovery of recordings is registered by entry points."""

import tomllib
from importlib import import_module
from pathlib import Path

from jointz.analysis import salvage_hook


def test_what_is_built_in_is_registered_and_has_both_functions():
    project = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())["project"]
    assert project["entry-points"][salvage_hook.GROUP] == salvage_hook.BUILT_IN
    for place in salvage_hook.BUILT_IN.values():
        module = import_module(place)
        assert callable(module.salvage_recordings)
        assert callable(module.salvage_advice)
