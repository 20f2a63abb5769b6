"""Output of the commands of ``jointz identify``."""

from collections.abc import Callable, Container, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import typer

from jointz.core.errors import EstimationError
from jointz.core.whole_file import whole_file
from jointz.terminal.options import Printing
from jointz.terminal.output import EXIT_NO_ESTIMATE, emit, emit_json, emit_table

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

    from jointz.io.text.column_arguments import Column

#: Samples for the figure alone: not part of what ``--json`` prints.
_FOR_FIGURES = "series"
#: What to do about a file that the system does not let be written.
_UNWRITTEN = "Make room or ask for permission, or name another file."


class Curves(Protocol):
    """Interface of curves over the gait cycle."""

    def to_frame(self) -> "pd.DataFrame":
        """Return one row a curve and phase, or a parameter."""

    def summary(self) -> str:
        """Return a short text."""

    def to_dict(self) -> dict[str, Any]:
        """Return plain values."""


class Fit(Curves, Protocol):
    """Interface of a result of ``identify``."""

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the result."""


@dataclass(frozen=True, slots=True)
class Output:
    """Options of a command that say how it answers."""

    model: str  # fitted model, for the JSON of a failure
    figure: Path | None  # path of the figure
    printing: Printing
    size: tuple[float, float] = (7.1, 3.5)  # inches: size of the figure

    def __post_init__(self) -> None:
        """Refuse a figure that could not be written, before the work is done."""
        check_figure(self.figure)

    @contextmanager
    def failures(self) -> Iterator[None]:
        """Turn a fit without an answer into exit status 1, with its code."""
        try:
            yield
        except EstimationError as exc:
            if self.printing.as_json:
                content = {"model": self.model, "status": f"failed:{exc.code}"}
                emit_json({**content, "message": str(exc)})
            else:
                typer.echo(f"jointz: {exc}", err=True)
            raise typer.Exit(EXIT_NO_ESTIMATE) from exc

    def report(
        self,
        fit: Fit,
        columns: "Mapping[str, Column]",
        *,
        file: Path,
        more: Mapping[str, Any] | None = None,
    ) -> None:
        """Write the figure, print the result and leave with its exit status."""
        if self.figure is not None:
            _save(fit.plot, self.figure, self.size)
        table = fit.to_frame()
        if self.printing.as_json:
            content = {k: v for k, v in fit.to_dict().items() if k != _FOR_FIGURES}
            emit_json({**content, **(more or {}), **file_origin(file, columns)})
        elif not self.printing.quiet:
            _print_table(table)
            emit(_without_rows(fit.summary(), set(table["parameter"])))
        self._leave(standing=bool(table["status"].isin(["ok", "at_bound"]).any()))

    def report_curves(
        self,
        curves: Curves,
        draw: "Callable[[Axes], object]",
        *,
        out: Path | None,
        more: Mapping[str, Any],
        standing: bool,
    ) -> None:
        """Write figure and csv file, print the result and leave with its exit status."""
        if self.figure is not None:
            _save(draw, self.figure, self.size)
        if out is not None:
            with whole_file(out, _UNWRITTEN) as partial:
                curves.to_frame().to_csv(partial, index=False)
        if self.printing.as_json:
            emit_json({**curves.to_dict(), **more})
        elif not self.printing.quiet:
            emit(curves.summary())
        self._leave(standing=standing)

    def _leave(self, *, standing: bool) -> None:
        if not (standing or self.printing.as_json or self.printing.quiet):
            emit("No parameter could be estimated from this record: exit status 1.")
        raise typer.Exit(0 if standing else EXIT_NO_ESTIMATE)


def file_origin(file: Path, columns: "Mapping[str, Column]") -> dict[str, Any]:
    """Return the file and its columns as they were understood."""
    echoed: dict[str, dict[str, object]] = {
        n: {"column": c.name, "unit": c.unit} | ({} if c.factor is None else {"factor": c.factor})
        for n, c in columns.items()
    }
    return {"file": str(file), "columns": echoed}


def check_figure(figure: Path | None) -> None:
    """Refuse a figure that could not be written."""
    _check_target("--figure", figure, (".svg", ".pdf", ".png"))


def check_table(out: Path | None) -> None:
    """Refuse a csv file that could not be written."""
    _check_target("--out", out, (".csv",))


def _check_target(option: str, file: Path | None, kinds: tuple[str, ...]) -> None:
    if file is None:
        return
    if file.suffix.lower() not in kinds:
        raise typer.BadParameter(
            f"{option} {file}: expected a name that ends in {' or '.join(kinds)}."
        )
    if file.is_dir() or not file.absolute().parent.is_dir():
        raise typer.BadParameter(f"{option} {file}: expected a file in a folder that exists.")


def _save(draw: "Callable[[Axes], object]", figure: Path, size: tuple[float, float]) -> None:
    """Write the figure, whole or not at all."""
    from matplotlib.figure import Figure

    canvas = Figure(figsize=size)
    draw(canvas.subplots())
    save_canvas(canvas, figure)


def save_drawn(draw: "Callable[[Canvas], object]", figure: Path, size: tuple[float, float]) -> None:
    """Draw on a canvas of a size in inches, in the style of figures, and write it."""
    from matplotlib.figure import Figure

    from jointz.results.figure_style import figure_style

    with figure_style():
        canvas = Figure(figsize=size, layout="constrained")
        draw(canvas)
        save_canvas(canvas, figure)


def save_canvas(canvas: "Canvas", figure: Path) -> None:
    """Write a figure, whole or not at all."""
    kind = figure.suffix.removeprefix(".")
    with whole_file(figure, _UNWRITTEN) as partial:
        canvas.savefig(partial, format=kind, bbox_inches="tight", dpi=150)


def _without_rows(summary: str, names: Container[str]) -> str:
    """Return a summary without the lines that the table above it has."""
    title, *lines = summary.splitlines()
    kept = [line for line in lines if (line.split() or [""])[0] not in names]
    return "\n".join([title, *kept])


def _print_table(table: "pd.DataFrame") -> None:
    def number(value: float | None) -> str:
        return "-" if value is None or value != value else f"{value:.4g}"

    def interval(low: float | None, high: float | None) -> str:
        ends = number(low), number(high)
        return "-" if ends == ("-", "-") else " to ".join(ends)

    rows: list[list[str]] = [
        [
            row["parameter"],
            number(row["value"]),
            interval(row["ci_low"], row["ci_high"]),
            row["unit"],
            row["status"],
        ]
        for row in table.to_dict("records")
    ]
    level = float(table["ci_level"].iloc[0])
    emit_table(rows, ["parameter", "value", f"{100 * level:g} % interval", "unit", "status"])
