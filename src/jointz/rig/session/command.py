"""``jointz run``: run an experiment and write its study."""

import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from jointz.core.errors import DeviceError, EngineError, WorkerLostError, WriteError
from jointz.terminal.exit_status import STILL_THERE
from jointz.terminal.options import Printing, SchedulerOption
from jointz.terminal.output import emit, emit_json, emit_table
from jointz.terminal.progress_bars import experiment_bars

if TYPE_CHECKING:
    from jointz.results.run_report import StudyRun


#: Devices an experiment can be run on.
Device = Literal["sim"]
#: Quality of a simulated rig and its people.
Preset = Literal["clean", "nominal", "hard", "anthropometric", "realistic"]
#: Clocks.
ClockName = Literal["fast", "real"]


@dataclass(frozen=True, slots=True)
class RigOptions:
    """Options about the devices, and about their simulation."""

    device: Annotated[
        Device | None, typer.Option(help="Simulated devices (sim); so without --config.")
    ] = None
    config: Annotated[
        Path | None,
        typer.Option(
            help="Real devices, as this device.toml names them; on Linux only. No driver was ever "
            "tried on hardware."
        ),
    ] = None
    preset: Annotated[
        Preset | None,
        typer.Option(
            help="How well simulated people and devices behave (default: realistic for people, "
            "nominal for benches and calibrations). anthropometric, realistic: people only."
        ),
    ] = None


SensorsOption = Annotated[
    str | None,
    typer.Option(
        help="Of simulated people: goniometer, and with it encoder and gyroscopes, with commas "
        "between (default: all that the preset has; realistic has all three)."
    ),
]
CalibrationOption = Annotated[
    Path | None,
    typer.Option(help="Take the entries of this file of jointz calibrate into the study."),
]


class _Prompting:
    """The operator at the terminal: reads what to do and presses Enter."""

    def __init__(self, paused: Callable[[], AbstractContextManager[None]]) -> None:
        self._paused = paused  # makes a context in which no progress is drawn on the terminal

    def prompt(self, text: str) -> None:
        with self._paused():
            try:
                typer.prompt(f"{text} [Enter]", default="", show_default=False, err=True)
            except typer.Abort:  # by Ctrl-C or the end of input, in the middle of the line
                typer.echo(err=True)
                raise KeyboardInterrupt from None  # the run ends: it is no participant's failure


def run(
    protocol: Annotated[str, typer.Argument(help="A built-in protocol, or a protocol file.")],
    out: Annotated[Path, typer.Option(help="The study's folder.")],
    rig: RigOptions = RigOptions(),
    sensors: SensorsOption = None,
    clock: Annotated[
        ClockName | None,
        typer.Option(help="As fast as it can (fast, of sim), or in real time (real, of devices)."),
    ] = None,
    participants: Annotated[
        int | None, typer.Option(min=1, help="How many; else those of --config, or the protocol's.")
    ] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Of plan and simulation.")] = None,
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Participants run in parallel (default: number of cores)."),
    ] = None,
    scheduler: SchedulerOption = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with a run that was interrupted.")
    ] = False,
    salvage: Annotated[
        bool,
        typer.Option(
            "--salvage", help="With --resume: leave out what is damaged, and say what it cost."
        ),
    ] = False,
    attended: Annotated[
        bool, typer.Option("--attended", help="A page starts, pauses and stops it: jointz console.")
    ] = False,
    live: Annotated[
        bool | None,
        typer.Option(
            "--live/--no-live",
            help="Estimate beside the session after new pulses, for the operator's page (default: "
            "where the protocol has [live]).",
        ),
    ] = None,
    calibration: CalibrationOption = None,
    printing: Printing = Printing(),
) -> None:
    """Run an experiment on devices or their simulation, and write its study.

    Takes the same arguments again with --resume after an interruption. Exits 3
    when a device fails or the safety gate trips.

    Example: jointz run walking --out study --participants 2 --seed 1
    """
    from jointz.rig.session.run import run as run_study

    real = clock == "real" or rig.config is not None
    with (
        experiment_bars(shown=not (printing.quiet or printing.as_json)) as bars,
        _resume_advised(out),
    ):
        made = run_study(
            protocol,
            **asdict(rig),
            out=out,
            seed=seed,
            sensors=sensors.replace(" ", "").split(",") if sensors else None,
            clock=clock,
            participants=participants,
            workers=workers or (1 if real or attended else os.cpu_count() or 1),
            scheduler=scheduler,
            resume=resume,
            salvage=salvage,
            attended=attended,
            live=live,
            calibration=calibration,
            operator=_Prompting(bars.paused) if real else None,
            progress=bars.experiment,
        )
    if printing.as_json:
        emit_json({"status": "ok", "study": str(made.study), **_numbers(made)})
    elif not printing.quiet:
        _print(made)


@contextmanager
def _resume_advised(out: Path) -> Iterator[None]:
    """Add to an error of devices, disks or workers how to go on, if something was recorded."""
    from jointz.rig.session.run_settings import SESSIONS

    try:
        yield
    except (DeviceError, WriteError, EngineError, WorkerLostError) as exc:
        if (out / SESSIONS).is_dir():
            exc.add_note(STILL_THERE)
        raise


def _numbers(made: "StudyRun") -> dict[str, Any]:
    table = made.report.to_frame()
    outcomes = ("planned", "completed", "missed", "aborted", "lost", "withdrawn")
    return {
        "protocol": made.report.protocol,
        "seed": made.report.seed,
        **{f"pulses_{outcome}": int(table[outcome].sum()) for outcome in outcomes},
        "onsets": made.report.onset_rows(),
        "gaps": [dict(row) for row in made.report.gaps],
        "timing": [dict(row) for row in made.report.timing],
        "salvaged": list(made.report.salvaged),
    }


def _print(made: "StudyRun") -> None:
    rows = [
        [
            f"{row['participant']} {row['timing_point']}",
            f"{row['completed']}/{row['planned']}",
            str(row["missed"] + row["aborted"] + row["lost"]),
            "-" if row["error_mean_pct"] is None else f"{row['error_mean_pct']:+.2f}",
            "-" if row["error_sd_pct"] is None else f"{row['error_sd_pct']:.2f}",
            "-" if row["theory_sd_pct"] is None else f"{row['theory_sd_pct']:.2f}",
        ]
        for row in made.report.onset_rows()
        if row["planned_pct"] is not None
    ]
    header = ["participant, point", "pulses", "done again", "onset error %", "SD %", "theory SD %"]
    if rows:
        emit_table(rows, header, title="Pulses, and where in the gait cycle they fired")
    for line in made.report.summary().splitlines()[:2]:
        if line not in made.report.salvaged:
            emit(line)
    if made.report.changes_text:
        emit(made.report.changes_text)
    for text in made.report.salvaged:
        emit(f"salvaged: {text}")
    emit(f"Study: {made.study / 'study.toml'}")
