"""Commands as a user types them, on simulated inputs, beside programs that do the same."""

import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from benchmarks.speed.cost import Cost, cost_of, least

#: `jointz analyze` of csv may take so many times the CPU time of reading the files with pandas.
MOST_READS = 4.0
_JOINTZ = str(Path(sys.executable).with_name("jointz"))

_READ = "import sys, pandas\nfor file in sys.argv[1:]: pandas.read_csv(file)"
_CONVERT = "import sys, pandas as pd; pd.read_csv(sys.argv[1]).to_xarray().to_netcdf(sys.argv[2])"
_MIXEDLM = """
import sys, pandas
from statsmodels.formula.api import mixedlm
print(mixedlm("y ~ level", pandas.read_csv(sys.argv[1]), groups="who").fit(reml=True).summary())
"""
_R_VERSIONS = """
shown <- function(name) paste(name, packageVersion(name))
cat(paste("R", getRversion()), shown("lmerTest"), shown("pbkrtest"), sep = ", ")
"""


@dataclass(frozen=True, slots=True)
class Peer:
    """Another program for the same work, as a command."""

    name: str
    command: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Command:
    """A command as typed, what it works on, and what it writes and must not be there before."""

    typed: str
    work: str
    out: str = ""
    peers: tuple[Peer, ...] = ()
    turns: int = 3
    most_cpu_ratio: float | None = None


@dataclass(frozen=True, slots=True)
class Measured:
    """What a command and its peers took."""

    command: Command
    cost: Cost
    peers: dict[str, Cost] = field(default_factory=dict)


def jointz(typed: str) -> list[str]:
    """Return the words of a command that starts with ``jointz``, for this environment's one."""
    return [_JOINTZ, *shlex.split(typed)[1:]]


def all_commands(folder: Path, *, quick: bool) -> list[Command]:
    """Return the commands; ``quick`` leaves out those that take minutes."""
    files = sorted((folder / "walkers-csv").glob("*.csv"))
    largest = max(files, key=lambda file: file.stat().st_size)
    size = f"{sum(file.stat().st_size for file in files) / 1e6:.0f} MB of csv"
    one = f"a csv of {largest.stat().st_size / 1e6:.0f} MB"
    people = len({file.name.split("_")[0] for file in files})
    walkers = f"{people} walker(s)"
    typed = f"jointz convert walkers-csv/{largest.name} walk.nc"
    protocol = "walking.toml" if quick else "walking"
    fast = [
        Command("jointz --version", "nothing"),
        Command("jointz inspect walkers-csv", size, peers=(_pandas_reads(files),)),
        Command(typed, one, "walk.nc", (_pandas_converts(largest),)),
        Command(
            "jointz analyze walkers-csv --method dissertation --out results-csv",
            f"{walkers}, {size}",
            "results-csv",
            (_pandas_reads(files),),
            most_cpu_ratio=MOST_READS,
        ),
        Command("jointz analyze walkers --out results", walkers, "results"),
        Command(
            "jointz compare rows.csv --response y --within level --participant who",
            "60 rows",
            peers=(*_statsmodels(), *_r()),
        ),
        Command(
            "jointz identify joint knee.csv --angle knee --torque tau --time t", "60 s at 1 kHz"
        ),
        Command(
            f"jointz run {protocol} --participants 1 --seed 2 --out study", "1 walker", "study",
            turns=1,
        ),
    ]  # fmt: skip
    slow = [
        Command("jointz compare results --out means", walkers, "means"),
        Command("jointz plan walking_doublets --out plan", "one plan", "plan", turns=1),
        Command("jointz demo --quick --out demo", "2 walkers, 2 protocols", "demo", turns=1),
    ]
    return fast if quick else [*fast, *slow]


def _pandas_reads(files: Sequence[Path]) -> Peer:
    command = (sys.executable, "-c", _READ, *map(str, files))
    return Peer(f"read_csv alone (pandas {version('pandas')})", command)


def _pandas_converts(file: Path) -> Peer:
    name = f"read_csv, to_netcdf (pandas {version('pandas')}, xarray {version('xarray')})"
    return Peer(name, (sys.executable, "-c", _CONVERT, str(file), "pandas.nc"))


def _statsmodels() -> list[Peer]:
    if find_spec("statsmodels") is None:
        return []
    name = f"MixedLM, fit alone (statsmodels {version('statsmodels')})"
    return [Peer(name, (sys.executable, "-c", _MIXEDLM, "rows.csv"))]


def _r() -> list[Peer]:
    r = shutil.which("Rscript")
    if r is None:
        return []
    versions = subprocess.run([r, "-e", _R_VERSIONS], capture_output=True, check=False, text=True)
    if versions.returncode:
        return []
    return [Peer(f"lmer, anova, ranova ({versions.stdout.strip()})", (r, "rows.R"))]


def measure(command: Command, folder: Path, *, turns: int) -> Measured:
    """Run a command and its peers in turns; the shortest times count."""
    costs: list[list[Cost]] = []
    for _ in range(turns):
        _remove(folder / command.out if command.out else None)
        ours = cost_of(jointz(command.typed), folder)
        costs.append([ours, *(cost_of(peer.command, folder) for peer in command.peers)])
    first, *others = (least(side) for side in zip(*costs, strict=True))
    names = [peer.name for peer in command.peers]
    return Measured(command, first, dict(zip(names, others, strict=True)))


def _remove(path: Path | None) -> None:
    if path is not None and path.is_dir():
        shutil.rmtree(path)
    elif path is not None:
        path.unlink(missing_ok=True)
