"""Studies drawn from the pool: their means and differences beside those of the pool."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial

import numpy as np
import pandas as pd
from benchmarks.kept import Entry

from jointz.core.gait_phases import TIMING_POINTS
from jointz.results.estimates import CellEstimate
from jointz.results.log_posterior import LogPosterior
from jointz.stats.comparison import paired_difference
from jointz.stats.people_likelihoods import PeopleResults, Place
from jointz.stats.people_together import together
from jointz.stats.population import people_means
from jointz.tasks.engine import Task, done_in_turn
from jointz.tasks.open_engine import open_engine

PARAMETERS = ("stiffness", "damping", "inertia")
MEAN, PAIRED, GROUPS, T_TEST = "mean", "paired", "groups", "t test"
Row = dict[str, object]
#: Condition -> everybody of the pool, by number.
Pool = Mapping[str, Sequence[Entry]]


def results_of(entries: Sequence[Entry]) -> PeopleResults:
    """Return what an analysis of these people found."""
    return PeopleResults(
        posteriors=[LogPosterior.from_dict(p) for entry in entries for p in entry["posteriors"]],
        cells=[CellEstimate.from_dict(c) for entry in entries for c in entry["cells"]],
        masses_kg={entry["cells"][0]["participant"]: entry["mass_kg"] for entry in entries},
    )


def pool_truth(entries: Sequence[Entry]) -> dict[Place, float]:
    """Return the mean of every parameter at every timing point over the whole pool."""
    return {
        (point, name): float(np.mean([entry["truth"][point][name] for entry in entries]))
        for point in TIMING_POINTS
        for name in PARAMETERS
    }


def studies(pool: Pool, *, draws: int, size: int, seed: int, workers: int) -> pd.DataFrame:
    """Draw studies and hold means and differences against the pool: one row a value."""
    rng = np.random.default_rng(seed)
    people = len(next(iter(pool.values())))
    chosen = [rng.choice(people, size=2 * size, replace=False) for _ in range(draws)]
    tasks = [
        Task(f"study {k}", partial(study_rows, pool, own[:size], own[size:]))
        for k, own in enumerate(chosen)
    ]
    rows: list[Row] = []
    with open_engine(workers=workers, tasks=draws, needs=__name__) as engine:
        for k, done in enumerate(done_in_turn(engine, tasks)):
            rows += [{"study": k, **row} for row in done.result()]
    return pd.DataFrame(rows)


def study_rows(pool: Pool, people: Sequence[int], others: Sequence[int]) -> list[Row]:
    """Return the rows of one study: means, paired differences, and of two groups."""
    usual, stiffer = pool.values()
    truths = [pool_truth(entries) for entries in (usual, stiffer)]
    own = [usual[i] for i in people]
    again, strangers = [stiffer[i] for i in people], [stiffer[i] for i in others]
    return [
        *_means(own, truths[0]),
        *_differences(PAIRED, own, again, truths),
        *_differences(GROUPS, own, strangers, truths),
        *_t_tests(own, again, truths),
    ]


def _means(entries: Sequence[Entry], truth: Mapping[Place, float]) -> Iterator[Row]:
    means = people_means(results_of(entries))
    for place, true in truth.items():
        mean = means.get(place)
        given = mean is not None and mean.decided
        found = (mean.value, mean.ci_low, mean.ci_high) if mean and given else None
        yield _row(MEAN, place, found, true=true, per=true)


def _differences(
    what: str,
    first: Sequence[Entry],
    second: Sequence[Entry],
    truths: Sequence[Mapping[Place, float]],
) -> Iterator[Row]:
    """Yield second minus first, relative to the first."""
    people = together(
        [results_of(first), results_of(second)], PARAMETERS, same_people=what == PAIRED
    )
    for place, usual in truths[0].items():
        difference = people.difference((1, place), (0, place)) if people else None
        found, p = None, 1.0
        if difference is not None and difference.decided:
            found = (difference.value, difference.ci_low, difference.ci_high)
            p = difference.p
        yield _row(what, place, found, true=truths[1][place] - usual, per=usual, p=p)


def _t_tests(
    first: Sequence[Entry], second: Sequence[Entry], truths: Sequence[Mapping[Place, float]]
) -> Iterator[Row]:
    """Yield the paired t test over the people with a value in both."""
    values = [_values(entries) for entries in (first, second)]
    for place, usual in truths[0].items():
        both = [p for p in values[0][place] if p in values[1][place]]
        found, p = None, 1.0
        if len(both) > 1:
            pair = [np.array([own[place][p] for p in both]) for own in values[::-1]]
            test = paired_difference(*pair)
            found, p = (test.difference, test.ci_low, test.ci_high), test.p
        yield _row(T_TEST, place, found, true=truths[1][place] - usual, per=usual, p=p)


def _row(
    what: str,
    place: Place,
    found: tuple[float, float, float] | None,
    *,
    true: float,
    per: float,
    p: float | None = None,
) -> Row:
    """Return a row: value and interval, if given, beside the truth, as shares of ``per``."""
    row: Row = {
        "what": what,
        "timing_point": place[0],
        "parameter": place[1],
        "given": found is not None,
        "held": None,
        "error": None,
        "half_width": None,
        "significant": None if p is None else bool(found and p < 0.05 and found[0] > 0.0),
    }
    if found is None:
        return row
    value, low, high = found
    return row | {
        "held": low <= true <= high,
        "error": (value - true) / per,
        "half_width": (high - low) / 2.0 / per,
    }


def _values(entries: Sequence[Entry]) -> dict[Place, dict[str, float]]:
    found: dict[Place, dict[str, float]] = {
        (point, name): {} for point in TIMING_POINTS for name in PARAMETERS
    }
    for cell in (CellEstimate.from_dict(c) for entry in entries for c in entry["cells"]):
        for name in PARAMETERS:
            parameter = cell.parameter(name)
            if parameter is not None and parameter.value is not None:
                found[cell.timing_point, name][cell.participant] = parameter.value
    return found


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Return share given, coverage, bias, RMSE and half-width, by what and parameter."""
    found = []
    for (what, parameter), group in rows.groupby(["what", "parameter"], sort=False):
        given = group[group["given"]]
        found.append({
            "what": what,
            "parameter": parameter,
            "given": len(given) / len(group),
            "coverage": float(given["held"].astype(float).mean()),
            "bias_pct": 100.0 * given["error"].mean(),
            "rmse_pct": 100.0 * float(np.sqrt((given["error"].astype(float) ** 2).mean())),
            "half_width_pct": 100.0 * given["half_width"].median(),
            "power": None if what == MEAN else group["significant"].astype(float).mean(),
        })  # fmt: skip
    return pd.DataFrame(found)
