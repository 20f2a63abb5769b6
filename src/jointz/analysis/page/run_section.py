"""Section of the report about the experiment."""

from typing import Any

from jointz.report.wording import format_integer
from jointz.results.run_report import RunReport


def run_section(run: RunReport) -> dict[str, Any]:
    """Return what the page shows of a run: pulses, onsets and timing of the control loop."""
    rows = [{**row, "name": name} for name, row in run.pooled_onsets().to_dict("index").items()]
    return {"rows": rows, "gaps": _gaps(run), "timing": _timing(run)}


def _gaps(run: RunReport) -> str:
    if not run.gaps:
        return ""
    fewest, most = min(g["fewest"] for g in run.gaps), max(g["most"] for g in run.gaps)
    longer = sum(g["longer_than_planned"] for g in run.gaps)
    text = f"Pulses were {fewest} to {most} strides apart"
    if not longer:
        return f"{text}, as planned."
    return f"{text}; {longer} came later than planned because the pulse before was missed."


def _timing(run: RunReport) -> str:
    ticks, missed, limited = (
        sum(t[key] for t in run.timing) for key in ("ticks", "missed_slots", "clamped_ticks")
    )
    text = (
        f"The control loop ran {format_integer(ticks)} ticks, missed {format_integer(missed)} slots"
    )
    if not limited:
        return f"{text} and limited no torque."
    return f"{text}, and sent less torque than commanded in {format_integer(limited)} ticks."
