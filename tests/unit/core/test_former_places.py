"""Packages of labs import modules from where they were."""

import subprocess
import sys
from importlib import import_module

import pytest

from jointz.former_places import PRESENT


@pytest.mark.parametrize("former", sorted(PRESENT))
def test_a_former_place_gives_the_module_of_the_present_one(former):
    assert import_module(former) is import_module(PRESENT[former])


def test_what_is_imported_first_from_a_former_place_is_the_same_class():
    program = (
        "from jointz.devices.interface import Stretch as first\n"
        "from jointz.identify.methods.cell_estimator import CellMethod\n"
        "import jointz.testing, jointz.rig.devices.interface as present\n"
        "assert first is present.Stretch and first.__module__ == 'jointz.rig.devices.interface'\n"
        "assert jointz.testing.ActuatorContract"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def test_a_module_that_never_was_is_missing():
    with pytest.raises(ModuleNotFoundError, match="nothing"):
        import_module("jointz.devices.nothing")
