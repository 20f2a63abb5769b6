"""Tables and progress on a terminal and elsewhere."""

import io
import os
import subprocess
import sys
import time

import pytest

from jointz.core.errors import OutputError
from jointz.terminal.output import emit, emit_json, emit_table
from jointz.terminal.progress_bars import experiment_bars, progress_bar


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def terminal(monkeypatch, stream):
    screen = Terminal()
    monkeypatch.setattr(sys, stream, screen)
    return screen


def test_elsewhere_a_table_is_separated_by_tabs(capsys):
    emit_table([["a", "1"], ["b", "2"]], ["name", "value"], title="Title")
    emit_table([["a", "1"]], ["name", "value"])
    assert capsys.readouterr().out == "Title\nname\tvalue\na\t1\nb\t2\nname\tvalue\na\t1\n"


def test_on_a_terminal_a_table_is_drawn_and_names_in_it_are_no_markup(monkeypatch):
    screen = terminal(monkeypatch, "stdout")
    emit_table([["[bold]lab[/bold] :smile:", "[/]"]], ["[red]name", "value"], title="[i]Title")
    for text in ("[bold]lab[/bold] :smile:", "[/]", "[red]name", "[i]Title"):
        assert text in screen.getvalue()
    assert "\t" not in screen.getvalue()


def test_names_in_progress_are_no_markup(monkeypatch):
    screen = terminal(monkeypatch, "stderr")
    with progress_bar(shown=True) as progress:
        progress(1, 2, "[lab] [/x]")
        drawn_at_least(screen, "[lab] [/x]")
    with experiment_bars(shown=True) as bars:
        bars.experiment("[/S01]", "[b]NWC", 3, 0, 0)
        bars.analysis(1, 2, "[/told]")
        drawn_at_least(screen, "[/S01] [b]NWC")
        drawn_at_least(screen, "[/told]")


@pytest.mark.parametrize("terminal", [True, False])
@pytest.mark.parametrize("shown", [True, False])
def test_progress_is_drawn_on_a_terminal_only(monkeypatch, terminal, shown):
    screen = Terminal() if terminal else io.StringIO()
    monkeypatch.setattr(sys, "stderr", screen)
    with progress_bar(shown=shown) as progress:
        assert (progress is not None) == (terminal and shown)
        if progress:
            progress(1, 2, "S02")
    assert bool(screen.getvalue()) == (terminal and shown)


def test_while_it_is_paused_nothing_is_drawn(monkeypatch):
    screen = terminal(monkeypatch, "stderr")
    with experiment_bars(shown=True) as bars:
        bars.experiment("S01", "NWC", 3, 0, 0)
        with bars.paused():
            before = screen.getvalue()
            bars.experiment("S01", "NWC", 4, 0, 0)
            assert screen.getvalue() == before
            assert sys.stderr is screen  # and not what draws lines above the bars
        bars.experiment("S02", "NWC", 5, 0, 0)
        drawn_at_least(screen, "5 strides")


def drawn_at_least(screen, text):
    for _ in range(100):
        if text in screen.getvalue():
            return
        time.sleep(0.02)
    pytest.fail(f"{text!r} is not on the screen")


def test_where_nothing_is_shown_there_is_nothing_to_pause(monkeypatch):
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with experiment_bars(shown=True) as bars, bars.paused():
        assert bars.experiment is None


def test_a_closed_stdout_is_an_output_error_once(monkeypatch):
    monkeypatch.setattr(sys, "stdout", None)
    with pytest.raises(OutputError, match=r"stdout: cannot be written \(it is closed\)") as caught:
        emit_table([["a", "1"]], ["name", "value"])
    with sys.stdout:  # what is still to come goes nowhere
        emit("more")

    assert isinstance(caught.value.__cause__, OSError)


def test_a_closed_stderr_shows_no_progress(monkeypatch):
    monkeypatch.setattr(sys, "stderr", None)
    with progress_bar(shown=True) as progress, experiment_bars(shown=True) as bars:
        assert (progress, bars.experiment) == (None, None)


def test_json_refuses_what_is_not_json():
    with pytest.raises(ValueError, match="not JSON compliant"):
        emit_json({"value": float("nan")})


@pytest.mark.skipif(sys.platform == "win32", reason="another error of the system")
def test_a_reader_that_has_enough_ends_the_output_quietly():
    code = "from jointz.terminal.output import emit\nfor _ in range(9000): emit('a line')"
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [sys.executable, "-c", code], stdout=writer, stderr=subprocess.PIPE, check=False
    )
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, b"")
