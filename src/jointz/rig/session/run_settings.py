"""Settings of a run, and the names of its files."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from jointz.core.protocols.protocol import Protocol
from jointz.core.protocols.protocol_models import ConditionSpec

#: The folder of a study that holds what was recorded.
SESSIONS = "sessions"
#: Newest live estimate of a participant, in the folder of the session.
LIVE_FILE = "live.json"


@dataclass(frozen=True, slots=True)
class RunSettings:
    """Settings of a run."""

    protocol: Protocol
    seed: int  # seed of plan and simulation
    clock: Literal["fast", "real"]  # ``fast``: virtual time; ``real``: clock of the machine
    study: Path  # folder of the study
    attended: bool = False  # whether the run is controlled from an operator's page
    salvage: bool = False  # whether damaged records are left out instead of refused
    live: bool = False  # whether a process beside the session estimates while it runs

    def session_folder(self, participant: str) -> Path:
        """Return where a participant's session is kept."""
        return self.study / SESSIONS / participant


def recording_name(participant: str, condition: str) -> str:
    """Return the name of a recording's file in the study."""
    return f"{participant}_{condition}.nc"


def pulses_name(participant: str, condition: str) -> str:
    """Return the name of the table of pulses of a recording."""
    return f"{participant}_{condition}_pulses.csv"


def has_pulse_table(protocol: Protocol, condition: ConditionSpec) -> bool:
    """Return whether a recording has a table of pulses; recordings of a bench have none."""
    return condition.perturbations is not None and protocol.kind != "bench"
