"""The versions of Python that CI names are those that the package claims."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[3]
WORKFLOW = (ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8")


def test_ci_tries_every_version_of_python_that_the_package_claims():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    claimed = {c.rpartition(" ")[2] for c in project["classifiers"] if "Python :: 3." in c}
    assert claimed <= set(re.findall(r'"(3\.\d+)"', WORKFLOW))


def test_what_ci_runs_and_leaves_out_exists():
    named = re.findall(r"--ignore (\S+)|pytest (\S+)|run: (\.\S+)", WORKFLOW)
    paths = {path for groups in named for path in groups if path and not path.startswith("pytest")}
    assert {"tests/unit", "tests/unit/rig", ".ci/run"} <= paths
    assert [path for path in paths if not (ROOT / path).exists()] == []
