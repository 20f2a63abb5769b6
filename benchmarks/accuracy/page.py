"""The page of the documentation, made from the summaries of rows."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.accuracy.ranks import BINS
from benchmarks.accuracy.rows import PARAMETERS
from benchmarks.accuracy.scores import ALL, Score
from benchmarks.accuracy.summaries import Summary, verdicts

from jointz.core.gait_phases import TIMING_POINTS

#: Rows whose rank histograms stand on the page: inside the model class, and outside.
RANK_ROWS = ("inside", "nominal-lag-0.5ms", "hard-lag-unknown", "anthropometric")
_SYMBOLS = {"stiffness": "K", "damping": "B", "inertia": "J"}
_INTRODUCTION = """<!-- Generated from benchmarks/accuracy/page.py -->
# Accuracy

What every method makes of simulated people whose impedance is known. The simulation and the
methods share no code for the joint. Rerun it, from the root of the repository, with

    python -m benchmarks.accuracy --rows all --methods all --participants 400 --seed 20260

Each participant walks 60 strides without and then with pulses of 17 N\\*m x 250 ms, which are fired
from the true gait phase, without the real-time loop; the recordings are analysed as a study's are,
and the lab knows what the row says. Stopped runs go on where they were.

- **Truth** of K (apparent: gravity of limb and device included), B and J is the
  information-weighted mean over the 100 ms behind the onset, averaged over the pulses. An inertia
  of all timing points is compared with the mean of theirs, and, in the table of timing points,
  with each.
- **Bias and RMSE** are mean and root mean square of estimate / truth - 1 over decided cells
  (status `ok` or `at_bound`). Cells with a true zero count only in the coverage and the RMSE in SI
  units, which the CSV beside each row has.
- **Coverage** is the share of decided cells whose 95 % interval holds the truth; beside it the
  central 95 % band of a rate of 0.95. Cells of one participant share errors (lag, gains), so the
  band is that of cells / design effect, the design effect being the variance of the rate as a ratio
  of participants' sums over the binomial variance, at least 1.
- **Bound** is the Bayesian Cramer-Rao bound of the same cells: true joint, right sensor, the best
  linear prediction of the unperturbed motion, what the lab knows of lag, gains and friction, K
  and B known to 100 % beforehand. Where pulses decide little, a method with narrower priors may
  pass below it.
  Its joint, sensor and noise are those of the rig where the mean response of the pulses leaves a
  chi-squared of 1 per sample about it; K and B that change inside the window (smooth over phase)
  are not in it, and raise that figure.
- **Width** is the median width of the interval, % of truth; **time** the median of a participant's
  analysis, reading excluded.

Where a figure asked for is not met:

- **Coverage above its band** in the nominal rows. In the row that draws K, B and J as widely as the
  priors do (the last one) it is 0.95: the intervals are right for such people. Those of the
  nominal rig are more alike than that and have neither reflex nor inertia that changes, which the
  intervals allow for, so that they come out 10 to 20 % wider than these people need. To fit
  them to this rig would make them too narrow for others.
- **RMSE of damping** asked below, or within 4 % of, the bound of the right model.
- **Inertia, hard, lag unknown**: 95 % of cells are withheld. Those that stand are the ones whose
  interval came out narrow by chance or error, and hold the truth in six of ten: without a
  measured lag do not use an inertia of such recordings.
- **Reflex of velocity at 30 ms**: nearest to what K and B do themselves; 0.885 and 0.891 instead of
  0.90.

"""


def page_of(summaries: Sequence[Summary], method: str, figures: Sequence[str]) -> str:
    """Return the page as Markdown.

    Parameters
    ----------
    summaries : sequence of dict
        Of the rows, in order.
    method : str
        That the targets are asked of.
    figures : sequence of str
        Rows with a drawn rank histogram.
    """
    parts = [_INTRODUCTION]
    if not summaries:
        return "\n".join([*parts, "No row has been run yet.\n"])
    parts.append(_overview(summaries, method))
    parts += [_row_section(summary, method, summary["row"] in figures) for summary in summaries]
    return "\n".join(parts)


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
    head = [
        "row",
        "people",
        "RMSE % K / B / J",
        "bound % K / B / J",
        "coverage K / B / J",
        "undecided %",
        "met",
    ]
    lines = []
    for summary in summaries:
        mine = _overall(summary, method)
        asked = verdicts(summary, method)
        lines.append(
            [
                f"[{summary['title']}](#{_label(summary)})",
                str(summary["participants"]),
                _slashed([s.rmse_pct for s in mine]),
                _slashed(list(summary["bound_pct"].values())),
                _slashed([s.coverage.rate for s in mine], ".3f"),
                _shown(max((s.undecided_pct + s.failed_pct for s in mine), default=None)),
                _met(asked),
            ]
        )
    return f"## `{method}`, every row\n\n{_table(head, lines)}\n"


def _met(asked: Sequence[tuple[str, bool]]) -> str:
    if not asked:
        return "-"
    n = sum(met for _, met in asked)
    return "yes" if n == len(asked) else f"{n} of {len(asked)}"


def _row_section(summary: Summary, method: str, has_figure: bool) -> str:  # noqa: FBT001
    participants, seed = summary["participants"], summary["seed"]
    parts = [
        f"({_label(summary)})=\n## {summary['title']}\n",
        f"`--rows {summary['row']}`, {participants} participants, seed {seed}, "
        f"{summary['pulses_per_point']} pulse(s) a timing point. Chi-squared per sample of the "
        f"mean response about the bound's own joint: {_shown(summary['misfit'], '.2f')}.\n",
    ]
    asked = verdicts(summary, method)
    if asked:
        parts.append(f"Asked of `{method}`:\n")
        parts.append(
            "\n".join(f"- {text}: {'met' if met else '**not met**'}" for text, met in asked)
        )
        parts.append("")
    parts += [_methods_table(summary), _points_table(summary)]
    if has_figure:
        parts.append(_ranks_text(summary, method))
    return "\n".join(parts)


def _methods_table(summary: Summary) -> str:
    head = [
        "method",
        "",
        "bias %",
        "RMSE %",
        "coverage (band)",
        "width %",
        "undecided %",
        "failed %",
    ]
    head += ["zero width", "bound %", "RMSE / bound", "time s"]
    lines = []
    for method in _methods(summary):
        seconds = summary["seconds"].get(method)
        for s in _overall(summary, method):
            c = s.coverage
            band = "-" if c.rate is None else f"{c.rate:.3f} ({c.low:.3f}-{c.high:.3f})"
            lines.append(
                [
                    f"`{method}`",
                    _SYMBOLS[s.parameter],
                    _shown(s.bias_pct, "+.1f"),
                    _shown(s.rmse_pct),
                    band,
                    _shown(s.width_pct),
                    _shown(s.undecided_pct),
                    _shown(s.failed_pct),
                    str(s.zero_width),
                    _shown(s.bound_pct),
                    _shown(s.ratio, ".2f"),
                    _shown(seconds, ".2f"),
                ]
            )
    return _table(head, lines) + "\n"


def _points_table(summary: Summary) -> str:
    scores = [Score.from_dict(s) for s in summary["scores"]]
    found = {(s.method, s.parameter, s.timing_point): s for s in scores}
    lines = [
        [
            f"`{method}`",
            _SYMBOLS[parameter],
            *[_point(found.get((method, parameter, point))) for point in TIMING_POINTS],
        ]
        for method in _methods(summary)
        for parameter in PARAMETERS
    ]
    said = "At each timing point: RMSE % (bias) / coverage / width % / undecided %\n\n"
    return said + _table(["method", "", *TIMING_POINTS], lines) + "\n"


def _point(s: Score | None) -> str:
    if s is None:
        return "-"
    bias, rate = _shown(s.bias_pct, "+.1f"), _shown(s.coverage.rate, ".2f")
    width, undecided = _shown(s.width_pct, ".0f"), _shown(s.undecided_pct, ".0f")
    return f"{_shown(s.rmse_pct)} ({bias}) / {rate} / {width} / {undecided}"


def _ranks_text(summary: Summary, method: str) -> str:
    ranks = [r for r in summary["ranks"] if r["method"] == method]
    lines = [
        [
            _SYMBOLS[r["parameter"]],
            f"{sum(r['counts'])}",
            f"{r['n_effective']:.0f}",
            f"{r['ks']:.3f}",
            f"{r['ks_limit']:.3f}",
            f"{r['chi2_p']:.3g}",
        ]
        for r in ranks
    ]
    head = ["", "cells", "effective", "KS distance", "95 % of uniform samples below", "chi2 p"]
    return (
        f"Where the truth stands in the intervals of `{method}`; flat where it knows its errors, "
        "a hollow where it claims too much, a hill where too little:\n\n"
        f"![rank histograms](images/accuracy-{summary['row']}.svg)\n\n{_table(head, lines)}\n"
    )


def _label(summary: Summary) -> str:
    """Return what links lead to; a dot would end it."""
    return "accuracy-" + str(summary["row"]).replace(".", "-")


def _methods(summary: Summary) -> list[str]:
    return list(dict.fromkeys(s["method"] for s in summary["scores"]))


def _overall(summary: Summary, method: str) -> list[Score]:
    scores = [Score.from_dict(s) for s in summary["scores"]]
    mine = {s.parameter: s for s in scores if s.method == method and s.timing_point == ALL}
    return [mine[name] for name in PARAMETERS if name in mine]


def _table(head: Sequence[str], lines: Sequence[Sequence[Any]]) -> str:
    rows = [head, ["---"] * len(head), *lines]
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def _slashed(values: Sequence[float | None], form: str = ".1f") -> str:
    return " / ".join(_shown(value, form) for value in values) or "-"


def _shown(value: float | None, form: str = ".1f") -> str:
    return "-" if value is None else format(value, form)
