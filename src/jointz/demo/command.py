"""``jointz demo``: a whole study on simulated people."""

from pathlib import Path
from typing import Annotated

import typer

from jointz.terminal.options import Printing
from jointz.terminal.output import emit, emit_json, emit_table
from jointz.terminal.progress_bars import experiment_bars

_ALIKE = (
    "in an exoskeleton that is strapped to the leg and pushes the knee, by two protocols; the "
    "recordings are analysed like real ones."
)
_WHOLE = f"Four simulated people walk {_ALIKE} This takes two minutes and 0.5 GB of disk."
_QUICK = f"Two simulated people walk {_ALIKE} This takes about 40 seconds."


def demo(
    out: Annotated[Path, typer.Option(help="The demo's folder.")] = Path("jointz-demo"),
    quick: Annotated[
        bool, typer.Option("--quick", help="Two people with 8 pulses a timing point.")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the simulation.")] = 1,
    printing: Printing = Printing(),
) -> None:
    """Run two walking protocols on the same simulated people and compare them with the truth.

    Doublets with three sensors, and beside them the dissertation's protocol: one torque that is
    held, measured by a goniometer. Replaces only its own folder.

    Example: jointz demo --quick
    """
    from jointz.demo.demo_study import run_demo

    shown = not (printing.quiet or printing.as_json)
    if shown:
        emit(_QUICK if quick else _WHOLE)
    with experiment_bars(shown=shown) as bars:
        demonstration = run_demo(
            out, quick=quick, seed=seed, run_progress=bars.experiment, progress=bars.analysis
        )
    accuracy = demonstration.accuracy().to_dict("records")
    if printing.as_json:
        emit_json(
            {
                "status": "ok",
                "report": str(demonstration.report),
                "n_standing": demonstration.doublets.analysis.n_standing,
                "accuracy": accuracy,
                "lesson": demonstration.lesson(),
            }
        )
        return
    if printing.quiet:
        return
    titles = {
        one.protocol.name: one.protocol.title
        for one in (demonstration.doublets, demonstration.dissertation)
    }
    rows = [
        [
            titles[row["protocol"]],
            row["parameter"],
            f"{row['n_decided']} of {row['n_cells']}",
            _percent(row["rms_error_pct"]),
            _percent(row["coverage"], times=100.0),
        ]
        for row in accuracy
    ]
    header = [
        "protocol",
        "parameter",
        "available",
        "RMS error",
        "95 % intervals that contain the truth",
    ]
    emit_table(rows, header, title="Two protocols on the same simulated people")
    emit(demonstration.lesson())
    emit(f"Report: {demonstration.report}")
    emit(f"Next: jointz explore {out / 'results'}, or your own file: jointz inspect FILE")


def _percent(value: float | None, *, times: float = 1.0) -> str:
    return "-" if value is None else f"{times * value:.0f} %"
