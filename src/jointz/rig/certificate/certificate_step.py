"""The certificate of an analysed study."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from jointz.analysis.saved_analysis import Analysis
from jointz.analysis.study_protocol import study_protocol
from jointz.core.errors import DataError, EngineError, EstimationError, OutputError
from jointz.core.grouping import by_key
from jointz.core.method_names import BAYESIAN
from jointz.core.study import Study
from jointz.results.certificate_result import (
    PARAMETERS,
    STATISTICS,
    Certificate,
    ComparedStatistic,
    expected_errors,
)
from jointz.results.estimates import CellEstimate
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
        (method != BAYESIAN, f"this is {method}. Choose the method {BAYESIAN}"),
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
    return list(by_key((cell.label, cell) for cell in cells).values())


#: Simulated people that a comparison needs.
FEWEST_PEOPLE = 4
#: Share of studies from the simulated world that are said to differ, over all statistics.
_LEVEL = 0.05
_DRAWS = 20000
#: People differ at least so much: sd of the logarithm, and of the arcsine of a share.
_LEAST_SD, _LEAST_SD_OF_SHARE = 0.1, 0.1
_SHARE = "without_value_pct"
_SMALLEST = 1e-6


def person_statistics(cells: Sequence[CellEstimate]) -> dict[str, float]:
    """Return the statistics of one person's timing points: medians; NaN where there is none."""
    rows = [_cell_statistics(cell) for cell in cells]
    estimates = [cell.parameter(name) for cell in cells for name in PARAMETERS]
    missing = [row is None or not row.available for row in estimates]
    statistics = {_SHARE: 100.0 * float(np.mean(missing))} if missing else {}
    for name in STATISTICS:
        if name != _SHARE:
            values = np.array([row.get(name, np.nan) for row in rows])
            known = values[np.isfinite(values) & (values > 0.0)]
            statistics[name] = float(np.median(known)) if known.size else float("nan")
    return statistics


def compared_statistics(
    study: Sequence[Mapping[str, float]], simulated: Sequence[Mapping[str, float]], *, seed: int
) -> tuple[ComparedStatistic, ...]:
    """Compare medians over the study's people with those of equally many simulated people.

    Logarithms (of shares: arcsines of the root) of people are normal; mean and SD of the simulated
    people are known as far as so many tell, which the limits include.
    """
    pairs = {
        name: tuple(
            np.array([row[name] for row in rows if np.isfinite(row.get(name, np.nan))])
            for rows in (study, simulated)
        )
        for name in STATISTICS
    }
    usable = {n: p for n, p in pairs.items() if p[0].size and p[1].size >= FEWEST_PEOPLE}
    return tuple(
        _compared(name, *pair, level=_LEVEL / len(usable), rng=np.random.default_rng([seed, k]))
        for k, (name, pair) in enumerate(usable.items())
    )


def _compared(
    name: str, own: np.ndarray, simulated: np.ndarray, *, level: float, rng: np.random.Generator
) -> ComparedStatistic:
    values, n = _straight(name, simulated), simulated.size
    least = _LEAST_SD_OF_SHARE if name == _SHARE else _LEAST_SD
    sd = max(float(values.std(ddof=1)), least)
    # Mean and SD of people of whom n were drawn, and medians of new people.
    sds = sd * np.sqrt((n - 1) / rng.chisquare(n - 1, _DRAWS))
    means = values.mean() + sds / np.sqrt(n) * rng.standard_normal(_DRAWS)
    people = means[:, None] + sds[:, None] * rng.standard_normal((_DRAWS, own.size))
    limits = np.quantile(np.median(people, axis=1), [level / 2.0, 1.0 - level / 2.0])
    low, high = _back(name, limits)
    return ComparedStatistic(
        name, float(np.median(own)), float(np.median(simulated)), float(low), float(high)
    )


def _straight(name: str, values: np.ndarray) -> np.ndarray:
    if name == _SHARE:
        return np.asarray(np.arcsin(np.sqrt(values / 100.0)))
    return np.asarray(np.log(np.maximum(values, _SMALLEST)))


def _back(name: str, values: np.ndarray) -> np.ndarray:
    if name == _SHARE:
        return np.asarray(100.0 * np.sin(values.clip(0.0, np.pi / 2.0)) ** 2)
    return np.asarray(np.exp(values))


def _cell_statistics(cell: CellEstimate) -> dict[str, float]:
    statistics = {}
    if cell.vaf_pct is not None:
        statistics["unexplained_pct"] = max(100.0 - cell.vaf_pct, 0.01)
    if cell.displacement_rad is not None:
        statistics["displacement_deg"] = float(np.degrees(cell.displacement_rad))
    stiffness, damping, inertia = (_centre(cell, name) for name in PARAMETERS)
    if stiffness > 0.0 and inertia > 0.0:
        statistics["natural_frequency_hz"] = float(np.sqrt(stiffness / inertia) / (2.0 * np.pi))
        statistics["damping_ratio"] = float(damping / (2.0 * np.sqrt(stiffness * inertia)))
    response, example = cell.response, cell.example
    if response is None or example is None:
        return statistics
    one = np.interp(response.time_s, example.time_s, example.response) - response.angle
    noise = float(np.sqrt(np.mean(one**2)))
    statistics["unpredictability_deg"] = float(np.degrees(noise))
    if response.fitted_angle is not None and noise > 0.0:
        left = float(np.sqrt(np.nanmean((response.angle - response.fitted_angle) ** 2)))
        statistics["misfit"] = left / noise * np.sqrt(example.n_averaged)
    return statistics


def _centre(cell: CellEstimate, name: str) -> float:
    """Return the value, or the centre of the interval of an undecided estimate; else NaN."""
    row = cell.parameter(name)
    if row is None:
        return float("nan")
    if row.value is not None:
        return row.value
    low, high = row.ci_low, row.ci_high
    return float(np.sqrt(low * high)) if low and high and low > 0.0 else float("nan")
