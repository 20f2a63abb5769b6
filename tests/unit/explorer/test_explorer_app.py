"""State that the pages of the explorer share, work beside it, and figures."""

import asyncio
import json
import shutil
from dataclasses import replace

import pytest

from jointz.explorer.cycle_page import curve_of_cells, cycle_figure, mean_curve, methods_figure
from jointz.explorer.exclusions import FILE, decide
from jointz.explorer.explorer_app import Explorer
from jointz.explorer.plots import Overlaid, overlay_figure, pulse_figure
from jointz.explorer.results_files import open_results
from jointz.explorer.view import View


@pytest.fixture(scope="module")
def made(rigid_results, tmp_path_factory):
    return shutil.copytree(rigid_results, tmp_path_factory.mktemp("explored") / "made")


@pytest.fixture
def explorer(made):
    (made / "study" / FILE).unlink(missing_ok=True)
    return Explorer(open_results(made / "results"), None)


async def settled(explorer):
    while explorer.working:
        await asyncio.sleep(0.01)


def test_traces_come_without_an_estimation_and_the_numbers_stay(explorer, monkeypatch):
    def refuse(*_):
        raise AssertionError("nobody asked for an estimation")

    monkeypatch.setattr("jointz.explorer.explorer_app.reestimate", refuse)

    async def work():
        explorer.request(explorer.results.people[0])
        assert explorer.working
        await settled(explorer)

    asyncio.run(work())

    assert explorer.traces(explorer.results.people[0])
    assert explorer.traces(explorer.results.people[1]) is None
    assert explorer.analysis == explorer.results.analysed
    # Averages are those of the results: they need no recordings.
    lines = overlay_figure([], View(explorer).cell(), None, quantity="angle")["data"]
    assert [line["name"] for line in lines] == ["average", "fit"]
    assert explorer.problem == ""


def test_numbers_wait_until_they_are_made_of_the_pulses_that_stand(explorer):
    view = View(explorer)
    pulse = view.pulse()
    seen = []

    async def work():
        assert await explorer.decide(pulse, "exclude", reason="stumbled")
        explorer.request(view.person)  # as the page does whenever something has changed
        await settled(explorer)
        seen.append((view.person in explorer.stale, view.cell().n_used))
        explorer.reestimate()
        await settled(explorer)
        seen.append((view.person in explorer.stale, view.cell().n_used))

    asyncio.run(work())

    assert seen == [(True, 4), (False, 3)]
    assert explorer.seconds > 0.0
    assert view.window_of(pulse).fitted is None
    assert len(explorer.changed) == 1
    assert view.cell_as_analysed().n_used == 4
    assert view.pulse().code == "user"


def test_two_exclusions_at_once_both_stand(explorer):
    view = View(explorer)
    first, second = view.pulses()[:2]

    async def work():
        await asyncio.gather(
            explorer.decide(first, "exclude", reason="one"),
            explorer.decide(second, "exclude", reason="two"),
        )
        explorer.reestimate()
        explorer.reestimate()  # by another page
        assert len(explorer.working) == 1
        await settled(explorer)

    asyncio.run(work())

    assert view.cell().n_used == 2
    assert view.person not in explorer.stale


def test_lines_written_elsewhere_are_followed(explorer):
    view = View(explorer)

    async def work():
        decide(explorer.results.study, view.pulse(), "exclude", reason="by another page")
        await explorer.check_study()
        assert explorer.stale == (view.person,)
        explorer.reestimate()
        await settled(explorer)

    asyncio.run(work())

    assert view.cell().n_used == 3


def test_what_goes_wrong_is_told_and_not_tried_without_end(explorer, made, monkeypatch):
    person = explorer.results.people[0]

    def fail(*_):
        raise RuntimeError("no luck")

    monkeypatch.setattr("jointz.explorer.explorer_app.read_traces", fail)

    async def work():
        explorer.request(person)
        await settled(explorer)
        version = explorer.version
        explorer.request(person)
        assert explorer.version == version
        explorer.dismiss()
        monkeypatch.undo()
        explorer.request(person)
        await settled(explorer)

    asyncio.run(work())

    assert explorer.problem == ""
    assert explorer.traces(person)


def test_figures_are_plain_json(explorer):
    asyncio.run(_traced(explorer))
    view = View(explorer)
    pulses = [Overlaid(k, view.window_of(p), used=True) for k, p in enumerate(view.pulses())]
    analysis = explorer.analysis
    curve = curve_of_cells(analysis.cells, "stiffness", name="<b>S</b>", colour="#000000")
    figures = [
        overlay_figure(pulses, view.cell(), 1, quantity="angle"),
        overlay_figure(pulses, view.cell("dissertation"), None, quantity="torque"),
        pulse_figure(view.trace_of(view.pulse()), view.window_of(view.pulse())),
        pulse_figure(None, None),
        cycle_figure("stiffness_per_mass", [curve]),
        methods_figure("stiffness", [curve]),
    ]
    for figure in figures:
        json.dumps(figure, allow_nan=False)
    assert figures[4]["data"][-1]["name"] == "&lt;b&gt;S&lt;/b&gt;"
    assert {t["name"] for t in figures[2]["data"]} == {
        "recorded", "measured", "baseline", "response", "fit", "residual"
    }  # fmt: skip
    assert mean_curve(analysis, "stiffness_per_mass", colour="#000000") is None  # undecided
    means = [replace(row, value=4.0, status="ok") for row in analysis.population]
    decided = replace(analysis, population=tuple(means))
    curve = mean_curve(decided, "stiffness_per_mass", colour="#000000")
    assert curve is not None
    assert {row.value for row in curve.estimates} == {4.0}


async def _traced(explorer):
    explorer.request(explorer.results.people[0])
    await settled(explorer)
