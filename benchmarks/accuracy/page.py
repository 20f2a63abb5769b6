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

#: Rows with a drawn rank histogram: inside the model class, and outside.
RANK_ROWS = ("inside", "nominal-lag-0.5ms", "hard-lag-unknown", "anthropometric")
#: Rows in the table of the page; all others are links.
MAIN_ROWS = (
    "nominal-lag-unknown",
    "nominal-lag-0.5ms",
    "nominal-10-pulses",
    "three-pulses",
    "nominal-varying-inertia",
    "nominal-smooth",
    "hard-lag-0.5ms",
    "hard-lag-unknown",
    "tissue",
    "reflex-velocity-30ms",
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
errors; `hard` people have larger errors (friction model 30 % off, more noise, goniometer up to
20 ms late); `anthropometric` people have the inertia of shank and foot (0.1 to 0.5 kg\\*m^2) and a
device strapped to skin and muscle. Pulses start at the true gait phase, without the real-time loop.

How far the knee is from the best linear prediction 50 / 100 / 150 ms after a phase (SD, median over
timing points): 0.3 / 0.9 / 1.4 degrees in one recorded walker at 0.8 m/s, 1.4 to 2.0 / 1.9 to 3.1 /
2.3 to 3.4 in a second whose inertial sensors drop samples (an upper limit); simulated `nominal`
0.1 / 0.4 / 0.9, `hard` 0.2 / 0.6 / 1.3, `realistic` 0.2 to 0.4 / 0.8 to 1.3 / 1.4 to 2.3. Two
walkers are weak evidence: `realistic` draws the size for each person. Its mean stride, moved to
level and slope, errs more than in the first walker. Goniometer noise comes on top
({download}`csv <tables/unpredictability.csv>`).

- **Truth**: K (with gravity), B and J, averaged over pulses and, weighted by information, over the
  100 ms after the onset. A J common to all timing points is compared with the mean true J.
- **RMSE**: root mean square of estimate / truth - 1 over decided estimates (status `ok` or
  `at_bound`). True values of zero count only in coverage and in the RMSE in SI units.
- **Coverage**: share of 95 % intervals that contain the truth; 0.95 is right, less is
  overconfident.
- **Undecided**: estimates without a value. RMSE and coverage describe only the others.
"""
_STRAPPED = """(accuracy-anthropometric)=
## Devices strapped to the leg

Rigid coupling is wrong for a strapped leg (former `rigid`): for `anthropometric` people almost all
K and B are undecided and the others wrong (K 47 % too low). With a strap, the default, use short
pulses or doublets:

| people | pulses | decided % K / B / J | RMSE % K / B / J |
| --- | --- | --- | --- |
| 6 of another simulator | doublets of 75 + 75 ms, window 0.2 s | 89 / 56 / 100 | 16 / 11 / 8 |
| the same | 60 ms, two sizes, both signs, window 0.15 s | 94 / 58 / 100 | 10 / 21 / 5 |
| the same | hold pulses of 250 ms | 0 / 0 / 100 | - / - / 9 |

[Realistic people](#accuracy-realistic) are above. `anthropometric` ones have an inertia that
changes without the momentum that goes with it ([why that matters](leg-model.md)): B comes out too
high by the rate of J there. With a goniometer alone B is 5 to 13 % too high in every world that was
tried; intervals of B include 8 % (SD) for this. A wrong torque gain scales K, B and J unnoticed.
More: [estimator](estimator.md).
"""
_LIMITS = """(accuracy-hard-lag-unknown)=
## Where the estimates are wrong

| condition | effect | remedy |
| --- | --- | --- |
| large errors, lag unknown (`hard`) | 95 % of J undecided; six of ten other intervals contain the truth | measure the lag; without it do not use J |
| velocity reflex of 30 % of K after 30 ms | K 10 % off; coverage of K and B 0.89 | pulses of both directions ([refusals](refusals.md)) |
| K and B change over the cycle (smooth row) | RMSE of K doubles; intervals widen accordingly | none needed: coverage holds |
| at most 10 pulses per timing point | intervals widen; a quarter of K is undecided with 3 pulses, over half with 1 | more pulses |
| K near zero in swing | errors in % are meaningless | read the RMSE in SI units |
| friction 30 %, gain 3 % or torsion 0.5 deg off | RMSE grows by under 0.5 percentage points | - |

For comparison, `dissertation` has an RMSE of 25 to 153 % and a coverage of 0.13 to 0.66 here.
"""  # noqa: E501
_TARGETS = """## Targets that are not met

{met} of {n} targets of `{method}` are met
({{download}}`all targets <tables/accuracy-targets.csv>`). The others:

- **Coverage above its band** in `nominal` and `hard` rows: intervals are 10 to 20 % too wide,
  because they allow for reflexes and varying inertia that these people lack. In people as varied
  as the priors assume (last row of the table) coverage is right. The band is the central 95 % of
  a rate of 0.95, with the number of estimates divided by the design effect of people (at least 1).
- **RMSE of B** where the target is below, or within 4 % of, the bound.
- **J, `hard`, lag unknown**, and **K, B and J of `anthropometric`**: see above.
- **Coverage under a velocity reflex after 30 ms**: 0.885 and 0.891 instead of 0.90.

The bound is the Bayesian Cramer-Rao bound for true joint and sensor models, the best linear
prediction of unperturbed motion, the lab's knowledge of lag, gains and friction, and priors of K
and B with an SD of 100 %. Methods with narrower priors may be below it. It ignores changes of K
and B in the window: where these are large (smooth over phase) the misfit, chi-squared per sample
of the mean response around that joint, is above 1 and the bound too low.
"""
_FILES = """## All figures

- {download}`accuracy-rows.csv <tables/accuracy-rows.csv>`: every row, method and parameter over
  all timing points, with people, seed, pulses per timing point and misfit.
- {download}`accuracy-ranks.csv <tables/accuracy-ranks.csv>`: rank histograms: number of
  estimates (`cells`), effective number, Kolmogorov-Smirnov distance and its 95 % limit, p of
  chi-squared, counts.
- The csv of a row: every method, parameter and timing point.

| column | meaning |
| --- | --- |
| `method`, `parameter`, `timing_point` | `all` is all timing points |
| `n` | estimates |
| `undecided_pct`, `failed_pct` | without a value |
| `bias_pct`, `rmse_pct` | mean and root mean square of estimate / truth - 1 |
| `rmse` | the same, in SI units |
| `width_pct` | median width of the interval, % of the truth |
| `zero_width`, `one_sided_pct` | intervals of width 0; values `at_bound` |
| `bound_pct`, `ratio` | Cramer-Rao bound; RMSE over it |
| `coverage.rate`, `.low`, `.high` | coverage and its band |
| `coverage.design_effect` | for estimates of the same person |
| `seconds` | median analysis time per person, without reading |
"""
_RERUN = """## Run it again

From the root of the repository (a stopped run continues):

    python -m benchmarks.accuracy --rows all --methods all --participants 400 --seed 20260

`--list` lists the rows; `--page-only` only writes this page and its files. Realistic people and
the comparison with the dissertation:

    python -m benchmarks.realistic
    python -m benchmarks.resemblance
    python -m benchmarks.worlds.make WORLD --protocol doublets  # in an environment with mujoco
    python -m benchmarks.worlds WORLD RESULTS
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
    rest = [s for s in summaries if s["row"] not in MAIN_ROWS]
    parts = [
        _INTRODUCTION,
        realistic_text(tables),
        _overview([s for s in summaries if s["row"] in MAIN_ROWS], method),
        _ranks_text(figures, method),
        _STRAPPED,
        foreign_text(tables),
        planning_text(tables),
        resemblance_text(tables),
        _LIMITS,
        _targets_text(summaries, method),
        _FILES,
        f"Other rows: {', '.join(_download(_title(s), s) for s in rest)}.\n" if rest else "",
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
    head = ["people and recordings", "RMSE %", "coverage", "undecided %", "file"]
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
    return f"## Errors of `{method}`\n\n{said}\n{_table(head, lines)}\n"


def _ranks_text(figures: Sequence[str], method: str) -> str:
    if not figures:
        return ""
    shown, *others = figures
    links = ", ".join(f"[{row}](images/accuracy-{row}.svg)" for row in others)
    more = f" Others: {links}." if links else ""
    return (
        f"Rank of the truth in the posterior of `{method}` (row `{shown}`): flat if intervals are "
        "right, U-shaped if too narrow, peaked if too wide."
        f"{more}\n\n![rank histograms](images/accuracy-{shown}.svg)\n"
    )


def _targets_text(summaries: Sequence[Summary], method: str) -> str:
    results = [met for summary in summaries for _, met in verdicts(summary, method)]
    if not results:
        return ""
    return _TARGETS.format(met=sum(results), n=len(results), method=method)


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
