"""``jointz identify time-varying`` and ``phase-curve``: impedance over the gait cycle."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from jointz.identification.output import Answer, Clock, Output
from jointz.terminal.file_options import Angle, Figure, File, Input, Torque, TorqueActsOn
from jointz.terminal.options import Printing
from jointz.terminal.printout import failures

if TYPE_CHECKING:
    import numpy as np

    from jointz.analysis.saved_analysis import Analysis

#: Size of a figure of curves, inches.
_SIZE = (7.0, 4.0)

Out = Annotated[
    Path | None, typer.Option(help="Write the curves: a csv file, one row a parameter and phase.")
]


def time_varying(
    file: File,
    angle: Angle,
    torque: Torque,
    command: Annotated[
        str | None, typer.Option(help="COL[:unit] of the commanded random torque (N*m).")
    ] = None,
    contact: Annotated[
        str | None, typer.Option(help="COL of a footswitch, for the heel strikes.")
    ] = None,
    force: Annotated[
        str | None,
        typer.Option(
            help="COL[:unit] of the vertical ground reaction force (N), for the heel strikes."
        ),
    ] = None,
    heel_strikes: Annotated[
        Path | None,
        typer.Option(
            dir_okay=False,
            help="Text file with the times of the heel strikes (s), one in each line, on the clock "
            "of --time; with --rate from 0.",
        ),
    ] = None,
    clock: Clock = Clock(),
    perturbed: Input = "torque",
    torque_acts_on: TorqueActsOn = "joint",
    segment_s: Annotated[
        float, typer.Option(help="Length of the segments about each phase, s.")
    ] = 0.1,
    n_phases: Annotated[int, typer.Option(help="Phases, evenly over the cycle.")] = 50,
    cutoff_hz: Annotated[float, typer.Option(help="Low-pass of all signals.")] = 20.0,
    length_s: Annotated[
        float | None,
        typer.Option(
            help="Longest lag of the impulse response, s; by default 0.3 for torque input, 0.04 to "
            "each side for angle input."
        ),
    ] = None,
    resamples: Annotated[int, typer.Option(help="Bootstrap resamples of the strides.")] = 1000,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the resampling.")] = 0,
    out: Out = None,
    answer: Answer = Answer(),
) -> None:
    """Fit K, B and J at phases of the gait cycle to walking with a random torque.

    Give --contact, --force or --heel-strikes. At least 30 strides.

    Example: jointz identify time-varying walk.csv --angle q --torque tau --contact foot --time t
    """
    if sum(source is not None for source in (contact, force, heel_strikes)) != 1:
        raise typer.BadParameter("Give --contact, --force or --heel-strikes, one of them.")
    output = Output("time_varying", answer, _SIZE, out)
    from jointz.identify.over_cycle.time_varying import identify_time_varying

    fit, origin = output.identify(
        identify_time_varying,
        file,
        {
            "angle": angle,
            "torque": torque,
            "time": clock.time,
            "command": command,
            "contact": contact,
            "ground_reaction_force": force,
        },
        clock=clock,
        heel_strikes=None if heel_strikes is None else _times(heel_strikes),
        input=perturbed,
        torque_acts_on=torque_acts_on,
        segment_s=segment_s,
        n_phases=n_phases,
        cutoff_hz=cutoff_hz,
        length_s=length_s,
        resamples=resamples,
        seed=seed,
    )
    standing = any(curve.n_decided for curve in fit.parameters)
    output.report_curves(fit, fit.plot, standing=standing, **origin)


def phase_curve(
    results: Annotated[
        Path, typer.Argument(file_okay=False, help="Results folder of jointz analyze, walking.")
    ],
    participant: Annotated[
        str | None,
        typer.Option(
            help="One participant, with session and side if the study has them, such as "
            "'S01, left'; by default all participants and the mean over them."
        ),
    ] = None,
    parameter: Annotated[
        list[str] | None,
        typer.Option(
            help="Such as stiffness; may be repeated. By default stiffness, damping and both per "
            "kg. The figure shows the first."
        ),
    ] = None,
    out: Out = None,
    figure: Figure = None,
    printing: Printing = Printing(),
) -> None:
    """Draw stiffness and damping of a walking study as smooth curves over the gait cycle.

    Example: jointz identify phase-curve results --out curves.csv --figure stiffness.svg
    """
    output = Output("phase_curve", Answer(figure, printing=printing), _SIZE, out)
    from functools import partial

    from jointz.identify.over_cycle.phase_curve import phase_curve as curves_of

    analysis = _load(results, quiet=printing.quiet)
    chosen = {"parameters": parameter} if parameter else {}
    with failures(printing, model="phase_curve"):
        curves = curves_of(analysis, participant, **chosen)
    draw = partial(curves.plot, parameter=curves.bands[0].parameter)
    output.report_curves(curves, draw, standing=True, status="ok", results=str(results))


def _load(results: Path, *, quiet: bool) -> "Analysis":
    """Load results; say on stderr which of their files were changed."""
    import warnings

    from jointz.analysis.saved_analysis import load

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        analysis = load(results)
    for warning in [] if quiet else caught:
        typer.echo(f"jointz: {warning.message}", err=True)
    return analysis


def _times(file: Path) -> "np.ndarray":
    """Read times in s, one in each line."""
    import numpy as np

    from jointz.core.errors import DataError
    from jointz.io.small_files import file_content

    try:
        lines = file_content(file, absent="no such file").decode("utf-8-sig").splitlines()
    except ValueError as exc:
        raise DataError(f"--heel-strikes {file}: cannot be read ({exc}).", path=str(file)) from exc
    times = []
    for row, line in enumerate(lines, 1):
        try:
            times += [float(line)] if line.strip() else []
        except ValueError as exc:
            raise DataError(
                f"--heel-strikes {file}, row {row}: expected a time in s, got {line[:40]!r}.",
                path=str(file),
                row=row,
            ) from exc
    return np.array(times)
