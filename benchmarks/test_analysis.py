"""A whole study's analysis beside reading its files with pandas, and its memory.

Ten participants of 28 min at 1 kHz as csv, made once by the demo's simulation.
pandas from 3.1 on parses a file on all cores when it is given its name, and on one
when it is given an open file; the table shows both, and says where the target of
three reads is met.
The two sides take turns, each in a process of its own, so that both see the
same noise of the machine and the peak memory is that of the job alone. With
``--benchmark-disable`` a small study runs once and no figure is asserted.
"""

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

import pytest
from benchmarks.figures import Figures, Peer, at_most, of_package

#: How long the analysis may take, in times of reading the same files with pandas.
MOST_READS = 3.0
#: How much memory ten participants may take, in times of one.
MOST_GROWTH = 1.2
N_TURNS = 3

_READ = """
import sys, pandas
for file in sys.argv[1:]:
    pandas.read_csv(file)
"""
_READ_ON_ONE_CORE = """
import sys, pandas
for file in sys.argv[1:]:
    with open(file) as opened:
        pandas.read_csv(opened)
"""
_ANALYZE = """
import sys
from pathlib import Path
from jointz.analysis.analyze import analyze
from jointz.analysis.results_folder import write_results
write_results(analyze(sys.argv[1], method="dissertation"), Path(sys.argv[2]), overwrite=True)
"""
_PEAK = """
status = open('/proc/self/status').read()
print('peak', status.split('VmHWM:')[1].split()[0])
"""


def run(code: str, *arguments: object) -> tuple[float, float]:
    """Return seconds and peak megabytes of a Python program."""
    start = perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", code + _PEAK, *map(str, arguments)],
        check=True,
        capture_output=True,
        text=True,
    )
    seconds = perf_counter() - start
    peak = re.search(r"peak (\d+)", done.stdout)
    assert peak is not None
    return seconds, int(peak.group(1)) / 1024


@pytest.fixture(scope="module")
def studies(
    quick: bool, tmp_path_factory: pytest.TempPathFactory, csv_study: Callable[..., None]
) -> Path:
    """A study of ten participants and one of the first of them."""
    root = tmp_path_factory.mktemp("benchmark")
    people, pulses, rate_hz = (2, 3, 500.0) if quick else (10, 50, 1000.0)
    for name, count in (("many", people), ("one", 1)):
        folder = root / name / "study"
        folder.parent.mkdir()
        csv_study(folder, people=count, strides=60, pulses=pulses, seed=1, rate_hz=rate_hz)
    return root


@pytest.mark.slow
def test_whole_analysis_beside_reading_the_files(
    studies: Path, quick: bool, figures: Figures
) -> None:
    files = sorted((studies / "many" / "study").glob("*.csv"))
    out = studies / "results"
    run(_ANALYZE, studies / "one" / "study", out)  # compiles, and warms the page cache
    turns = [
        (
            run(_READ, *files),
            run(_READ_ON_ONE_CORE, *files),
            run(_ANALYZE, studies / "many" / "study", out),
        )
        for _ in range(1 if quick else N_TURNS)
    ]
    one = run(_ANALYZE, studies / "one" / "study", out)
    read_s, slow_read_s, ours_s = (
        min(seconds for seconds, _ in side) for side in zip(*turns, strict=True)
    )
    peak_mb = turns[0][2][1]
    size_mb = sum(f.stat().st_size for f in files) / 1e6
    print(f"\n{len(files)} files, {size_mb:.0f} MB; whole processes, report included")
    print(f"jointz analyze            {ours_s:6.1f} s {peak_mb:6.0f} MB")
    print(
        f"one participant           {one[0]:6.1f} s {one[1]:6.0f} MB  growth {peak_mb / one[1]:.2f}"
    )
    what = f"`jointz analyze`, {len(files) // 2} participants, {size_mb:.0f} MB of csv"
    for name, seconds in (("read_csv(name)", read_s), ("read_csv(open file)", slow_read_s)):
        peer = of_package(name, "pandas")
        figures.beside(f"{what}: time", peer, (ours_s, seconds), "s", asked=at_most(MOST_READS))
        ratio = ours_s / seconds
        verdict = "met" if ratio <= MOST_READS else "not met"
        print(f"pandas {name:<19}{seconds:6.1f} s            ratio {ratio:.2f} ({verdict})")
    growth = (peak_mb, one[1])
    figures.beside(
        f"{what}: memory", Peer("one participant"), growth, "MB", asked=at_most(MOST_GROWTH)
    )
    if quick:
        return
    assert peak_mb / one[1] <= MOST_GROWTH
