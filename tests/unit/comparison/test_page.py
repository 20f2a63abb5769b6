"""The page, the figures and the text of a comparison."""

from dataclasses import replace

import pytest
from tests.unit.report.pages import Page, words

from jointz.comparison.compare import compare_results
from jointz.comparison.comparison_result import Comparison
from jointz.comparison.comparison_text import comparison_tables
from jointz.comparison.figures import draw_comparison
from jointz.comparison.page import render_comparison
from jointz.results.statistics.comparison_rows import Difference, PersonValue, Source, SourceMean

UNIT = "N*m/rad/kg"


def two_groups(first="<b>patients</b>", second="controls", **more):
    people = ("S1", "S2", "S3")
    values = {first: (1.0, 2.0, 3.0), second: (2.0, 2.5, None)}
    means = tuple(
        SourceMean(name, "stiffness_per_mass", UNIT, "LRE", n, 3 - n, 0, 2.0, 0.8, 1.0, 3.0, 0.4)
        for name, n in ((first, 3), (second, 2))
    )
    difference = Difference(
        "stiffness_per_mass", UNIT, "LRE", first, second, "groups", 3, 2, 0, 2.0, 2.25, -0.25,
        -2.0, 1.5, -0.4, 2.6, 0.7, 0.7, "g", -0.3, -1.9, 1.2, 0.45, 0.38,
    )  # fmt: skip
    return Comparison(
        sources=(Source(first, people), Source(second, tuple("ABC"))),
        values=tuple(
            PersonValue(name, person, "stiffness_per_mass", "LRE", value)
            for name, row in values.items()
            for person, value in zip(people, row, strict=True)
        ),
        means=means,
        differences=(difference,),
        margin_pct=20.0,
        **more,
    )


@pytest.fixture(scope="module")
def published():
    return compare_results(["published"])


@pytest.mark.parametrize("make", [two_groups, lambda: compare_results(["published"])])
def test_the_page_is_whole_and_fetches_nothing(make):
    made = make()
    page = Page(render_comparison(made, draw_comparison(made)))

    assert page.open == []
    assert all(link.startswith("#") for link in page.links)


def test_names_of_folders_are_no_markup():
    page = render_comparison(two_groups(), draw_comparison(two_groups()))

    assert "<b>patients</b>" not in page
    assert "&lt;b&gt;patients&lt;/b&gt;" in page


def test_the_number_of_differences_at_the_top_is_by_the_adjusted_p():
    made = two_groups()
    (one,) = made.differences
    made = replace(made, differences=(replace(one, p=0.03, p_adjusted=0.09),))

    page = Page(render_comparison(made, draw_comparison(made)))

    assert "0 of 1differences with p < 0.05" in words(page)


def test_the_text_has_one_row_a_difference(published):
    tables = {title.split(" ")[0]: rows for title, _, rows in comparison_tables(published)}

    assert len(tables["First"]) == 3 * 15
    assert len(tables["Means"]) == 3 * 6
    sphericity = published.tests[0].fit.repeated_measures
    assert tables["Mixed"][0][3:6] == ["6.835", "5, 45", "< 0.0001"]
    assert tables["Mixed"][0][6:8] == [f"{sphericity.epsilon:.2f}", f"{sphericity.p_epsilon:.2g}"]
