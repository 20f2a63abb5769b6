"""Run all benchmarks and write the page: ``python -m benchmarks.gather``, from the root.

Four parts, each in a process of its own: the tests beside peers, few people (the growth with the
number of participants begins there), people on every engine, fits on every engine. What a part
measured is kept under ``build/benchmarks`` and taken again with ``--keep``, where the machine is
the same. ``--quick`` does little work and writes its page there too: it shows that everything
runs, and its figures mean nothing. Peers that are not installed are named on the page;
opensourceleg, which needs older packages, is looked for in ``.venv-osl`` (``make test-osl``), and
gives a fifth part.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from benchmarks.figures import SCHEMA, write_json
from benchmarks.growth_figure import draw_growth
from benchmarks.machine import commit, machine
from benchmarks.page import broken, growth, missed, page_of
from benchmarks.page_tables import write_tables

from jointz.core.provenance import now

_ROOT = Path(__file__).parents[1]
_KEPT = _ROOT / "build" / "benchmarks"
_PAGE = _ROOT / "docs" / "benchmarks.md"
_IMAGE = Path("images", "benchmarks-growth.svg")
_OSL = _ROOT / ".venv-osl" / "bin" / "python"
#: Longer than any benchmark takes on a slow machine, s.
_PATIENCE_S = 3600


@dataclass(frozen=True, slots=True)
class Part:
    """One part of the run.

    Parameters
    ----------
    name : str
        As on the command line.
    command : tuple of str
        What runs it; the file to write comes behind.
    """

    name: str
    command: tuple[str, ...]


def all_parts(*, quick: bool, osl: Path | None) -> list[Part]:
    """Return what there is to run.

    Parameters
    ----------
    quick : bool
        Whether little work is wanted.
    osl : pathlib.Path or None
        Python of an environment with opensourceleg.
    """
    parts = [Part("tests", _tests(sys.executable, quick=quick, ignore_loop=osl is not None))]
    if osl is not None:
        parts.append(Part("loop", _tests(str(osl), quick=quick, only_loop=True)))
    few, many = ((1,), (2,)) if quick else ((1, 10), (100, 1000))
    return [
        *parts,
        Part("growth", _scale("people", *few, engines=("processes",))),
        Part("engines", _scale("people", *many)),
        Part("fits", _scale("fits", 600 if quick else 100_000, engines=("processes", "dask"))),
    ]


def _tests(
    python: str, *, quick: bool, ignore_loop: bool = False, only_loop: bool = False
) -> tuple[str, ...]:
    loop = "benchmarks/test_loop.py"
    words = [python, "-m", "pytest", loop if only_loop else "benchmarks", "-q", "-s"]
    words.append(f"--timeout={_PATIENCE_S}")
    if ignore_loop:
        words.append(f"--ignore={loop}")
    if quick:
        words.append("--small")
        if not only_loop:  # opensourceleg's environment has no pytest-benchmark
            words += ["--benchmark-min-rounds=1", "--benchmark-max-time=0.05"]
    return (*words, "--figures")


def _scale(what: str, *counts: int, engines: Sequence[str] = ()) -> tuple[str, ...]:
    words = [sys.executable, "-m", "benchmarks.scale", what, "--counts", *map(str, counts)]
    if engines:
        words += ["--engines", *engines]
    return (*words, "--out")


def run_part(part: Part, kept: Path, *, load: float) -> dict[str, Any]:
    """Run a part, and keep what it measured; or return why it measured nothing.

    Parameters
    ----------
    part : Part
        Which.
    kept : pathlib.Path
        Folder of what is kept.
    load : float
        Of the machine before anything was run.
    """
    kept.mkdir(parents=True, exist_ok=True)
    raw, file = kept / f"{part.name}.partial", kept / f"{part.name}.json"
    for old in (raw, file):
        old.unlink(missing_ok=True)
    environment = {"OPENBLAS_NUM_THREADS": "1", **os.environ}
    made = _under_which(part) | {"load": load, "threads": environment["OPENBLAS_NUM_THREADS"]}
    print(f"\n== {part.name}", flush=True)
    start = perf_counter()
    ended = subprocess.run([*part.command, str(raw)], cwd=_ROOT, env=environment, check=False)
    if not raw.is_file():
        return made | {"found": None, "why": f"its process ended with status {ended.returncode}"}
    made |= {"seconds": perf_counter() - start, "found": json.loads(raw.read_text())}
    raw.unlink()
    write_json(made, file)
    return made


def _under_which(part: Part) -> dict[str, Any]:
    return {
        "schema": SCHEMA,
        "part": part.name,
        "machine": machine(),
        "commit": commit(_ROOT),
        "date": now(),
    }


def kept_part(part: Part, kept: Path) -> dict[str, Any] | None:
    """Return what a part measured earlier on this machine; None where there is nothing.

    Parameters
    ----------
    part : Part
        Which.
    kept : pathlib.Path
        Folder of what is kept.
    """
    file = kept / f"{part.name}.json"
    if not file.is_file():
        return None
    found: dict[str, Any] = json.loads(file.read_text())
    if found["schema"] != SCHEMA or found["machine"] != machine():
        print(f"{part.name}: kept from another machine or version, and measured again.")
        return None
    print(f"{part.name}: kept, of {found['date']}, commit {found['commit']}.")
    return found


def write_page(parts: Sequence[dict[str, Any]], page: Path, *, quick: bool) -> None:
    """Write the page, its figure and its tables.

    Parameters
    ----------
    parts : sequence of dict
        What the parts measured.
    page : pathlib.Path
        File to write; figure and tables go into ``images`` and ``tables`` beside it.
    quick : bool
        Whether little work was done, which the page then says.
    """
    grown = growth(parts)
    page.parent.mkdir(parents=True, exist_ok=True)
    if grown:
        draw_growth(grown, page.parent / _IMAGE)
    write_tables(parts, page.parent / "tables", quick=quick)
    image = _IMAGE.as_posix() if grown else ""
    page.write_text(page_of(parts, image=image, quick=quick), encoding="utf-8")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmarks and write the page; return 1 where something is not met, or broke.

    Parameters
    ----------
    arguments : sequence of str, optional
        Of the command line by default.
    """
    asked = _parser().parse_args(arguments)
    kept = asked.kept.resolve() / ("quick" if asked.quick else "")
    page = asked.page or (kept / "benchmarks.md" if asked.quick else _PAGE)
    load = round(os.getloadavg()[0], 1)
    parts = []
    for part in all_parts(quick=asked.quick, osl=_osl(asked.osl_python)):
        chosen = not asked.parts or part.name in asked.parts
        made = kept_part(part, kept) if asked.keep or not chosen else None
        if made is None and chosen:
            made = run_part(part, kept, load=load)
        if made is not None:
            parts.append(made)
    write_page(parts, page, quick=asked.quick)
    found = [f"BROKEN  {text}" for text in broken(parts)]
    if not asked.quick:
        found += [f"NOT MET {text}" for text in missed(parts)]
    print("\n".join(["", *found, f"Page: {page}"]))
    return 1 if found else 0


def _osl(python: Path) -> Path | None:
    """Return the Python that has opensourceleg, where there is one."""
    if shutil.which(python) is None:
        return None
    words = [str(python), "-c", "import pytest, pytest_timeout, opensourceleg, jointz"]
    found = subprocess.run(words, capture_output=True, check=False)
    return None if found.returncode else python


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.gather", description=__doc__)
    add = parser.add_argument
    names = [part.name for part in all_parts(quick=True, osl=_OSL)]
    add("--parts", nargs="+", choices=names, help="run these; of others, what was kept")
    add("--keep", action="store_true", help="take what was kept; run what is missing")
    add("--quick", action="store_true", help="little work: shows that it runs")
    add("--page", type=Path, help="page to write; docs/benchmarks.md, with --quick beside the rest")
    add("--kept", type=Path, default=_KEPT, help="folder of what the parts measured")
    add("--osl-python", type=Path, default=_OSL, help="Python that has opensourceleg")
    return parser


if __name__ == "__main__":
    sys.exit(main())
