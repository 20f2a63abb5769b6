"""The page of a collection: self-contained, true to its tables, nothing passed over."""

import re
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import pytest

from jointz.collections.coverage_page import render_coverage
from jointz.collections.pool_result import CollectionPool

BY = ("joint", "timing_point", "condition", "speed")
CITATIONS = [
    {
        "study": "lab-a",
        "cite": "Fictional Lab A <2026>",
        "licence": "CC-BY-4.0",
        "consent": "research",
    },
    {"study": "lab-b", "cite": "Fictional Lab B (2026)", "licence": "CC0-1.0", "consent": "public"},
]


def pooled_row(**told: Any) -> dict[str, Any]:
    """Return a row of the pooled table."""
    made = {
        "joint": "knee", "timing_point": "MST", "condition": "level", "speed": "1.1 to 1.3 m/s",
        "parameter": "stiffness", "unit": "N*m/rad", "methods": "rigid",
        "model": "univariate", "value": 60.0, "ci_low": 54.0, "ci_high": 66.0,
        "prediction_low": 40.0, "prediction_high": 80.0, "tau": 5.0, "tau_low": 2.0,
        "tau_high": 9.0, "i2_pct": 70.0, "q": 8.1, "q_p": 0.02, "n_studies": 2, "n_people": 20,
        "n_left_out": 0, "n_at_bound": 0, "n_undecided": 0, "n_failed": 0, "printed": "",
        "status": "ok",
    }  # fmt: skip
    return made | told


def study_row(study: str, value: float, **told: Any) -> dict[str, Any]:
    """Return a row of the table of studies."""
    made = {
        "joint": "knee", "timing_point": "MST", "condition": "level", "speed": "1.1 to 1.3 m/s",
        "parameter": "stiffness", "unit": "N*m/rad", "study": study, "method": "rigid",
        "values": "estimates", "n_people": 10, "n_at_bound": 0, "n_undecided": 0, "n_failed": 0,
        "value": value, "se": 2.0, "ci_low": value - 4.5, "ci_high": value + 4.5,
        "weight_pct": 50.0, "status": "ok",
    }  # fmt: skip
    return made | told


NONE = dict.fromkeys(["prediction_low", "prediction_high", "tau", "i2_pct", "q", "q_p"], np.nan)


@pytest.fixture
def tables() -> CollectionPool:
    alone = NONE | {"status": "one_study", "n_studies": 1, "n_people": 9}
    pooled = [
        pooled_row(),
        pooled_row(timing_point="LRE", ci_low=20.0, ci_high=100.0, **alone),
        pooled_row(joint="ankle", speed="0.7 to 0.9 m/s", **alone),
        pooled_row(timing_point="TST", value=np.nan, ci_low=np.nan, ci_high=np.nan,
                   **NONE | {"status": "failed:too_few_studies", "n_undecided": 3}),
    ]  # fmt: skip
    studies = [
        study_row("lab-a", 57.0, weight_pct=75.0),
        study_row("lab-b", 63.0, weight_pct=25.0),
        study_row("lab-c & sons", 90.0, n_people=1, se=np.nan, ci_low=np.nan, ci_high=np.nan,
                  weight_pct=np.nan, status="one_person"),
    ]  # fmt: skip
    printed = [study_row("thesis", 58.0, values="printed", weight_pct=np.nan)]
    return CollectionPool(pd.DataFrame(pooled), pd.DataFrame(studies), pd.DataFrame(printed), by=BY)


def page_of(pool: CollectionPool, **changes: Any) -> str:
    """Return the page."""
    provenance = {"catalog": "abc"}
    return render_coverage(replace(pool, **changes), citations=CITATIONS, provenance=provenance)


def test_it_needs_nothing_else_and_names_are_text(tables: CollectionPool) -> None:
    page = page_of(tables, notes=("<b>mixed</b>",))
    assert not re.search(r"(?:src|href)=\"(?!#)|https?:|<script|@import|url\(", page)
    assert "prefers-color-scheme: dark" in page
    assert "&lt;b&gt;mixed&lt;/b&gt;" in page
    assert "lab-c &amp; sons" in page
    assert "Fictional Lab A &lt;2026&gt; (CC-BY-4.0; consent: research)" in page
    assert "Fictional Lab B (2026) (CC0-1.0; consent: public)" in page


def test_every_place_of_the_map_says_how_well_it_is_known(tables: CollectionPool) -> None:
    page = page_of(tables)
    cells = re.findall(r'<td class="([a-z ]+)" title="([^"]*)"><b>([^<]*)</b>(.*?)</td>', page)
    told = [
        (kind, title, reach, re.findall(">([^<]+)<", rest)) for kind, title, reach, rest in cells
    ]
    assert ("well", "60.0 [54.0, 66.0] N·m/rad", "± 10 %", ["2 studies", "20 people"]) in told
    assert ("far alone", "60 [20, 100] N·m/rad", "± 67 %", ["1 study", "9 people"]) in told
    assert ("none", "not known", "\u2013", ["3 undecided"]) in told
    assert sum(kind == "none" for kind, *_ in told) == 3  # TST of the knee, LRE, TST of the ankle


def test_an_activity_has_its_own_places_along_the_cycle(tables: CollectionPool) -> None:
    seated = pooled_row(joint="elbow", activity="seated", timing_point="rest")
    pooled = pd.DataFrame([*tables.table.assign(activity="walking").to_dict("records"), seated])
    by = ("joint", "timing_point", "activity")
    studies, printed = (t.assign(activity="walking") for t in (tables.studies, tables.printed))
    page = page_of(CollectionPool(pooled.assign(status="one_study"), studies, printed, by))
    heads = re.findall(r"<thead><tr>(.*?)</tr>", page)
    columns = [re.findall(r'<th class="at">([^<]*)<', head) for head in heads]
    assert ["rest"] in columns
    assert not any("rest" in line and "LRE" in line for line in columns)


def test_a_forest_is_to_scale_and_stays_inside(tables: CollectionPool) -> None:
    (text,) = re.findall(r"<svg.*?</svg>", page_of(tables), re.DOTALL)
    svg = ET.fromstring(text)
    lines = [line for line in svg.iter("line") if line.get("class") == "ci"]
    ends = [(float(line.get("x1", 0)), float(line.get("x2", 0))) for line in lines]
    (a_low, a_high), (b_low, b_high) = ends
    assert a_high - a_low == pytest.approx(b_high - b_low, abs=0.2)
    per_unit = (a_high - a_low) / 9.0
    assert b_low - a_low == pytest.approx(6.0 * per_unit, abs=0.3)
    squares = [float(s.get("width", 0)) for s in svg.iter("rect")]
    assert squares[0] ** 2 / squares[1] ** 2 == pytest.approx(3.0, rel=0.05)
    width = float(svg.get("viewBox", "").split()[2])
    found = [float(e.get(k, 0)) for e in svg.iter() for k in ("x", "x1", "x2") if e.get(k)]
    assert 0.0 <= min(found) <= max(found) < width
    # The interval of another study reaches beyond what is drawn: both arrows say so.
    assert sum(path.get("class") == "cut" for path in svg.iter("path")) == 2


def test_printed_and_left_out_studies_have_tables_of_their_own(tables: CollectionPool) -> None:
    page = page_of(tables)
    printed = page[page.index('<section id="printed">') : page.index('<section id="left-out">')]
    assert "thesis" in printed
    assert "lab-a" not in printed
    left = page[page.index('<section id="left-out">') : page.index('<section id="rules">')]
    assert "lab-c &amp; sons" in left
    assert "lab-b" not in left
