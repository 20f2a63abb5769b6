"""Counts on pages, in the terminal and in comparisons are those of the csv files."""

import re
from collections import Counter
from dataclasses import replace

import pandas as pd
import pytest
from tests.unit.analysis.studies import study_record

from jointz.analysis.printed_analysis import print_analysis
from jointz.analysis.results_folder import write_results
from jointz.comparison.compare import compare_results, write_comparison
from jointz.comparison.comparison_text import comparison_tables
from jointz.report.wording import ABSOLUTE

ABORTED = 11


@pytest.fixture(scope="module")
def written(walking, tmp_path_factory):
    """Write the results of a study with aborted pulses, and return analysis, folder and tables."""
    used = [i for i, p in enumerate(walking.pulses) if not p.code][:ABORTED]
    pulses = tuple(
        replace(p, code="aborted") if i in used else p for i, p in enumerate(walking.pulses)
    )
    study = study_record()
    lost = tuple(
        replace(m, value=None, status="undecided") if m.timing_point == "TST" else m
        for m in walking.population
    )
    analysis = replace(
        walking, pulses=pulses, population=lost, provenance={**walking.provenance, "study": study}
    )
    folder = tmp_path_factory.mktemp("counts") / "results"
    write_results(analysis, folder, figures=False, tables=True)
    names = ("estimates", "pulses", "excluded", "population")
    return analysis, folder, {name: pd.read_csv(folder / f"{name}.csv") for name in names}


def words(page):
    return " ".join(re.sub(r"<[^>]+>", " ", page).replace("&nbsp;", " ").split())


def test_counts_are_those_of_the_csv_files(written, capsys):
    analysis, folder, tables = written
    values = tables["estimates"].query(f"parameter in {list(ABSOLUTE)}")
    statuses = Counter(values["status"])
    available = int(values["value"].notna().sum())
    failed = sum(n for status, n in statuses.items() if status.startswith("failed"))
    out = tables["excluded"].query("kind == 'pulse'")["code"]
    aborted, excluded = int((out == "aborted").sum()), int((out != "aborted").sum())
    used = int(tables["pulses"]["code"].isna().sum())
    assert (aborted, used + excluded + aborted) == (ABORTED, len(tables["pulses"]))

    page = words((folder / "report.html").read_text(encoding="utf-8"))
    spaced = f"{used:,}".replace(",", " ")
    assert f"{spaced} pulses were used and {excluded} excluded" in page
    assert f"{aborted} more were broken off during the run and done again." in page
    assert f"{available} of {len(values)} values of K, B and J are available (" in page
    assert f"{statuses['undecided']} undecided, {failed} failed)" in page
    assert f"undecided {statuses['undecided']} " in page
    assert f"failed:all_pulses_excluded {failed} " in page
    for name in ("stiffness", "damping"):
        means = tables["population"].query("parameter == @name + '_per_mass'")["value"]
        assert f"{name} per body mass {means.notna().sum()} of {len(means)}" in page

    capsys.readouterr()
    print_analysis(analysis, folder / "report.html")
    printed = " ".join(capsys.readouterr().out.split())
    assert f"pulses: {used:,} used, {excluded:,} excluded, {aborted} broken off" in printed
    assert f"{available} of {len(values)} values of K, B and J are available; " in printed
    assert f"{statuses['undecided']} undecided" in printed
    assert analysis.summary().startswith(f"10 participant(s), method rigid: {available} of ")


def test_a_comparison_has_the_means_of_the_folder(written, tmp_path):
    _, folder, tables = written
    made = compare_results([folder])
    means = tables["population"].set_index(["timing_point", "parameter"])
    for mean in made.means:
        row = means.loc[mean.timing_point, mean.parameter]
        numbers = [mean.mean, mean.sd, mean.ci_low, mean.ci_high, mean.n]
        expected = row[["value", "sd", "ci_low", "ci_high", "n_participants"]].astype(float)
        if mean.mean is None:
            assert (mean.status, row["status"]) == ("undecided", "undecided")
        else:
            assert numbers == pytest.approx(list(expected), rel=1e-6)
    missing = sum(m.n_missing for m in made.means)
    assert made.n_missing == missing == len(made.missing)
    assert f"{missing} values are missing and not in the means: " in " ".join(made.notes)
    page = words(write_comparison(made, tmp_path / "out").read_text(encoding="utf-8"))
    assert f"{missing} values missing" in page
    (_, header, rows) = comparison_tables(made)[0]
    assert sum(int(r[header.index("no value")].replace("-", "0")) for r in rows) == missing
