"""``jointz identify stride``: quasi-stiffness of a mean stride."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from jointz.identification.output import Answer, Output

if TYPE_CHECKING:
    import xarray as xr

    from jointz.results.statistics.quasi_stiffness_fit import QuasiStiffness


def stride(
    file: Annotated[
        Path,
        typer.Argument(
            dir_okay=False, help="Mean stride, one row a phase: csv, csv.gz, parquet, nc, mat."
        ),
    ],
    angle: Annotated[
        str, typer.Option(help="COL[:unit] of the angle, 0 at neutral posture (rad).")
    ],
    torque: Annotated[
        str | None,
        typer.Option(help="COL[:unit] of the torque on the joint (N*m), positive as the angle."),
    ] = None,
    torque_per_mass: Annotated[
        str | None, typer.Option(help="In place of --torque: COL[:unit] per body mass (N*m/kg).")
    ] = None,
    gait_pct: Annotated[
        str | None,
        typer.Option(
            help="COL[:unit] of the phase (% of the gait cycle); by default the rows lie evenly "
            "from 0 to 100 %."
        ),
    ] = None,
    window_pct: Annotated[
        float, typer.Option(help="Width of the window of the local slope, % of the cycle.")
    ] = 6.0,
    out: Annotated[
        Path | None, typer.Option(help="Write a csv file, one row a timing point and measure.")
    ] = None,
    answer: Answer = Answer(),
) -> None:
    """Fit the quasi-stiffness of a mean stride: slope of torque over angle at six timing points.

    Quasi-stiffness is not the stiffness K, which needs a perturbation.

    Example: jointz identify stride mean.csv --angle knee:deg --torque-per-mass tau --gait-pct pct
    """
    if (torque is None) == (torque_per_mass is None):
        raise typer.BadParameter("Give --torque or --torque-per-mass, one of them.")
    output = Output("quasi_stiffness", answer, (6.0, 4.5), out)
    fit, origin = output.identify(
        _quasi_stiffness,
        file,
        {
            "angle": angle,
            "torque": torque,
            "torque_per_mass": torque_per_mass,
            "gait_pct": gait_pct,
        },
        needs_clock=False,
        window_pct=window_pct,
    )
    standing = any(estimate.status == "ok" for estimate in fit.estimates)
    status = "ok" if standing else "undecided"
    output.report_curves(fit, fit.plot, standing=standing, status=status, **origin)


def _quasi_stiffness(
    mean: "xr.Dataset", *, rate_hz: float | None, window_pct: float
) -> "QuasiStiffness":
    from jointz.stats import quasi_stiffness

    del rate_hz  # a mean stride has phases, no clock
    per_mass = "torque_per_mass" in mean
    return quasi_stiffness(
        mean["angle"].to_numpy(),
        mean["torque_per_mass" if per_mass else "torque"].to_numpy(),
        gait_pct=mean["gait_pct"].to_numpy() if "gait_pct" in mean else None,
        window_pct=window_pct,
        moment_unit="N*m/kg" if per_mass else "N*m",
    )
