"""The recordings of one load of a bench, and the report of what was done."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jointz.core.protocols.protocol import ConditionSpec
from jointz.devices.interface import Rig
from jointz.experiment.bench.bench_plan import TimedPulse
from jointz.experiment.files.journal import read_journal
from jointz.experiment.files.session_files import JOURNAL_FILE, bench_plan_of
from jointz.experiment.files.whole_files import write_whole
from jointz.io.formats.netcdf_recording import write_recording
from jointz.session.bench_recordings import bench_record, pulse_table
from jointz.session.run_settings import RunSettings, pulses_name, recording_name, timing_rows
from jointz.session.study_file import pulses_csv


def write_bench(rig: Rig, settings: RunSettings, folder: Path) -> dict[str, Any]:
    """Write the recordings of a load and return the report of what was done."""
    protocol, load = settings.protocol, rig.wearer.id
    events, plans = read_journal(folder / JOURNAL_FILE), bench_plan_of(folder)
    report: dict[str, Any] = {"onsets": [], "gaps": [], "timing": [], "aborted": [], "truth": {}}
    for condition in protocol.conditions:
        name = recording_name(load, condition.name)
        recording, logs = bench_record(
            folder,
            condition,
            events=events,
            file=name,
            participant=load,
            protocol=protocol,
            salvage=settings.salvage,
        )
        write_recording(recording, settings.study / name)
        if condition.perturbations is not None and protocol.kind == "calibration":
            table = pulse_table(recording, plans.get(condition.name, ()))
            file = settings.study / pulses_name(load, condition.name)
            write_whole(file, pulses_csv(table))
        report["onsets"] += _pulses(load, condition, plans)
        report["timing"] += timing_rows(load, condition.name, logs, settings)
        report["devices"] = logs[0].header["devices"]
    report["torque_model"] = report["devices"]["actuator"]["torque_model"]
    truth = getattr(rig, "bench_truth", None)
    if truth is not None:
        report["truth"] = truth()
    return report


def _pulses(
    load: str, condition: ConditionSpec, plans: Mapping[str, Sequence[TimedPulse]]
) -> list[dict[str, Any]]:
    """Return how many pulses a condition had: a trial that was interrupted was done again whole."""
    count = sum(len(plans.get(name, ())) for name in condition.trial_names)
    if count == 0:
        return []
    return [
        {
            "participant": load,
            "condition": condition.name,
            "timing_point": "",
            "planned_pct": None,
            "planned": count,
            "completed": count,
            "missed": 0,
            "aborted": 0,
            "lost": 0,
            "n": 0,
            "n_missing": 0,
            "error_mean_pct": None,
            "error_sd_pct": None,
            "theory_sd_pct": None,
        }
    ]
