"""``jointz calibrate``: estimates instruments from a calibration study."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from jointz.terminal.file_options import Figure
from jointz.terminal.options import Printing
from jointz.terminal.output import EXIT_NO_ESTIMATE, EXIT_OK, emit, emit_json, emit_table
from jointz.terminal.printout import check_figure, save_canvas

if TYPE_CHECKING:
    import pandas as pd

    from jointz.rig.calibration.report import Calibration

_HEADER = ["participant", "entry", "value", "sd", "unit", "status", "reason"]
_PANEL = (8.0, 3.6)  # inches
_MOST_PANELS = 12


#: Choices of ``STEP``.
Step = Literal["zero", "footswitch", "hinge", "frame", "leg", "torsion", "spring"]


def calibrate(
    step: Annotated[Step, typer.Argument(help="Which step.")],
    study: Annotated[
        Path, typer.Argument(help="The study of jointz run calibration-STEP, or your own.")
    ],
    out: Annotated[
        Path | None, typer.Option(help="Calibration file to write; one that is there is added to.")
    ] = None,
    into: Annotated[
        Path | None,
        typer.Option(
            help="Study to put the entries into; study.toml.before-calibration keeps what it "
            "held before."
        ),
    ] = None,
    entry: Annotated[
        list[str] | None,
        typer.Option(help="Write this entry only, such as angle_gain; may be repeated."),
    ] = None,
    protocol: Annotated[
        str | None,
        typer.Option(help="States the known loads of leg and spring; else the one that was run."),
    ] = None,
    figure: Figure = None,
    printing: Printing = Printing(),
) -> None:
    """Calibrate instruments: entries of [calibration] with their standard deviations.

    Steps: zero, footswitch, hinge (goniometer against an encoder), frame (the exoskeleton
    alone), leg (hanging, without and with a known weight), torsion (locked), spring. jointz run
    calibration-STEP records each. Only entries that stand are written; jointz run --calibration
    takes the file into the study that it makes.
    Exit status: 0 an entry stands, 1 none does, 2 the input cannot be trusted.

    Example: jointz calibrate hinge hinge-study --out calibration.toml
    """
    check_figure(figure)
    from jointz.rig.calibration.calibrate import calibrate as calibrate_study

    calibration = calibrate_study(
        study, step=step, protocol=protocol, entries=entry or None, out=out, into=into
    )
    if figure is not None:
        _save(calibration, figure)
    if printing.as_json:
        emit_json(_without_series(calibration))
    elif not printing.quiet:
        _print(calibration)
    raise typer.Exit(EXIT_OK if calibration.standing else EXIT_NO_ESTIMATE)


def _without_series(calibration: "Calibration") -> dict[str, object]:
    content = calibration.to_dict()
    for fit in content["fits"].values():
        del fit["series"]
    return {"status": "ok" if calibration.standing else "nothing_stands", **content}


def _print(calibration: "Calibration") -> None:
    table = calibration.to_frame()
    for used, title in ((True, "[calibration]"), (False, "beside")):
        rows = _rows(table[table["used"] == used])
        if rows:
            emit_table(rows, _HEADER, title=title)
    notes = {note for fit in calibration.fits.values() for note in fit.notes}
    for note in [*sorted(notes), *calibration.notes]:
        emit(f"Note: {note}")
    for file in calibration.written:
        emit(f"Written: {file}")


def _rows(table: "pd.DataFrame") -> list[list[str]]:
    def number(value: float | None, digits: int) -> str:
        return "-" if value is None or value != value else f"{value:.{digits}g}"

    return [
        [
            row["participant"],
            row["entry"],
            number(row["value"], 5),
            number(row["sd"], 2),
            "" if row["unit"] == "1" else row["unit"],
            row["status"],
            row["reason"],
        ]
        for row in table.to_dict("records")
    ]


def _save(calibration: "Calibration", figure: Path) -> None:
    """Write a figure with a panel for each of the first participants."""
    from matplotlib.figure import Figure as Canvas

    shown = list(calibration.fits.items())[:_MOST_PANELS]
    canvas = Canvas(figsize=(_PANEL[0], _PANEL[1] * max(1, len(shown))), layout="constrained")
    panels = canvas.subplots(max(1, len(shown)), squeeze=False)[:, 0]
    for axes, (participant, fit) in zip(panels, shown, strict=False):
        fit.plot(axes)
        axes.set_title(f"{participant}. {axes.get_title()}", fontsize="medium")
    save_canvas(canvas, figure)
