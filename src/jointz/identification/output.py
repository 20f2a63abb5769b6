"""Options that the commands of ``jointz identify`` share, the fit of a file, and its output."""

from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import typer

from jointz.core.whole_file import whole_file
from jointz.terminal.file_options import Figure, Rate, TextOptions, Time
from jointz.terminal.options import Printing
from jointz.terminal.output import EXIT_NO_ESTIMATE, emit, emit_json, emit_table
from jointz.terminal.printout import UNWRITTEN, check_figure, check_table, failures, save_canvas

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

#: Samples for the figure alone: not part of what ``--json`` prints.
_FOR_FIGURES = "series"

FitT = TypeVar("FitT")


@dataclass(frozen=True, slots=True)
class Clock:
    """Options about the times of the samples."""

    time: Time = None
    rate: Rate = None


@dataclass(frozen=True, slots=True)
class Answer:
    """Options about the layout of the file, and about figure and text of the result."""

    figure: Figure = None
    text: TextOptions = field(default_factory=TextOptions)
    printing: Printing = field(default_factory=Printing)


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

    @property
    def status(self) -> str:
        """Status of the estimate, as in ``--json``."""

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the result."""


@dataclass(frozen=True, slots=True)
class Output:
    """Fit of a file by a command, and what the command prints and writes."""

    model: str  # fitted model, for JSON
    answer: Answer
    size: tuple[float, float] = (7.1, 3.5)  # inches: size of the figure
    out: Path | None = None  # table of curves

    def __post_init__(self) -> None:
        """Refuse a table or figure that could not be written, before the work is done."""
        check_table(self.out)
        check_figure(self.answer.figure)

    def identify(
        self,
        method: Callable[..., FitT],
        file: Path,
        columns: Mapping[str, str | None],
        /,
        *,
        clock: Clock = Clock(),
        **settings: Any,
    ) -> tuple[FitT, dict[str, Any]]:
        """Return the fit of a file, and the file and its columns as they were understood."""
        from jointz.identification.identify_file import identify_file

        stated = {name: text for name, text in columns.items() if text is not None}
        with failures(self.answer.printing, model=self.model):
            layout = self.answer.text.layout()
            fit, parsed = identify_file(
                method, file, stated, files=layout, rate_hz=clock.rate, **settings
            )
        echoed: dict[str, dict[str, object]] = {
            name: {"column": c.name, "unit": c.unit}
            | ({} if c.factor is None else {"factor": c.factor})
            for name, c in parsed.items()
        }
        return fit, {"file": str(file), "columns": echoed}

    def report(self, fit: Fit, origin: Mapping[str, Any], **more: Any) -> None:
        """Write the figure, print the result and leave with its exit status."""
        self._draw(fit.plot)
        table = fit.to_frame()
        if self.answer.printing.as_json:
            content = {k: v for k, v in fit.to_dict().items() if k != _FOR_FIGURES}
            emit_json({**content, "model": self.model, "status": fit.status, **more, **origin})
        elif not self.answer.printing.quiet:
            _print_table(table)
            emit(_without_rows(fit.summary(), set(table["parameter"])))
        self._leave(standing=bool(table["status"].isin(["ok", "at_bound"]).any()))

    def report_curves(
        self, curves: Curves, draw: "Callable[[Axes], object]", *, standing: bool, **more: Any
    ) -> None:
        """Write figure and csv file, print the result and leave with its exit status."""
        self._draw(draw)
        if self.out is not None:
            with whole_file(self.out, UNWRITTEN) as partial:
                curves.to_frame().to_csv(partial, index=False)
        if self.answer.printing.as_json:
            emit_json({**curves.to_dict(), "model": self.model, **more})
        elif not self.answer.printing.quiet:
            emit(curves.summary())
        self._leave(standing=standing)

    def _draw(self, draw: "Callable[[Axes], object]") -> None:
        """Write the figure, whole or not at all."""
        if self.answer.figure is None:
            return
        from matplotlib.figure import Figure as Canvas

        canvas = Canvas(figsize=self.size)
        draw(canvas.subplots())
        save_canvas(canvas, self.answer.figure)

    def _leave(self, *, standing: bool) -> None:
        printing = self.answer.printing
        if not (standing or printing.as_json or printing.quiet):
            emit("No parameter could be estimated from this record: exit status 1.")
        raise typer.Exit(0 if standing else EXIT_NO_ESTIMATE)


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
