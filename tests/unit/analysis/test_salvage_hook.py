"""Recovery of recordings is registered by entry points."""

import tomllib
from importlib import import_module
from pathlib import Path

import pytest

from jointz.analysis import salvage_hook
from jointz.core.errors import DataError


def test_what_is_built_in_is_registered_and_has_both_functions():
    project = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())["project"]
    assert project["entry-points"][salvage_hook.GROUP] == salvage_hook.BUILT_IN
    for place in salvage_hook.BUILT_IN.values():
        module = import_module(place)
        assert callable(module.salvage_recordings)
        assert callable(module.salvage_advice)


def test_a_module_that_cannot_be_loaded_hides_no_error_of_the_study(monkeypatch, tmp_path):
    monkeypatch.setattr(salvage_hook, "BUILT_IN", {"broken": "no_such_module"})
    assert salvage_hook.salvage_advice(tmp_path, "a problem") == ""
    with pytest.raises(DataError, match="broken = no_such_module"):
        salvage_hook.salvage_recordings(tmp_path)
