"""``jointz pool``: one table of results of several studies, and means over studies."""

from pathlib import Path
from typing import Annotated

import typer

from jointz.terminal.options import Printing
from jointz.terminal.output import EXIT_NO_ESTIMATE, EXIT_OK
from jointz.terminal.printout import emit_result


def pool(
    results: Annotated[list[Path], typer.Argument(help="Results folders of jointz analyze.")],
    out: Annotated[Path, typer.Option(help="Folder for tables, figures and a page.")],
    conditions: Annotated[
        Path | None,
        typer.Option(
            help="Table (csv) with the columns results, study, condition, walking_speed_m_s, "
            "slope_deg, surface, group: one row a folder."
        ),
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace existing pooled results.")
    ] = False,
    printing: Printing = Printing(),
) -> None:
    """Pool results of several studies: one table, and means over studies (random effects, REML).

    Without --conditions every folder is a study of its own. Studies that differ in joint,
    direction, units, method or estimand are refused.
    Needs the extra: pip install "jointz[parquet]".
    Exit status: 0 at least one mean is available, 1 none is, 2 the input cannot be trusted.

    Example: jointz pool results-a results-b --conditions conditions.csv --out pooled
    """
    from jointz.pooling.pool import PAGE, pool

    pooled = pool(results, conditions=conditions, out=out, overwrite=overwrite)
    status, page = "ok" if pooled.available else "nothing_stands", out / PAGE
    content = {"status": status, "page": str(page)} | pooled.to_dict()
    emit_result(printing, content, pooled.summary(), f"Page: {page}")
    raise typer.Exit(EXIT_OK if pooled.available else EXIT_NO_ESTIMATE)
