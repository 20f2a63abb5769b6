"""The page of the documentation and its tables, made from the summaries of rows."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from benchmarks.accuracy.ranks import BINS
from benchmarks.accuracy.rows import PARAMETERS
from benchmarks.accuracy.scores import ALL, Score
from benchmarks.accuracy.summaries import Summary, verdicts
from benchmarks.planning.page import planning_text
from benchmarks.realistic.page import realistic_text, resemblance_text
from benchmarks.worlds.page import foreign_text

#: Methods of stored results that this version replaced.
FORMER_METHODS = ("rigid",)
#: Rows with a drawn rank histogram.
RANK_ROWS = ("inside",)
#: Rows in the table of the page; accuracy-rows.csv has all.
MAIN_ROWS = (
    "nominal-lag-unknown",
    "nominal-lag-0.5ms",
    "three-pulses",
    "hard-lag-0.5ms",
    "hard-lag-unknown",
    "anthropometric",
    "inside",
)
#: Part of a title that most rows share.
_USUAL_LAG = ", lag known to 0.5 ms"
_INTRODUCTION = """<!-- Generated from benchmarks/accuracy/page.py -->
# Accuracy

This page gives the errors of estimates in simulated people, whose impedance is known. For your own
study see [certificate](certificate.md).

## Simulation

Each person walks 60 strides without and then with pulses of 17 N\\*m x 250 ms at six timing
points, 50 each unless the row says otherwise. Simulation and methods share no code for the joint.
`nominal` people have the inertias of the dissertation (0.03 to 0.07 kg\\*m^2) and usual instrument
errors. `hard` people have larger errors (friction model 30 % off, more noise, goniometer up to
20 ms late). `anthropometric` people have the inertia of shank and foot (0.1 to 0.5 kg\\*m^2) and a
device strapped to skin and muscle.

Real gait varies more than that of `nominal` people. After 100 ms two recorded walkers are 0.7 to
3.1 degrees (SD) from the best linear prediction, `nominal` people 0.4 and `realistic` ones 0.8 to
1.3 ({download}`csv <tables/unpredictability.csv>`).

- **Truth**: K (with gravity), B and J, averaged over pulses and the 100 ms after the onset.
- **Available**: estimates with a value (status `ok` or `at_bound`). RMSE, bias and coverage
  are of these.
- **RMSE**: root mean square of estimate / truth - 1.
- **Coverage**: share of 95 % intervals that contain the truth. The band is where a true 0.95 would
  be; it accounts for several estimates per person.
"""
_FORMER = """These rows were run with `rigid`, which `bayesian` replaced. For 40 `nominal`
people with unknown lag both have the same RMSE within 0.5 percentage points; intervals of K are
1.2 times as wide with `bayesian`.

"""
_LIMITS = """(accuracy-hard-lag-unknown)=
## Where the estimates are wrong

| condition | effect | remedy |
| --- | --- | --- |
| rigid coupling stated for a strapped leg (`anthropometric`) | K and B not available in over 90 %, K of the others 47 % too low | state the strap; use doublets |
| goniometer alone | B 5 to 13 % too high | intervals include 8 % (SD) for it |
| large errors, lag unknown (`hard`) | J not available in 95 %; of its other intervals, 62 % contain the truth | measure the lag; without it do not use J |
| velocity reflex of 30 % of K after 30 ms | RMSE of K 10 %; coverage of K and B 0.88 and 0.89 | pulses of both directions ([undecided](undecided.md)) |
| K and B change over the cycle | RMSE of K doubles, intervals widen accordingly | none needed: coverage holds |
| 3 pulses per timing point | a quarter of K is not available; with 1 pulse over half | more pulses |
| torque gain wrong | K, B and J wrong by the same factor, unnoticed | calibrate |

For comparison, `dissertation` has an RMSE of 25 to 153 % and a coverage of 0.13 to 0.66 here.
"""  # noqa: E501
_TARGETS = """## Targets that are not met

One file has {{download}}`all targets <tables/accuracy-targets.csv>` of {method}. Most targets that
are not met are coverages above their band: intervals in `nominal` and `hard` rows are 10 to 20 %
too wide, because they allow for reflexes and varying inertia that these people lack.
"""
_FILES = """## All figures

- {download}`accuracy-rows.csv <tables/accuracy-rows.csv>`: every row, method and parameter over
  all timing points. The csv of a row has single timing points, too.
- {download}`accuracy-ranks.csv <tables/accuracy-ranks.csv>`: rank histograms.

| column | meaning |
| --- | --- |
| `method`, `parameter`, `timing_point` | `all` is all timing points |
| `n` | estimates |
| `undecided_pct`, `failed_pct` | without a value |
| `bias_pct`, `rmse_pct`, `rmse` | mean error, RMSE; RMSE in SI units |
| `width_pct` | median width of the interval, % of the truth |
| `zero_width`, `one_sided_pct` | width 0; `at_bound` |
| `bound_pct`, `ratio` | Cramer-Rao bound; RMSE over it |
| `coverage.rate`, `.low`, `.high` | coverage and its band |
| `coverage.design_effect` | for estimates of the same person |
| `seconds` | median per person |
"""
_RERUN = """## Run it again

From the root of the repository (a stopped run continues):

    python -m benchmarks.accuracy --rows all --methods all --participants 400 --seed 20260
    python -m benchmarks.realistic
    python -m benchmarks.resemblance
    python -m benchmarks.worlds.make WORLD --protocol doublets  # in an environment with mujoco
    python -m benchmarks.worlds WORLD RESULTS

`--list` lists the rows; `--page-only` only writes this page and its files.
"""


def page_of(summaries: Sequence[Summary], method: str, figures: Sequence[str], tables: Path) -> str:
    """Return the page as Markdown.

    Parameters
    ----------
    summaries : sequence of dict
        Of the rows, in order.
    method : str
        Method that the targets are for.
    figures : sequence of str
        Rows with a drawn rank histogram.
    tables : Path
        Folder of the tables, which holds those of realistic people if these have been run.
    """
    if not summaries:
        return "\n".join([_INTRODUCTION, "No row has been run yet.\n"])
    parts = [
        _INTRODUCTION,
        realistic_text(tables),
        _overview([s for s in summaries if s["row"] in MAIN_ROWS], method),
        _ranks_text(figures, method),
        foreign_text(tables),
        planning_text(tables),
        resemblance_text(tables),
        _LIMITS,
        _targets_text(summaries, method),
        _FILES,
        _RERUN,
    ]
    return "\n".join(filter(None, parts))


def tables_of(summaries: Sequence[Summary], method: str) -> dict[str, pd.DataFrame]:
    """Return the tables that the page links to, by the name of their file.

    Parameters
    ----------
    summaries : sequence of dict
        Of the rows, in order.
    method : str
        Method that the targets are for.
    """
    scores = {_file_name(summary): _scores_table(summary) for summary in summaries}
    overall = [
        table[table["timing_point"] == ALL].assign(
            **{name: summary[name] for name in ("row", "title", "participants", "seed")},
            pulses_per_point=summary["pulses_per_point"],
            misfit=summary["misfit"],
        )
        for summary, table in zip(summaries, scores.values(), strict=True)
    ]
    targets = [
        {"row": summary["row"], "method": method, "target": text, "met": met}
        for summary in summaries
        for text, met in verdicts(summary, method)
    ]
    ranks = [_rank_entry(summary, r) for summary in summaries for r in summary["ranks"]]
    named = {"rows": pd.concat(overall) if overall else pd.DataFrame()}
    named |= {"targets": pd.DataFrame(targets), "ranks": pd.DataFrame(ranks)}
    return scores | {f"accuracy-{name}.csv": table for name, table in named.items()}


def write_tables(summaries: Sequence[Summary], method: str, folder: Path) -> None:
    """Write the tables that the page links to.

    Parameters
    ----------
    summaries : sequence of dict
        Of the rows, in order.
    method : str
        Method that the targets are for.
    folder : Path
        Where.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for name, table in tables_of(summaries, method).items():
        table.to_csv(folder / name, index=False, float_format="%.5g")


def _scores_table(summary: Summary) -> pd.DataFrame:
    table = pd.json_normalize(summary["scores"])
    return table.assign(seconds=table["method"].map(summary["seconds"]))


def _rank_entry(summary: Summary, ranks: dict[str, Any]) -> dict[str, Any]:
    """Return one line of the table of ranks; the counts of its bins are one cell."""
    counts = ranks["counts"]
    return {
        "row": summary["row"],
        **{name: ranks[name] for name in ("method", "parameter")},
        "cells": sum(counts),
        **{name: ranks[name] for name in ("n_effective", "ks", "ks_limit", "chi2_p")},
        "counts": " ".join(str(n) for n in counts),
    }


def draw_ranks(summary: Summary, method: str, path: Path) -> bool:
    """Draw the rank histograms of a method in a row; tell whether there was anything to draw.

    Parameters
    ----------
    summary : dict
        Of a row.
    method : str
        Which method.
    path : Path
        SVG to write.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    ranks = {r["parameter"]: r for r in summary["ranks"] if r["method"] == method}
    if not ranks:
        return False
    with mpl.rc_context({"svg.hashsalt": "jointz", "svg.fonttype": "none"}):
        figure = Figure(figsize=(8.0, 2.4), layout="constrained")
        for axes, (name, found) in zip(
            figure.subplots(1, len(ranks), squeeze=False)[0], ranks.items(), strict=True
        ):
            counts = found["counts"]
            axes.bar([(k + 0.5) / BINS for k in range(BINS)], counts, 0.95 / BINS, color="#4477aa")
            axes.axhline(sum(counts) / BINS, color="black", linewidth=1.0)
            axes.set_title(name)
            axes.set_xlabel("place of the truth")
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, metadata={"Date": None})
    return True


def _overview(summaries: Sequence[Summary], method: str) -> str:
    head = ["people and recordings", "RMSE %", "coverage", "not available %", "file"]
    lines = []
    for summary in summaries:
        mine = _overall(summary, method)
        lines.append(
            [
                _title(summary),
                _slashed([s.rmse_pct for s in mine], ".0f"),
                _slashed([s.coverage.rate for s in mine], ".2f"),
                _slashed([s.undecided_pct + s.failed_pct for s in mine], ".0f"),
                _download("csv", summary),
            ]
        )
    several = {summary["participants"] for summary in summaries}
    people = " or ".join(str(n) for n in sorted(several, reverse=True))
    said = (
        f"K / B / J over all timing points; {people} people per row. The lag is known to 0.5 ms "
        "unless a row says otherwise.\n"
    )
    former = _FORMER if method in FORMER_METHODS else ""
    return f"## Errors of {_named(method)}\n\n{former}{said}\n{_table(head, lines)}\n"


def _ranks_text(figures: Sequence[str], method: str) -> str:
    if not figures:
        return ""
    shown = figures[0]
    return (
        f"The figure shows the rank of the truth in the posterior of `{method}` (row `{shown}`): "
        "flat if intervals are right, U-shaped if too narrow, peaked if too wide.\n\n"
        f"![rank histograms](images/accuracy-{shown}.svg)\n"
    )


def _targets_text(summaries: Sequence[Summary], method: str) -> str:
    judged = any(verdicts(summary, method) for summary in summaries)
    return _TARGETS.format(method=_named(method)) if judged else ""


def _named(method: str) -> str:
    return f"the former `{method}`" if method in FORMER_METHODS else f"`{method}`"


def _file_name(summary: Summary) -> str:
    return f"accuracy-{summary['row']}.csv"


def _title(summary: Summary) -> str:
    """Return the title of a row without the usual knowledge of the lag, which the page states."""
    return str(summary["title"]).replace(_USUAL_LAG, "")


def _download(text: str, summary: Summary) -> str:
    return f"{{download}}`{text} <tables/{_file_name(summary)}>`"


def _overall(summary: Summary, method: str) -> list[Score]:
    scores = [Score.from_dict(s) for s in summary["scores"]]
    mine = {s.parameter: s for s in scores if s.method == method and s.timing_point == ALL}
    return [mine[name] for name in PARAMETERS if name in mine]


def _table(head: Sequence[str], lines: Sequence[Sequence[Any]]) -> str:
    rows = [head, ["---"] * len(head), *lines]
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def _slashed(values: Sequence[float | None], form: str) -> str:
    return " / ".join("-" if v is None else format(v, form) for v in values) or "-"
