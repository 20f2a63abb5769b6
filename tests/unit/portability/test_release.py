"""The checklist of a release: what each step says of a checkout, and what the table shows."""

import importlib.util
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path
from types import ModuleType

import pytest

REPOSITORY = Path(__file__).parents[3]
FILES = {
    "CHANGELOG.md": "# Changelog\n\n## 1.2.0 - 2026-01-31\n\n- New: all.\n\n## 1.1.0 - 2025-01-01",
    "CITATION.cff": "cff-version: 1.2.0\nversion: 1.2.0\ndate-released: 2026-01-31\n",
    "LICENSE": "BSD",
    "README.md": "# jointz",
    "pyproject.toml": "",
    "src/jointz/__init__.py": '__version__ = "1.2.0"\n',
    "src/jointz/py.typed": "",
    "src/jointz/report/templates/page.html.j2": "",
    "src/jointz/io/protocols_builtin/walking.toml": "",
}


def load_checklist() -> ModuleType:
    spec = importlib.util.spec_from_file_location("release", REPOSITORY / ".ci" / "release.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["release"] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


release = load_checklist()


def git(folder: Path, *arguments: str) -> None:
    who = ["-c", "user.name=a", "-c", "user.email=a@example.org"]
    subprocess.run(["git", *who, *arguments], cwd=folder, check=True, capture_output=True)


@pytest.fixture
def checkout(tmp_path: Path):
    """A release of a small checkout in which everything is right."""
    root = tmp_path / "checkout"
    for name, text in FILES.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    git(root, "init", "--quiet")
    git(root, "add", ".")
    git(root, "commit", "--quiet", "-m", "all")
    return release.Release(root, tmp_path, "1.2.0")


def edit(checkout, name: str, old: str, new: str) -> None:
    file = checkout.root / name
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


def problems(step, checkout) -> str:
    with pytest.raises(release.StepError) as caught:
        step(checkout)
    return "\n".join(caught.value.problems)


def archives(checkout, *, extra: str = "", without: str = "") -> None:
    """Write wheel and sdist as the build would, with a file more or less in both."""
    checkout.dist.mkdir()
    names = [name for name in FILES if name != without] + ([extra] if extra else [])
    with zipfile.ZipFile(checkout.wheel, "w") as wheel:
        wheel.writestr("jointz-1.2.0.dist-info/METADATA", "")
        for name in names:
            if name.startswith("src/"):
                wheel.writestr(name.removeprefix("src/"), "")
    with tarfile.open(checkout.sdist, "w:gz") as sdist:
        for name in [*names, "PKG-INFO"]:
            sdist.addfile(tarfile.TarInfo(f"jointz-1.2.0/{name}"))


# --- git and versions -------------------------------------------------------------------------


def test_a_checkout_in_which_everything_is_right_passes(checkout):
    assert release.check_clean(checkout)
    assert release.check_versions(checkout) == "1.2.0"
    archives(checkout)
    assert release.check_contents(checkout) == "wheel 4 files, sdist 10"


@pytest.mark.parametrize(
    ("name", "old", "new", "expected"),
    [
        ("CITATION.cff", "\nversion: 1.2.0", "\nversion: 1.1.0", "CITATION.cff: version 1.1.0"),
        ("src/jointz/__init__.py", "1.2.0", "2.0", "__init__.py: version 2.0, expected 1.2.0"),
        ("CHANGELOG.md", "1.2.0 - 2026-01-31", "Unreleased", "newest section is '## Unreleased'"),
        ("CHANGELOG.md", "- New: all.", "", "has no entry"),
        ("CHANGELOG.md", "2026-01-31", "2026-02-01", "date-released 2026-01-31"),
    ],
)
def test_a_version_or_date_that_differs_is_named_with_the_remedy(
    checkout, name, old, new, expected
):
    edit(checkout, name, old, new)

    assert expected in problems(release.check_versions, checkout)


# --- contents ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"extra": "src/jointz/notes.txt"}, "wheel: 1 not in git: jointz/notes.txt"),
        ({"extra": "tests/test_all.py"}, "sdist: 1 not in git: tests/test_all.py"),
        ({"without": "src/jointz/py.typed"}, "wheel: no file like py"),
        ({"without": "LICENSE"}, "sdist: LICENSE is missing"),
    ],
)
def test_files_too_many_or_too_few_are_named(checkout, changes, expected):
    archives(checkout, **changes)

    assert expected in problems(release.check_contents, checkout)


def test_names_of_the_reference_are_those_of_its_lists():
    page = (REPOSITORY / "docs" / "reference.md").read_text(encoding="utf-8")

    names = release.reference_names(page)

    assert len(names) > 30
    assert {"jointz.analyze", "jointz.stats.mixed_model"} <= set(names)
    assert [name for name in names if not name.startswith("jointz.")] == []


def test_missing_keys_of_the_citation_are_named(checkout):
    assert "message, title, authors" in problems(release.check_citation, checkout)
    assert "keys only" in release.check_citation(release.Release(REPOSITORY, checkout.work))


# --- checklist --------------------------------------------------------------------------------


def fail(_):
    raise release.StepError("a is wrong. Do b.", "c is wrong. Do d.")


def test_the_other_steps_run_after_a_failure_and_all_problems_stand_at_the_end(checkout):
    steps = [
        release.Step("one", fail),
        release.Step("two", lambda _: "fine"),
        release.Step("three", lambda _: "never", ("one",)),
    ]

    outcomes = release.run_steps(checkout, steps)
    text = release.summary(outcomes)

    assert [outcome.result for outcome in outcomes] == ["FAILED", "ok", "not run"]
    assert "needs one" in text
    assert text.endswith("- one: a is wrong. Do b.\n- one: c is wrong. Do d.")


def test_the_version_in_the_checkout_is_ready_for_a_release():
    version = release.first(r'^version = "(.+)"$', REPOSITORY / "pyproject.toml")

    assert release.changelog_problems(REPOSITORY, version) == []
