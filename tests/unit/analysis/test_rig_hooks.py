"""Recovery of recordings and certificates come from entry points."""

import tomllib
from importlib import import_module
from pathlib import Path

import pytest

from jointz.analysis import rig_hooks
from jointz.core.errors import DataError


def test_what_is_built_in_is_registered_and_has_all_functions():
    project = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())["project"]
    functions = {
        "jointz.salvage": ("salvage_recordings", "salvage_advice"),
        "jointz.certificates": ("check_certifiable", "certificate_of"),
    }
    assert set(functions) == set(rig_hooks.BUILT_IN)
    for group, places in rig_hooks.BUILT_IN.items():
        assert project["entry-points"][group] == places
        for place in places.values():
            module = import_module(place)
            assert all(callable(getattr(module, name)) for name in functions[group])


def test_a_module_that_cannot_be_loaded_hides_no_error_of_the_study(monkeypatch, tmp_path):
    monkeypatch.setitem(rig_hooks.BUILT_IN, "jointz.salvage", {"broken": "no_such_module"})
    assert rig_hooks.salvage_advice(tmp_path, "a problem") == ""
    with pytest.raises(DataError, match=r"jointz\.salvage: broken = no_such_module"):
        rig_hooks.salvage_recordings(tmp_path)
