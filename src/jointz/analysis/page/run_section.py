"""The part of the report that says how the experiment went."""

from typing import Any

from jointz.report.wording import format_integer
from jointz.results.run_report import RunReport


def run_section(run: RunReport) -> dict[str, Any]:
    """Return what the page shows of a run: pulses, onsets and time keeping."""
    rows = [{**row, "name": name} for name, row in run.pooled_onsets().to_dict("index").items()]
    return {"rows": rows, "gaps": _gaps(run), "timing": _timing(run)}


def _gaps(run: RunReport) -> str:
    if not run.gaps:
        return ""
    fewest, most = min(g["fewest"] for g in run.gaps), max(g["most"] for g in run.gaps)
    longer = sum(g["longer_than_planned"] for g in run.gaps)
    told = f"Pulses were {fewest} to {most} strides apart"
    if not longer:
        return f"{told}, as planned."
    return f"{told}; {longer} waited longer than planned, because a pulse before them was missed."


def _timing(run: RunReport) -> str:
    ticks = sum(t["ticks"] for t in run.timing)
    missed = sum(t["missed_slots"] for t in run.timing)
    cut = sum(t["clamped_ticks"] for t in run.timing)
    told = (
        f"The control loop ran {format_integer(ticks)} ticks, missed {format_integer(missed)} slots"
    )
    if not cut:
        return f"{told} and cut no torque."
    return f"{told}, and sent less torque than was asked for in {format_integer(cut)} ticks."
