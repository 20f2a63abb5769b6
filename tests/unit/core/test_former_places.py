"""Packages of labs import modules from where they were."""

import subprocess
import sys
from importlib import import_module
from importlib.util import find_spec

import pytest

from jointz.former_places import PRESENT

#: In a fresh process, where nothing is loaded yet.
_CLASSES = """
from jointz.devices.interface import Stretch as first
from jointz.identify.methods.cell_estimator import CellMethod
import jointz.testing, jointz.rig.devices.interface as present
assert first is present.Stretch and first.__module__ == 'jointz.rig.devices.interface'
assert jointz.testing.ActuatorContract
"""
_FROM_PACKAGE = """
from jointz.sim import plant, presets
from jointz.analysis.certificate import study_protocol
assert plant.__name__ == 'jointz.rig.sim.walking.plant'
assert presets.__name__ == 'jointz.rig.sim.presets'
assert study_protocol.__name__ == 'jointz.analysis.study_protocol'
"""
_THREADS = """
from concurrent.futures import ThreadPoolExecutor
def rig(_):
    from jointz.sim.rig import simulated_rig
    return simulated_rig
with ThreadPoolExecutor(4) as pool:
    assert len(set(pool.map(rig, range(4)))) == 1
"""


@pytest.mark.parametrize("former", sorted(PRESENT))
def test_a_former_place_gives_the_module_of_the_present_one(former):
    assert import_module(former) is import_module(PRESENT[former])


@pytest.mark.parametrize(
    "program", [_CLASSES, _FROM_PACKAGE, _THREADS], ids=["classes", "from_package", "threads"]
)
def test_a_program_with_former_names_runs(program):
    subprocess.run([sys.executable, "-c", program], check=True)


def test_a_module_that_never_was_is_missing():
    assert find_spec("jointz.devices.nothing") is None
    with pytest.raises(ModuleNotFoundError, match="nothing"):
        import_module("jointz.devices.nothing")
