"""``jointz plan``: pulses, sensors and people for a wanted interval."""

from math import ceil, radians
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import typer

from jointz.core.errors import DataError
from jointz.terminal.options import Printing
from jointz.terminal.output import EXIT_NO_ESTIMATE, emit, emit_json, emit_table
from jointz.terminal.progress_bars import progress_bar

if TYPE_CHECKING:
    from jointz.planning.plan_result import Plan

_LETTERS = {"K": "stiffness", "B": "damping", "J": "inertia"}


def plan(
    protocol: Annotated[
        str, typer.Argument(help="Walking protocol with pulses; none with --study.")
    ] = "",
    out: Annotated[Path, typer.Option(help="Folder for page, table and protocol.")] = Path("plan"),
    pilot: Annotated[
        Path | None,
        typer.Option(
            file_okay=False,
            help="Study with 3 to 5 minutes of your own walking: sensors, calibration, people.",
        ),
    ] = None,
    study: Annotated[
        Path | None,
        typer.Option(
            file_okay=False,
            help="Results of jointz analyze: what that study could see, instead of a plan.",
        ),
    ] = None,
    study_folder: Annotated[
        Path | None,
        typer.Option(file_okay=False, help="With --study: the study, if not beside it."),
    ] = None,
    sensor: Annotated[
        list[str] | None,
        typer.Option(
            help="goniometer, encoder or gyroscopes; with =NOISE in degrees, or degrees/s. "
            "May be repeated."
        ),
    ] = None,
    calibration: Annotated[
        Path | None, typer.Option(dir_okay=False, help="A file of jointz calibrate.")
    ] = None,
    mass: Annotated[float | None, typer.Option(help="Body mass (kg); 75 by default.")] = None,
    height: Annotated[float | None, typer.Option(help="Height (m); 1.75 by default.")] = None,
    torque: Annotated[
        float | None, typer.Option(help="Largest torque of the device (N*m).")
    ] = None,
    bandwidth: Annotated[
        float | None, typer.Option(help="Of the torque (Hz); 13 by default.")
    ] = None,
    motion: Annotated[
        float, typer.Option(help="Degrees that 9 of 10 legs may move at most.")
    ] = 15.0,
    half_width: Annotated[
        float | None, typer.Option(help="Wanted half of the 95 % interval of a person (%).")
    ] = None,
    of: Annotated[str, typer.Option(help="Of which of K, B and J, separated by commas.")] = "K,B",
    mean: Annotated[
        float | None, typer.Option(help="Wanted half-width of the mean over people (%).")
    ] = None,
    difference: Annotated[
        float | None, typer.Option(help="Difference of two conditions to be found (%).")
    ] = None,
    share: Annotated[
        float, typer.Option(help="Legs that shall reach the half-width, and the power (%).")
    ] = 80.0,
    minutes: Annotated[
        float | None, typer.Option(help="Walking of a participant, at most (min).")
    ] = None,
    participants: Annotated[int | None, typer.Option(help="At most so many.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the legs that are drawn.")] = 1,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an earlier plan.")
    ] = False,
    printing: Printing = Printing(),
) -> None:
    """Plan an experiment: pulses, sensors, minutes and people for a wanted interval.

    Writes a page, a table, JSON, and a protocol file that jointz run takes; nothing if refused.
    Exit status: 0 planned, 1 a wish cannot be kept (the nearest one is named), 2 bad input.

    Example: jointz plan walking_doublets --pilot my-walking --half-width 25 --minutes 30
    """
    if bool(protocol) == (study is not None):
        raise DataError("expected either a protocol to plan, or --study RESULTS of a recorded one.")
    if not 50.0 <= share <= 95.0:
        raise DataError(f"--share: expected 50 to 95 (%), got {share:g}.")
    from jointz.core.whole_file import refuse_existing
    from jointz.planning.page import PROTOCOL, write_plan

    if not overwrite:
        refuse_existing(out, "folder")
    wishes = {
        "half_width_pct": half_width,
        "parameters": _parameters(of),
        "share": share / 100.0,
        "minutes": minutes,
        "participants": participants,
        "mean_pct": mean,
        "difference_pct": difference,
        "motion_deg": motion,
    }
    of_lab = {
        "pilot": pilot,
        "sensors": _sensors(sensor),
        "calibration": _calibration(calibration),
        "mass_kg": mass,
        "height_m": height,
        "torque_nm": torque,
        "bandwidth_hz": bandwidth,
    }
    with progress_bar(shown=not (printing.quiet or printing.as_json)) as progress:
        made = _made(protocol, study, study_folder, of_lab, wishes, seed=seed, progress=progress)
    keeps = made.recorded or not made.refused
    page = str(write_plan(made, out, overwrite=overwrite)) if keeps else ""
    if printing.as_json:
        status = "refused" if made.refused else "ok"
        emit_json({"status": status, "page": page, "plan": made.to_dict()})
    elif not printing.quiet:
        _print(made)
        emit(f"Page: {page}" if page else "Nothing was written. Ask for the nearest wish.")
        if made.protocol_text:
            sensors = ",".join(made.sensors)
            emit(f"Next: jointz run {quote(str(out / PROTOCOL))} --sensors {sensors} --out STUDY")
    if made.refused:
        for text in made.refused if printing.quiet else ():
            typer.echo(f"jointz: refused: {text}", err=True)
        raise typer.Exit(EXIT_NO_ESTIMATE)


def _made(
    protocol: str,
    study: Path | None,
    study_folder: Path | None,
    of_lab: dict[str, Any],
    wishes: dict[str, Any],
    **settings: Any,
) -> "Plan":
    from jointz.planning.plan_study import plan as planned
    from jointz.planning.plan_study import plan_recorded

    if study is None:
        if study_folder is not None:
            raise DataError("--study-folder goes with --study.")
        return planned(protocol, **of_lab, **wishes, **settings)
    if stated := [name for name, value in of_lab.items() if value is not None]:
        raise DataError(
            f"--study takes the lab from the study; expected no {', '.join(stated)} beside it."
        )
    return plan_recorded(study, study=study_folder, **wishes, **settings)


def _parameters(of: str) -> tuple[str, ...]:
    names = [name.strip() for name in of.split(",") if name.strip()]
    unknown = [name for name in names if name not in _LETTERS]
    if not names or unknown:
        raise DataError(f"--of: expected some of K,B,J; got {', '.join(unknown) or 'none'}.")
    return tuple(_LETTERS[name] for name in names)


def _sensors(stated: list[str] | None) -> dict[str, float | None] | None:
    """Return sensors with their noise, rad or rad/s."""
    if not stated:
        return None
    sensors: dict[str, float | None] = {}
    for text in stated:
        name, equals, noise = text.partition("=")
        try:
            sensors[name] = radians(float(noise)) if equals else None
        except ValueError:
            raise DataError(
                f"--sensor {text}: expected NAME or NAME=NOISE in degrees, such as goniometer=0.3."
            ) from None
    return sensors


def _calibration(file: Path | None) -> Any:
    if file is None:
        return None
    from jointz.io.calibration_file import read_calibration

    return read_calibration(file).common


def _print(made: "Plan") -> None:
    share = f"{100.0 * float(made.wishes['share']):.0f} of 100 legs"
    for text in made.refused:
        emit(f"Refused: {text}")
    emit_table(
        [
            [
                e.timing_point if e.parameter == "stiffness" else "",
                str(e.pulses) if e.parameter == "stiffness" else "",
                next(k for k, v in _LETTERS.items() if v == e.parameter),
                f"{e.half_width_pct:.0f} %",
                f"{e.assured_pct:.0f} %",
                f"{e.endless_pct:.0f} %" + ("" if e.decidable else ", undecided"),
                f"{100.0 * e.decided_share:.0f} %",
            ]
            for e in made.estimates
        ],
        ["", "pulses", "", "typical leg", share, "any number of pulses", "available"],
        title="Half of the 95 % interval, % of the value",
    )
    emit(f"Pulses: {made.pulses}.")
    emit(
        f"{made.participants} participants, {ceil(made.minutes)} min of walking each; the joint "
        f"moves up to {made.peak_deg:.0f} degrees."
    )
    emit(f"Walking: {made.walking}.")
    for text in made.notes:
        emit(text)
