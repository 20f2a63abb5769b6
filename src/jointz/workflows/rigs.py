"""Which rig an experiment is run on."""

from dataclasses import dataclass

from jointz.core.errors import DataError
from jointz.devices.interface import Rig

DEVICES = ("sim",)
PRESETS = ("clean", "nominal", "hard", "anthropometric")


@dataclass(frozen=True, slots=True)
class RigSettings:
    """The devices, and for simulated ones how well they and people behave.

    Parameters
    ----------
    device : str
        ``sim``: the simulated walking human with an exoskeleton.
    preset : str
        Of the simulation: ``clean``, ``nominal``, ``hard`` or ``anthropometric``.
    seed : int
        Of the simulation.
    sample_rate_hz : float, Hz
        Of all simulated devices.
    """

    device: str = "sim"
    preset: str = "nominal"
    seed: int = 1
    sample_rate_hz: float = 500.0

    def __post_init__(self) -> None:
        if self.device not in DEVICES:
            raise DataError(f"device: expected one of {', '.join(DEVICES)}; got {self.device!r}.")
        if self.preset not in PRESETS:
            raise DataError(f"preset: expected one of {', '.join(PRESETS)}; got {self.preset!r}.")


def open_rig(settings: RigSettings, number: int) -> Rig:
    """Return the rig of one participant.

    Parameters
    ----------
    settings : RigSettings
        Which devices.
    number : int
        Of the participant, from 0.
    """
    from jointz.sim.rig import simulated_rig

    return simulated_rig(
        number,
        preset=settings.preset,
        seed=settings.seed,
        sample_rate_hz=settings.sample_rate_hz,
    )
