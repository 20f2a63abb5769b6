"""Who is run after somebody failed, and what is said of it."""

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest

from jointz.core.errors import DeviceError, EngineError
from jointz.rig.session import run as session_run
from jointz.rig.session.run import run_people
from jointz.rig.session.run_settings import RunSettings
from jointz.tasks.engine import Serial


@dataclass(frozen=True)
class Rig:
    hardware: object = None
    seed: int = 7


@pytest.fixture
def rigs(monkeypatch):
    """People without devices."""

    def opened(rig, number):
        return SimpleNamespace(wearer=SimpleNamespace(id=f"S{number + 1:02d}"))

    monkeypatch.setattr(session_run, "open_rig", opened)


@pytest.fixture
def run(rigs, monkeypatch):
    """Run people of whom some fail, in this process, and list who was run."""

    def started(failing, *, rig=None, attended=False, operator=None):
        begun = []

        def run_participant(one, settings, *, operator, progress, advisor):
            assert advisor is None
            begun.append(one.wearer.id)
            progress("perturbed", 1, 2, 3)
            if one.wearer.id in failing:
                raise failing[one.wearer.id]
            return {"of": one.wearer.id, "operator": operator}

        monkeypatch.setattr(session_run, "run_participant", run_participant)
        settings = SimpleNamespace(attended=attended, live=False)
        told = []
        try:
            reports = run_people(
                settings,
                rig or Rig(),
                3,
                workers=1,
                scheduler=None,
                operator=operator,
                progress=lambda *found: told.append(found),
            )
        except Exception as exc:  # noqa: BLE001 - is looked at
            return begun, exc
        assert told == [(name, "perturbed", 1, 2, 3) for name in begun]
        return begun, reports

    return started


def test_everybody_is_run_in_turn_with_the_operator(run):
    begun, reports = run({}, operator="operator")
    assert begun == [one["of"] for one in reports] == ["S01", "S02", "S03"]
    assert {one["operator"] for one in reports} == {"operator"}


def test_others_who_are_simulated_are_run_and_everybody_who_failed_is_named(run):
    begun, error = run({"S01": ZeroDivisionError("one"), "S03": ValueError("three")})

    assert begun == ["S01", "S02", "S03"]
    assert isinstance(error, ZeroDivisionError)
    assert ["participant 1" in note for note in error.__notes__] == [True, False]
    assert "participant 3" in error.__notes__[1]


@pytest.mark.parametrize(
    "given", [{"rig": Rig(hardware="motors")}, {"attended": True}, {"operator": "operator"}]
)
def test_nobody_is_put_on_devices_or_called_by_an_operator_after_one_failed(run, given):
    begun, error = run({"S02": DeviceError("motor", "it is hot")}, **given)

    assert begun == ["S01", "S02"]
    assert "participant 2" in error.__notes__[0]


def run_elsewhere(*, scheduler):
    """Run two people by others than this process."""
    return run_people(
        RunSettings(None, 7, "fast", Path("study")),
        Rig(),
        2,
        workers=2,
        scheduler=scheduler,
        operator=None,
        progress=None,
    )


def test_workers_are_told_the_whole_path_of_the_study(rigs, monkeypatch, tmp_path):
    """They may have been started in another folder."""
    monkeypatch.setattr(session_run, "open_engine", lambda *_, **__: nullcontext(Serial()))
    monkeypatch.setattr(session_run, "run_participant", lambda _, settings, **__: settings.study)
    monkeypatch.chdir(tmp_path)

    assert run_elsewhere(scheduler="tcp://lab:8786") == [Path.cwd() / "study"] * 2


def test_processes_that_cannot_be_started_are_no_bug(monkeypatch):
    def refused(*_):
        raise OSError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(session_run, "_session_pool", refused)
    with pytest.raises(EngineError, match="Resource temporarily unavailable"):
        run_elsewhere(scheduler=None)
