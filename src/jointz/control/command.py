"""``jointz control``: from a measured impedance to a controller."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from jointz.control.design_command import design
from jointz.control.rendering.command import check
from jointz.core.errors import DataError
from jointz.terminal.file_options import Figure
from jointz.terminal.options import Commands, Printing
from jointz.terminal.printout import check_figure, emit_result, save_drawn

if TYPE_CHECKING:
    from jointz.control.impedance_profile import ImpedanceProfile

control = Commands(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Impedance over the gait cycle for a controller: make, draw and export a profile.",
)
#: Inches, of a figure with one panel a quantity.
_SIZE = (7.0, 7.5)
_File = Annotated[Path, typer.Argument(dir_okay=False, help="A file of jointz control profile.")]


#: Choices of ``--from``.
Source = Literal["results", "published"]


@control.callback()
def _control() -> None:
    """Make, draw and export a profile."""


@control.command()
def profile(
    results: Annotated[
        Path | None,
        typer.Argument(
            file_okay=False, help="Results folder of jointz analyze; none with --from published."
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="The profile to write (JSON).")] = Path("profile.json"),
    participant: Annotated[
        str | None,
        typer.Option(
            help="One participant, with session and side if the study has them, such as "
            "'S01, left'; by default the mean over all."
        ),
    ] = None,
    source: Annotated[
        Source,
        typer.Option(
            "--from", help="Results, or a published knee (the dissertation's, and Winter)."
        ),
    ] = "results",
    mass: Annotated[
        float | None, typer.Option(min=1.0, help="Body mass for a mean or a published knee (kg).")
    ] = None,
    figure: Figure = None,
    printing: Printing = Printing(),
) -> None:
    """Make a profile: stiffness, damping and equilibrium angle over the gait cycle.

    The equilibrium needs the internal moment of the joint, a channel joint_moment of inverse
    dynamics; without it a published one is taken, and the profile says so.
    Exit status: 0 written, 1 an interval reaches zero or too little is decided, 2 bad input.

    Example: jointz control profile results --participant S01 --out S01.json
    """
    check_figure(figure)
    if (results is None) != (source == "published"):
        raise DataError("expected a results folder, or --from published without one.")
    from jointz.control.make_profile import impedance_profile
    from jointz.control.profile_file import write_profile

    analysis = None
    if results is not None:
        from jointz.analysis.saved_analysis import load

        analysis = load(results)
    made = impedance_profile(analysis, participant, mass_kg=mass)
    write_profile(made, out)
    _report(made, figure, written=out, printing=printing)


@control.command()
def show(
    file: _File,
    figure: Figure = None,
    printing: Printing = Printing(),
) -> None:
    """Print a profile, and draw it with --figure.

    Example: jointz control show S01.json --figure S01.svg
    """
    check_figure(figure)
    from jointz.control.profile_file import read_profile

    _report(read_profile(file), figure, written=None, printing=printing)


@control.command()
def export(
    file: _File,
    out: Annotated[
        Path,
        typer.Argument(
            help="File to write: .h (C), .mat (MATLAB), .csv, or .py (Open-Source Leg)."
        ),
    ],
    printing: Printing = Printing(),
) -> None:
    """Write a profile for other software; torques agree with the profile to 1e-9 N*m.

    Only .py loses: four states of constant impedance are fitted, and their error is printed.

    Example: jointz control export S01.json knee.h
    """
    from jointz.control.profile_file import read_profile
    from jointz.control.state_machine import fit_state_machine
    from jointz.control.writers import export_profile, fit_text

    profile = read_profile(file)
    export_profile(profile, out)
    errors, lines = {}, [f"Written: {out}"]
    if out.suffix.lower() == ".py":
        fit = fit_state_machine(profile)
        errors = {"rms_nm": fit.rms_nm, "rms_deviated_nm": fit.rms_deviated_nm}
        lines = [fit_text(fit)[0], *lines]
    emit_result(printing, {"written": str(out), **errors}, *lines)


control.command()(design)
control.command()(check)


def _report(
    profile: "ImpedanceProfile",
    figure: Path | None,
    *,
    written: Path | None,
    printing: Printing,
) -> None:
    if figure is not None:
        from jointz.control.impedance_profile import draw_profile

        save_drawn(lambda canvas: draw_profile(canvas, profile), figure, _SIZE)
    files = {"written": str(written)} if written else {}
    lines = (f"Written: {file}" for file in files.values())
    emit_result(printing, {**profile.to_dict(), **files}, profile.summary(), *lines)
