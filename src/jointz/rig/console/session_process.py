"""Process of a session: a child of the page's process that outlives it."""

import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path

from jointz.core.errors import DataError
from jointz.rig.session.live.live_session import control_files, holder_of

#: Length of the end of the child's messages that is kept.
_LONGEST_WORDS = 2000
_PATIENCE_S, _LOOK_S = 5.0, 0.05


class SessionProcess:
    """Runs a session in a process of its own, or watches another process."""

    def __init__(self, study: Path, arguments: Sequence[str]) -> None:
        self._study = study
        self._arguments = tuple(arguments)
        self._child: subprocess.Popen[bytes] | None = None
        self._words = tempfile.TemporaryFile()  # noqa: SIM115 - as long as the page
        self._lock = threading.Lock()

    @property
    def can_start(self) -> bool:
        """Whether this page can start the session."""
        return bool(self._arguments)

    @property
    def is_own(self) -> bool:
        """Whether the session's process lives and was started here."""
        return self._own_number is not None

    @property
    def number(self) -> int | None:
        """The number of the session's process, whoever started it; None if none is alive."""
        return self._own_number or holder_of(self._study)

    @property
    def _own_number(self) -> int | None:
        living = self._child is not None and self._child.poll() is None
        return self._child.pid if self._child is not None and living else None

    def alive(self) -> bool:
        """Tell whether the session's process lives, whoever started it."""
        return self.number is not None

    def start(self, *, resume: bool) -> None:
        """Start the session, or go on with it."""
        with self._lock:
            if not self.can_start:
                raise DataError(
                    f"{self._study}: this page can only watch. Give the protocol and --resume."
                )
            # A stopped session may still be closing its devices.
            patience = time.monotonic() + (_PATIENCE_S if resume else 0.0)
            while self.alive() and time.monotonic() < patience:
                time.sleep(_LOOK_S)
            if self.alive():
                raise DataError(f"{self._study}: the session's process lives; nothing to start.")
            for file in control_files(self._study):  # of a session that was killed
                file.unlink(missing_ok=True)
            self._words.seek(0)
            self._words.truncate()
            # A session of its own: neither a Ctrl-C nor the end of the page's process reaches it.
            self._child = subprocess.Popen(  # arguments, no shell
                [sys.executable, "-m", "jointz", "run", *self._arguments] + ["--resume"] * resume,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=self._words,
                start_new_session=True,
            )

    def close(self) -> None:
        """Close the file of messages; the process lives on."""
        self._words.close()

    def last_words(self) -> str:
        """Return the end of the process's messages on stderr."""
        try:
            size = self._words.seek(0, 2)
            self._words.seek(max(0, size - _LONGEST_WORDS))
            return self._words.read().decode(errors="replace").strip()
        except ValueError:  # closed
            return ""
