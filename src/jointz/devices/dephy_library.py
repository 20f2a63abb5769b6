"""Undo what flexsea changes in the whole program."""

import contextlib
import io
import logging
import sys
from collections.abc import Iterator

_LOG = logging.getLogger(__name__)


@contextlib.contextmanager
def traceback_limit_kept() -> Iterator[None]:
    """Undo that flexsea sets ``sys.tracebacklimit = 0`` for the whole program.

    Every error would lose where it came from.
    """
    missing = object()
    limit = getattr(sys, "tracebacklimit", missing)
    try:
        yield
    finally:
        if limit is not missing:
            sys.tracebacklimit = limit  # type: ignore[assignment]
        elif hasattr(sys, "tracebacklimit"):
            del sys.tracebacklimit


@contextlib.contextmanager
def flexsea_kept_quiet() -> Iterator[None]:
    """Keep its prints out of stdout, which belongs to ``--json``, and restore tracebacks."""
    said = io.StringIO()
    try:
        with traceback_limit_kept(), contextlib.redirect_stdout(said):
            yield
    finally:
        if text := said.getvalue().strip():
            _LOG.debug("flexsea: %s", text)
