"""What an entry must say, and the results that a collection gives."""

import json
import math
import tomllib

import pandas as pd
import pytest
from benchmarks.collection_entries import write_entry
from pydantic import ValidationError

from jointz.collections.catalog_columns import CATALOG_COLUMNS
from jointz.collections.catalog_query import CatalogFilter, QueryResult
from jointz.collections.entry_model import Entry


@pytest.fixture
def content(tmp_path):
    write_entry(tmp_path / "lab", seed=1, people=2)
    return tomllib.loads((tmp_path / "lab" / "entry.toml").read_text())


EMPTY = {name: "" if kind == "text" else math.nan for name, kind in CATALOG_COLUMNS.items()}


def problems(content):
    with pytest.raises(ValidationError) as raised:
        Entry.model_validate(content)
    return {".".join(map(str, e["loc"])): e["msg"] for e in raised.value.errors()}


def test_estimates_need_people_and_printed_values_a_sample(content):
    content["participants"] = []
    assert "need the people" in problems(content)["participants"]

    content["values"] = "printed"
    assert "need the people" in problems(content)["sample"]

    content["sample"] = {"n": 10}
    assert Entry.model_validate(content).kind == "printed"


def test_gait_needs_speed_slope_and_surface_all_told_at_once(content):
    for key in ("walking_speed_m_s", "slope_deg", "surface"):
        del content["conditions"][0][key]

    assert set(problems(content)) == {
        f"conditions.0.{key}" for key in ("walking_speed_m_s", "slope_deg", "surface")
    }


def test_two_conditions_may_not_share_a_name_or_a_file(content):
    content["conditions"] *= 2

    assert set(problems(content)) == {"conditions.1.name", "conditions.1.estimates"}


# --- results -------------------------------------------------------------------------------------


def test_the_median_onset_is_one_on_the_cycle():
    row = EMPTY | {"study": "a", "status": "ok", "value": 1.0}
    onsets = {"TSW": [99.0, 1.0, 98.5], "LRE": [7.0, 8.5], "strike": [99.5, 0.5], "all": [math.nan]}
    onsets["near"] = [99.6, 0.4]  # whose median is a hair before heel strike
    table = pd.DataFrame(
        [row | {"timing_point": p, "onset_gait_pct": x} for p, xs in onsets.items() for x in xs]
    )

    groups = QueryResult(table, CatalogFilter()).groups().set_index("timing_point")

    assert groups["onset_gait_pct"].dropna().to_dict() == {
        "strike": 0.0, "near": 0.0, "LRE": 7.75, "TSW": 99.0,
    }  # fmt: skip
    assert groups.index.tolist() == ["strike", "near", "LRE", "TSW", "all"]


def test_an_infinite_value_is_told_in_json_and_comes_back():
    table = pd.DataFrame([EMPTY | {"value": math.inf, "ci_low": -math.inf, "ci_high": 2.0}])
    made = QueryResult(table, CatalogFilter())

    text = json.dumps(made.to_dict(), allow_nan=False)
    back = QueryResult.from_dict(json.loads(text))

    assert '"value": "inf"' in text
    assert back.table[["value", "ci_low", "ci_high"]].iloc[0].tolist() == [math.inf, -math.inf, 2.0]


def test_a_query_counts_people_not_rows():
    person = EMPTY | {"study": "a", "joint": "knee", "parameter": "stiffness", "status": "ok"}
    first = person | {"participant": "S1", "timing_point": "LRE", "onset_gait_pct": 7.0}
    rows = [
        first | {"value": 50.0},
        first | {"timing_point": "MSW", "onset_gait_pct": 81.0, "value": 20.0},
        first | {"study": "b", "value": 70.0},
        first | {"participant": "S2", "status": "undecided"},
    ]

    made = QueryResult(pd.DataFrame(rows), CatalogFilter())

    groups = made.groups().set_index("timing_point")
    assert groups.loc["LRE", ["studies", "people", "estimates", "median"]].tolist() == [2, 2, 2, 60]
    assert made.summary().startswith("4 estimates of 3 people in 2 studies")
    assert made.to_dict()["rows"][3]["value"] is None
