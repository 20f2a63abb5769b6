"""Tables and progress on a terminal and elsewhere."""

import io
import sys

import pytest

from jointz.cli.console import emit_json, emit_table, progress_bar


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_elsewhere_a_table_is_separated_by_tabs(capsys):
    emit_table([["a", "1"], ["b", "2"]], ["name", "value"], title="Title")
    emit_table([["a", "1"]], ["name", "value"])
    assert capsys.readouterr().out == "Title\nname\tvalue\na\t1\nb\t2\nname\tvalue\na\t1\n"


def test_on_a_terminal_a_table_is_drawn(monkeypatch):
    screen = Terminal()
    monkeypatch.setattr(sys, "stdout", screen)
    emit_table([["a", "1"]], ["name", "value"], title="Title")
    assert "Title" in screen.getvalue()
    assert "\t" not in screen.getvalue()


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


def test_json_refuses_what_is_not_json():
    with pytest.raises(ValueError, match="not JSON compliant"):
        emit_json({"value": float("nan")})
