"""The check of the built site: dead links, and downloads that an example lacks."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

SCRIPT = Path(__file__).parents[3] / "docs" / "check_site.py"
LINK = '<a href="../_downloads/0a/{}">download</a>'


@pytest.fixture(scope="module")
def check(load_script: Callable[[Path], ModuleType]) -> ModuleType:
    return load_script(SCRIPT)


def site(folder: Path, linked: list[str], present: list[str]) -> Path:
    """Write a site with one example."""
    (folder / "gallery").mkdir()
    (folder / "_downloads" / "0a").mkdir(parents=True)
    (folder / "gallery" / "index.html").write_text('<a href="first.html">first</a>')
    (folder / "gallery" / "first.html").write_text("".join(LINK.format(name) for name in linked))
    for name in present:
        (folder / "_downloads" / "0a" / name).write_text("")
    return folder


def test_a_site_whose_example_offers_script_and_notebook_is_accepted(check, tmp_path):
    files = ["first.py", "first.ipynb"]

    assert list(check.problems(site(tmp_path, linked=files, present=files))) == []


def test_an_example_without_a_notebook_is_a_problem(check, tmp_path):
    files = ["first.py", "other.ipynb"]

    assert list(check.problems(site(tmp_path, linked=files, present=files))) == [
        "gallery/first.html: offers no first.ipynb for download"
    ]


def test_a_download_that_is_absent_is_a_problem(check, tmp_path):
    linked = ["first.py", "first.ipynb"]

    assert list(check.problems(site(tmp_path, linked=linked, present=["first.py"]))) == [
        "gallery/first.html: leads to ../_downloads/0a/first.ipynb, which is not there"
    ]
