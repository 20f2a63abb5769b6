"""Fixtures that tests and benchmarks share."""

import os
import re
from collections.abc import Callable, Generator
from pathlib import Path

import pytest

import jointz
from jointz.io.protocols import load_protocol

pytest_plugins = ["tests.real_time"]


def write_csv_study(
    folder: Path, *, people: int, strides: int, pulses: int, seed: int, rate_hz: float = 500.0
) -> None:
    """Run the walking protocol on simulated people; write what a lab's logger would: plain csv."""
    # Packages beside opensourceleg have another ``benchmarks``.
    from benchmarks.speed.csv_copy import write_csv_copy

    whole = load_protocol("walking")
    unperturbed, perturbed = whole.conditions[-2:]
    few = perturbed.perturbations.model_copy(update={"count_per_point": pulses})
    protocol = whole.model_copy(
        update={
            "rates": whole.rates.model_copy(update={"control_hz": rate_hz, "sample_hz": rate_hz}),
            "conditions": (
                unperturbed.model_copy(update={"strides": strides}),
                perturbed.model_copy(update={"perturbations": few}),
            ),
        }
    )
    made = jointz.run(
        protocol, out=folder.with_name(folder.name + "_run"), preset="nominal",
        participants=people, seed=seed,
        workers=1 if people < 3 else 2,  # to start two takes longer than one person
    )  # fmt: skip
    write_csv_copy(made.study, folder)


#: Libraries, with blanks between: a test that would skip because one is absent fails.
_REQUIRED = os.environ.get("JOINTZ_REQUIRE", "").split()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Fail a test that skips for want of a library that must be there."""
    report = yield
    _no_skip(report)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Fail a module that skips for want of a library that must be there."""
    report = yield
    _no_skip(report)
    return report


def _no_skip(report: pytest.TestReport | pytest.CollectReport) -> None:
    told = str(report.longrepr)
    for name in _REQUIRED if report.skipped else ():
        if re.search(rf"could not import '{name}\b|\b{name} is not installed", told):
            report.outcome = "failed"
            report.longrepr = f"JOINTZ_REQUIRE names {name}, and {told}"


@pytest.fixture(scope="session")
def csv_study() -> Callable[..., None]:
    """Return the function that makes a simulated study of plain csv files."""
    return write_csv_study
