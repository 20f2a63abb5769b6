"""Studies of the benchmark: recorded worlds A, B and C, simulated presets, and their analysis."""

import json
import os
import re
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.accuracy.people import cell_truth
from benchmarks.real_legs.scores import Row, Truths, rows_of

import jointz

_ROOT = Path(__file__).parents[2]
_CONDITION = "perturbed"
_WINDOW = re.compile(r"^window_s\s*=.*$", re.MULTILINE)
#: Bootstrap resamples. Few, because only values and intervals of the method are scored.
_RESAMPLES = 10


@dataclass(frozen=True, slots=True)
class World:
    """A study whose truth is known.

    Parameters
    ----------
    name : str
        Study or preset, as tables show it.
    folder : Path
        The study, for :func:`jointz.analyze`.
    window_s : float, s
        Window of the analysis.
    truths : mapping
        Participant -> timing point -> parameter -> true value.
    """

    name: str
    folder: Path
    window_s: float
    truths: Truths


@dataclass(frozen=True, slots=True)
class WorldResult:
    """Rows of an analysed study, and what the analysis cost."""

    world: World
    rows: list[Row]
    cpu_s: float  # of the whole analysis
    median_cpu_s: float  # over the participants
    notes: list[str]  # of participants whose analysis ended with an error, among others


def real_legs_folder() -> Path:
    """Return where the recorded worlds are expected: beside the project, or beside its data."""
    data = Path(os.environ.get("JOINTZ_DATA") or _ROOT.parent / "shared" / "data")
    return (data / ".." / "real_legs").resolve()


def point_truth(point: Mapping[str, Any], window_s: float) -> dict[str, float]:
    """Return the truths of one timing point of ``truth.json``.

    Parameters
    ----------
    point : mapping
        The timing point of a participant.
    window_s : float, s
        Window of the analysis.

    Raises
    ------
    ValueError
        If the file has no truth for this window.
    """
    key = f"{window_s:g}"
    if key not in point["windows"]:
        known = ", ".join(point["windows"])
        raise ValueError(f"window: truth.json has {known} s; got {key}. Choose one of them.")
    window = point["windows"][key]
    return {
        "stiffness": window["K_secant"],
        "damping": window["B_mean"],
        "inertia": point["J"],
        "stiffness_onset": point["K_onset"],
        "damping_onset": point["B_onset"],
    }


def recorded_truths(folder: Path, study: str, window_s: float) -> Truths:
    """Return the truths of a recorded world.

    Parameters
    ----------
    folder : Path
        Holds ``truth.json``.
    study : str
        ``A``, ``B`` or ``C``.
    window_s : float, s
        Window of the analysis.
    """
    people = json.loads((folder / "truth.json").read_text())["studies"][study]
    return {
        person: {name: point_truth(point, window_s) for name, point in points.items()}
        for person, points in people.items()
    }


def simulated_truths(study: Path) -> Truths:
    """Return the truths of a study that jointz simulated: means over the pulses of a point.

    Parameters
    ----------
    study : Path
        Its folder.
    """
    people = json.loads((study / "ground_truth.json").read_text())["participants"]
    return {person: cell_truth(truth[_CONDITION]) for person, truth in people.items()}


def copy_with_window(study: Path, window_s: float, into: Path) -> Path:
    """Return a copy of a study with another window; its recordings are links.

    Parameters
    ----------
    study : Path
        The study's folder.
    window_s : float, s
        Window of the copy.
    into : Path
        Folder to make.

    Raises
    ------
    ValueError
        If study.toml does not give its window in one line.
    """
    text, count = _WINDOW.subn(f"window_s = {window_s:g}", (study / "study.toml").read_text())
    if count != 1:
        raise ValueError(f"{study / 'study.toml'}: expected one line window_s = ..., found {count}")
    into.mkdir(parents=True)
    for file in study.iterdir():
        if file.name != "study.toml":
            (into / file.name).symlink_to(file.resolve())
    (into / "study.toml").write_text(text)
    return into


def recorded_world(folder: Path, study: str, window_s: float | None, scratch: Path) -> World:
    """Return a recorded world, with its own window or another one.

    Parameters
    ----------
    folder : Path
        Holds the worlds and ``truth.json``.
    study : str
        ``A``, ``B`` or ``C``.
    window_s : float, s, or None
        Window of the analysis; the study's own by default.
    scratch : Path
        Folder for a copy.
    """
    source = folder / study
    own = _window_of(source)
    window = own if window_s is None else window_s
    truths = recorded_truths(folder, study, window)
    used = source if window == own else copy_with_window(source, window, scratch / study)
    return World(study, used, window, truths)


def simulated_world(preset: str, *, people: int, seed: int, workers: int, scratch: Path) -> World:
    """Simulate a walking study of a preset and return it with its truth.

    Parameters
    ----------
    preset : str
        Preset of the simulation, for example ``nominal``.
    people, seed : int
        Number of participants, and seed of the simulation.
    workers : int
        Participants simulated at once; results do not depend on it.
    scratch : Path
        Folder for the study.
    """
    study = scratch / preset
    jointz.run(
        "walking",
        device="sim",
        preset=preset,
        participants=people,
        seed=seed,
        out=study,
        workers=min(workers, people),
        progress=False,
    )
    return World(preset, study, _window_of(study), simulated_truths(study))


def _window_of(study: Path) -> float:
    return float(jointz.open_study(study).spec.perturbations.window_s)


def analyzed(world: World, method: str) -> WorldResult:
    """Analyse a study in this process and return its rows and the CPU time.

    Parameters
    ----------
    world : World
        The study and its truth.
    method : str
        Name of the method.
    """
    analyze = jointz.analyze  # imports it, which is not part of the analysis
    marks: list[float] = []
    start = time.process_time()
    analysis = analyze(
        world.folder,
        method=method,
        resamples=_RESAMPLES,
        seed=0,
        progress=lambda *_: marks.append(time.process_time()),
    )
    return WorldResult(
        world,
        rows_of(world.name, analysis.cells, world.truths),
        cpu_s=time.process_time() - start,
        median_cpu_s=float(np.median(np.diff(marks))),
        notes=list(analysis.statistics["notes"]),
    )
