"""How an experiment is run, and what its files are called."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from jointz.core.protocols.protocol import Protocol
from jointz.experiment.timing import timing_report
from jointz.io.log_reader import SessionLog

#: The folder of a study that holds what was recorded.
SESSIONS = "sessions"


@dataclass(frozen=True, slots=True)
class RunSettings:
    """How an experiment is run."""

    protocol: Protocol  # what to do
    seed: int  # of plan and simulation
    clock: Literal["fast", "real"]  # virtual or the machine's
    study: Path  # the study's folder
    attended: bool = False  # whether an operator's page starts, pauses and stops
    # whether damaged parts of what was recorded are left out instead of refused
    salvage: bool = False

    def session_folder(self, participant: str) -> Path:
        """Return where a participant's session is kept."""
        return self.study / SESSIONS / participant


def recording_name(participant: str, condition: str) -> str:
    """Return the name of a recording's file in the study."""
    return f"{participant}_{condition}.nc"


def pulses_name(participant: str, condition: str) -> str:
    """Return the name of the table of pulses of a recording."""
    return f"{participant}_{condition}_pulses.csv"


def timing_rows(
    wearer: str, condition: str, logs: Sequence[SessionLog], settings: RunSettings
) -> list[dict[str, Any]]:
    """Return how well the loop kept its time, a row a log."""
    period_ns = round(1e9 / settings.protocol.rates.control_hz)
    return [
        {
            "participant": wearer,
            "condition": condition,
            "segment": log.header["segment"],
            **timing_report(log.records, period_ns),
        }
        for log in logs
    ]
