"""The recordings of one load of a bench, and the report of what was done."""

from pathlib import Path
from typing import Any

from jointz.devices.interface import Rig
from jointz.experiment.journal import read_journal
from jointz.experiment.session import JOURNAL_FILE
from jointz.io.netcdf import write_recording
from jointz.workflows.bench_recordings import bench_record
from jointz.workflows.run_settings import RunSettings, recording_name, timing_rows


def write_bench(rig: Rig, settings: RunSettings, folder: Path) -> dict[str, Any]:
    """Write the recordings of a load and return the report of what was done.

    Parameters
    ----------
    rig : Rig
        The bench with the load.
    settings : RunSettings
        Where to write.
    folder : pathlib.Path
        Of the session.
    """
    protocol, load = settings.protocol, rig.wearer.id
    events = read_journal(folder / JOURNAL_FILE)
    report: dict[str, Any] = {"onsets": [], "gaps": [], "timing": [], "aborted": [], "truth": {}}
    for condition in protocol.conditions:
        name = recording_name(load, condition.name)
        recording, logs = bench_record(
            folder, condition, events=events, file=name, participant=load, protocol=protocol
        )
        write_recording(recording, settings.study / name)
        report["timing"] += timing_rows(load, condition.name, logs, settings)
        report["devices"] = logs[0].header["devices"]
    report["torque_model"] = report["devices"]["actuator"]["torque_model"]
    truth = getattr(rig, "bench_truth", None)
    if truth is not None:
        report["truth"] = truth()
    return report
