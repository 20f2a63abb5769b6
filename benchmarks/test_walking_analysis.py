"""``jointz analyze`` on ten people who walked with 300 pulses each: the whole command.

The study is made once by ``jointz run walking`` on simulated people. The command, which gives
people and figures to processes of its own, and the same analysis in one process take turns, so
that both see the same noise of the machine. Seconds are printed beside what is asked of a quiet
machine of two cores; asserted is the ratio. With ``--benchmark-disable`` one participant with few
pulses is analysed once and no figure is asserted.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from time import perf_counter

import pytest
from benchmarks.figures import Figures, Peer, at_most

from jointz.io.protocols import load_protocol
from jointz.session.run import run as run_experiment

#: How long the command may take, in times of one process, where there are two cores or more.
MOST_OF_ONE_PROCESS = 0.75
#: Asked of the whole command, s.
ASKED_S = 8.0
N_TURNS = 3
PEOPLE, FEW_PULSES = 10, 10

_COMMAND = [sys.executable, "-m", "jointz", "analyze"]
_IN_ONE_PROCESS = """
import os, sys
os.environ["OPENBLAS_NUM_THREADS"] = "1"
from pathlib import Path
from jointz.analysis.analyze import analyze
from jointz.analysis.results_folder import write_results
write_results(analyze(sys.argv[1]), Path(sys.argv[3]))
"""


def seconds(command: list[str], study: Path, out: Path) -> float:
    """Return how long a command takes to analyse a study into a new folder."""
    shutil.rmtree(out, ignore_errors=True)
    start = perf_counter()
    subprocess.run([*command, str(study), "--out", str(out)], check=True, capture_output=True)
    return perf_counter() - start


@pytest.fixture(scope="module")
def study(quick: bool, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study of ten people by the walking protocol."""
    protocol = load_protocol("walking")
    if quick:
        few = [
            c.model_copy(
                update={
                    "perturbations": c.perturbations.model_copy(
                        update={"count_per_point": FEW_PULSES}
                    )
                }
            )
            if c.perturbations
            else c
            for c in protocol.conditions
        ]
        protocol = protocol.model_copy(update={"conditions": tuple(few)})
    return run_experiment(
        protocol,
        out=tmp_path_factory.mktemp("walking") / "study",
        seed=1,
        participants=1 if quick else PEOPLE,
        workers=os.cpu_count() or 1,
    ).study


@pytest.mark.slow
def test_the_command_beside_one_process(study: Path, quick: bool, figures: Figures) -> None:
    out = study.parent / "results"
    alone = [sys.executable, "-c", _IN_ONE_PROCESS]
    seconds(_COMMAND, study, out)  # compiles, and warms the page cache
    turns = [
        (seconds(_COMMAND, study, out), seconds(alone, study, out))
        for _ in range(1 if quick else N_TURNS)
    ]
    command_s, alone_s = (min(side) for side in zip(*turns, strict=True))
    cores = os.cpu_count() or 1
    verdict = "met" if command_s <= ASKED_S else "not met"
    print(f"\nwhole processes, report included, {cores} core(s)")
    print(f"jointz analyze  {command_s:6.1f} s, {ASKED_S:g} asked ({verdict})")
    print(f"in one process  {alone_s:6.1f} s, ratio {command_s / alone_s:.2f}")
    what = "`jointz analyze`, 1 walker, few pulses"
    if not quick:
        what = f"`jointz analyze`, {PEOPLE} walkers with 300 pulses each"
    figures.alone(what, command_s, "s", asked=at_most(ASKED_S))
    if cores > 1:
        asked, peer = at_most(MOST_OF_ONE_PROCESS), Peer("one process")
        figures.beside(what, peer, (command_s, alone_s), "s", asked=asked)
    if not quick and cores > 1:
        assert command_s <= MOST_OF_ONE_PROCESS * alone_s
