"""Notebooks of the gallery: they hold the code of their scripts, and a sample of them runs."""

import ast
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[3] / "examples"
SCRIPTS = sorted([*(EXAMPLES / "gallery").glob("*.py"), *(EXAMPLES / "traps").glob("trap_*.py")])
#: One that only computes, one that simulates and analyses a study, one trap with figures.
SAMPLE = ["gallery/identify_kbj.py", "gallery/first_study.py", "traps/trap_01_vaf.py"]
#: Runs code cells in order in one namespace, as a notebook does; figures are not shown.
_RUN_CELLS = """
import json, sys
import matplotlib
matplotlib.use("agg")
namespace = {"__name__": "__main__"}
for cell in json.load(open(sys.argv[1], encoding="utf-8")):
    exec(compile(cell, sys.argv[1], "exec"), namespace)
"""


def code_cells(script: Path, folder: Path) -> list[str]:
    """Return the code cells of the notebook that sphinx-gallery makes of a script."""
    notebook = pytest.importorskip("sphinx_gallery.notebook")
    notebook.python_to_jupyter_cli([str(shutil.copy(script, folder))])
    made = json.loads((folder / script.name).with_suffix(".ipynb").read_text(encoding="utf-8"))
    return ["".join(c["source"]) for c in made["cells"] if c["cell_type"] == "code"]


def statements(source: str) -> list[str]:
    return [ast.dump(node) for node in ast.parse(source).body]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_a_notebook_holds_the_code_of_its_script(script, tmp_path):
    cells = code_cells(script, tmp_path)

    after_docstring = statements(script.read_text(encoding="utf-8"))[1:]
    assert [s for cell in cells for s in statements(cell)] == after_docstring


@pytest.mark.slow
@pytest.mark.parametrize("name", SAMPLE)
def test_a_notebook_runs_by_itself_in_an_empty_folder(name, tmp_path):
    (tmp_path / "converted").mkdir()
    (tmp_path / "empty").mkdir()
    cells = tmp_path / "cells.json"
    cells.write_text(json.dumps(code_cells(EXAMPLES / name, tmp_path / "converted")), "utf-8")

    done = subprocess.run(
        [sys.executable, "-c", _RUN_CELLS, str(cells)],
        cwd=tmp_path / "empty",
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=280,
        check=False,
    )

    assert done.returncode == 0, done.stderr
