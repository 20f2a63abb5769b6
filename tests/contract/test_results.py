"""What every result promises: a table, a text, a figure, and a way through JSON and back.

A new result class fails here until it has an example in result_examples.py.
"""

import copy
import dataclasses
import importlib
import json
import pkgutil
import re
import subprocess
import sys
from typing import Any

import matplotlib as mpl
import pandas as pd
import pytest
from matplotlib.axes import Axes
from tests.contract.result_examples import EXAMPLES, example

import jointz
from jointz.results.base import Result


@pytest.fixture(params=EXAMPLES)
def result(request: pytest.FixtureRequest) -> Any:
    return example(request.param)


@pytest.fixture(autouse=True)
def _no_window():
    import matplotlib.pyplot as plt

    backend = mpl.get_backend()
    mpl.use("Agg")
    yield
    plt.close("all")
    mpl.use(backend)


def subclasses(kind):
    for one in kind.__subclasses__():
        if getattr(sys.modules[one.__module__], one.__name__, None) is one:  # slots make two
            yield one
            yield from subclasses(one)


def test_every_result_class_has_an_example():
    for module in pkgutil.walk_packages(jointz.__path__, "jointz."):
        if module.name.startswith(("jointz.results", "jointz.inspection")):
            importlib.import_module(module.name)
    results = {c for c in subclasses(Result) if hasattr(c, "to_frame") and not [*subclasses(c)]}

    assert results == {type(example(name)) for name in EXAMPLES}


def test_a_result_gives_a_table_and_a_short_text(result):
    table, text = result.to_frame(), result.summary()

    assert isinstance(table, pd.DataFrame)
    assert table.index.equals(pd.RangeIndex(len(table)))
    assert table.columns.is_unique
    assert text == text.strip() != ""
    assert not re.search(r"\bnan\b", text.lower())
    assert "None" not in text


def test_a_result_draws_where_it_is_told_and_on_its_own(result):
    import matplotlib.pyplot as plt

    ax = plt.figure().add_subplot()

    assert result.plot(ax) is ax
    assert result.plot(ax=ax) is ax
    assert plt.get_fignums() == [ax.figure.number]
    ax.figure.canvas.draw()
    own = result.plot()
    assert isinstance(own, Axes)
    assert own.get_ylabel()
    own.figure.canvas.draw()


def test_a_result_comes_back_from_json_as_it_was(result):
    plain = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    before = copy.deepcopy(plain)

    back = type(result).from_dict(plain)

    assert plain == before  # reading leaves what is read as it was
    assert type(back) is type(result)
    assert back == result
    assert back.to_dict() == result.to_dict()
    assert json.loads(json.dumps(back.to_dict())) == plain
    pd.testing.assert_frame_equal(back.to_frame(), result.to_frame())
    assert back.summary() == result.summary()


def test_two_results_that_differ_are_not_equal():
    distinct = [example(name) for name in EXAMPLES]

    for i, a in enumerate(distinct):
        for j, b in enumerate(distinct):
            assert (a == b) is (i == j)


def test_a_result_cannot_be_changed(result):
    for field in dataclasses.fields(result):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(result, field.name, None)
    assert not hasattr(result, "__dict__")


def test_another_schema_is_refused_by_name(result):
    plain = result.to_dict()

    for schema in ("jointz.StudyAnalysis/99", 99, None):
        with pytest.raises(ValueError, match="expected schema") as caught:
            type(result).from_dict(plain | {"schema": schema})
        assert repr(schema) in str(caught.value)
        assert str(plain["schema"]) in str(caught.value)
    with pytest.raises(ValueError, match="expected schema"):
        type(result).from_dict({k: v for k, v in plain.items() if k != "schema"})


def test_a_schema_belongs_to_one_class():
    schemas = {(type(made), made.to_dict()["schema"]) for made in map(example, EXAMPLES)}

    assert len({kind for kind, _ in schemas}) == len({schema for _, schema in schemas})


def test_results_load_no_matplotlib_until_they_draw():
    code = (
        "import sys, jointz.results.study_analysis, jointz.results.run_report;"
        "import jointz.results.series.joint_fit;"
        "sys.exit('matplotlib' in sys.modules)"
    )

    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
