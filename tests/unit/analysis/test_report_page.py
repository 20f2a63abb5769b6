import hashlib
import re
from base64 import b64encode
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from tests.unit.report.pages import Page, words

from jointz.analysis.page.figure_files import draw_figures, draw_truth_picture
from jointz.analysis.page.first_page import first_page
from jointz.analysis.page.report_page import render_report
from jointz.report.wording import DASH, format_estimate


@pytest.fixture(scope="module")
def html(walking, walking_figures, truth):
    figures = walking_figures[0] | {"truth": draw_truth_picture(truth).svg}
    return render_report(walking, figures, title="Knee study", truth=truth)


@pytest.fixture(scope="module")
def page(html):
    return Page(html)


def test_the_page_is_well_formed(html, page):
    assert page.open == []
    assert page.tags.count("figure") == page.tags.count("svg") == 9
    assert len(page.ids) == len(set(page.ids))
    outside = {"methods.txt", "methods.tex"}  # files beside the report
    assert {link[1:] for link in set(page.links) - outside} <= set(page.ids)
    assert html.count("<style") == 1  # no rule of a figure reaches the page
    assert len(html.encode()) < 5e6  # ten people and six timing points


def test_the_page_needs_nothing_from_outside(html, page):
    bare = re.sub(r'xmlns(:\w+)?="[^"]*"', "", html)
    assert "http:" not in bare
    assert "https:" not in bare
    assert "//" not in "".join(page.links)
    assert "@import" not in html
    assert "link" not in page.tags


def test_a_browser_may_run_no_script_but_the_copy_button_and_fetch_nothing(html):
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', html).group(1)
    (script,) = re.findall(r"<script>(.*?)</script>", html, flags=re.DOTALL)
    digest = b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in policy
    assert policy.startswith("default-src 'none'")
    assert "unsafe" not in policy.replace("style-src 'unsafe-inline'", "")
    assert "innerHTML" not in script


def test_a_bound_is_shown_as_a_bound_and_dust_never(html, page, walking):
    assert re.search(r"at most \d\d\.\d", words(page))  # of ten people, values only
    few = replace(walking, cells=tuple(c for c in walking.cells if c.participant < "S05"))
    assert re.search(r"0 \(at most \d\d\.\d\)", words(Page(render_report(few, {}, title="t"))))
    assert not re.search(r"\d[eE]-\d", re.sub(r"<svg.*?</svg>", "", html, flags=re.DOTALL))


def test_the_summary_counts_each_pulse_once(page):
    # 59 cells of 48 + 2 pulses, one of 0 + 50; the rows of the shared inertia do not count again.
    assert "2\N{NARROW NO-BREAK SPACE}832 pulses were used and 168 excluded." in page.text


def test_the_truth_table_holds_rms_and_coverage(page, truth):
    rows = truth[truth["parameter"] == "stiffness"].dropna()
    rms = float(np.sqrt((rows["error_pct"] ** 2).mean()))
    assert f"Stiffness{rms:.1f}" in page.text.replace("\n", "")
    assert f"{int(rows['covered'].sum())} of {len(rows)}" in page.text


def test_means_that_are_undecided_for_everybody_are_said_to_be(walking):
    population = tuple(
        replace(m, value=None, ci_low=None, ci_high=None, status="undecided", n_participants=0)
        if m.parameter.startswith("damping")
        else m
        for m in walking.population
    )
    first = first_page(replace(walking, population=population))
    assert any("damping per body mass 0 of 6" in text for text in first["said"])
    # The inertia that timing points share has a row without damping.
    assert {row["cells"][1]["text"] for row in first["table"]["rows"]} - {""} == {"undecided"}


def test_what_protocols_decide_of_the_same_people_stands_beside_the_truth(walking, truth):
    accuracy = pd.DataFrame(
        [
            ("doublets", "stiffness", 22, 24, 9.6, 0.9545),
            ("hold", "stiffness", 0, 24, None, None),
        ],
        columns=["protocol", "parameter", "n_decided", "n_cells", "rms_error_pct", "coverage"],
        dtype=object,
    )
    html = render_report(walking, {}, title="t", truth=truth, accuracy=accuracy)
    rows = re.findall("<tr>(.*?)</tr>", html)
    texts = [re.sub("(<.*?>)+", " ", row).strip() for row in rows]
    assert "doublets Stiffness 22 of 24 10 95" in texts
    assert f"hold Stiffness 0 of 24 {DASH} {DASH}" in texts


@pytest.mark.parametrize("text", ["<script>alert(1)</script>$1_{", '&lt;a" onload="x'])
def test_user_text_stays_text(bench, text):
    cells = tuple(replace(c, participant=text, timing_point=text) for c in bench.cells[:1])
    hostile = replace(bench, cells=cells, settings={"method": text, "study": text})
    page = Page(render_report(hostile, draw_figures(hostile), title=text))
    assert page.open == []
    assert page.tags.count("script") == 1  # our own, and no other may run
    assert page.text.count(text) >= 4


def renamed(rows, text):
    """Give records the hostile text for a name, wherever they have one."""
    names = ("participant", "recording", "detail")
    return tuple(
        replace(row, **{n: text for n in names if isinstance(getattr(row, n, None), str)})
        for row in rows
    )


def test_names_stay_text_in_every_table_of_walking(walking, recommended, unperturbed, truth):
    text = '<blink class="x">&amp;</blink>'
    of_walking = {
        name: renamed(getattr(walking, name), text) for name in ("pulses", "strides", "gaps")
    }
    strides = [{**row, "participant": text} for row in walking.statistics["strides"]]
    slopes = [{**row, "participant": text} for row in unperturbed.statistics["quasi_stiffness"]]
    hostile = replace(
        recommended,
        cells=renamed(recommended.cells, text),
        comparison=renamed(recommended.comparison, text),
        **of_walking,
        statistics={**walking.statistics, "strides": strides, "quasi_stiffness": slopes},
    )
    html = render_report(hostile, {}, title=text, truth=truth.assign(participant=text))
    page = Page(html)
    assert page.open == []
    assert "blink" not in page.tags
    assert page.text.count(text) > 8


def test_a_study_in_which_nothing_stands_still_has_a_page(failed):
    page = Page(render_report(failed, draw_figures(failed), title="Nothing"))
    assert page.open == []
    assert "0 of 3 values of K, B and J are available (3 failed)" in words(page)
    assert "figure" not in page.tags


def test_a_recording_is_shown_by_the_name_its_variables_lead_to(walking):
    raw, shown = "${LAB_DISK:-../disk}/ewp.csv", "ewp_of_the_lab.csv"
    strides = tuple(replace(s, recording=raw) for s in walking.strides)
    pulses = tuple(replace(p, recording=raw, code=p.code or "user") for p in walking.pulses)
    summary = [{**row, "recording": raw} for row in walking.statistics["strides"]]
    renamed = replace(
        walking,
        strides=strides,
        pulses=pulses,
        statistics={**walking.statistics, "strides": summary},
        provenance={**walking.provenance, "inputs": [{"file": raw, "name": shown}]},
    )
    html = render_report(renamed, {}, title="Lab")

    assert "LAB_DISK" not in html
    assert html.count(shown) == 1  # an input; of many recordings, the page has sums only

    few = replace(
        renamed,
        strides=strides[:6],
        pulses=pulses[:6],
        statistics={**walking.statistics, "strides": summary[:6]},
    )
    html = render_report(few, {}, title="Lab")
    assert "LAB_DISK" not in html
    assert html.count(shown) > 6 + 1  # in all three tables


def test_the_first_page_has_the_answers_in_few_words(html):
    first = Page(html[html.index('<section id="first">') : html.index("<nav>")])
    assert len(first.text.split()) <= 350
    text = words(first)
    assert "10 participants (S01 to S10)" in text
    assert "pulses were used and 168 excluded" in text
    for heading in ("What can be said, and what cannot", "What to do next", "How to cite"):
        assert heading in text
    assert "times the mean of the dissertation" in text


def test_what_is_below_the_first_page_is_folded_and_can_be_reached(html, page):
    below = html[html.index("</nav>") :]
    assert "<details open" not in below
    assert below.count('<details class="fold"') >= 10
    reachable = {link[1:] for link in page.links if link.startswith("#")}
    folded = set(re.findall(r'</summary>\s*<section id="([^"]+)"', below))
    assert folded == reachable & folded


def test_one_person_has_that_persons_values_on_the_first_page(walking):
    cells = tuple(c for c in walking.cells if c.participant == "S01")
    html = render_report(replace(walking, cells=cells, population=()), {}, title="One")
    first = words(Page(html[html.index('<section id="first">') : html.index("<nav>")]))
    assert format_estimate(cells[0].parameter("stiffness_per_mass")) in first
    assert "Mean over" not in first


def effect(analysis, name, trajectory="A", p=0.01, code=""):
    return {
        "case": "k1", "trajectory": trajectory, "response": "stiffness", "effect": name,
        "analysis": analysis, "statistic": None if code else 7.25, "df_num": 1.0, "df_den": 54.0,
        "p": None if code else p, "p_holm": None if code else 3 * p, "code": code,
    }  # fmt: skip


def test_a_bench_report_has_the_tests_of_type_and_direction(bench):
    tests = [
        effect("one_way", "type"),
        effect("mixed", "type", p=0.012),
        effect("one_way", "direction", "E"),
        effect("mixed", "direction", "E", code="confounded"),
        effect("mixed", "joint", "E", p=1e-9),
    ]
    statistics = {
        "pulse_effects": {
            "methods": ["pulse_likelihood"], "tests": tests, "alpha": 0.05, "notes": ["k1 E so"],
        }
    }  # fmt: skip
    settings = {"kind": "bench", "method": "full_record", "baseline": "none"}
    analysis = replace(bench, settings=settings, statistics=statistics)
    html = render_report(analysis, {}, title="Bench")
    text = words(Page(html.replace("<td", " <td")))
    assert "k1 A stiffness type 7.25 (1, 54) 0.01 7.25 (1, 54) 0.012 0.036" in text
    assert f"k1 E stiffness direction 7.25 (1, 54) 0.01 confounded {DASH} {DASH}" in text
    assert "k1 E stiffness type or direction 7.25 (1, 54) < 0.0001 < 0.0001" in text
