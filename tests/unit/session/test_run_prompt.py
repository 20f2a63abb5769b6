"""``jointz run``: the operator's prompt and the terminal it shares."""

from contextlib import contextmanager

import pytest
import typer

from jointz.session import command


@pytest.fixture
def screen(monkeypatch):
    """Note what happens on the terminal, in order."""
    events = []
    monkeypatch.setattr(command.typer, "prompt", lambda text, **_: events.append(text))
    monkeypatch.setattr(command.typer, "echo", lambda **_: events.append("line ended"))
    return events


def alone_on(events):
    @contextmanager
    def alone():
        events.append("hidden")
        yield
        events.append("drawn again")

    return alone


def test_nothing_is_drawn_while_the_operator_reads_the_prompt(screen):
    command._Prompting(alone_on(screen)).prompt("Walk.")

    assert screen == ["hidden", "Walk. [Enter]", "drawn again"]


def test_ctrl_c_at_the_prompt_ends_its_line_and_draws_nothing_more(screen, monkeypatch):
    def stopped(text, **_):
        screen.append(text)
        raise typer.Abort

    monkeypatch.setattr(command.typer, "prompt", stopped)
    with pytest.raises(KeyboardInterrupt):
        command._Prompting(alone_on(screen)).prompt("Walk.")

    assert screen == ["hidden", "Walk. [Enter]", "line ended"]
