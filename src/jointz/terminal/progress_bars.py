"""Progress bars of commands and of the Python face, on a terminal or in a notebook."""

import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from time import monotonic

from jointz.tasks.progress import Progress, RunProgress
from jointz.terminal.output import is_terminal

#: Tasks of minutes need a long view for the time left.
_RATE_OVER_S = 600.0


@contextmanager
def shown_progress(*, progress: Progress | bool | None) -> Iterator[Progress]:
    """Yield the caller's function of progress; for True one that draws a bar where people look."""
    if callable(progress):
        yield progress
        return
    with progress_bar(shown=bool(progress)) as drawn:
        yield drawn or _silent


@contextmanager
def shown_run_progress(*, progress: RunProgress | bool | None) -> Iterator[RunProgress]:
    """Yield the caller's function of a run's progress; for True one that draws bars."""
    if callable(progress):
        yield progress
        return
    with experiment_bars(shown=bool(progress)) as bars:
        yield bars.experiment or _silent


def _silent(*_: object) -> None:
    """Show nothing."""


@contextmanager
def progress_bar(*, shown: bool) -> Iterator[Progress | None]:
    """Yield a callback that draws a progress bar on a terminal or in a notebook, else None."""
    if shown and _in_notebook():
        yield _notebook_progress()
        return
    if not shown or not is_terminal(sys.stderr):
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as RichProgress

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
    with RichProgress(
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

    # arguments: participant, condition, strides, pulses done, pulses planned
    experiment: RunProgress | None = None
    analysis: Progress | None = None  # arguments: number done, total number, name of the next step
    # factory of a context without drawing; after an error the bars stay away
    paused: Callable[[], AbstractContextManager[None]] = nullcontext


@contextmanager
def experiment_bars(*, shown: bool) -> Iterator[Bars]:
    """Yield callbacks that draw a bar for each participant and one for the analysis."""
    if shown and _in_notebook():
        yield Bars(_notebook_run_progress(), _notebook_progress())
        return
    if not shown or not is_terminal(sys.stderr):
        yield Bars()
        return
    from rich.console import Console
    from rich.live import Live
    from rich.progress import BarColumn, TaskID, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as RichProgress

    columns = (
        TextColumn("{task.description:<20}", markup=False),
        BarColumn(),
        TextColumn("{task.fields[text]:<28}", markup=False),
        TimeElapsedColumn(),
    )
    tasks: dict[str, TaskID] = {}
    console = Console(stderr=True)
    with RichProgress(*columns, console=console, transient=True) as bars:

        def task(name: str) -> TaskID:
            if name not in tasks:
                tasks[name] = bars.add_task(name, total=None, text="")
            return tasks[name]

        def experiment(who: str, condition: str, strides: int, done: int, planned: int) -> None:
            pulses = f", {done}/{planned} pulses" if planned else ""
            bars.update(
                task(who),
                description=f"{who} {condition}",
                total=planned or None,
                completed=done,
                text=f"{strides} strides{pulses}",
            )

        def analysis(done: int, total: int, what: str) -> None:
            bars.update(task("analysis"), total=total, completed=done, text=what)

        @contextmanager
        def paused() -> Iterator[None]:
            bars.stop()
            yield
            # A new display: the old one would go up as many lines as it had, over others'.
            bars.live = Live(console=console, transient=True, get_renderable=bars.get_renderable)
            bars.start()

        yield Bars(experiment, analysis, paused)


def _in_notebook() -> bool:
    """Whether this is a Jupyter kernel, which shows what a cell displays."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    return hasattr(shell, "kernel")


def _notebook_line() -> Callable[[str], None]:
    """Return a function that replaces one line of text under a notebook's cell."""
    from IPython.display import display

    line = display({"text/plain": ""}, raw=True, display_id=True)

    def show(text: str) -> None:
        line.update({"text/plain": text}, raw=True)

    return show


def _notebook_progress() -> Progress:
    show, start = _notebook_line(), monotonic()

    def update(done: int, total: int, what: str) -> None:
        filled = round(20 * done / max(total, 1))
        seconds = monotonic() - start
        left = f", {seconds * (total - done) / done:.0f} s left" if 0 < done < total else ""
        show(f"{'█' * filled}{'░' * (20 - filled)} {done}/{total} {what} ({seconds:.0f} s{left})")

    return update


def _notebook_run_progress() -> RunProgress:
    show = _notebook_line()
    people: dict[str, str] = {}

    def update(who: str, condition: str, strides: int, done: int, planned: int) -> None:
        pulses = f", {done}/{planned} pulses" if planned else ""
        people[who] = f"{who} {condition}: {strides} strides{pulses}"
        show("\n".join(people.values()))

    return update
