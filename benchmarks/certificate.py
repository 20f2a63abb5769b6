"""Does a certificate hold its promise? RMSE that it states beside the true one of the study.

Run as ``python -m benchmarks.certificate --worlds realistic nominal --studies 3 --participants 10``
for studies of simulated people of other seeds than the certificate's, or with ``--study FOLDER
--truth truth.json`` for a study from elsewhere, whose truth is participant -> timing point ->
``stiffness``, ``damping``, ``inertia``. Printed are, for K, B and J, the RMSE in % of truth that
is promised and that of the estimates, and their ratio; or that the certificate cannot promise.
"""

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.realistic.rows import ROWS

import jointz
from jointz.core.gait_phases import ALL_POINTS
from jointz.results.certificate_result import (
    PARAMETERS,
    Certificate,
    VirtualEstimate,
    expected_errors,
)
from jointz.results.estimates import CellEstimate
from jointz.rig.session.run import TRUTH_FILE
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.own_truth import cell_truth, own_truth
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import preset
from jointz.tasks.open_engine import open_engine

Truth = Mapping[str, Mapping[str, Mapping[str, float]]]
_WINDOW_S = 0.1
_RESAMPLES = 2


def promise(study: Path, truth: Truth, *, people: int, workers: int) -> dict[str, Any]:
    """Return what the certificate of a study states, and the true errors of its estimates."""
    with open_engine(workers=workers, tasks=people, needs="jointz.analysis.certify") as engine:
        analysis = jointz.analyze(
            study, resamples=_RESAMPLES, certify=people, engine=engine, progress=False
        )
    certificate = analysis.certificate
    if certificate is None:
        raise AssertionError("analyze(certify=...) makes a certificate")
    own = [row for cell in analysis.cells for row in beside_truth(cell, truth)]
    return {
        "status": certificate.status,
        "reasons": list(certificate.reasons),
        "parameters": compared(certificate, own),
        "statistics": certificate.comparison_frame().to_dict("records"),
    }


def beside_truth(cell: CellEstimate, truth: Truth) -> list[VirtualEstimate]:
    """Return K, B and J of a timing point of the study beside their truth."""
    true = truth.get(cell.participant, {}).get(cell.timing_point, {})
    found = [(true.get(name), cell.parameter(name)) for name in PARAMETERS]
    return [
        VirtualEstimate(
            cell.label, cell.timing_point, p.name, t, p.value, p.ci_low, p.ci_high, p.status
        )
        for t, p in found
        if t is not None and p is not None
    ]


def compared(
    certificate: Certificate, own: Sequence[VirtualEstimate]
) -> dict[str, dict[str, float | None]]:
    """Return RMSE (%), coverage and share undecided, as promised and as they are."""
    errors = {
        kind: {row.parameter: row for row in rows if row.timing_point == ALL_POINTS}
        for kind, rows in (("promised", certificate.errors), ("true", expected_errors(own)))
    }
    table: dict[str, dict[str, float | None]] = {}
    for name in PARAMETERS:
        row: dict[str, float | None] = {}
        for kind, found in errors.items():
            error = found.get(name)
            row[kind] = None if error is None else error.rmse_pct
            row[f"{kind} coverage"] = None if error is None else error.coverage
            row[f"{kind} undecided_pct"] = None if error is None else error.undecided_pct
        stated, true = row["promised"], row["true"]
        row["ratio"] = stated / true if stated and true else None
        table[name] = row
    return table


def simulated_study(
    folder: Path, world: str, *, participants: int, per_point: int, seed: int
) -> tuple[Path, Truth]:
    """Write a study of simulated people; return it and the truth of what its method estimates."""
    plan = replace(ROWS["b"].plan, per_point=per_point)
    settings = preset(world)
    people = [draw_person(number, seed=seed) for number in range(participants)]
    study = simulate_study(folder, preset=settings, participants=people, plan=plan)
    if settings.body is not None:
        return study, {p.id: own_truth(p, settings, plan, _WINDOW_S) for p in people}
    stated = json.loads((study / TRUTH_FILE).read_text())["participants"]
    return study, {person: cell_truth(walks["perturbed"]) for person, walks in stated.items()}


def apparent(truth: Truth) -> Truth:
    """Return truths whose stiffness includes that of gravity and of the moving leg, if stated."""
    beside = ("gravity_stiffness", "inertial_stiffness")
    return {
        person: {
            point: {**row, "stiffness": row["stiffness"] + sum(row.get(n, 0.0) for n in beside)}
            for point, row in points.items()
        }
        for person, points in truth.items()
    }


def report(name: str, result: Mapping[str, Any]) -> None:
    """Print one study."""
    print(f"{name}: {result['status']}")
    for reason in result["reasons"]:
        print(f"  {reason}")
    for parameter, row in result["parameters"].items():
        numbers = [f"{k} {v:.3g}" for k, v in row.items() if v is not None]
        print(f"  {parameter:<10} {', '.join(numbers)}", flush=True)


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", nargs="+", default=["realistic"])
    parser.add_argument("--studies", type=int, default=3)
    parser.add_argument("--participants", type=int, default=10)
    parser.add_argument("--per-point", type=int, default=50)
    parser.add_argument("--people", type=int, default=10, help="simulated by the certificate")
    parser.add_argument("--seed", type=int, default=9000)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--study", type=Path)
    parser.add_argument("--truth", type=Path)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args(arguments)
    options = {"people": given.people, "workers": given.workers}
    results: dict[str, Any] = {}
    if given.study is not None:
        if given.truth is None:
            parser.error("--study needs --truth")
        content = json.loads(given.truth.read_text())
        truth = apparent(content.get("participants", content))
        results[str(given.study)] = promise(given.study, truth, **options)
        report(str(given.study), results[str(given.study)])
    for world in given.worlds if given.study is None else ():
        for number in range(given.studies):
            name = f"{world} {number + 1}"
            with TemporaryDirectory(prefix="certificate_") as scratch:
                study, truth = simulated_study(
                    Path(scratch) / "study",
                    world,
                    participants=given.participants,
                    per_point=given.per_point,
                    seed=given.seed + number,
                )
                results[name] = promise(study, truth, **options)
            report(name, results[name])
    if given.out:
        given.out.write_text(json.dumps(results, indent=1))
    return results


if __name__ == "__main__":
    main()
