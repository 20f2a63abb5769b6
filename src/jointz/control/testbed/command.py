"""``jointz control compare``: controllers in the test bed."""

from pathlib import Path
from typing import Annotated

import typer

from jointz.core.whole_file import refuse_existing
from jointz.terminal.file_options import Figure
from jointz.terminal.options import Debug, Json, Quiet
from jointz.terminal.output import emit, emit_json
from jointz.terminal.printout import check_figure, save_drawn
from jointz.terminal.progress_bars import progress_bar


def compare(
    profiles: Annotated[
        list[Path],
        typer.Argument(dir_okay=False, help="Files of jointz control profile, one a person."),
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", file_okay=False, help="Folder to write: page, tables, figures."),
    ] = None,
    seeds: Annotated[
        int, typer.Option("--seeds", min=1, help="Runs of each person, controller and test.")
    ] = 3,
    seed: Annotated[int, typer.Option("--seed", min=0, help="First number of all draws.")] = 1,
    height: Annotated[float, typer.Option("--height", help="Body height of all (m).")] = 1.74,
    load_share: Annotated[
        float,
        typer.Option(
            "--load-share",
            help="Part of the load's change with the angle that acts on the knee, 0 to 1.",
        ),
    ] = 0.25,
    figure: Figure = None,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Compare controllers of a knee in a simulated person who walks.

    Each runs on each profile: plain walking, pushes, other speeds, delay, phase error. With two or
    more profiles the mean of the others' is a controller, too.

    Example: jointz control compare S01.json S02.json S03.json --out controllers
    """
    del debug
    check_figure(figure)
    from jointz.control.profile_file import read_profile
    from jointz.control.testbed.compare import compare_controllers
    from jointz.control.testbed.page import check_page, write_page

    if out is not None:
        check_page(out)
    if figure is not None:
        refuse_existing(figure)
    people = [read_profile(file) for file in profiles]
    with progress_bar(shown=not (quiet or as_json)) as progress:
        found = compare_controllers(
            people, seeds=seeds, seed=seed, height_m=height, load_share=load_share,
            progress=progress,
        )  # fmt: skip
    page = None if out is None else write_page(found, out)
    if figure is not None:
        save_drawn(lambda canvas: found.plot(canvas.subplots()), figure, found.FIGURE_SIZE)
    if as_json:
        content = {k: v for k, v in found.to_dict().items() if k not in ("runs", "traces")}
        emit_json({"status": "ok", **content, **({"written": str(page)} if page else {})})
    elif not quiet:
        emit(found.summary())
        if page:
            emit(f"Written: {page}")
