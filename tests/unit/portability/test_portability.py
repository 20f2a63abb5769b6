"""What works on Windows and on a Mac, as far as a Linux that lacks what they lack can tell."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from jointz.core.errors import DataError
from jointz.rig.console.console_app import open_console
from jointz.rig.experiment.loop import undisturbed
from jointz.rig.session.live import live_session
from jointz.rig.session.live.live_session import refuse_where_unseen
from jointz.rig.session.rigs.hardware_rig import refuse_with_devices

#: Imports every module but those that need an extra; the public names come with the first.
IMPORTS = """
import pkgutil
import jointz
APP = ("jointz.rig.console.", "jointz.explorer.", "jointz.web.")
for name in jointz.__all__:
    getattr(jointz, name)
names = [
    found.name
    for found in pkgutil.walk_packages(jointz.__path__, "jointz.")
    if found.name != "jointz.__main__" and not found.name.startswith(APP)
]
failed = {}
for name in names:
    try:
        __import__(name)
    except ImportError as exc:
        failed[name] = str(exc)
told = {"names": names, "failed": failed}
"""
#: A simulated experiment, and another process at it.
RUN = """
import os
from pathlib import Path
import jointz
from jointz.core.errors import OutputError
from jointz.rig.experiment.files import file_lock
from jointz.rig.experiment.files.whole_files import open_to_append
from jointz.io.protocols import load_protocol

whole = load_protocol("walking")
perturbed = whole.conditions[-1]
few = perturbed.perturbations.model_copy(update={"count_per_point": 1, "warm_up_strides": 6})
conditions = (perturbed.model_copy(update={"perturbations": few}),)
rates = whole.rates.model_copy(update={"control_hz": 200.0, "sample_hz": 200.0})
short = {"conditions": conditions, "participants": 1, "rates": rates}
protocol = whole.model_copy(update=short)
jointz.run(protocol, out="study")
told = {"journal": Path("study/sessions/S01/journal.jsonl").read_text(encoding="utf-8")}
told["recordings"] = len(jointz.open_study("study").recordings)
fd = open_to_append(Path("study/run.json"))
file_lock.hold(fd, Path("study/run.json"))
try:
    jointz.run(protocol, out="study", resume=True)
except OutputError as exc:
    told["held"] = str(exc)
os.close(fd)
"""


def ran(system: str, code: str, folder: Path) -> dict:
    """Run code in a Python that is like another system's; return what it told."""
    begin = f"import other_systems\nother_systems.{system}()\n"
    ending = "\nimport json\nprint(json.dumps(told))"
    done = subprocess.run(
        [sys.executable, "-c", begin + code + ending],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parent), "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_everything_can_be_imported_on_windows_which_lacks_all_that_a_mac_does(tmp_path):
    told = ran("as_on_windows", IMPORTS, tmp_path)
    assert {"jointz.rig.session.run", "jointz.demo.command", "jointz.io.c3d.c3d_format"} <= set(
        told["names"]
    )
    assert told["failed"] == {}


def test_a_simulated_experiment_runs_on_windows_and_is_held_by_one_process(tmp_path):
    told = ran("as_on_windows", RUN, tmp_path)
    assert told["journal"].count('"pulse_completed"') == 6
    assert told["recordings"] == 1
    assert "held" in told


@pytest.mark.parametrize("system", ["darwin", "win32"])
def test_real_devices_are_refused_elsewhere_before_anything_begins(system, monkeypatch):
    monkeypatch.setattr(sys, "platform", system)
    with pytest.raises(DataError, match="Linux only"):
        refuse_with_devices(device=None, preset=None, clock=None, workers=1)


def test_a_session_is_followed_only_where_the_system_tells_who_holds_it(monkeypatch, tmp_path):
    refuse_where_unseen()
    monkeypatch.setattr(live_session, "_LOCKS", tmp_path / "locks")
    with pytest.raises(DataError, match="Linux"):
        refuse_where_unseen()
    with pytest.raises(DataError, match="Linux"):
        open_console(tmp_path, ["walking"], resume=False, host="", port=0, announce=print)
    assert list(tmp_path.iterdir()) == []


def test_without_a_scheduler_to_ask_the_loop_runs_as_it_may(monkeypatch):
    for name in [name for name in vars(os) if name.startswith("sched_")]:
        monkeypatch.delattr(os, name)
    with undisturbed() as scheduling:
        assert scheduling == "SCHED_OTHER"
