"""The paper: made by its script, short enough, and without numbers or sources of its own."""

import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import jinja2
import pytest

PAPER = Path(__file__).parents[3] / "paper"
REQUIRED = ["Summary", "Statement of need", "State of the field", "Software design"]
REQUIRED += ["Research impact statement", "AI usage disclosure", "Acknowledgements", "References"]
NUMBER_WORDS = (
    "three four five six seven eight nine ten eleven twelve twenty thirty forty fifty hundred"
)
#: Parts of the template whose digits are no results: placeholders, citations, labels, links.
NO_RESULTS = r"\{\{.*?\}\}|\{%.*?%\}|@[\w:]+|\]\([^)]*\)|\\\w+\{[^}]*\}|<!--.*?-->"


@pytest.fixture(scope="module")
def script(load_script: Callable[[Path], ModuleType]) -> ModuleType:
    return load_script(PAPER / "make_paper.py")


@pytest.fixture(scope="module")
def text() -> str:
    return (PAPER / "paper.md").read_text(encoding="utf-8")


def body(name: str) -> str:
    """Return a file without its head."""
    return (PAPER / name).read_text(encoding="utf-8").split("\n---\n", 1)[1]


def test_paper_and_figure_are_what_the_script_makes(script):
    assert script.outdated() == [], "run make paper"


def test_the_paper_is_as_long_as_joss_asks(script, text):
    assert 750 <= script.word_count(text) <= 1000


def test_words_of_tables_count_and_rules_of_tables_do_not(script):
    paper = (
        "---\ntitle: no\n---\n\n<!-- no word -->\n\n# One\n\n| two | 3 |\n|---|---|\n\nfour / 5 %\n"
    )

    assert script.word_count(paper) == 5


def test_every_section_that_joss_asks_for_is_there_in_its_order(text):
    assert re.findall(r"^# (.+)$", text, re.MULTILINE) == REQUIRED


def test_every_citation_is_in_the_bibliography_and_the_other_way_round(text):
    bibliography = (PAPER / "paper.bib").read_text(encoding="utf-8")
    keys = re.findall(r"^@\w+\{([\w:]+),$", bibliography, re.MULTILINE)

    assert len(set(keys)) == len(keys)
    assert set(re.findall(r"@([\w:]+)", body("paper.md"))) == set(keys)


def test_no_number_of_the_template_is_typed():
    prose = re.sub(NO_RESULTS, " ", body("paper.template.md"), flags=re.DOTALL)

    assert re.findall(r"(?<![A-Za-z])\d\S*", prose) == []  # C3D and spm1d are names
    assert set(re.findall(r"\w+", prose.lower())) & set(NUMBER_WORDS.split()) == set()


def test_a_name_that_the_tables_lack_is_an_error(script, monkeypatch, tmp_path):
    (tmp_path / "template.md").write_text("---\n---\n\n{{ realistic.nobody.stiffness }}\n")
    monkeypatch.setattr(script, "TEMPLATE", tmp_path / "template.md")

    with pytest.raises(jinja2.UndefinedError, match="nobody"):
        script.paper()


def test_missing_values_are_dashes(script):
    rows = {"stiffness": {"x": ""}, "damping": {"x": "0.25"}, "inertia": {"x": "1"}}

    assert script.triple(rows, "x", 100) == "- / 25 / 100"


def test_authors_and_date_are_those_of_the_citation_file(text):
    citation = (PAPER.parent / "CITATION.cff").read_text(encoding="utf-8")
    names = re.findall(r'- name: "(.+)"', citation)

    assert names
    assert re.findall(r"^  - name: (.+)\n    affiliation", text, re.MULTILINE) == names


def test_counts_are_those_of_the_entry_points(script):
    project = tomllib.loads((PAPER.parent / "pyproject.toml").read_text(encoding="utf-8"))
    counts = script.counts()

    entries = project["project"]["entry-points"]
    assert counts["methods"] == len(entries["jointz.estimators"])
    assert counts["controllers"] == len(entries["jointz.controllers"])
