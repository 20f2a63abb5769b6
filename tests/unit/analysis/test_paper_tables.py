"""Tables for a paper: the cells are the results, and LaTeX takes them as they are."""

import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from jointz.analysis.paper.latex import MOST_ROWS, latex_table, to_latex
from jointz.analysis.paper.methods_text import methods_latex
from jointz.analysis.paper.paper_tables import paper_tables
from jointz.analysis.paper.table import NO_VALUE, Table
from jointz.report.wording import DASH, MINUS, TIMES, format_interval, format_number
from jointz.results.study_analysis import StudyAnalysis

NUMBER = re.compile(rf"[{MINUS}\d.]+")


@pytest.fixture(scope="module")
def tables(walking):
    return paper_tables(walking)


def cell_of(frame, person, point, column):
    row = frame[(frame["Participant"] == person) & (frame["Timing point"] == point)]
    assert len(row) == 1
    return row.iloc[0][column]


def test_every_estimate_stands_in_its_row_as_in_the_results(walking, tables):
    frame = tables["estimates"].to_frame()
    assert len(frame) == len(walking.cells)
    for cell in walking.cells:
        estimate = cell.parameter("stiffness")
        if estimate is None or estimate.status != "ok":
            continue
        text = cell_of(frame, cell.participant, cell.timing_point, "K (N·m/rad)")
        assert text == format_interval(estimate.value, estimate.ci_low, estimate.ci_high)
        value, low, high = map(float, NUMBER.findall(text))
        assert value == pytest.approx(estimate.value, rel=0.01)
        assert low < value < high


def test_what_is_undecided_is_a_dash_with_a_note_and_a_bound_a_limit(walking, tables):
    frame = tables["estimates"].to_frame()
    assert cell_of(frame, "S05", "TST", "K (N·m/rad)") == NO_VALUE
    assert cell_of(frame, "S05", "TST", "Note") == "K, B undecided"
    bound = next(c for c in walking.cells if (c.participant, c.timing_point) == ("S03", "MSW"))
    limit = bound.parameter("stiffness").ci_high
    assert cell_of(frame, "S03", "MSW", "K (N·m/rad)") == f"< {format_number(limit)}"
    assert cell_of(frame, "S03", "MSW", "Note") == "K upper limit"
    assert cell_of(frame, "S09", "PSW", "Note") == "K, B failed: all_pulses_excluded"


def test_a_parameter_that_a_row_never_had_is_blank_and_not_a_dash(tables):
    frame = tables["estimates"].to_frame()
    assert cell_of(frame, "S01", "all points", "K (N·m/rad)") == ""
    assert cell_of(frame, "S01", "all points", "J (kg·m²)").startswith("0.")


def test_means_are_those_of_the_population(walking, tables):
    frame = tables["population"].to_frame()
    assert len(frame) == len(walking.population)
    mean = next(
        m for m in walking.population if (m.parameter, m.timing_point) == ("damping", "MST")
    )
    (row,) = frame[(frame["Parameter"] == "B") & (frame["Timing point"] == "MST")].to_dict(
        "records"
    )
    assert row["Mean [interval]"] == format_interval(mean.value, mean.ci_low, mean.ci_high)
    assert row["n"] == str(mean.n_participants)
    assert row["SD"] == format_number(mean.sd, like=mean.value)
    assert row["Unit"] == "N·m·s/rad"


def test_methods_are_compared_by_the_mean_of_what_stands(walking, tables):
    frame = tables["methods"].to_frame()
    (row,) = frame[(frame["Parameter"] == "K") & (frame["Timing point"] == "LRE")].to_dict(
        "records"
    )
    for name, cells in (("rigid", walking.cells), ("dissertation", walking.comparison)):
        values = [c.parameter("stiffness").value for c in cells if c.timing_point == "LRE"]
        found = list(map(float, NUMBER.findall(row[name])))
        assert found[0] == pytest.approx(np.mean(values), rel=0.01)
        assert found[-1] == len(values) == 10


def test_exclusions_are_counted_by_code(walking, tables):
    frame = tables["exclusions"].to_frame()
    counts = walking.excluded_frame().groupby(["kind", "code"])
    assert len(frame) == len(counts)
    for row in frame.to_dict("records"):
        own = counts.get_group((row["What"], row["Code"]))
        assert int(row["Left out"].replace("\N{NARROW NO-BREAK SPACE}", "")) == len(own)
        assert int(row["Participants"]) == own["participant"].nunique()


def with_fallback(bench):
    """Return a bench whose last case needed another method, which also is the comparison."""
    chosen = tuple(replace(c, method="full_record") for c in bench.cells)
    others = tuple(replace(c, method="dissertation") for c in bench.cells)
    settings = {**bench.settings, "method": "full_record"}
    return replace(bench, cells=(others[0], *chosen[1:]), comparison=others, settings=settings)


def test_a_case_that_needed_another_method_counts_once(bench):
    table = paper_tables(with_fallback(bench))["methods"]
    assert table.head[3:] == ("whole trials", "dissertation")  # the chosen one first
    first = bench.cells[0].timing_point
    (row,) = [r for r in table.rows if r[0] == "K" and r[2] == first]
    stiffness = bench.cells[0].parameter("stiffness")
    text = format_interval(stiffness.value, stiffness.ci_low, stiffness.ci_high)
    assert row[3:] == (NO_VALUE, f"{text} (1)")


def test_where_nobody_was_perturbed_quasi_stiffness_takes_the_place_of_estimates(unperturbed):
    tables = paper_tables(unperturbed)
    assert list(tables) == ["quasi_stiffness"]
    frame = tables["quasi_stiffness"].to_frame()
    (row,) = frame[frame["Timing point"] == "TST"].to_dict("records")
    assert row["Slope (N·m/rad)"] == "181 [144, 218]"
    assert row["Local slope (N·m/rad)"] == NO_VALUE
    assert row["Strides"] == "42"
    assert row["Note"] == "slope: angle turns; local slope: no range"
    tex = tables["quasi_stiffness"].to_latex("quasi_stiffness")
    assert r"181 [144, 218]$^{a}$ & ---$^{b}$" in tex


def test_nothing_standing_is_a_table_of_dashes_and_nobody_none(failed):
    frame = paper_tables(failed)["estimates"].to_frame()
    assert list(frame["K (N·m/rad)"]) == [NO_VALUE]
    assert paper_tables(StudyAnalysis(cells=())) == {}


@pytest.mark.parametrize(
    ("text", "tex"),
    [
        ("a_b & 5 % of $1 #2 {x} ~^", r"a\_b \& 5 \% of \$1 \#2 \{x\} \textasciitilde{}"
                                       r"\textasciicircum{}"),
        (r"\input{x}", r"\textbackslash{}input\{x\}"),
        (f"{MINUS}0.5 ± 2 N·m·s/rad", r"$-$0.5 $\pm$ 2 N$\cdot$m$\cdot$s/rad"),
        (f"2.5 {TIMES} 10⁻⁶ kg·m²", r"2.5 $\times$ 10$^{-6}$ kg$\cdot$m$^{2}$"),
        (f"— < 0.3 {DASH} 0.4 > “x”…", r"--- $<$ 0.3 -- 0.4 $>$ ``x''\ldots{}"),
        ("a--b", "a-{}-b"),
        ("one\n\ntwo", "one  two"),
        ("2\N{NARROW NO-BREAK SPACE}832", r"2\,832"),
    ],
)  # fmt: skip
def test_every_special_character_is_escaped(text, tex):
    assert to_latex(text) == tex


def test_a_table_has_as_many_cells_in_every_row_as_columns_and_its_head_on_every_page(tables):
    for name, table in tables.items():
        tex = table.to_latex(name)
        long = len(table.rows) > MOST_ROWS
        assert (r"\begin{longtable}" in tex) == long
        assert tex.count(r"\toprule") == tex.count(r"\bottomrule") == 1 + long
        assert tex.count(r"\begin{") == tex.count(r"\end{") == 2 - long
        assert tex.isascii()
        begins, ends = (
            (r"\endlastfoot", r"\end{longtable}") if long else (r"\midrule", r"\bottomrule")
        )
        body = tex.split(begins)[1].split(ends)[0].strip().splitlines()
        assert len(body) == len(table.rows)
        columns = [column for column in table.head if column != "Note"]
        assert {len(re.findall(r"(?<!\\)&", line)) for line in body} == {len(columns) - 1}


def test_a_dash_of_latex_bears_the_mark_of_its_note(tables):
    tex = tables["estimates"].to_latex("t")
    (row,) = [line for line in tex.splitlines() if line.startswith("S05 & TST")]
    mark = re.search(r"---(\$\^\{[a-j]\}\$) & ", row).group(1)
    assert f"{mark}--- (undecided)" in tex
    assert "undecided" not in row
    assert r"$<$ " in next(line for line in tex.splitlines() if line.startswith("S03 & MSW"))


def test_a_row_that_begins_with_a_bracket_is_no_argument_of_the_line_before():
    tex = latex_table(["a", "b"], [["1", "2"], ["[3]", "4"]], caption="c", label="l")
    assert "{}[3] & 4" in tex


@pytest.mark.skipif(not shutil.which("pdflatex"), reason="no pdflatex on this machine")
def test_pdflatex_takes_methods_and_tables(walking, tables, tmp_path):
    hostile = Table("a_b & 5 % “c” <x>", ("K (N·m/rad)", "#"), (("[1, 2]", "\\x{~^}"),))
    for name, table in {**tables, "hostile": hostile}.items():
        (tmp_path / f"{name}.tex").write_text(table.to_latex(name), encoding="utf-8")
    (tmp_path / "methods_text.tex").write_text(methods_latex(walking), encoding="utf-8")
    inputs = "\n".join(rf"\input{{{n}}}" for n in (*tables, "hostile", "methods_text"))
    (tmp_path / "main.tex").write_text(
        "\\documentclass[a4paper]{article}\\usepackage[margin=25mm]{geometry}\\usepackage{booktabs,longtable}\\begin{document}\n"
        f"{inputs}\n\\end{{document}}\n"
    )
    done = subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "main.tex"],
        cwd=tmp_path, capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-2000:]
    assert (tmp_path / "main.pdf").stat().st_size > 10_000
