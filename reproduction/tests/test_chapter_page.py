import re

import pytest
from reproduction.chapter2_figures import draw_chapter2
from reproduction.chapter_page import render_chapter, render_validation
from reproduction.reproduction_result import Reproduction
from reproduction.reproduction_tables import (
    Claim,
    ClaimTable,
    Compared,
    ComparedTable,
    GridBlock,
    ParticipantGrid,
)
from tests.unit.report.pages import Page as HtmlPage

MINUS = "\N{MINUS SIGN}"
PLUS_MINUS = "\N{PLUS-MINUS SIGN}"

ROWS = (
    Compared(
        "k1, trajectory C", "%", printed=-5.14, printed_sd=1.32, dissertation=-4.8731,
        dissertation_sd=2.1266, recommended=0.0812, recommended_low=-0.4011,
        recommended_high=0.5622, truth=0.0,
    ),
    Compared("I1 <all>", "%", printed=-15.2, printed_sd=10.91, dissertation=-14.0, note="of 10"),
)  # fmt: skip
INTRINSIC = (
    Compared(
        "intrinsic inertia", "kg*m^2", printed=0.001, printed_sd=2.65e-5, dissertation=0.00098432,
        dissertation_sd=1.1e-5, recommended=0.00100213, recommended_low=0.00100101,
        recommended_high=0.0010032, truth=0.001,
    ),
    Compared("intrinsic stiffness", "N*m/rad", printed=0.388, recommended=0.391),
)  # fmt: skip
COUNTS = (
    Compared("pairs with VAF above 99.9 %", printed=19.0, dissertation=20.0),
    Compared("bandwidth", "Hz", printed=26.8),
)
REPRODUCTION = Reproduction(
    chapter=2,
    title="The exoskeleton on its bench",
    tables=(
        ComparedTable("stiffness_errors", "Errors of stiffness", "Percent of the truth.", ROWS),
        ComparedTable("intrinsic", "Intrinsic impedance", "", INTRINSIC),
        ComparedTable("vaf", "Counts", "", COUNTS),
    ),
    notes=("Reference E is confounded & said so.",),
    provenance={
        "jointz": "0.4",
        "packages": {"numpy": "2.4"},
        "settings": {"seed": 1, "cases": [1, 2]},
    },
)


class Page(HtmlPage):
    """Gathers the cells of tables, too: their classes and texts."""

    def __init__(self, html):
        self.cells = []
        super().__init__(html)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        super().handle_starttag(tag, attrs)
        if tag in ("td", "th"):
            self.cells.append([dict(attrs).get("class", ""), ""])

    def handle_data(self, data):
        super().handle_data(data)
        if {"td", "th"} & set(self.open):
            self.cells[-1][1] += data

    def texts(self, column):
        """Return the texts of a column's cells, heads left out."""
        return [" ".join(t.split()) for c, t in self.cells if c.split()[:2] == ["v", column]]


@pytest.fixture(scope="module")
def figures():
    response = {
        "frequency_hz": [1.0, 2.0, 5.0],
        "gain": [0.4, 1.0, 5.0],
        "phase_deg": [10.0, 40.0, 90.0],
        "model_gain": [0.4, 1.0, 5.0],
        "model_phase_deg": [10.0, 40.0, 90.0],
    }
    mechanism = {"mechanism": "none", "stiffness_pct": 0.0, "damping": 0.0, "inertia_pct": 0.0}
    return draw_chapter2({"intrinsic": response, "mechanisms": [mechanism]})


@pytest.fixture(scope="module")
def html(figures):
    return render_chapter(REPRODUCTION, figures)


@pytest.fixture(scope="module")
def page(html):
    return Page(html)


def test_the_page_needs_nothing_from_outside(html, page):
    bare = re.sub(r'xmlns(:\w+)?="[^"]*"', "", html)
    assert "http:" not in bare
    assert "https:" not in bare
    assert "@import" not in html
    assert {"script", "link", "img"} & set(page.tags) == set()
    assert len(page.ids) == len(set(page.ids))
    assert {link[1:] for link in page.links} <= set(page.ids)


def test_printed_numbers_keep_their_digits(page):
    assert page.texts("printed") == [
        f"{MINUS}5.14 {PLUS_MINUS} 1.32",
        f"{MINUS}15.2 {PLUS_MINUS} 10.91",
        f"0.001 {PLUS_MINUS} 2.65 × 10⁻⁵",  # noqa: RUF001
        "0.388",
        "19",
        "26.8",
    ]


def test_our_numbers_have_the_digits_that_their_spread_allows(page):
    assert page.texts("dissertation") == [
        f"{MINUS}4.9 {PLUS_MINUS} 2.1",
        f"{MINUS}14",
        f"0.000984 {PLUS_MINUS} 0.000011",
        "–",  # noqa: RUF001
        "20",
        "–",  # noqa: RUF001
    ]
    assert page.texts("recommended") == [
        f"0.08 [{MINUS}0.40, 0.56]",
        "–",  # noqa: RUF001
        "0.0010021 [0.0010010, 0.0010032]",
        "0.391",
    ]


def test_a_truth_outside_its_interval_is_marked_and_counted(page):
    truths = page.texts("truth")
    assert truths == ["0.00", "–", "0.0010000 outside the interval", "–"]  # noqa: RUF001
    assert "1 of 2" in page.text


def test_text_from_outside_is_escaped(html):
    assert "I1 &lt;all&gt;" in html
    assert "confounded &amp; said so" in html


@pytest.mark.parametrize(
    ("rows", "texts"),
    [
        ((Compared("share", "%", 40.0, dissertation=float("nan")),), ["–"]),  # noqa: RUF001
        # Small beside the others of its unit.
        (
            tuple(Compared("a", "%", dissertation=v) for v in (-22.31, -7e-6)),
            [f"{MINUS}22.3", "0.00"],
        ),
        ((Compared("lowest VAF", "%", printed=95.0, dissertation=99.97),), ["99.97"]),
    ],
)
def test_numbers_are_neither_rounded_to_100_percent_nor_printed_from_noise(rows, texts):
    table = ComparedTable("claims", "Claims", "", rows)
    page = Page(render_chapter(Reproduction(2, "x", (table,)), {}))
    assert page.texts("dissertation") == texts


# --- statements and participants ------------------------------------------------------------------

CHAPTER_4 = Reproduction(
    chapter=4,
    title="The knee",
    tables=(
        ClaimTable(
            "factors",
            "Factors",
            "",
            (
                Claim("4.3.2.2", "stiffness & point", "p < 0.001", "p = 0.00008", "reproduced"),
                Claim("4.3.2.2", "inertia", "p < 0.001", "p = 0.38", "not reproduced", "n = 10"),
            ),
        ),
        ParticipantGrid(
            "table_4_1",
            "Table 4.1",
            "",
            "N*m/rad/kg",
            ("S1", "S2"),
            (
                GridBlock("printed", {"LRE": (1.88, 2e-14)}, {"LRE": 0.94}),
                GridBlock("recommended", {"LRE": (2.1, None)}, {"LRE": 2.1}),
            ),
        ),
    ),
)


def test_participants_stand_in_columns_with_their_average():
    page = Page(render_chapter(CHAPTER_4, {}))
    texts = [" ".join(text.split()) for _, text in page.cells]
    row = texts.index("LRE")
    assert texts[row : row + 4] == ["LRE", "1.88", "0", "0.94"]
    second = texts.index("LRE", row + 1)
    assert texts[second + 2] in ("-", "\N{EN DASH}", "\N{EM DASH}")


def test_chapters_of_one_page_share_no_id(figures):
    page = Page(render_validation([(REPRODUCTION, figures), (CHAPTER_4, {})]))
    assert len(page.ids) == len(set(page.ids))
    assert {link[1:] for link in page.links} <= set(page.ids)
    assert {"chapter-2", "chapter-4", "table-4-factors"} <= set(page.ids)
