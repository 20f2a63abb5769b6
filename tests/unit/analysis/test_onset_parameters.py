"""Stiffness and damping at the onset: in the files and tables, beside the figures."""

import re
from dataclasses import replace

import pandas as pd
import pytest
from tests.unit.analysis.studies import bayesian_analysis, study_record

import jointz
from jointz.analysis.page.details_tables import details_frame
from jointz.analysis.page.figure_files import draw_figures
from jointz.analysis.page.report_page import render_report
from jointz.analysis.paper.methods_text import methods_text
from jointz.analysis.paper.paper_tables import paper_tables
from jointz.analysis.results_folder import write_results
from jointz.analysis.saved_analysis import Analysis
from jointz.comparison.compare import compare_results
from jointz.results.estimates import ParameterEstimate
from jointz.results.person_estimates import person_cells
from jointz.stats.population import population_means

ONSET = ("stiffness_onset", "damping_onset")


def with_onset(cell):
    """Return a cell with both parameters at its end, undecided where the whole one is."""
    rows = []
    for name in ONSET:
        whole = cell.parameter(name.removesuffix("_onset"))
        numbers = ("value", "ci_low", "ci_high", "unbounded")
        scaled = {n: x if (x := getattr(whole, n)) is None else 1.2 * x for n in numbers}
        rows.append(ParameterEstimate(name, status=whole.status, **scaled))
    return replace(cell, parameters=(*cell.parameters, *rows))


def as_saved(analysis, cells):
    people = [{"id": person} for person in dict.fromkeys(c.participant for c in cells)]
    provenance = {"study": study_record(participants=people), "study_sha256": "ab" * 32}
    parts = {n: getattr(analysis, n) for n in ("comparison", "settings")}
    means = population_means(person_cells(cells))
    return Analysis(cells=cells, population=means, provenance=provenance, **parts)


@pytest.fixture(scope="module")
def plain():
    made = bayesian_analysis()
    return as_saved(made, made.cells)


@pytest.fixture(scope="module")
def onset(plain):
    return as_saved(plain, tuple(map(with_onset, plain.cells)))


@pytest.fixture(scope="module")
def figures(plain, onset):
    return draw_figures(plain), draw_figures(onset)


@pytest.fixture(scope="module")
def folders(plain, onset, tmp_path_factory):
    root = tmp_path_factory.mktemp("onset")
    for name, analysis in (("plain", plain), ("onset", onset)):
        write_results(analysis, root / name, figures=False)
    return root


def test_the_files_hold_them_behind_the_others(folders, onset):
    table = pd.read_csv(folders / "onset" / "estimates.csv")
    cell = table[(table["participant"] == "S01") & (table["timing_point"] == "LRE")]
    means = pd.read_csv(folders / "onset" / "population.csv")

    assert cell["parameter"].tolist() == ["stiffness", "inertia", "damping", *ONSET]
    assert cell["unit"].tolist()[-2:] == ["N*m/rad", "N*m*s/rad"]
    of_onset = means[means["parameter"].isin(ONSET)]
    assert len(of_onset) == 2 * means["timing_point"].nunique()
    assert set(of_onset["n_participants"]) == {2, 3}  # one value is undecided
    assert of_onset["value"].notna().any()
    assert jointz.load(folders / "onset") == onset


def test_no_other_row_of_the_files_changes(folders):
    for name in ("estimates", "population", "details", "comparison", "covariance"):
        files = [folders / k / f"{name}.csv" for k in ("plain", "onset")]
        if not files[0].exists():
            assert not files[1].exists()
            continue
        lines = [file.read_text(encoding="utf-8").splitlines() for file in files]
        assert [line for line in lines[1] if "_onset," not in line] == lines[0]


WHICH = (
    "Stiffness, damping and inertia are those along the measured motion in the window; stiffness "
    "and damping at the onset are those of small displacements at the onset of the pulse."
)


def test_the_report_shows_them_and_says_which_is_which(plain, onset, figures):
    old, new = (
        render_report(a, f, title="t") for a, f in zip((plain, onset), figures, strict=True)
    )
    heads = [re.findall(r"<th>(Stiffness at the onset)<", page) for page in (old, new)]

    assert [len(found) for found in heads] == [0, 2]  # means over people, and participants
    # In the text on methods; below the table of means, and in the caption of the figure.
    assert (old.count(WHICH), new.count(WHICH)) == (1, 3)


def test_with_one_person_the_sentence_stands_below_the_participants(onset):
    one = replace(onset, cells=onset.cells[:3], population=())

    assert render_report(one, {}, title="t").count(WHICH) == 2


def test_the_details_hold_them(plain, onset):
    old, new = details_frame(plain), details_frame(onset)
    added = new[new["parameter"].isin(ONSET)]

    assert len(added) == 2 * len(onset.cells)
    assert added["unbounded"].notna().any()
    assert set(added["unit"]) == {"N*m/rad", "N*m*s/rad"}
    rest = new[~new["parameter"].isin(ONSET)].reset_index(drop=True)
    pd.testing.assert_frame_equal(rest, old, check_dtype=False)


def test_figures_and_printed_tables_stay_as_they_are(plain, onset, figures):
    assert figures[0] == figures[1]
    assert {n: t.rows for n, t in paper_tables(onset).items()} == {
        n: t.rows for n, t in paper_tables(plain).items()
    }
    assert f"Of {3 * len(onset.cells)} estimates" in methods_text(onset)


def test_results_with_and_without_them_are_compared_in_what_both_have(folders):
    both = compare_results([folders / "plain", folders / "onset"], paired=True)
    alone = compare_results([folders / "onset"])

    assert both.parameters == alone.parameters == ("stiffness", "damping", "inertia")
    assert all(d.ci_low <= 0.0 <= d.ci_high for d in both.differences if d.available)
