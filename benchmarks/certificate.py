"""Does a certificate tell the truth? Simulated studies: RMSE it expects beside the true one.

Run as ``python -m benchmarks.certificate --studies 5 --participants 4 --seed 9000``. Each study
is a row of the accuracy benchmark, in turn, with people of its own seed. Printed are, for K, B
and J, the RMSE in % of truth of what the method rigid estimates, the RMSE the certificate
expects from the same recordings, and their ratio - for each row over all its studies, and over
all of them. The issue asks for a ratio between 0.75 and 1.25 over 100 studies of ten people.
"""

import argparse
import json
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.accuracy.people import cell_truth, settings_of, simulate
from benchmarks.accuracy.rows import PARAMETERS, Row, all_rows
from benchmarks.accuracy.runs import ESTIMATION, code_hash

from jointz.analysis.certify import evidence_of
from jointz.core.gait_phases import ALL_POINTS
from jointz.identify.appraisal.certificate_draws import Injection
from jointz.identify.appraisal.certificate_study import own_estimates, virtual_estimates
from jointz.results.certificate_result import VirtualEstimate, expected_errors
from jointz.tasks.engine import Task, done_in_turn
from jointz.tasks.open_engine import open_engine
from jointz.tasks.task_store import TaskStore, task_key

ROWS = ("nominal-lag-unknown", "nominal-lag-0.5ms", "hard-lag-0.5ms", "hard-lag-unknown")


def study(
    row: Row, *, participants: int, replicates: int, seed: int, planted_lag_s: float = 0.0
) -> dict[str, list[VirtualEstimate]]:
    """Simulate a study; return its estimates beside the truth, and its certificate's.

    Parameters
    ----------
    row : Row
        Rig, and what is known of it.
    participants, replicates : int
        People, and injections into each.
    seed : int
        Of people and injections.
    planted_lag_s : float, s
        Lag injected beyond the calibrated one, where that is not 0.
    """
    real: list[VirtualEstimate] = []
    virtual: list[VirtualEstimate] = []
    for number in range(participants):
        simulated = simulate(row, number, seed)
        person = simulated.rig.person.id
        settings = settings_of(row, simulated.rig, ["rigid"])
        explained = evidence_of(person, simulated.recordings, settings)
        if not explained:
            continue
        (evidence,) = explained
        truth = cell_truth(simulated.truth)
        real += [
            VirtualEstimate(
                participant=f"{seed} {person}",
                replicate=0,
                timing_point=label,
                parameter=p.name,
                truth=truth[label][p.name],
                value=p.value,
                ci_low=p.ci_low,
                ci_high=p.ci_high,
                status=p.status,
            )
            for label, rows in own_estimates(evidence).items()
            for p in rows
        ]
        known = evidence.known.angle_lag_s
        lag_s = known.value + planted_lag_s if known and planted_lag_s else None
        rng = np.random.default_rng([seed, number])
        for found in virtual_estimates(
            evidence, Injection(lag_s=lag_s), replicates=replicates, rng=rng
        ):
            virtual += found
    return {"real": real, "virtual": virtual}


def scored(estimates: Sequence[VirtualEstimate]) -> dict[str, dict[str, float]]:
    """Return RMSE and bias in %, share decided and coverage of K, B and J.

    Parameters
    ----------
    estimates : sequence of VirtualEstimate
        Estimates beside their truth.

    Notes
    -----
    By the rules of the certificate: a truth that is nearly nothing has no error in %.
    """
    overall = [e for e in expected_errors(estimates) if e.timing_point == ALL_POINTS]
    return {
        error.parameter: {
            "rmse": _number(error.rmse_pct),
            "bias": _number(error.bias_pct),
            "decided": 1.0 - error.undecided_pct / 100.0,
            "coverage": _number(error.coverage),
            "small": error.n_small / error.n,
        }
        for error in overall
    }


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


def report(results: Sequence[tuple[str, dict[str, list[VirtualEstimate]]]]) -> dict[str, Any]:
    """Print and return scores of each row and of all, and the ratio of the RMSEs.

    Parameters
    ----------
    results : sequence of (str, dict)
        Name of the row, and what :func:`study` returned.
    """
    out: dict[str, Any] = {}
    for name in [*dict.fromkeys(row for row, _ in results), "all"]:
        both = {
            kind: scored([e for row, r in results if name in (row, "all") for e in r[kind]])
            for kind in ("real", "virtual")
        }
        print(name)
        for p in PARAMETERS:
            true, expected = both["real"][p], both["virtual"][p]
            print(
                f"  {p:<10} true {true['rmse']:5.1f} % expected {expected['rmse']:5.1f} % ratio "
                f"{expected['rmse'] / true['rmse']:.2f} bias {true['bias']:+.1f} / "
                f"{expected['bias']:+.1f} % coverage {true['coverage']:.2f} / "
                f"{expected['coverage']:.2f} decided {true['decided']:.2f} / "
                f"{expected['decided']:.2f} small {expected['small']:.3f}"
            )
        out[name] = both
    return out


def _key(name: str, options: Mapping[str, Any]) -> str:
    settings = {"row": name, **options, "code": code_hash(ESTIMATION)}
    return task_key(what="certificate benchmark", inputs={}, settings=settings)


def _task(name: str, options: Mapping[str, Any]) -> Task[dict[str, list[VirtualEstimate]]]:
    call = partial(study, all_rows()[name], **options)
    return Task(name, call, key=partial(_key, name, options))


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the benchmark.

    Parameters
    ----------
    arguments : sequence of str, optional
        Of the command line.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--studies", type=int, default=100)
    parser.add_argument("--participants", type=int, default=10)
    parser.add_argument("--replicates", type=int, default=5)
    parser.add_argument("--seed", type=int, default=9000)
    parser.add_argument("--rows", nargs="+", default=list(ROWS))
    parser.add_argument("--planted-lag-s", type=float, default=0.0)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument(  # a name for what is kept; it lies in the user's cache folder
        "--cache", type=Path, default=Path(".accuracy-cache/certificate")
    )
    parser.add_argument("--out", type=Path)
    given = parser.parse_args(arguments)
    options = {
        "participants": given.participants,
        "replicates": given.replicates,
        "planted_lag_s": given.planted_lag_s,
    }
    tasks = [
        _task(given.rows[k % len(given.rows)], options | {"seed": given.seed + k})
        for k in range(given.studies)
    ]
    store = TaskStore(given.cache)
    with open_engine(workers=given.workers, tasks=len(tasks), needs=__name__) as engine:
        coming = done_in_turn(engine, tasks, store=store)
        scores = report([(done.name, done.result()) for done in coming])
    if given.out:
        given.out.write_text(json.dumps(scores, indent=1))
    return scores


if __name__ == "__main__":
    main()
