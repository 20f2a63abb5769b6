"""Chapters of the dissertation again: every table and figure printed beside ours."""

import json
import multiprocessing
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jointz.core.provenance import now, software
from jointz.core.reproduction import Reproduction
from jointz.io.protocols import load_protocol
from jointz.report.chapter2_figures import draw_chapter2
from jointz.report.chapter3_figures import draw_chapter3
from jointz.report.chapter_page import render_chapter
from jointz.workflows import chapter2, chapter2_claims, chapter2_loads, chapter3, chapter3_stiffness
from jointz.workflows.mechanisms import Mechanism, mechanism_errors, mechanism_table, mechanisms
from jointz.workflows.results_folder import new_folder, write_marker
from jointz.workflows.run import TRUTH_FILE, run

MARKER = "provenance.json"
CHAPTERS = (2, 3)
_TITLES = {
    2: "The series-elastic exoskeleton on its bench",
    3: "The quasi-direct-drive actuator on its bench",
}

#: Called with tasks done, tasks in all, and what was done last.
Progress = Callable[[int, int, str], None]
Task = tuple[str, Callable[..., Any], tuple[Any, ...]]


@dataclass(frozen=True, slots=True)
class Chapter:
    """A chapter that was written.

    Parameters
    ----------
    page : pathlib.Path
        The page to open.
    reproduction : Reproduction
        Its numbers.
    """

    page: Path
    reproduction: Reproduction


def reproduce(
    chapters: Iterable[int],
    *,
    out: str | os.PathLike[str],
    seed: int = 1,
    preset: str = "nominal",
    overwrite: bool = False,
    progress: Progress | None = None,
) -> tuple[Chapter, ...]:
    """Run the simulated protocols of chapters and write their numbers beside the printed ones.

    Parameters
    ----------
    chapters : iterable of int
        Of :data:`CHAPTERS`.
    out : path
        A folder of its own for every chapter is made in it.
    seed : int
        Of the simulated benches.
    preset : str
        ``clean``, ``nominal`` or ``hard``.
    overwrite : bool
        Replace chapters that are there.
    progress : callable, optional
        Called with (tasks done, tasks in all, what was done last).

    Returns
    -------
    tuple of Chapter
        Pages and numbers.

    Raises
    ------
    OutputError
        When a folder exists and may not be replaced, or cannot be written.
    """
    tell = progress or (lambda _done, _total, _what: None)
    written = []
    for number in chapters:
        folder = Path(out) / f"chapter{number}"
        with new_folder(folder, marker=MARKER, overwrite=overwrite) as partial:
            made = _CHAPTERS[number](seed, preset, tell)
            _write(made, partial)
        written.append(Chapter(folder / f"chapter{number}.html", made))
    return tuple(written)


def _write(made: Reproduction, folder: Path) -> None:
    name = f"chapter{made.chapter}"
    (folder / "tables").mkdir()
    (folder / "figures").mkdir()
    frame = made.to_frame()
    for table, rows in frame.groupby("table", sort=False):
        rows.drop(columns="table").to_csv(folder / "tables" / f"{table}.csv", index=False)
    figures = _FIGURES[made.chapter](made.curves)
    for figure, svg in figures.items():
        (folder / "figures" / f"{figure}.svg").write_text(svg, encoding="utf-8")
    text = json.dumps(made.to_dict(), allow_nan=False)
    (folder / f"{name}.json").write_text(text, encoding="utf-8")
    (folder / f"{name}.html").write_text(render_chapter(made, figures), encoding="utf-8")
    write_marker(folder, MARKER, dict(made.provenance))


# --- chapter 2 -----------------------------------------------------------------------------------


def _chapter2(seed: int, preset: str, tell: Progress) -> Reproduction:
    loads = [load.name for load in load_protocol("sea-mass-spring").loads]
    with tempfile.TemporaryDirectory() as folder:
        tasks: list[Task] = [(load, _load, (folder, load, seed, preset)) for load in loads]
        tasks += [("bandwidth", _bandwidth, (folder, seed, preset))]
        tasks += [("intrinsic impedance", _intrinsic, (folder, seed, preset))]
        tasks += [(m.name, _mechanism, (m, seed)) for m in mechanisms()]
        done = dict(_in_processes(tasks, tell))
    found = {load: done[load] for load in loads}
    pairs = [pair for study in found.values() for pair in study.pairs]
    cases = [pair for pair in pairs if pair.case != "damper"]
    claims, notes = chapter2_claims.claim_tables(
        cases,
        [p for study in found.values() for p in study.single],
        [p for study in found.values() for p in study.recommended_single],
    )
    errors = {m.name: done[m.name] for m in mechanisms()}
    bandwidth_table, bandwidth_curves = done["bandwidth"]
    intrinsic_table, intrinsic_curves = done["intrinsic impedance"]
    return Reproduction(
        chapter=2,
        title=_TITLES[2],
        tables=(
            bandwidth_table,
            intrinsic_table,
            *chapter2_loads.error_tables(cases, found[loads[0]].torque_gain),
            chapter2_loads.vaf_table(found),
            claims,
            mechanism_table(errors),
            chapter2_loads.pair_table(pairs),
            chapter2_loads.other_devices(),
        ),
        curves={
            "bandwidth": bandwidth_curves,
            "intrinsic": intrinsic_curves,
            "loads": [pair._asdict() for pair in pairs],
            "mechanisms": [
                {
                    "mechanism": name,
                    "stiffness_pct": values["stiffness"],
                    "damping": values["damping"],
                    "inertia_pct": values["inertia"],
                }
                for name, values in errors.items()
            ],
        },
        notes=(
            "The bench is simulated: the numbers say what the method does on a machine like the "
            "dissertation's whose truth is known, not what the dissertation's machine did.",
            "The errors of the bench are one set of parameters, chosen before this comparison; "
            "docs/sea-bench.md tells the reason for each, and what was changed after a look.",
            *notes,
        ),
        provenance=_provenance(2, seed, preset),
    )


def _study(folder: str, protocol: str, seed: int, preset: str, *, load: str = "") -> Path:
    """Run a protocol, with one of its loads where one is named."""
    spec = load_protocol(protocol)
    if load:
        kept = tuple(one for one in spec.loads if one.name == load)
        spec = spec.model_copy(update={"loads": kept})
    study = Path(folder) / f"{protocol}-{load}"
    run(spec, out=study, seed=seed, preset=preset)
    return study


def _load(folder: str, load: str, seed: int, preset: str) -> chapter2_loads.LoadStudy:
    study = _study(folder, "sea-mass-spring", seed, preset, load=load)
    return chapter2_loads.analyze_load(study, load, _truth(study, load), seed)


def _bandwidth(folder: str, seed: int, preset: str) -> Any:
    return chapter2.bandwidth(_study(folder, "sea-bandwidth", seed, preset))


def _intrinsic(folder: str, seed: int, preset: str) -> Any:
    study = _study(folder, "sea-intrinsic", seed, preset)
    return chapter2.intrinsic(study, _truth(study, "free")["intrinsic"])


def _mechanism(mechanism: Mechanism, seed: int) -> dict[str, float]:
    return mechanism_errors(mechanism, seed=seed)


def _truth(study: Path, load: str) -> dict[str, Any]:
    content = json.loads((study / TRUTH_FILE).read_text(encoding="utf-8"))
    truth: dict[str, Any] = content["participants"][load]
    return truth


# --- chapter 3 -----------------------------------------------------------------------------------

_QDD = ("qdd-torque-speed", "qdd-chirp", "qdd-static", "qdd-dither", "qdd-perturbation")


def _chapter3(seed: int, preset: str, tell: Progress) -> Reproduction:
    with tempfile.TemporaryDirectory() as folder:
        tasks: list[Task] = [(name, _study, (folder, name, seed, preset)) for name in _QDD]
        studies: dict[str, Path] = dict(_in_processes(tasks, tell))
        truth = _truth(studies["qdd-static"], "springs")
        spring, gain_sd = truth["load"]["stiffness"], truth["errors"]["sensor_gain_sd"]
        models, model_curves, fit = chapter3.torque_models(
            chapter3.recorded(studies["qdd-torque-speed"]), _as_sensed(truth)
        )
        chirp, chirp_curves = chapter3.chirp(chapter3.recorded(studies["qdd-chirp"]), fit)
        static, static_curves = chapter3_stiffness.static_stiffness(
            chapter3.recorded(studies["qdd-static"]), fit, spring, gain_sd=gain_sd
        )
        dither = chapter3_stiffness.dither_stiffness(
            chapter3.recorded(studies["qdd-dither"]), fit, spring, gain_sd=gain_sd
        )
        by_sensor = dither.rows[0].dissertation or spring
        pulses, pulse_curves = chapter3_stiffness.perturbation(
            studies["qdd-perturbation"], by_sensor, spring
        )
    return Reproduction(
        chapter=3,
        title=_TITLES[3],
        tables=(models, chirp, static, dither, pulses, chapter3.other_devices()),
        curves={
            "torque_models": model_curves,
            "chirp": chirp_curves,
            "static": static_curves,
            "perturbation": pulse_curves,
        },
        notes=(
            "The bench is simulated: the numbers say what the method does on a machine like the "
            "dissertation's whose truth is known, not what the dissertation's machine did.",
            "docs/qdd-bench.md holds the reason for every constant of the bench.",
        ),
        provenance=_provenance(3, seed, preset),
    )


def _as_sensed(truth: Mapping[str, Any]) -> dict[str, float]:
    """Return the motor's constants as the torque sensor, with its gain, reads them."""
    machine, errors, gain = truth["machine"], truth["errors"], truth["sensor_gain"]
    constant = machine["torque_constant"] * (1.0 + errors["torque_constant_error"])
    return {
        "bias": errors["sensor_bias_nm"],
        "torque_constant": gain * constant,
        "coulomb_friction": gain * machine["coulomb_friction"],
        "gear_friction": gain * machine["gear_friction"],
        "rotor_inertia": gain * machine["rotor_inertia"],
    }


# --- common --------------------------------------------------------------------------------------


def _in_processes(tasks: list[Task], tell: Progress) -> Iterator[tuple[str, Any]]:
    """Yield name and result of every task, as many at once as there are cores."""
    context = multiprocessing.get_context("spawn")
    workers = min(len(tasks), os.cpu_count() or 1)
    tell(0, len(tasks), "")
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        names: dict[Future[Any], str] = {
            pool.submit(work, *arguments): name for name, work, arguments in tasks
        }
        try:
            for done, future in enumerate(as_completed(names), start=1):
                yield names[future], future.result()
                tell(done, len(tasks), names[future])
        finally:
            pool.shutdown(cancel_futures=True)


def _provenance(chapter: int, seed: int, preset: str) -> dict[str, Any]:
    return {
        **software(),
        "created": now(),
        "settings": {"chapter": chapter, "seed": seed, "preset": preset},
    }


_CHAPTERS: Mapping[int, Callable[[int, str, Progress], Reproduction]] = {
    2: _chapter2,
    3: _chapter3,
}
_FIGURES: Mapping[int, Callable[[Mapping[str, Any]], dict[str, str]]] = {
    2: draw_chapter2,
    3: draw_chapter3,
}
