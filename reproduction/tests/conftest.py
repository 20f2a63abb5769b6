"""The command of the reproduction, run inside the test's process."""

import json
import sys

import pytest
from reproduction.__main__ import main


@pytest.fixture
def command(monkeypatch, capsys):
    """Return what runs the command: its exit status, its output, or its output as JSON."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["reproduction", *map(str, arguments)])
        monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")  # the command sets it
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main()
        out = capsys.readouterr().out
        return end.value.code or 0, json.loads(out) if "--json" in arguments else out

    return call
