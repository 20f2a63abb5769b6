"""``jointz demo``: the main job with nothing to bring."""

from pathlib import Path
from typing import Annotated

import typer

from jointz.terminal.options import Debug, Json, Quiet
from jointz.terminal.output import emit, emit_json, emit_table
from jointz.terminal.progress_bars import experiment_bars

_ALIKE = "in an exoskeleton that pushes the knee; their recordings are analysed like real ones."
_WHOLE = f"Ten simulated people walk {_ALIKE} This takes a few minutes and 1.2 GB of disk."
_QUICK = f"Two simulated people walk {_ALIKE} This takes half a minute."


def demo(
    out: Annotated[Path, typer.Option("--out", help="The demo's folder.")] = Path("jointz-demo"),
    quick: Annotated[
        bool, typer.Option("--quick", help="Two participants with 10 pulses a timing point.")
    ] = False,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the simulation.")] = 1,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Run the walking experiment on simulated people, analyse it, show the truth beside it.

    Replaces only its own folder.

    Example: jointz demo --quick
    """
    del debug
    from jointz.demo.demo_study import run_demo

    shown = not (quiet or as_json)
    if shown:
        emit(_QUICK if quick else _WHOLE)
    with experiment_bars(shown=shown) as bars:
        demonstration = run_demo(
            out, quick=quick, seed=seed, run_progress=bars.experiment, progress=bars.analysis
        )
    accuracy = demonstration.accuracy()
    if as_json:
        emit_json(
            {
                "status": "ok",
                "report": str(demonstration.report),
                "n_standing": demonstration.analysis.n_standing,
                "accuracy": accuracy.to_dict("records"),
            }
        )
        return
    if quiet:
        return
    rows = [
        [
            row["parameter"],
            f"{row['rms_error_pct']:.0f} %",
            f"{100 * row['coverage']:.0f} %",
            str(row["n"]),
        ]
        for row in accuracy.to_dict("records")
    ]
    vaf = demonstration.analysis.statistics["vaf"]["mean_pct"]
    header = ["parameter", "RMS error", "95 % intervals that hold the truth", "cells"]
    emit_table(rows, header, title="Truth against estimate (simulated study)")
    emit(f"Mean VAF {vaf:.2f} %: a fit that looks this good says little about accuracy.")
    emit(f"Report: {demonstration.report}")
    emit(f"Next: jointz explore {out / 'results'}, or your own file: jointz inspect FILE")
