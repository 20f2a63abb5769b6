"""How an experiment is run, and what its files are called."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from jointz.core.protocol import Protocol
from jointz.experiment.timing import timing_report
from jointz.io.session_log import SessionLog

#: The folder of a study that holds what was recorded.
SESSIONS = "sessions"


@dataclass(frozen=True, slots=True)
class RunSettings:
    """How an experiment is run.

    Parameters
    ----------
    protocol : Protocol
        What to do.
    seed : int
        Of plan and simulation.
    clock : {"fast", "real"}
        Virtual or the machine's.
    study : pathlib.Path
        The study's folder.
    attended : bool
        Whether an operator's page starts, pauses and stops.
    salvage : bool
        Whether damaged parts of what was recorded are left out instead of refused.
    """

    protocol: Protocol
    seed: int
    clock: Literal["fast", "real"]
    study: Path
    attended: bool = False
    salvage: bool = False

    def session_folder(self, participant: str) -> Path:
        """Return where a participant's session is kept.

        Parameters
        ----------
        participant : str
            Id.
        """
        return self.study / SESSIONS / participant


def recording_name(participant: str, condition: str) -> str:
    """Return the name of a recording's file in the study.

    Parameters
    ----------
    participant, condition : str
        Whose and which.
    """
    return f"{participant}_{condition}.nc"


def pulses_name(participant: str, condition: str) -> str:
    """Return the name of the table of pulses of a recording.

    Parameters
    ----------
    participant, condition : str
        Whose and which.
    """
    return f"{participant}_{condition}_pulses.csv"


def timing_rows(
    wearer: str, condition: str, logs: Sequence[SessionLog], settings: RunSettings
) -> list[dict[str, Any]]:
    """Return how well the loop kept its time, a row a log.

    Parameters
    ----------
    wearer, condition : str
        Whose, and in which condition.
    logs : sequence of SessionLog
        Of the condition.
    settings : RunSettings
        For the period of the loop.
    """
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
