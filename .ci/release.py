"""Check that this checkout can be released, and leave wheel and sdist in dist: ``make release``.

Needs Python, git and a package index. Every step runs unless one that it needs has failed; the
table at the end has them all, and the exit status is 1 if any failed.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
import tomllib
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).parent.parent
#: Files of a sdist that are not of git: hatchling writes the first and adds the others.
SDIST_OWN = {"PKG-INFO", ".gitignore", "pyproject.toml"}
SDIST_NEEDS = {"LICENSE", "README.md", "CITATION.cff", "CHANGELOG.md", "pyproject.toml"}
#: Endings and places that a wheel must have: what code reads besides code.
WHEEL_NEEDS = (r"py\.typed$", r"/templates/.*\.j2$", r"/protocols_builtin/.*\.toml$")
CITATION_KEYS = ("cff-version", "message", "title", "authors", "version", "date-released")
LAST_LINES = 15

#: Resolves dotted names, read from stdin, in the package as installed.
RESOLVE = """
import importlib, json, sys
def resolve(name):
    parts = name.split(".")
    for k in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:k]))
        except ModuleNotFoundError as exc:
            if not ".".join(parts[:k]).startswith(str(exc.name)):
                raise
            continue
        for part in parts[k:]:
            found = getattr(found, part)
        return
    raise ImportError(name)
failed = {}
for name in json.load(sys.stdin):
    try:
        resolve(name)
    except Exception as exc:
        failed[name] = f"{type(exc).__name__}: {exc}"
print(json.dumps(failed))
"""


class StepError(Exception):
    """A step failed: one message per problem, with its remedy."""

    def __init__(self, *problems: str) -> None:
        super().__init__("\n".join(problems))
        self.problems = problems


class Unavailable(Exception):  # noqa: N818 - not an error of the release
    """A tool cannot be installed here, and nothing replaces it."""


@dataclass
class Release:
    """The checkout and the folders of a run."""

    root: Path
    work: Path  # outside the checkout, so that nothing is imported from it
    version: str = ""
    tools: dict[str, Path] = field(default_factory=dict)  # those that could be installed

    @property
    def dist(self) -> Path:
        """Folder of wheel and sdist."""
        return self.root / "dist"

    @property
    def wheel(self) -> Path:
        """The wheel of this version."""
        return self.dist / f"jointz-{self.version}-py3-none-any.whl"

    @property
    def sdist(self) -> Path:
        """The source distribution of this version."""
        return self.dist / f"jointz-{self.version}.tar.gz"

    @property
    def python(self) -> Path:
        """Python of the environment with the wheel and no extras."""
        return self.work / "bare" / "bin" / "python"


@dataclass(frozen=True)
class Step:
    """A step of the checklist."""

    name: str
    run: Callable[[Release], str]  # returns a detail for the table
    needs: tuple[str, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """A line of the table."""

    name: str
    result: str  # ``ok``, ``FAILED``, ``skipped`` or ``not run``
    seconds: float
    detail: str
    problems: tuple[str, ...] = ()


# --- steps ------------------------------------------------------------------------------------


def check_clean(release: Release) -> str:
    """Find uncommitted files: the release is what git has."""
    changed = git(release.root, "status", "--porcelain").splitlines()
    if changed:
        more = [f"and {len(changed) - 10} more"] if len(changed) > 10 else []
        files = ", ".join([line[3:] for line in changed[:10]] + more)
        raise StepError(f"Uncommitted: {files}. Commit, remove or ignore them.")
    return git(release.root, "rev-parse", "--short", "HEAD").strip()


def check_versions(release: Release) -> str:
    """Compare version and date everywhere, and read the newest section of the changelog."""
    root, version = release.root, release.version
    problems = []
    package = first(r'^__version__ = "(.+)"$', root / "src/jointz/__init__.py")
    cited = first(r'^version: "?([^"\s]+)"?$', root / "CITATION.cff")
    for name, found in (("src/jointz/__init__.py", package), ("CITATION.cff", cited)):
        if found != version:
            problems.append(
                f"{name}: version {found or 'missing'}, expected {version} as in pyproject.toml."
            )
    problems += changelog_problems(root, version)
    tagged = git(root, "tag", "--list", f"v{version}").strip()
    if tagged and git(root, "rev-list", "-1", tagged) != git(root, "rev-parse", "HEAD"):
        problems.append(f"{version} was released as {tagged}. Raise the version.")
    if problems:
        raise StepError(*problems)
    return version


def changelog_problems(root: Path, version: str) -> list[str]:
    """Return what is wrong with the newest section of the changelog."""
    heading, body = newest_section((root / "CHANGELOG.md").read_text(encoding="utf-8"))
    wanted = f"## {version} - YYYY-MM-DD"
    found = re.fullmatch(r"(\S+) - (\d{4}-\d\d-\d\d)", heading)
    if found is None:
        return [
            f"CHANGELOG.md: newest section is '## {heading}'. Give it version and date: {wanted}."
        ]
    problems = []
    if found[1] != version:
        problems.append(
            f"CHANGELOG.md: newest section is of {found[1]}, pyproject.toml has {version}. "
            "Raise the version, or add its section."
        )
    if not re.search(r"^- ", body, re.MULTILINE):
        problems.append(f"CHANGELOG.md: the section of {found[1]} has no entry. Say what changed.")
    cited = first(r'^date-released: "?([\d-]+)"?$', root / "CITATION.cff")
    if cited != found[2]:
        problems.append(
            f"CITATION.cff: date-released {cited or 'missing'}, CHANGELOG.md has {found[2]}. "
            "Write the day of the release into both."
        )
    return problems + date_problems(found[2])


def date_problems(text: str) -> list[str]:
    """Return what is wrong with the day of a release."""
    try:
        day = date.fromisoformat(text)
    except ValueError:
        return [f"CHANGELOG.md: {text} is no date."]
    # A day later: some time zones are ahead.
    if (day - datetime.now(tz=UTC).date()).days > 1:
        return [f"CHANGELOG.md: {text} is in the future. Write the day of the release."]
    return []


def newest_section(changelog: str) -> tuple[str, str]:
    """Return heading and text of the first section."""
    sections = re.split(r"^## (.+)$", changelog, flags=re.MULTILINE)
    return (sections[1].strip(), sections[2]) if len(sections) > 2 else ("(none)", "")


def install_tools(release: Release) -> str:
    """Install ``build``, ``twine`` and ``cffconvert``, each in an environment of its own."""
    missing = []
    for name in ("build", "twine", "cffconvert"):
        python = new_environment(release.work / name)
        try:
            call(python, "-m", "pip", "install", "--quiet", name, cwd=release.work)
        except StepError:
            missing.append(name)
        else:
            release.tools[name] = python
    if "build" in missing:
        raise StepError("build cannot be installed. Give pip an index that has it.")
    return f"without {', '.join(missing)}" if missing else "build, twine, cffconvert"


def build_files(release: Release) -> str:
    """Build the sdist from the checkout, and the wheel from the sdist."""
    release.dist.mkdir(exist_ok=True)
    for old in (*release.dist.glob("jointz-*.whl"), *release.dist.glob("jointz-*.tar.gz")):
        old.unlink()
    # Times in the archives are those of the commit: the same commit makes the same files.
    os.environ["SOURCE_DATE_EPOCH"] = git(release.root, "log", "-1", "--format=%ct").strip()
    call(release.tools["build"], "-m", "build", "--outdir", release.dist, cwd=release.root)
    made = [path.name for path in (release.wheel, release.sdist) if path.exists()]
    if len(made) < 2:
        raise StepError(f"dist has only: {', '.join(made) or 'nothing'}.")
    sizes = [
        f"{path.suffix[1:]} {path.stat().st_size / 1000:,.0f} kB"
        for path in (release.wheel, release.sdist)
    ]
    return ", ".join(sizes)


def check_contents(release: Release) -> str:
    """Compare the files in wheel and sdist with those of git."""
    with zipfile.ZipFile(release.wheel) as archive:
        wheel = {name for name in archive.namelist() if ".dist-info/" not in name}
    with tarfile.open(release.sdist) as archive:
        sdist = {
            str(PurePosixPath(*PurePosixPath(m.name).parts[1:])) for m in archive if m.isfile()
        }
    source = set(git(release.root, "ls-files", "src").splitlines())
    problems = differences("wheel", wheel, {name.removeprefix("src/") for name in source})
    problems += differences("sdist", sdist - SDIST_OWN, source | (SDIST_NEEDS - SDIST_OWN))
    problems += [f"sdist: {name} is missing." for name in sorted(SDIST_NEEDS - sdist)]
    for pattern in WHEEL_NEEDS:
        if not any(re.search(pattern, name) for name in wheel):
            problems.append(f"wheel: no file like {pattern}. See [tool.hatch] in pyproject.toml.")
    if problems:
        raise StepError(*problems)
    return f"wheel {len(wheel)} files, sdist {len(sdist)}"


def differences(archive: str, found: set[str], expected: set[str]) -> list[str]:
    """Return what an archive has too much or too little."""
    remedy = "See [tool.hatch] in pyproject.toml, or add the files to git."
    pairs = (("missing", expected - found), ("not in git", found - expected))
    return [
        f"{archive}: {len(names)} {what}: {', '.join(sorted(names)[:8])}. {remedy}"
        for what, names in pairs
        if names
    ]


def check_metadata(release: Release) -> str:
    """Ask twine whether an index accepts the files and can show the README."""
    if "twine" not in release.tools:
        raise Unavailable("twine cannot be installed here")
    call(release.tools["twine"], "-m", "twine", "check", "--strict", release.wheel, release.sdist,
         cwd=release.work)  # fmt: skip
    return "twine check --strict"


def check_citation(release: Release) -> str:
    """Look for the keys of CITATION.cff, and validate it if cffconvert is here."""
    file = release.root / "CITATION.cff"
    missing = [key for key in CITATION_KEYS if first(rf"^({key}):", file) is None]
    if missing:
        raise StepError(f"CITATION.cff: add {', '.join(missing)}.")
    if "cffconvert" not in release.tools:
        return "keys only: cffconvert cannot be installed here"
    tool = release.tools["cffconvert"].with_name("cffconvert")
    call(tool, "--validate", "--infile", file, cwd=release.work)
    return "cffconvert --validate"


def install_bare(release: Release) -> str:
    """Install the wheel without extras, in a new environment outside the checkout."""
    python = new_environment(release.work / "bare")
    call(python, "-m", "pip", "install", "--quiet", "--constraint",
         release.root / "constraints.txt", release.wheel, cwd=release.work)  # fmt: skip
    said = call(python.with_name("jointz"), "--version", cwd=release.work).strip()
    if release.version not in said.split():
        raise StepError(f"jointz --version: said '{said}', expected {release.version}.")
    return said


def run_demo(release: Release) -> str:
    """Run the demo, and analyse its recordings."""
    jointz = release.python.with_name("jointz")
    call(jointz, "demo", "--quick", "--quiet", cwd=release.work)
    call(jointz, "analyze", "jointz-demo/study", "--out", "results", "--resamples", "100",
         "--quiet", cwd=release.work)  # fmt: skip
    for name in ("report.html", "estimates.csv", "provenance.json"):
        if not (release.work / "results" / name).is_file():
            raise StepError(f"jointz analyze: results have no {name}.")
    rows = (release.work / "results" / "estimates.csv").read_text(encoding="utf-8").splitlines()
    return f"{len(rows) - 1} estimates"


def import_reference(release: Release) -> str:
    """Import every name of the reference, without extras."""
    page = (release.root / "docs" / "reference.md").read_text(encoding="utf-8")
    names = reference_names(page)
    said = call(release.python, "-c", RESOLVE, cwd=release.work, stdin=json.dumps(names))
    failed = json.loads(said.splitlines()[-1])
    if failed:
        raise StepError(*(f"docs/reference.md: {name}: {why}" for name, why in failed.items()))
    return f"{len(names)} names"


def reference_names(page: str) -> list[str]:
    """Return the full names in the autosummaries of a page."""
    names, module, listing = [], "", False
    for line in page.splitlines():
        if line.startswith(".. currentmodule::"):
            module = line.split("::")[1].strip()
        if line.startswith("```") or line.startswith(".. "):
            listing = line.startswith(".. autosummary::")
        elif listing and re.fullmatch(r"   [\w.]+", line):
            names.append(f"{module}.{line.strip()}")
    return names


def check_paper(release: Release) -> str:
    """Compare the paper with what its command makes with the wheel."""
    call(release.python, "paper/make_paper.py", "--check", cwd=release.root)
    return "as committed"


STEPS = (
    Step("clean", check_clean),
    Step("versions", check_versions),
    Step("tools", install_tools),
    Step("build", build_files, ("tools",)),
    Step("contents", check_contents, ("build",)),
    Step("metadata", check_metadata, ("build",)),
    Step("citation", check_citation),
    Step("install", install_bare, ("build",)),
    Step("demo", run_demo, ("install",)),
    Step("reference", import_reference, ("install",)),
    Step("paper", check_paper, ("install",)),
)


# --- commands ---------------------------------------------------------------------------------


def call(*command: str | Path, cwd: Path, stdin: str | None = None) -> str:
    """Run a command and return its output; its last lines are the problem if it fails."""
    words = [str(word) for word in command]
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    environment["OPENBLAS_NUM_THREADS"] = "1"
    environment["PYTHONDONTWRITEBYTECODE"] = "1"  # nothing new in the checkout
    done = subprocess.run(
        words, cwd=cwd, env=environment, input=stdin, capture_output=True, text=True, check=False
    )
    if done.returncode:
        said = (done.stdout + done.stderr).strip().splitlines()[-LAST_LINES:]
        name = " ".join([Path(words[0]).name, *words[1:]]).replace(RESOLVE, "...")
        raise StepError("\n  ".join([f"{name}: exit status {done.returncode}", *said]))
    return done.stdout


def git(root: Path, *arguments: str) -> str:
    """Return what git says of a checkout."""
    return call("git", *arguments, cwd=root)


def first(pattern: str, file: Path) -> str | None:
    """Return the first group of the first match in a file."""
    found = re.search(pattern, file.read_text(encoding="utf-8"), re.MULTILINE)
    return found[1] if found else None


def new_environment(folder: Path) -> Path:
    """Make a virtual environment and return its Python."""
    call(sys.executable, "-m", "venv", folder, cwd=folder.parent)
    return folder / "bin" / "python"


# --- checklist --------------------------------------------------------------------------------


def run_steps(release: Release, steps: Sequence[Step]) -> list[Outcome]:
    """Run every step whose needs are met."""
    outcomes: list[Outcome] = []
    for step in steps:
        passed = {outcome.name for outcome in outcomes if outcome.result == "ok"}
        lacking = [need for need in step.needs if need not in passed]
        print(f"release: {step.name} ...", file=sys.stderr, flush=True)
        if lacking:
            outcomes.append(Outcome(step.name, "not run", 0.0, f"needs {', '.join(lacking)}"))
        else:
            outcomes.append(run_step(release, step))
    return outcomes


def run_step(release: Release, step: Step) -> Outcome:
    """Run one step."""
    began = time.monotonic()
    problems: tuple[str, ...] = ()
    try:
        result, detail = "ok", step.run(release)
    except Unavailable as exc:
        result, detail = "skipped", str(exc)
    except StepError as exc:
        result, detail, problems = "FAILED", f"{len(exc.problems)} problem(s), below", exc.problems
    except (OSError, KeyError, ValueError) as exc:
        result, detail, problems = "FAILED", "see below", (f"{type(exc).__name__}: {exc}",)
    return Outcome(step.name, result, time.monotonic() - began, detail, problems)


def summary(outcomes: Sequence[Outcome]) -> str:
    """Return the table, and all problems below it."""
    lines = [f"{'step':<10} {'result':<8} {'seconds':>7}  detail"]
    lines += [f"{o.name:<10} {o.result:<8} {o.seconds:>7.1f}  {o.detail}" for o in outcomes]
    lines.append(f"{'':<10} {'':<8} {sum(o.seconds for o in outcomes):>7.1f}  in all")
    problems = [f"{o.name}: {problem}" for o in outcomes for problem in o.problems]
    if problems:
        lines += ["", "To be done before a release:", *(f"- {problem}" for problem in problems)]
    return "\n".join(lines)


def main() -> int:
    """Run the checklist and return the exit status."""
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "version"
    ]
    work = Path(tempfile.mkdtemp(prefix="jointz-release-"))
    try:
        outcomes = run_steps(Release(ROOT, work, version), STEPS)
    finally:
        shutil.rmtree(work, ignore_errors=True)
    print(summary(outcomes))
    failed = any(outcome.result in ("FAILED", "not run") for outcome in outcomes)
    if not failed:
        print(f"\ndist holds jointz {version}. Tag it: git tag v{version}")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
