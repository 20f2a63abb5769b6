"""The explorer as a person uses it: in a real browser, on real results, files and all."""

import json
import shutil
import signal
import subprocess
import sys

import pytest

from jointz.analysis.analyze import analyze
from jointz.analysis.results_folder import write_results
from jointz.analysis.saved_analysis import load
from jointz.core.codes import Exclusion
from jointz.explorer.exclusions import decide
from jointz.explorer.results_files import pulses_of
from jointz.explorer.view import estimate_or_status
from jointz.io.study_reader import open_study
from jointz.report.wording import DASH

pytest.importorskip("nicegui", reason="nicegui is not installed")

NASTY = '<img src=x onerror="document.title=1">&amp; S01'
PATIENCE_MS = 30_000


@pytest.fixture(scope="module")
def study(small_study_source, tmp_path_factory):
    """A study, one of whose participants has a name that would be a tag, with results beside it."""
    above = tmp_path_factory.mktemp("explored")
    root = above / "study"
    shutil.copytree(small_study_source, root)
    toml = root / "study.toml"
    ids = [e.split('"')[1] for e in toml.read_text().splitlines() if e.startswith("id = ")]
    toml.write_text(toml.read_text().replace(f'"{ids[0]}"', json.dumps(NASTY)))
    write_results(analyze(root, resamples=10), above / "results", figures=False)
    return root


@pytest.fixture(scope="module")
def address(study, terminal_signals_of_module):
    command = [sys.executable, "-m", "jointz", "explore", str(study.parent / "results"), "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            told = "".join(iter(process.stdout.readline, "}\n"))
            yield json.loads(told + "}")["address"]
            process.send_signal(signal.SIGINT)
            assert process.wait(20) in (0, 130)
        finally:
            process.kill()


@pytest.fixture(scope="module")
def shared(browser, address, script_errors):
    """One page for all tests."""
    context = browser.new_context(
        viewport={"width": 1400, "height": 900},
    )
    context.set_default_timeout(PATIENCE_MS)
    opened = context.new_page()
    opened.foreign, opened.errors = [], script_errors(opened)
    opened.on("request", lambda request: opened.foreign.append(request.url))
    opened.goto(address)
    opened.locator(".pulse-state", has_text="used").wait_for()  # the recordings were read
    yield opened
    context.close()


@pytest.fixture
def page(shared, address):
    """The page with its first pulse; a test may leave it on any tab."""
    shared.bring_to_front()
    shared.get_by_role("tab", name="Pulses").click()
    shared.locator(".pulses tbody tr").first.click()
    shared.locator(".pulse-name", has_text="Pulse 1 of 4").wait_for()
    yield shared
    assert shared.errors == []
    own = address.split("?")[0]
    assert all(url.startswith((own, "data:", "blob:", "ws:")) for url in shared.foreign)


def damping(page):
    return page.locator(".number .now").nth(1).inner_text()


def reestimate(page):
    page.get_by_role("button", name="Re-estimate 1 participant").click()


def finished(page, used):
    """Wait until the numbers stand that were made of so many pulses."""
    page.locator(".used", has_text=f"{used} of 4 pulses used").wait_for()
    page.locator(".number.stale").first.wait_for(state="detached")


def test_an_excluded_pulse_changes_the_numbers_and_survives(page, address, study):
    finished(page, 4)
    before = damping(page)
    page.get_by_role("button", name="Exclude pulse").click()  # without a reason: refused
    page.get_by_text("State a reason").wait_for()
    assert not (study / "exclusions.csv").exists()

    page.get_by_label("Reason").fill("stumbled <b>hard</b>")
    page.get_by_role("button", name="Exclude pulse").click()

    # Nothing is estimated until it is asked for.
    page.locator(".pulse-state", has_text="still used in the numbers").wait_for()
    page.locator(".number.stale .now", has_text=before).first.wait_for()
    page.locator(".notice", has_text="saves nothing in the results folder").wait_for()
    reestimate(page)
    finished(page, 3)
    page.locator(".state", has_text="re-estimated, not saved").wait_for()
    page.locator(".numbers", has_text="re-estimated on this page, not saved").wait_for()
    after = damping(page)
    assert after != before
    page.locator(".was", has_text=before).first.wait_for()  # the old number stays beside it
    page.locator(".pulse-state", has_text="excluded by you: stumbled <b>hard</b>").wait_for()

    page.reload()
    finished(page, 3)
    assert damping(page) == after

    # A fresh analysis from the study's own file gives the same numbers as the page.
    fresh = analyze(study, resamples=10).cells[0].parameter("damping")
    assert after == estimate_or_status(fresh)
    page.get_by_role("tab", name="Exclusions").click()
    page.locator(".methods td", has_text="stumbled <b>hard</b>").wait_for()
    assert "jointz analyze" in page.locator(".command").inner_text()

    # A second page restores it, and the first follows.
    second = page.context.new_page()
    second.goto(address)
    second.get_by_role("button", name="Restore pulse").click()
    reestimate(second)
    finished(second, 4)
    finished(page, 4)
    assert damping(page) == damping(second) == before
    second.close()


def test_a_pulse_that_the_rig_broke_off_is_not_excluded_by_you(page, study):
    pulse = pulses_of(load(study.parent / "results"), NASTY, "LRE")[0]
    rig = decide(open_study(study), pulse, "exclude", reason=Exclusion.ABORTED.meaning)

    page.locator(".pulse-state", has_text="excluded by the rig: broken off").wait_for()
    page.get_by_role("tab", name="Exclusions").click()
    page.locator(".methods tr", has_text="the rig").wait_for()
    decide(rig, pulse, "restore", reason="")
    page.locator(".methods tr", has_text="the rig").wait_for(state="detached")


def test_names_of_strangers_are_text(page):
    names = page.locator(".item .name").all_inner_texts()

    assert NASTY in names
    assert page.locator("img[src='x']").count() == 0
    page.get_by_role("tab", name="Gait cycle").click()
    # SVG has every name as it is; it would be empty had a figure taken it for a tag.
    page.locator(".legendtext", has_text=NASTY).first.wait_for()
    assert page.title().startswith("jointz explore")


def test_pulses_are_walked_through_by_key_and_by_table(page):
    page.locator(".pulse-name", has_text="Pulse 1 of 4").wait_for()
    page.keyboard.press("ArrowRight")
    page.locator(".pulse-name", has_text="Pulse 2 of 4").wait_for()
    page.locator(".pulses tbody tr").nth(3).click()
    page.locator(".pulse-name", has_text="Pulse 4 of 4").wait_for()
    page.keyboard.press("ArrowRight")
    page.locator(".pulse-name", has_text="Pulse 1 of 4").wait_for()
    assert page.locator(".plot.tall .scatterlayer .trace").count() >= 8


def test_nobody_is_answered_without_the_token(address, page_client):
    assert page_client(address).refused_everywhere()


def test_tabs_are_left_and_plots_resized_without_a_script_error(page, address, script_errors):
    page = page.context.new_page()  # of its own: others are not to be resized
    errors = script_errors(page)
    page.goto(address)
    page.locator(".pulse-state", has_text="used").wait_for()
    for name in ("Gait cycle", "Methods", "Exclusions", "Pulses", "Gait cycle"):
        page.get_by_role("tab", name=name).click()
        page.get_by_role("tab", name=name, selected=True).wait_for()
        if name in ("Gait cycle", "Pulses"):
            page.locator(".plot .main-svg").first.wait_for()
    widths = "[...document.querySelectorAll('.plot')].flatMap((e) => [e, ...e.querySelectorAll("
    widths += "'.main-svg')]).map((e) => e.clientWidth)"
    # Plots are as wide as their places.
    page.wait_for_function(f"new Set({widths}).size === 1")
    wide = page.evaluate(widths)[0]
    page.set_viewport_size({"width": 1000, "height": 900})
    page.wait_for_function(f"new Set({widths}).size === 1 && {widths}[0] < {wide}")
    assert errors == []
    page.close()


def test_a_method_is_added_and_shown(page):
    page.get_by_role("tab", name="Methods").click()
    page.get_by_label("Add a method").click()
    page.get_by_role("option", name="matched strides").click()
    page.locator(".methods th", has_text="matched strides").wait_for()
    page.locator(".progress").wait_for(state="hidden")
    cells = page.locator(".methods tbody tr").first.locator("td").all_inner_texts()
    assert len(cells) == 4
    assert cells[3] not in ("", DASH)


def test_the_report_is_shown_without_its_scripts_and_no_other_file(page, address):
    with page.context.expect_page() as opened:
        page.get_by_role("link", name="report").click()
    report = opened.value
    report.locator("h1").wait_for()
    errors = []
    report.on("console", lambda message: errors.append(message.text))
    policies = [one["value"] for one in report.reload().headers_array()
                if one["name"].lower() == "content-security-policy"]  # fmt: skip
    assert any("sandbox" in policy for policy in policies)
    assert any("sandboxed" in text for text in errors)  # its script is blocked
    report.locator("summary", has_text="Methods text").click()
    report.get_by_role("link", name="methods.txt").click()
    report.locator("body", has_text="participant").wait_for()
    own = address.split("?")[0]
    for name in ("estimates.csv", "analysis.json"):
        assert report.goto(f"{own}report/{name}").status == 404
    outside = report.goto(f"{own}report/..%2F..%2Fstudy%2Fstudy.toml")  # the explorer's page
    assert "[[participants]]" not in outside.text()
    report.close()
