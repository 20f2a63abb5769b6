"""Folders as they are read for a comparison: names, ids, onsets, what their files must say."""

import json
from pathlib import Path

import numpy as np
import pytest

from jointz.comparison.compare import check_out, compare_results, write_comparison
from jointz.core.errors import DataError, OutputError

from .results_folders import POINTS, STUDY, UNDECIDED, changed, estimates, said

# --- names ---------------------------------------------------------------------------------------


def test_a_folder_called_published_beside_the_word_is_ambiguous(results, tmp_path, monkeypatch):
    folder = results("published")
    monkeypatch.chdir(tmp_path)

    with pytest.raises(DataError, match=r"Write \./published for the folder"):
        compare_results(["published"])
    for meant in ("./published", Path("published"), folder):
        made = compare_results([meant])
        assert [s.name for s in made.sources] == [f"{tmp_path.name}/published"]
        assert not made.sources[0].published


def test_a_folder_called_published_elsewhere_is_told_from_the_tables(results):
    made = compare_results([results("study/published"), "published"])

    assert [(s.name, s.published) for s in made.sources] == [
        ("study/published", False), ("published", True),
    ]  # fmt: skip


@pytest.mark.parametrize("way", ["{0}", "{0}/../{1}", "{0}/."])
def test_what_is_compared_is_never_written_over(results, tmp_path, way):
    a, b = results("a"), results("b")
    link = tmp_path / "link"
    link.symlink_to(a)
    out = way.format(link, link.name)

    for overwrite in (False, True):
        with pytest.raises(OutputError, match="is one of the compared folders"):
            check_out(out, [str(b), str(a), "published"], overwrite=overwrite)


def test_results_are_not_replaced_by_a_comparison(results, tmp_path):
    a, b, other = (results(name) for name in ("a", "b", "other"))
    made = compare_results([a, b])

    with pytest.raises(OutputError, match="made it as analysis, not as comparison"):
        check_out(other, [a, b], overwrite=True)
    with pytest.raises(OutputError, match="made it as analysis, not as comparison"):
        write_comparison(made, other, overwrite=True)
    assert (other / "estimates.csv").exists()
    write_comparison(made, tmp_path / "out")
    check_out(tmp_path / "out", [a, b], overwrite=True)
    assert json.loads((tmp_path / "out/provenance.json").read_text())["made_by"] == "comparison"


# --- ids -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("others", ["abcde", "aBCDE"])
def test_ids_that_are_all_the_same_but_for_how_they_are_written_ask_for_a_decision(results, others):
    sources = [results("a"), results("b", others)]

    with pytest.raises(DataError, match="--groups"):
        compare_results(sources)
    made = compare_results(sources, paired=False)
    assert {d.design for d in made.differences} == {"groups"}


def test_some_ids_that_are_nearly_the_same_are_a_warning(results):
    made = compare_results([results("a"), results("b", "aXY")])

    assert said(made, "A and a")[0].startswith("WARNING: ")
    assert {d.design for d in made.differences} == {"groups"}


def test_labels_are_kept_as_they_are_written(results):
    people = ("NA", "nan", "1", "1.0", "1e3")

    made = compare_results([results("a", people)])

    assert made.sources[0].participants == people
    assert {m.n for m in made.means} == {5}
    assert said(made, "1 and 1.0")


# --- onsets --------------------------------------------------------------------------------------


def test_timing_points_of_one_name_that_lie_apart_are_refused(results):
    other = estimates(points=POINTS | {"LRE": 30.0})

    with pytest.raises(DataError, match=r"LRE at 7\.0 % in a and at 30\.0 % in b"):
        compare_results([results("a"), results("b", table=other)])


@pytest.mark.parametrize(("onset", "noted"), [(7.4, False), (7.6, True), (8.9, True)])
def test_a_small_shift_of_an_onset_is_noted(results, onset, noted):
    other = estimates(points=POINTS | {"LRE": onset})

    made = compare_results([results("a"), results("b", table=other)])

    assert bool(said(made, f"LRE at 7.0 % in a and at {onset} % in b")) == noted


def test_the_gait_cycle_has_no_end(results):
    tables = (estimates(points=POINTS | {"LRE": onset}) for onset in (99.8, 0.1))

    made = compare_results([results(name, table=t) for name, t in zip("ab", tables, strict=True)])

    assert not said(made, "timing points of one name")


# --- values --------------------------------------------------------------------------------------


def test_a_mean_over_points_tells_what_it_is_of(results):
    table = estimates()
    where = "parameter == 'inertia' and participant == '{}' and timing_point {}"
    table = changed(table, where.format("B", "!= 'LRE'"), **UNDECIDED)
    bound = {"value": 0.0, "ci_low": 0.0, "status": "at_bound"}
    table = changed(table, where.format("C", "!= 'LRE'"), **bound)
    other = estimates(seed=1).query("parameter != 'inertia' or timing_point == 'LRE'")
    other = changed(other, "parameter == 'inertia'", timing_point="all", onset_gait_pct=np.nan)

    made = compare_results([results("a", table=table), results("b", table=other)])

    held = {v.participant: v for v in made.values
            if (v.source, v.timing_point) == ("a", "all")}  # fmt: skip
    counts = {p: (v.n_points, v.n_lacking, v.n_bounded) for p, v in held.items()}
    assert counts == {
        "A": (3, 0, 0),
        "B": (1, 2, 0),
        "C": (3, 0, 2),
        "D": (3, 0, 0),
        "E": (3, 0, 0),
    }
    assert said(made, "a B (of 1 of 3)")
    (row,) = (d for d in made.differences if d.timing_point == "all")
    assert row.n_at_bound == 1


def test_people_who_are_all_undecided_have_masses_all_the_same(results):
    table = estimates().assign(**UNDECIDED)
    sources = [results("a", table=table), results("b")]

    alone, both = compare_results(sources[:1]), compare_results(sources)

    assert (
        alone.parameters == both.parameters == ("stiffness_per_mass", "damping_per_mass", "inertia")
    )
    assert said(both, "45 undecided")[0].startswith("WARNING: a:")
    assert not both.available
    assert any(m.mean is not None for m in both.means)


# --- provenance ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "content",
    [
        {}, {"study": None}, {"study": "x"}, {"study": {}}, {"study": {"kind": "walking"}},
        {"study": {"joint": "knee", "kind": 3}}, {"study": STUDY, "settings": [1]},
    ],
)  # fmt: skip
def test_a_provenance_that_does_not_say_kind_and_joint_is_refused(results, content):
    with pytest.raises(DataError, match="expected study with kind and joint, and settings"):
        compare_results([results("a", provenance=content)])
