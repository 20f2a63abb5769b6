"""The certificate of an analysed study."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from jointz.analysis.saved_analysis import Analysis
from jointz.analysis.study_protocol import study_protocol
from jointz.core.errors import DataError, EngineError, EstimationError, OutputError
from jointz.core.method_names import BAYESIAN
from jointz.core.study import Study
from jointz.results.certificate_result import Certificate, expected_errors
from jointz.results.estimates import CellEstimate
from jointz.rig.certificate.compared_statistics import (
    compared_statistics,
    person_statistics,
)
from jointz.rig.certificate.virtual_people import (
    VirtualPerson,
    VirtualRequest,
    virtual_person,
    world_of,
)
from jointz.tasks.engine import Engine, Task, done_in_turn, on_one_thread
from jointz.tasks.task_store import TaskStore, task_key


def check_certifiable(study: Study, method: str) -> None:
    """Raise DataError if no simulated person can repeat the study."""
    spec = study.spec
    reasons = (
        (
            spec.kind != "walking",
            f'this is a study of kind "{spec.kind}". On a bench, measure loads of known '
            "impedance instead",
        ),
        (
            method != BAYESIAN,
            f"this is {method}. Choose the method {BAYESIAN}",
        ),
        (
            spec.joint != "knee",
            f"the simulated people have a knee only, and this is a study of the {spec.joint}",
        ),
        (
            spec.perturbations.source in ("angle", "reference"),
            "the simulated device gives pulses of torque, and perturbations.source is "
            f'"{spec.perturbations.source}"',
        ),
    )
    for unfit, why in reasons:
        if unfit:
            raise DataError(f"certify: a certificate is for pulses of torque in walking; {why}.")


def certificate_of(
    study: Study,
    analysis: Analysis,
    *,
    people: int,
    seed: int,
    engine: Engine,
    store: TaskStore | None = None,
    show: Callable[[int, str], None],
) -> Certificate:
    """Let simulated people walk the protocol of an analysed study; return the errors to expect.

    ``show`` is called with the number of people done and what comes next.
    """
    coupling = str(analysis.settings["coupling"])
    protocol = study_protocol(study, analysis.pulses, analysis.strides)
    # Workers may have been started in another folder.
    at_root = replace(study, root=study.root.absolute())
    request = VirtualRequest(at_root, coupling, protocol, seed)
    tasks = (
        Task(
            f"simulated person {number + 1}",
            partial(on_one_thread, partial(virtual_person, request, number)),
            key=partial(_key, request, number),
        )
        for number in range(people)
    )
    done: list[VirtualPerson] = []
    left_out: dict[str, str] = {}
    show(0, "certificate")
    for number, task in enumerate(done_in_turn(engine, tasks, store=store), start=1):
        try:
            done.append(task.result())
        except (OutputError, EngineError):  # these concern all people
            raise
        except (DataError, EstimationError, ArithmeticError, ValueError) as exc:
            left_out[f"V{number:02d}"] = f"{type(exc).__name__}: {exc}"
        show(number, "certificate")
    if not done:
        raise DataError(
            f"certify: no simulated person has a result: {next(iter(left_out.values()))}"
        )
    own = [person_statistics(cells) for cells in _people(analysis.cells)]
    simulated = [person_statistics(person.cells) for person in done]
    estimates = tuple(row for person in done for row in person.estimates)
    return Certificate(
        method=str(analysis.settings["method"]),
        errors=expected_errors(estimates),
        estimates=estimates,
        n_participants=len(done),
        comparisons=compared_statistics(own, simulated, seed=seed),
        world=world_of(request.true_coupling).name,
        protocol=protocol.text,
        left_out=left_out,
        settings={"seed": seed, "window_s": study.spec.perturbations.window_s},
    )


def _key(request: VirtualRequest, number: int) -> str:
    settings = {
        "coupling": request.coupling,
        "seed": request.seed,
        "protocol": repr(request.protocol),
    }
    inputs = {"study.toml": request.study.sha256}
    return task_key(what=f"simulated person {number}", inputs=inputs, settings=settings)


def _people(cells: Sequence[CellEstimate]) -> list[list[CellEstimate]]:
    people: dict[str, list[CellEstimate]] = {}
    for cell in cells:
        people.setdefault(cell.label, []).append(cell)
    return list(people.values())
