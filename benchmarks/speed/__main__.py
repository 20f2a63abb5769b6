"""Time the commands and their computations beside peers, and write docs/benchmarks.md.

Run from the root as ``python -m benchmarks.speed``. Peers that are not installed are named on the
page; opensourceleg, which needs older packages, is looked for in ``.venv-osl`` (``make test-osl``).
"""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from benchmarks.speed.commands import Measured, all_commands, measure
from benchmarks.speed.cost import Figure
from benchmarks.speed.machine import machine
from benchmarks.speed.page import Run, write_page

from jointz.core.provenance import now, software

_ROOT = Path(__file__).parents[2]
_OSL = _ROOT / ".venv-osl" / "bin" / "python"
#: Run by its path: another package calls itself ``benchmarks``.
_LOOP = Path(__file__).with_name("loop.py")
_BLOCKS, _TICKS = 6, 2000


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure everything and write the page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.speed", description=__doc__)
    parser.add_argument("--page", type=Path, default=_ROOT / "docs" / "benchmarks.md")
    parser.add_argument("--quick", action="store_true", help="little work: shows that it runs")
    settings = parser.parse_args(arguments)
    load, start = os.getloadavg()[0], perf_counter()
    with TemporaryDirectory() as name:
        commands, kernels = _measured(Path(name), quick=settings.quick)
    loop = _loop_figures(quick=settings.quick)
    packages = ("mujoco", "statsmodels", "spm1d")
    absent = [package for package in packages if find_spec(package) is None]
    absent += [] if loop else ["opensourceleg"]
    absent += [] if any("lmer" in peer for one in commands for peer in one.peers) else ["lmerTest"]
    versions = software()
    run = Run(
        commands=commands,
        kernels=[*kernels, *loop],
        absent=absent,
        machine=machine(),
        version=versions["jointz"],
        commit=_commit(),
        date=now()[:10],
        load=load,
        minutes=(perf_counter() - start) / 60,
    )
    write_page(run, settings.page)
    print(f"Page: {settings.page}, {run.minutes:.1f} min")


def _measured(folder: Path, *, quick: bool) -> tuple[list[Measured], list[Figure]]:
    with _announced("inputs"):
        words = [sys.executable, "-m", "benchmarks.speed.inputs", str(folder)]
        people, pulses = (1, 4) if quick else (3, 50)
        subprocess.run([*words, f"{people}", f"{pulses}"], cwd=_ROOT, check=True)
    commands = []
    for command in all_commands(folder, quick=quick):
        with _announced(command.typed):
            commands.append(measure(command, folder, turns=1 if quick else command.turns))
        print(f"  {commands[-1].cost}\n  {commands[-1].peers}")
    # Imported last: a process starts with the memory of the one that starts it.
    import pandas as pd
    from benchmarks.speed.kernels import kernel_figures

    with _announced("computations"):
        return commands, kernel_figures(pd.read_csv(folder / "rows.csv"), quick=quick)


@contextmanager
def _announced(what: str) -> Iterator[None]:
    start = perf_counter()
    print(f"== {what}", flush=True)
    yield
    print(f"  {perf_counter() - start:.1f} s in all", flush=True)


def _loop_figures(*, quick: bool) -> list[Figure]:
    """Return the period errors of the control loop; none without opensourceleg."""
    blocks, ticks = (1, 20) if quick else (_BLOCKS, _TICKS)
    words = ["-P", str(_LOOP), f"{blocks}", f"{ticks}"]
    if not _OSL.is_file():
        return []
    version = "from importlib.metadata import version; print(version('opensourceleg'))"
    found = [
        subprocess.run([_OSL, *one], cwd=_ROOT, capture_output=True, text=True, check=False)
        for one in (["-c", version], words)
    ]
    if any(one.returncode for one in found):
        print(found[-1].stderr)
        return []
    peer = f"SoftRealtimeLoop (opensourceleg {found[0].stdout.strip()})"
    return [
        Figure(f"control loop at {rate} Hz: period error, p99", "us", ours, peer, theirs)
        for rate, (ours, theirs) in json.loads(found[1].stdout.splitlines()[-1]).items()
    ]


def _commit() -> str:
    words = ["git", "-C", str(_ROOT), "rev-parse", "--short=12", "HEAD"]
    found = subprocess.run(words, capture_output=True, text=True, check=False)
    return found.stdout.strip() or "unknown"


if __name__ == "__main__":
    main()
