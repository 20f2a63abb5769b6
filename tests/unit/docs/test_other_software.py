"""Scripts for R, Octave, SPSS and Stata: means as by pandas, columns as in estimates.csv."""

import csv
import io
import re
import shutil
import subprocess
from pathlib import Path

import pandas as pd
import pytest

from jointz.results.study_analysis import StudyAnalysis

DOCS = Path(__file__).parents[3] / "docs"
SCRIPTS = DOCS / "other_software"
COLUMNS = list(StudyAnalysis(cells=()).to_frame().columns)
TEXT_COLUMNS = ["participant", "timing_point", "parameter", "unit"]
TEXT_COLUMNS += ["method", "status", "session", "side"]
MEANS = ["mean", "sd", "people"]


def script(name: str) -> str:
    return (SCRIPTS / name).read_text(encoding="utf-8")


def awkward(estimates: pd.DataFrame) -> pd.DataFrame:
    """Return names that programs take for numbers or logicals, two sides, and every status."""
    other = estimates.assign(side="right", value=1.1 * estimates["value"])
    both = pd.concat([estimates.assign(side="left"), other], ignore_index=True)
    both["participant"] = both["participant"].map({"S01": "01", "S02": "2e1"})
    both["timing_point"] = both["timing_point"].replace({"LRE": "T", "MST": "NA"})
    both.loc[::7, ["value", "status"]] = [None, "undecided"]
    both.loc[1::13, ["value", "status"]] = [0.0, "at_bound"]
    both.loc[2::17, ["value", "status"]] = [None, "failed:no_pulses"]
    return both


@pytest.fixture(params=["as written", "awkward"])
def results(request, small_results, tmp_path) -> Path:
    """A folder with the results of a small study in its folder ``results``."""
    shutil.copytree(small_results, tmp_path / "results")
    file = tmp_path / "results" / "estimates.csv"
    if request.param == "awkward":
        awkward(pd.read_csv(file)).to_csv(file, index=False)
    return tmp_path


def expected(folder: Path) -> pd.DataFrame:
    """Return the means over people by pandas."""
    text = dict.fromkeys(TEXT_COLUMNS, str)
    rows = pd.read_csv(folder / "results" / "estimates.csv", dtype=text, keep_default_na=False,
                       na_values={"value": [""]})  # fmt: skip
    rows = rows[rows["status"] == "ok"]
    people = rows.groupby(["parameter", "timing_point", "participant"])["value"].mean()
    means = people.groupby(level=[0, 1]).agg(["mean", "std", "count"])
    return means.set_axis(MEANS, axis="columns")


def printed_table(text: str, parameter: int = 0, timing_point: int = 1) -> pd.DataFrame:
    """Return the means in what a script printed; SPSS leaves a repeated parameter blank."""
    rows, last = {}, ""
    for cells in csv.reader(io.StringIO(text)):
        if len(cells) != 5 or not re.fullmatch(r"\d+", cells[4]) or cells[timing_point] == "Total":
            continue
        last = cells[parameter] or last
        numbers = [float(c) if c not in (".", "NA", "") else float("nan") for c in cells[2:]]
        rows[last, cells[timing_point]] = numbers
    index = pd.MultiIndex.from_tuples(rows, names=["parameter", "timing_point"])
    return pd.DataFrame(list(rows.values()), index, MEANS)


def run(program: str, *arguments: str, folder: Path) -> str:
    """Run a program in a folder; skip if it is not installed."""
    if not shutil.which(program):
        pytest.skip(f"{program} is not installed")
    done = subprocess.run(
        [program, *arguments], cwd=folder, capture_output=True, text=True, timeout=200, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def assert_means(found: pd.DataFrame, folder: Path, atol: float = 0.0) -> None:
    wanted = expected(folder)
    assert len(wanted) > 10
    found = found.loc[wanted.index]
    # Octave's SD of one value is 0, the others have none.
    several = wanted["people"] > 1
    pd.testing.assert_frame_equal(
        found[["mean", "people"]].astype(float),
        wanted[["mean", "people"]].astype(float),
        rtol=1e-8,
        atol=atol,
    )
    pd.testing.assert_series_equal(
        found["sd"][several], wanted["sd"][several], rtol=1e-6, atol=atol
    )


def test_r_prints_the_means_of_pandas(results):
    printed = run("Rscript", str(SCRIPTS / "results.R"), folder=results)

    assert_means(printed_table(printed, parameter=1, timing_point=0), results)


def test_octave_prints_the_means_of_pandas(results):
    printed = run("octave-cli", "--no-init-file", str(SCRIPTS / "results.m"), folder=results)

    assert_means(printed_table(printed, parameter=1, timing_point=0), results)


def test_pspp_prints_the_means_of_pandas_by_the_script_for_spss(results):
    before, _, _ = script("results.sps").partition("\nMIXED ")  # which PSPP does not have
    (results / "means.sps").write_text(before + "\n", encoding="utf-8")

    printed = run("pspp", "-o", "-", "-O", "format=csv", "means.sps", folder=results)

    assert_means(printed_table(printed), results, atol=1e-5)


# --- columns ------------------------------------------------------------------------------------


def test_spss_gives_every_column_its_type():
    body = re.search(r"/VARIABLES=\n(.*?)\.\n", script("results.sps").replace(".0", ""), re.DOTALL)
    assert body is not None
    words = body[1].split()

    assert words[::2] == COLUMNS
    kinds = dict(zip(words[::2], words[1::2], strict=True))
    assert [name for name, kind in kinds.items() if kind[0] == "A"] == TEXT_COLUMNS


def test_stata_names_every_column_and_which_are_text():
    text = script("results.do").replace("///\n", " ")
    named = re.search(r"^confirm variable (.*)$", text, re.MULTILINE)
    positions = re.search(r"stringcols\(([\d ]+)\)", text)
    assert named is not None
    assert positions is not None

    assert named[1].split() == COLUMNS
    assert [COLUMNS[int(k) - 1] for k in positions[1].split()] == TEXT_COLUMNS


def test_r_reads_every_text_column_as_text():
    named = re.findall(r'(\w+) = "character"', script("results.R"))

    assert named == TEXT_COLUMNS


def test_columns_of_the_file_are_those_of_the_frame(results):
    header = (results / "results" / "estimates.csv").read_text(encoding="utf-8").split("\n", 1)[0]

    assert header.split(",") == COLUMNS


def test_every_script_can_be_downloaded_from_the_page():
    page = (DOCS / "publish.md").read_text(encoding="utf-8")
    linked = re.findall(r"\{download\}`[^<`]+<other_software/([^>]+)>`", page)

    assert sorted(linked) == sorted(p.name for p in SCRIPTS.iterdir())
