"""Fixtures that tests and benchmarks share."""

import os
import re
from collections.abc import Callable, Generator
from pathlib import Path

import pandas as pd
import pytest

import jointz
from jointz.identify.preparation.conditioning import torque_from_current
from jointz.io.formats.netcdf_recording import read_recording
from jointz.io.protocols import load_protocol
from jointz.io.study_reader import open_study

pytest_plugins = ["tests.real_time"]

_TOML = """jointz = 1
joint = "knee"
kind = "walking"
coupling = "rigid"
positive = "flexion"
torque_acts_on = "joint"

[channels.time]
column = "time"
unit = "s"
[channels.angle]
column = "angle"
unit = "rad"
[channels.torque]
column = "torque"
unit = "N*m"
[channels.command]
column = "command"
unit = "N*m"
[channels.contact]
column = "contact"
kind = "contact"
"""


def write_csv_study(
    folder: Path, *, people: int, strides: int, pulses: int, seed: int, rate_hz: float = 500.0
) -> None:
    """Run the walking protocol on simulated people; write what a lab's logger would: plain csv."""
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
    spec = open_study(made.study).spec
    folder.mkdir(parents=True)
    lines = [_TOML]
    for person in spec.participants:
        lines += ["[[participants]]", f'id = "{person.id}"', f"mass_kg = {person.mass_kg}"]
        lines += [f"height_m = {person.height_m}"]
    for entry in spec.recordings:
        recording = read_recording(made.study / entry.file)
        torque, _ = torque_from_current(recording, spec.torque_model, cutoff_hz=20.0)
        recording = recording.assign(torque=("time", torque))
        names = ("time", "angle", "torque", "command", "contact")
        table = pd.DataFrame({name: recording[name].to_numpy() for name in names})
        file = entry.file.replace(".nc", ".csv")
        table.dropna().round(6).to_csv(folder / file, index=False)
        lines += ["[[recordings]]", f'participant = "{entry.participant}"']
        lines += [f'condition = "{entry.condition}"', f'file = "{file}"']
    (folder / "study.toml").write_text("\n".join(lines) + "\n")


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
