"""Output of commands: results on stdout, progress and errors on stderr."""

import errno
import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TextIO

from jointz.core.errors import WriteError

if TYPE_CHECKING:
    from jointz.tasks.progress import Progress, RunProgress

EXIT_OK = 0
EXIT_NOTHING_STANDS = 1
EXIT_BAD_INPUT = 2
EXIT_DEVICE = 3

#: Tasks of minutes need a long view for the time left.
_RATE_OVER_S = 600.0


def emit(text: str = "") -> None:
    """Print a line of results."""
    try:
        _write_line(text)
    except OSError as exc:
        _discard_stdout()
        raise WriteError("stdout", exc, "Send it where it can go.") from exc


def _write_line(text: str) -> None:
    if sys.stdout is None:  # so Python has it where the shell closed it
        raise OSError(errno.EBADF, "it is closed")
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def _discard_stdout() -> None:
    """Send what is still to come nowhere: Python would try again at its end, and complain."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    if sys.stdout is None:
        sys.stdout = os.fdopen(nowhere, "w")
    else:
        os.dup2(nowhere, sys.stdout.fileno())


def emit_json(content: Mapping[str, Any]) -> None:
    """Print one JSON object on stdout."""
    emit(json.dumps(content, indent=2, allow_nan=False))


def emit_error(kind: str, message: str) -> None:
    """Print the JSON object that tells an error on stdout."""
    emit_json({"status": "error", "error": kind, "message": message})


def emit_table(rows: list[list[str]], header: list[str], *, title: str = "") -> None:
    """Print a table: by rich on a terminal, tab-separated elsewhere."""
    if not _is_terminal(sys.stdout):
        if title:
            emit(title)
        for row in [header, *rows]:
            emit("\t".join(row))
        return
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title or None, title_justify="left", header_style="bold")
    for k, name in enumerate(header):
        table.add_column(name, justify="left" if k == 0 else "right")
    for row in rows:
        table.add_row(*row)
    # Names are as people wrote them: brackets in them are no styles, colons no pictures.
    Console(markup=False, emoji=False).print(table)


def _is_terminal(stream: TextIO | None) -> bool:
    return stream is not None and stream.isatty()


@contextmanager
def progress_bar(*, shown: bool) -> Iterator["Progress | None"]:
    """Yield a callback that draws a progress bar on a terminal's stderr, None if not shown."""
    if not shown or not _is_terminal(sys.stderr):
        yield None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description:<24}", markup=False),
        BarColumn(),
        TextColumn("{task.completed:.0f}/{task.total:.0f}"),
        TextColumn("{task.fields[rate]}"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    console = Console(stderr=True)
    with Progress(
        *columns, console=console, transient=True, speed_estimate_period=_RATE_OVER_S
    ) as bar:
        task = bar.add_task("starting", total=1, rate="")

        def update(done: int, total: int, what: str) -> None:
            rate = _rate(done, bar.tasks[0].elapsed)
            bar.update(task, completed=done, total=total, description=what, rate=rate)

        yield update


def _rate(done: int, seconds: float | None) -> str:
    return f"{60.0 * done / seconds:.3g}/min" if done and seconds else ""


@dataclass(frozen=True, slots=True)
class Bars:
    """Callbacks of progress bars, None where nothing is shown."""

    # called with participant, condition, strides, pulses done, pulses planned
    experiment: "RunProgress | None" = None
    analysis: "Progress | None" = None  # called with done, of how many, what comes next
    # makes a context in which nothing is drawn; after an error the bars are not drawn again
    paused: Callable[[], AbstractContextManager[None]] = nullcontext


@contextmanager
def experiment_bars(*, shown: bool) -> Iterator[Bars]:
    """Yield callbacks that draw a bar for each participant and one for the analysis on stderr."""
    if not shown or not _is_terminal(sys.stderr):
        yield Bars()
        return
    from rich.console import Console
    from rich.live import Live
    from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description:<20}", markup=False),
        BarColumn(),
        TextColumn("{task.fields[told]:<28}", markup=False),
        TimeElapsedColumn(),
    )
    tasks: dict[str, TaskID] = {}
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True) as bars:

        def task(name: str) -> TaskID:
            if name not in tasks:
                tasks[name] = bars.add_task(name, total=None, told="")
            return tasks[name]

        def experiment(who: str, condition: str, strides: int, done: int, planned: int) -> None:
            pulses = f", {done}/{planned} pulses" if planned else ""
            bars.update(
                task(who),
                description=f"{who} {condition}",
                total=planned or None,
                completed=done,
                told=f"{strides} strides{pulses}",
            )

        def analysis(done: int, total: int, what: str) -> None:
            bars.update(task("analysis"), total=total, completed=done, told=what)

        @contextmanager
        def paused() -> Iterator[None]:
            bars.stop()
            yield
            # A new display: the old one would go up as many lines as it had, over others'.
            bars.live = Live(console=console, transient=True, get_renderable=bars.get_renderable)
            bars.start()

        yield Bars(experiment, analysis, paused)
