"""The benchmark of speed: costs of a process, the commands it types, and its page."""

import csv
import sys

import pytest
from benchmarks.speed import __main__ as speed
from benchmarks.speed.commands import Command, Measured
from benchmarks.speed.cost import Cost, Figure, cost_of
from benchmarks.speed.page import Run, write_page

READING = Command("jointz analyze csv --out r", "10 MB", "r", most_cpu_ratio=4.0)
ALONE = Command("jointz plan walking", "one plan", turns=1)


def a_run(*, cpu_s=3.0, load=0.1):
    reading = Measured(READING, Cost(2.0, cpu_s, 300.0), {"read_csv (pandas 3)": Cost(1, 1, 100)})
    return Run(
        commands=[reading, Measured(ALONE, Cost(20.0, 11.0, 1234.0))],
        kernels=[Figure("SPM", "ms", 0.5, "ttest (spm1d 0.4)", 5.0, 1.0)],
        absent=["mujoco"],
        machine="CPU, 2 core(s)",
        version="0.1.0",
        commit="abc",
        date="2026-01-01",
        load=load,
        minutes=9.0,
    )


def written(run, folder):
    write_page(run, folder / "page.md")
    with (folder / "tables" / "benchmarks.csv").open() as file:
        return (folder / "page.md").read_text(), list(csv.DictReader(file))


def test_cost_of_a_process_has_time_and_memory_of_its_own(tmp_path):
    cost = cost_of(
        [sys.executable, "-c", "x = bytearray(200_000_000); sum(range(10**6))"], tmp_path
    )

    assert 0.0 < cost.cpu_s < 60.0
    assert cost.peak_mb > 190.0  # not less than this process's


def test_a_command_that_fails_ends_the_run_with_its_message(tmp_path):
    with pytest.raises(RuntimeError, match="no such column"):
        cost_of([sys.executable, "-c", "raise SystemExit('no such column')"], tmp_path)


def test_the_page_has_a_row_for_each_command_beside_its_peer(tmp_path):
    page, rows = written(a_run(), tmp_path)

    assert "2 of 2 targets are met" in page
    assert (
        "| `jointz analyze csv --out r` | 10 MB | 2 | 3 | 300 | read_csv (pandas 3) "
        "| 1 | 1 | 3 | at most 4 |"
    ) in page
    assert "| `jointz plan walking` | one plan | 20 | 11 | 1,234 |" in page
    assert "| SPM | 0.5 ms | ttest (spm1d 0.4) | 5 ms | 10 | at least 1 |" in page
    assert "left out: mujoco" in page
    assert "busy" not in page
    assert [row["ratio"] for row in rows if row["quantity"] == "SPM"] == ["10"]
    assert len(rows) == 7


def test_a_missed_target_and_a_busy_machine_are_named(tmp_path):
    page, rows = written(a_run(cpu_s=5.0, load=3.0), tmp_path)

    assert "1 of 2 targets are met. Not met:" in page
    assert "- `jointz analyze csv --out r`: CPU time: 5.00 times that of read_csv" in page
    assert "busy with other work" in page
    assert sum(row["met"] == "False" for row in rows) == 1


@pytest.mark.slow
def test_all_commands_run(tmp_path):
    speed.main(["--quick", "--page", str(tmp_path / "page.md")])

    assert "| `jointz inspect walkers-csv` |" in (tmp_path / "page.md").read_text()
