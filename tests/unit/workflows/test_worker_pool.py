"""Who is run after somebody failed, and what is said of it."""

from dataclasses import dataclass
from types import SimpleNamespace

import pytest

from jointz.core.errors import DeviceError
from jointz.workflows import worker_pool
from jointz.workflows.worker_pool import run_people


@dataclass(frozen=True)
class Rig:
    hardware: object = None
    seed: int = 7


@pytest.fixture
def run(monkeypatch):
    """Run people of whom some fail, in this process, and list who was run."""

    def started(failing, *, rig=None, attended=False):
        begun = []

        def run_participant(one, settings, *, operator, progress):
            begun.append(one.wearer.id)
            progress("perturbed", 1, 2, 3)
            if one.wearer.id in failing:
                raise failing[one.wearer.id]
            return {"of": one.wearer.id, "operator": operator}

        monkeypatch.setattr(worker_pool, "run_participant", run_participant)
        settings = SimpleNamespace(attended=attended)
        told = []
        try:
            reports = run_people(
                settings,
                rig or Rig(),
                3,
                workers=1,
                scheduler=None,
                operator="operator",
                progress=lambda *found: told.append(found),
            )
        except Exception as exc:  # noqa: BLE001 - is looked at
            return begun, exc
        assert told == [(name, "perturbed", 1, 2, 3) for name in begun]
        return begun, reports

    def opened(rig, number):
        return SimpleNamespace(wearer=SimpleNamespace(id=f"S{number + 1:02d}"))

    monkeypatch.setattr(worker_pool, "open_rig", opened)
    return started


def test_everybody_is_run_in_turn_with_the_operator(run):
    begun, reports = run({})
    assert begun == [one["of"] for one in reports] == ["S01", "S02", "S03"]
    assert {one["operator"] for one in reports} == {"operator"}


def test_others_who_are_simulated_are_run_and_everybody_who_failed_is_named(run):
    begun, error = run({"S01": ZeroDivisionError("one"), "S03": ValueError("three")})

    assert begun == ["S01", "S02", "S03"]
    assert isinstance(error, ZeroDivisionError)
    assert error.__notes__ == [
        "It was participant 1 (seed 7).",
        "participant 3 (seed 7) failed too: three",
    ]


@pytest.mark.parametrize("given", [{"rig": Rig(hardware="motors")}, {"attended": True}])
def test_nobody_is_put_on_devices_after_one_failed(run, given):
    begun, error = run({"S02": DeviceError("motor", "it is hot")}, **given)

    assert begun == ["S01", "S02"]
    assert error.__notes__ == ["It was participant 2 (seed 7)."]
