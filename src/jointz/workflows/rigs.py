"""Which rig an experiment is run on."""

from dataclasses import dataclass

from jointz.core.errors import DataError
from jointz.core.protocol import LoadSpec, Protocol
from jointz.core.walking_speed import REFERENCE_SPEED_M_S
from jointz.devices.interface import Rig

DEVICES = ("sim",)
PRESETS = ("clean", "nominal", "hard", "anthropometric")
_BENCH_PRESETS = ("clean", "nominal", "hard")


@dataclass(frozen=True, slots=True)
class RigSettings:
    """The devices, and for simulated ones how well they and people behave.

    Parameters
    ----------
    device : str
        ``sim``: the simulated walking human with an exoskeleton, or a simulated bench.
    preset : str
        Of the simulation: ``clean``, ``nominal``, ``hard`` or, for people,
        ``anthropometric``.
    seed : int
        Of the simulation.
    sample_rate_hz : float, Hz
        Of all simulated devices.
    bench : str, optional
        Which bench, for a protocol of one; None for walking.
    loads : tuple of LoadSpec
        Of the bench.
    speed_m_s : float, m/s
        At which simulated people walk.
    """

    device: str = "sim"
    preset: str = "nominal"
    seed: int = 1
    sample_rate_hz: float = 500.0
    bench: str | None = None
    loads: tuple[LoadSpec, ...] = ()
    speed_m_s: float = REFERENCE_SPEED_M_S

    def __post_init__(self) -> None:
        presets = PRESETS if self.bench is None else _BENCH_PRESETS
        if self.device not in DEVICES:
            raise DataError(f"device: expected one of {', '.join(DEVICES)}; got {self.device!r}.")
        if self.preset not in presets:
            raise DataError(f"preset: expected one of {', '.join(presets)}; got {self.preset!r}.")


def rig_settings(protocol: Protocol, device: str, preset: str, seed: int) -> RigSettings:
    """Return the settings of the rig that a protocol asks for.

    Parameters
    ----------
    protocol : Protocol
        Of the experiment.
    device, preset, seed
        As :class:`RigSettings` has them.

    Raises
    ------
    DataError
        When device or preset are none, or a bench protocol does not say which bench.
    """
    if protocol.gait is not None:
        return RigSettings(
            device,
            preset,
            seed,
            protocol.rates.sample_hz,
            speed_m_s=protocol.gait.speed_m_s,
        )
    if protocol.bench is None:
        raise DataError(
            f"{protocol.name}: bench: missing; the simulated devices need to know which: "
            '"series-elastic" or "quasi-direct-drive".'
        )
    return RigSettings(
        device, preset, seed, protocol.rates.sample_hz, protocol.bench, protocol.loads
    )


def open_rig(settings: RigSettings, number: int) -> Rig:
    """Return the rig of one participant or load.

    Parameters
    ----------
    settings : RigSettings
        Which devices.
    number : int
        Of the participant or load, from 0.
    """
    if settings.bench is not None:
        from jointz.sim.bench_rig import simulated_bench

        return simulated_bench(
            settings.bench,
            settings.loads[number] if settings.loads else LoadSpec(name="bench"),
            preset=settings.preset,
            seed=settings.seed,
            sample_rate_hz=settings.sample_rate_hz,
        )
    from jointz.sim.rig import simulated_rig

    return simulated_rig(
        number,
        preset=settings.preset,
        seed=settings.seed,
        sample_rate_hz=settings.sample_rate_hz,
        speed_m_s=settings.speed_m_s,
    )
