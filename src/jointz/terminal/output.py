"""Output of commands: results and errors."""

import errno
import json
import os
import sys
from collections.abc import Mapping
from typing import Any, TextIO

from jointz.core.errors import WriteError

EXIT_OK = 0
EXIT_NO_ESTIMATE = 1
EXIT_BAD_INPUT = 2
EXIT_DEVICE = 3


def emit(text: str = "") -> None:
    """Print a line of results."""
    try:
        _write_line(text)
    except BrokenPipeError:  # the reader, such as head, has enough
        _discard_stdout()
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
    if not is_terminal(sys.stdout):
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


def is_terminal(stream: TextIO | None) -> bool:
    """Whether people see a stream as it is written; where it was closed it is None."""
    return stream is not None and stream.isatty()
