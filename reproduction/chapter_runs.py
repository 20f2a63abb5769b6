"""Simulated studies of a chapter, as many at once as there are cores."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from jointz.io.protocols import load_protocol
from jointz.rig.session.run import TRUTH_FILE, run
from jointz.tasks.engine import Task, done_in_turn
from jointz.tasks.open_engine import open_engine
from jointz.tasks.progress import Progress


def in_processes(tasks: Sequence[Task[Any]], tell: Progress) -> Iterator[tuple[str, Any]]:
    """Yield name and result of every task."""
    tell(0, len(tasks), "")
    with open_engine(tasks=len(tasks), needs=__name__) as engine:
        for count, done in enumerate(done_in_turn(engine, tasks), start=1):
            yield done.name, done.result()
            tell(count, len(tasks), done.name)


def run_study(folder: str, protocol: str, seed: int, preset: str, *, load: str = "") -> Path:
    """Run a protocol, with one of its loads where one is named."""
    spec = load_protocol(protocol)
    if load:
        kept = tuple(item for item in spec.loads if item.name == load)
        spec = spec.model_copy(update={"loads": kept})
    study = Path(folder) / f"{protocol}-{load}"
    run(spec, out=study, seed=seed, preset=preset)
    return study


def study_truth(study: Path, participant: str) -> Any:
    """Return the true values of a load or person of a simulated study."""
    content = json.loads((study / TRUTH_FILE).read_text(encoding="utf-8"))
    return content["participants"][participant]
