"""The walk over the built site finds what is dead or comes from elsewhere."""

from pathlib import Path

import pytest

DOCS = Path(__file__).parents[3] / "docs"


@pytest.fixture(scope="module")
def check_site(load_script):
    return load_script(DOCS / "check_site.py")


@pytest.fixture
def site(tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "_static").mkdir()
    (tmp_path / "_static" / "own.css").write_text("body { background: url(own.png) }")
    (tmp_path / "own.js").write_text("")
    (tmp_path / "index.html").write_text(
        '<link rel="stylesheet" href="_static/own.css"><script src="own.js?v=1"></script>'
        '<a href="sub/page.html#place">there</a><a href="https://elsewhere.example">out</a>'
        '<link rel="canonical" href="https://elsewhere.example">'
    )
    (tmp_path / "sub" / "page.html").write_text('<h1 id="place">x</h1><a href="../">up</a>')
    return tmp_path


def add(site, html):
    page = site / "sub" / "page.html"
    page.write_text(page.read_text() + html)


def test_a_whole_site_has_no_problems(check_site, site):
    assert list(check_site.problems(site)) == []
    assert check_site.main([str(site)]) == 0


@pytest.mark.parametrize(
    ("html", "told"),
    [
        ('<a href="gone.html">x</a>', "leads to gone.html, which is not there"),
        ('<a href="../index.html#gone">x</a>', "which has no such place"),
        ('<img src="gone.png">', "needs gone.png, which is not there"),
        ('<script src="https://cdn.example/x.js"></script>', "fetches https://cdn.example/x.js"),
        ('<link rel="stylesheet" href="http://cdn.example/x.css">', "from elsewhere"),
    ],
)
def test_each_planted_error_is_found_and_told(check_site, site, html, told, capsys):
    add(site, html)

    (problem,) = check_site.problems(site)

    assert problem.startswith("sub/page.html: ")
    assert told in problem
    assert check_site.main([str(site)]) == 1
    assert problem in capsys.readouterr().err


def test_a_style_sheet_that_fetches_a_font_is_found(check_site, site):
    (site / "_static" / "own.css").write_text("@font-face { src: url(https://cdn.example/f) }")

    assert [p.split(":")[0] for p in check_site.problems(site)] == ["_static/own.css"]
