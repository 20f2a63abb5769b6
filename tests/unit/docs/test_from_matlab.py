"""The page for people from MATLAB: every row with a program gives the number of that program.

The other side is stored (docs/from_matlab/reference.json); where Octave and R are installed the
slow tests run it anew.
"""

import dataclasses
import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

DOCS = Path(__file__).parents[3] / "docs"

sys.path.insert(0, str(DOCS))
try:
    made = importlib.import_module("make_from_matlab")
    given = importlib.import_module("from_matlab.given")
    ours = importlib.import_module("from_matlab.ours")
    programs = importlib.import_module("from_matlab.programs")
    rows = importlib.import_module("from_matlab.rows")
finally:
    sys.path.remove(str(DOCS))

ROWS = {row.id: row for row in rows.all_rows()}
COMPARED = [name for name, row in ROWS.items() if row.program]
STORED = programs.stored()
ARRAYS = given.given()
#: Numbers of one row are no surer than this share of the largest of them.
ROUNDING = 1e-13


def numbers(values: list[float | None]) -> np.ndarray:
    return np.array([np.nan if v is None else v for v in values], dtype=float)


def assert_same(found: np.ndarray, expected: np.ndarray, rtol: float) -> None:
    assert found.shape == expected.shape
    assert np.isfinite(expected).all()
    floor = ROUNDING * np.abs(expected).max() if rtol else 0.0
    np.testing.assert_allclose(found, expected, rtol=rtol, atol=floor)


# --- the two sides ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", COMPARED)
def test_both_snippets_of_a_row_give_the_same_number_which_is_stored_for_them(name):
    row, kept = ROWS[name], STORED["rows"][name]
    stored = (kept["program"], kept["code"], kept["compared"])

    assert_same(ours.value(row, ARRAYS), numbers(kept["value"]), row.rtol)
    assert stored == (row.program, row.code, row.theirs), (
        "run python docs/make_from_matlab.py --reference"
    )


def test_the_programs_saw_the_data_that_are_made_here():
    now = programs.fingerprint()

    assert set(now) == set(STORED["given"])
    for name, value in STORED["given"].items():
        assert now[name] == pytest.approx(value, rel=1e-9, abs=1e-9), name


@pytest.mark.slow
@pytest.mark.parametrize("program", ["Octave", "R"])
def test_the_programs_say_today_what_is_stored(program):
    if not programs.installed(program):
        pytest.skip(f"{program} and its packages are not installed")
    own = [ROWS[name] for name in COMPARED if ROWS[name].program == program]

    found = programs.run_rows(program, own)["values"]

    for row in own:
        assert_same(numbers(found[row.id]), numbers(STORED["rows"][row.id]["value"]), row.rtol)


# --- the rows -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [n for n, row in ROWS.items() if row.untested and row.python])
def test_a_snippet_that_is_not_compared_runs_too(name):
    """But for what needs more than is given: a study on disk, 30 strides."""
    if name in ("mat-file", "nlid-tv"):
        pytest.skip("the data given to all rows do not hold what it needs")
    row = ROWS[name]

    assert ours.value(dataclasses.replace(row, ours="1.0"), ARRAYS) == [1.0]


# --- the page -----------------------------------------------------------------------------------


def test_the_page_is_what_the_script_makes():
    page = (DOCS / "from-matlab.md").read_text(encoding="utf-8")

    assert page == made.page(), "run python docs/make_from_matlab.py"
    assert set(STORED["rows"]) == set(COMPARED)
    assert len(COMPARED) >= 30


@pytest.mark.parametrize("name", made.program_files())
def test_the_files_of_programs_are_what_the_script_makes(name):
    stored = (DOCS / "tables" / name).read_text(encoding="utf-8")

    assert stored == made.program_files()[name], "run python docs/make_from_matlab.py"
