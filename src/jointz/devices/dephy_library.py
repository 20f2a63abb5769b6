"""What flexsea does beside its work, undone."""

import contextlib
import importlib
import io
import logging
import sys
from collections.abc import Iterator
from typing import Any

from jointz.core.errors import DeviceError

_LOG = logging.getLogger(__name__)


def flexsea_device(name: str) -> Any:
    """Return flexsea's class of a device."""
    try:
        return importlib.import_module("flexsea.device").Device
    except ImportError as exc:
        raise DeviceError(
            name, 'flexsea is not installed. Install it: pip install "jointz[dephy]".'
        ) from exc


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
