"""Which rig an experiment is run on."""

from dataclasses import dataclass, replace

from jointz.core.errors import DataError
from jointz.core.protocols.protocol import CalibrationStep, LoadSpec, Protocol
from jointz.core.walking_speed import REFERENCE_SPEED_M_S
from jointz.devices.interface import Rig
from jointz.io.calibration_file import CalibrationFile
from jointz.session.rigs.calibrated_rig import CalibratedRig
from jointz.session.rigs.hardware_rig import Hardware, HardwareRig

DEVICES = ("sim",)
PRESETS = ("clean", "nominal", "hard", "anthropometric")
_BENCH_PRESETS = ("clean", "nominal", "hard")
#: In the others the frame of the exoskeleton is part of the limb: there is none to hang up.
_FRAME_PRESETS = ("anthropometric",)


@dataclass(frozen=True, slots=True)
class RigSettings:
    """The devices, and for simulated ones how well they and people behave."""

    # ``sim``: the simulated walking human with an exoskeleton, or a simulated bench
    device: str = "sim"
    # of the simulation: ``clean``, ``nominal``, ``hard`` or, for people, ``anthropometric``
    preset: str = "nominal"
    seed: int = 1  # of the simulation
    sample_rate_hz: float = 500.0  # Hz: of all simulated devices
    bench: str | None = None  # which bench, for a protocol of one; None for walking
    loads: tuple[LoadSpec, ...] = ()  # of the bench, or of the calibration's step
    speed_m_s: float = REFERENCE_SPEED_M_S  # m/s: at which simulated people walk
    # real devices instead of simulated ones; ``device`` and ``preset`` say ``hardware`` then
    hardware: Hardware | None = None
    step: CalibrationStep | None = None  # of a calibration, for a protocol of one
    # what a calibration knows of the instruments: it stands over what the rig knows
    known: CalibrationFile | None = None

    def __post_init__(self) -> None:
        if self.hardware is not None:
            return
        presets = PRESETS if self.bench is None else _BENCH_PRESETS
        if self.device not in DEVICES:
            raise DataError(f"device: expected one of {', '.join(DEVICES)}; got {self.device!r}.")
        if self.step == "frame" and self.preset in set(PRESETS) - set(_FRAME_PRESETS):
            raise DataError(
                f"preset: {self.preset!r} gives the simulated exoskeleton no frame of its own: it "
                "is part of the limb, and there is none to calibrate. Give 'anthropometric'."
            )
        if self.preset not in presets:
            raise DataError(f"preset: expected one of {', '.join(presets)}; got {self.preset!r}.")


def rig_settings(protocol: Protocol, device: str, preset: str, seed: int) -> RigSettings:
    """Return the settings of the rig that a protocol asks for."""
    if protocol.gait is not None:
        return RigSettings(
            device,
            preset,
            seed,
            protocol.rates.sample_hz,
            speed_m_s=protocol.gait.speed_m_s,
        )
    if protocol.calibration is not None:
        return RigSettings(
            device,
            preset,
            seed,
            protocol.rates.sample_hz,
            loads=protocol.loads,
            step=protocol.calibration,
        )
    if protocol.bench is None:
        raise DataError(
            f"{protocol.name}: bench: missing; the simulated devices need to know which: "
            '"series-elastic" or "quasi-direct-drive".'
        )
    return RigSettings(
        device, preset, seed, protocol.rates.sample_hz, protocol.bench, protocol.loads
    )


def hardware_settings(hardware: Hardware, seed: int) -> RigSettings:
    """Return the settings of a rig of real devices."""
    return RigSettings("hardware", "hardware", seed, hardware=hardware)


def with_calibration(settings: RigSettings, known: CalibrationFile, count: int) -> RigSettings:
    """Return the settings of a rig whose instruments a calibration knows."""
    ids = [open_rig(settings, number).wearer.id for number in range(count)]
    if not any(known.of(one).model_fields_set for one in ids):
        named = ", ".join(known.participants) or "nobody"
        raise DataError(
            f"calibration: has no entry for any of {', '.join(ids)}; it names {named}. Give the "
            "file of these participants."
        )
    return replace(settings, known=known)


def open_rig(settings: RigSettings, number: int) -> Rig:
    """Return the rig of one participant or load."""
    rig = _own_rig(settings, number)
    return rig if settings.known is None else CalibratedRig(rig, settings.known.of(rig.wearer.id))


def _own_rig(settings: RigSettings, number: int) -> Rig:
    """Return a rig with what it knows of its own instruments."""
    if settings.hardware is not None:
        return HardwareRig(settings.hardware, number)
    if settings.bench is not None:
        from jointz.sim.benches.bench_rig import simulated_bench

        return simulated_bench(
            settings.bench,
            settings.loads[number] if settings.loads else LoadSpec(name="bench"),
            preset=settings.preset,
            seed=settings.seed,
            sample_rate_hz=settings.sample_rate_hz,
        )
    if settings.step is not None:
        from jointz.sim.calibration_benches.calibration_rig import calibration_rig

        return calibration_rig(
            number,
            settings.step,
            loads=settings.loads,
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
        not_zeroed=_not_zeroed(settings.known),
    )


def _not_zeroed(known: CalibrationFile | None) -> tuple[str, ...]:
    """Return whose simulated goniometer shows its own zero in walking.

    Theirs of whom a calibration knows it: one that is zeroed when it is taped on would be
    corrected for what is not there.
    """
    people = {} if known is None else known.participants
    return tuple(one for one in people if known and known.of(one).angle_zero_rad is not None)
