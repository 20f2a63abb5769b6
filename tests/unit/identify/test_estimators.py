"""Registry of methods: entry points, loaded when used, those of other packages too."""

import subprocess
import sys
import tomllib
from importlib.metadata import EntryPoint
from pathlib import Path
from types import SimpleNamespace

import pytest

from jointz.identify import estimators
from jointz.identify.estimators import METHODS
from jointz.identify.regression.cell_estimator import CellMethod
from jointz.identify.regression.cell_regressions import PILOT

MINE = CellMethod("mine", "pre_pulse", PILOT.fit, kinds=("walking",))


class Class(CellMethod):
    def __init__(self):
        super().__init__("class", "pre_pulse", PILOT.fit)


@pytest.fixture
def installed(monkeypatch):
    """Install a package that registers four estimators."""
    names = {"mine": "MINE", "class": "Class", "pilot": "MINE", "other": "MINE"}
    points = [EntryPoint(k, f"{__name__}:{v}", estimators.GROUP) for k, v in names.items()]
    monkeypatch.setitem(sys.modules, __name__, SimpleNamespace(**globals()))
    monkeypatch.setattr(estimators, "entry_points", lambda **_group: points)
    estimators._entries.cache_clear()
    yield
    estimators._entries.cache_clear()


def test_the_methods_of_jointz_are_entry_points():
    project = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text("utf-8"))[
        "project"
    ]
    assert project["entry-points"][estimators.GROUP] == dict(estimators.BUILT_IN)


def test_the_registry_loads_no_method():
    code = (
        "import sys, jointz.identify.estimators; "
        "raise SystemExit(any(m.startswith(('jointz.identify.regression.', "
        "'jointz.identify.walking.', 'jointz.identify.bench.')) for m in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_every_method_goes_by_its_name_and_serves_its_kinds():
    assert all(METHODS[name].name == name for name in METHODS)
    assert set(METHODS) - set(METHODS.serving("walking")) == {"full_record"}
    assert set(METHODS) - set(METHODS.serving("bench")) == {"bayesian"}


def test_estimators_of_other_packages_follow_those_of_jointz(installed):
    assert list(METHODS)[-3:] == ["mine", "class", "other"]
    assert METHODS["mine"] is MINE
    assert METHODS["class"].name == "class"
    assert METHODS["pilot"] is PILOT  # those of jointz cannot be replaced
    assert "unknown" not in METHODS


def test_an_estimator_under_another_name_is_refused(installed):
    with pytest.raises(TypeError, match=r"other = .*expected an Estimator named 'other'"):
        METHODS["other"]
