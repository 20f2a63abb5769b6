"""Runs of all controllers, tests, people and seeds in the test bed."""

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from jointz.control.impedance_profile import GRID_PCT, ImpedanceProfile
from jointz.control.leg_body import HEIGHT_M
from jointz.control.testbed.bed_comparison import (
    INTACT,
    PUSHES,
    BedComparison,
    BedRun,
    BedTrace,
    bed_correlations,
    bed_means,
)
from jointz.control.testbed.bed_laws import OTHERS, REFERENCE, persons_laws
from jointz.control.testbed.knee_bed import LOAD_SHARE, KneeBed, knee_bed, walk_through
from jointz.control.testbed.scores import (
    PLAIN,
    SAMPLE_S,
    TESTS,
    drawn_walk,
    intact_angle,
    push_scores,
    run_scores,
)
from jointz.core.errors import DataError
from jointz.core.provenance import now, software
from jointz.tasks.progress import Progress

#: Strides and pushes of the traces.
_TRACED_PUSH, _TRACE_S = 2, 0.8

_Record = tuple[np.ndarray, np.ndarray]


def compare_controllers(
    profiles: Sequence[ImpedanceProfile],
    *,
    seeds: int = 3,
    seed: int = 1,
    height_m: float = HEIGHT_M,
    load_share: float = LOAD_SHARE,
    progress: Progress | None = None,
) -> BedComparison:
    """Compare controllers of a knee in the simulated walking of people.

    Parameters
    ----------
    profiles : sequence of ImpedanceProfile
        Knees with positive flexion, one a person. With two or more, the mean of the others is
        compared, too.
    seeds : int
        Runs of each person, controller and test.
    seed : int
        The same seed gives the same result.
    height_m : float, m
        Body height of all.
    load_share : float
        Part of the ground force's change of moment with the angle that acts on the knee, 0 to 1.
    progress : callable, optional
        Called with runs done, all runs, and whose come next.

    Returns
    -------
    BedComparison
        Scores, means with 95 % t intervals over people, paired differences, rank correlations.

    Raises
    ------
    DataError
        Without a profile, for one that is no knee with positive flexion, for two of one person,
        or for settings out of range.

    Notes
    -----
    See :mod:`jointz.control.testbed.knee_bed` for the model. Nothing is fitted to the result.
    """
    _check(profiles, seeds, seed)
    runs: list[BedRun] = []
    traces: tuple[BedTrace, ...] = ()
    for person, profile in enumerate(profiles):
        laws = persons_laws(profiles, person)
        beds = {
            speed: knee_bed(profile, height_m=height_m, speed=speed, load_share=load_share)
            for speed in {test.speed for test in TESTS.values()}
        }
        if person == 0:
            traces += (_intact(beds[1.0]),)
        for k, (name, nodes) in enumerate(laws.items()):
            if progress:
                done = person * len(laws) + k
                progress(done, len(profiles) * len(laws), f"{profile.subject}: {name}")
            for n in range(seeds):
                records = _records(beds, nodes, (seed, person, n))
                runs += _scored(beds, records, (profile.subject, name, n))
                if (person, n) == (0, 0):
                    traces += _traces(records, name)
    return BedComparison(
        participants=tuple(profile.subject for profile in profiles),
        runs=tuple(runs),
        means=bed_means(tuple(runs)),
        differences=bed_means(tuple(runs), REFERENCE),
        correlations=bed_correlations(tuple(runs)),
        traces=traces,
        settings={
            "seeds": seeds, "seed": seed, "height_m": height_m, "load_share": load_share,
            "reference": REFERENCE, "others": OTHERS if len(profiles) > 1 else None,
        },
        provenance={**software(), "created": now()},
    )  # fmt: skip


def _check(profiles: Sequence[ImpedanceProfile], seeds: int, seed: int) -> None:
    if not profiles:
        raise DataError("compare: no profile. Give files of jointz control profile.")
    if seeds < 1 or seed < 0:
        raise DataError(f"compare: expected seeds from 1 and seed from 0, got {seeds} and {seed}.")
    people = Counter(profile.subject.partition(",")[0] for profile in profiles)  # of all sides
    twice = [name for name, n in people.items() if n > 1]
    if twice:
        raise DataError(
            f"compare: several profiles of {', '.join(twice)}; each counts as a person. Leave one."
        )


def _records(
    beds: Mapping[float, KneeBed], nodes: np.ndarray, seed: tuple[int, ...]
) -> dict[str, _Record]:
    """Return recording and falls of each test."""
    return {
        name: walk_through(beds[test.speed], nodes, drawn_walk(test, beds[test.speed], seed))
        for name, test in TESTS.items()
    }


def _scored(
    beds: Mapping[float, KneeBed], records: Mapping[str, _Record], which: tuple[str, str, int]
) -> list[BedRun]:
    person, controller, seed = which
    runs = []
    for name, test in TESTS.items():
        scores = run_scores(beds[test.speed], *records[name])
        if test.push_at is not None:
            scores |= push_scores(records[name][0], records[PLAIN][0], test.push_at)
        finite = {key: value if np.isfinite(value) else None for key, value in scores.items()}
        runs.append(BedRun(person, controller, name, seed + 1, finite))
    return runs


def _intact(bed: KneeBed) -> BedTrace:
    grid = np.append(GRID_PCT, 100.0)
    return BedTrace(INTACT, PLAIN, grid, np.degrees(intact_angle(bed, 0.01 * grid)))


def _traces(records: Mapping[str, _Record], controller: str) -> tuple[BedTrace, ...]:
    """Return the mean angle over the cycle, and the deviation after a push."""
    plain = records[PLAIN][0]
    phase, angle = plain[:, 0], np.degrees(plain[:, 1])
    grid = np.append(GRID_PCT, 100.0)
    strides = [
        np.interp(grid, 100.0 * (phase[own] - n), angle[own])
        for n in range(int(phase.max()) + 1)
        if np.isfinite(angle[own := phase.astype(int) == n]).all()
    ]
    if strides:
        mean = np.mean(strides, axis=0)
    else:  # until it falls
        first = (phase < 1.0) & np.isfinite(angle)
        mean = np.interp(grid, 100.0 * phase[first], angle[first], right=np.nan)
    traces = [_until_it_falls(controller, PLAIN, grid, mean)]
    for name in PUSHES:
        begin = _TRACED_PUSH + (TESTS[name].push_at or 0.0)
        at = np.flatnonzero(phase >= begin)[: round(_TRACE_S / SAMPLE_S)]
        away = np.degrees(records[name][0][at, 1]) - angle[at]
        traces.append(_until_it_falls(controller, name, SAMPLE_S * np.arange(at.size), away))
    return tuple(traces)


def _until_it_falls(controller: str, test: str, x: np.ndarray, y: np.ndarray) -> BedTrace:
    whole = np.isfinite(y)
    end = y.size if whole.all() else int(np.argmin(whole))
    return BedTrace(controller, test, x[:end], y[:end])
