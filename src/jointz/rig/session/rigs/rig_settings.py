"""Settings of the rig that an experiment is run on, and the rig itself."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, cast

from jointz.core.errors import DataError
from jointz.core.gait_phases import REFERENCE_SPEED_M_S
from jointz.core.protocols.protocol import Protocol
from jointz.core.protocols.protocol_models import CalibrationStep, LoadSpec
from jointz.core.study import CalibrationSpec
from jointz.io.calibration_file import CalibrationFile
from jointz.rig.devices.drivers import registered_devices
from jointz.rig.devices.interface import Rig
from jointz.rig.sim.sensors.sensor_settings import checked_sensors

if TYPE_CHECKING:
    from jointz.rig.session.rigs.hardware_rig import Hardware

PRESETS = ("clean", "nominal", "hard", "anthropometric", "realistic")
_BENCH_PRESETS = ("clean", "nominal", "hard")
#: In the others the frame of the exoskeleton is part of the limb: there is none to hang up.
_FRAME_PRESETS = ("anthropometric", "realistic")


@dataclass(frozen=True, slots=True)
class RigSettings:
    """The devices, and for simulated ones how well they and people behave."""

    # ``sim``: simulated walking human with an exoskeleton, or simulated bench; otherwise name of a
    # rig of another package
    device: str = "sim"
    # preset of the simulation: ``clean``, ``nominal``, ``hard`` or, for people, ``anthropometric``,
    # ``realistic``
    preset: str = "nominal"
    seed: int = 1  # seed of the simulation
    sample_rate_hz: float = 500.0  # Hz: sampling rate of all simulated devices
    bench: str | None = None  # name of the bench, for a protocol of a bench; None for walking
    loads: tuple[LoadSpec, ...] = ()  # loads of the bench, or of the calibration's step
    # known additions to the joint of simulated people that walk, by condition
    condition_loads: Mapping[str, LoadSpec] = field(default_factory=dict)
    speed_m_s: float = REFERENCE_SPEED_M_S  # m/s: walking speed of simulated people
    # real devices instead of simulated ones; ``device`` and ``preset`` are ``hardware`` then
    hardware: "Hardware | None" = None
    step: CalibrationStep | None = None  # step of a calibration, for a protocol of a calibration
    # calibration of the instruments; takes precedence over the values of the rig
    known: CalibrationFile | None = None
    # sensors of the motion of simulated people; None: those of the preset
    sensors: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        if self.hardware is not None:
            return
        devices = registered_devices("rig")
        if self.device not in devices:
            raise DataError(
                f"device: expected one of {', '.join(sorted(devices))}; got {self.device!r}."
            )
        if self.device == "sim":
            self._check_preset()

    def _check_preset(self) -> None:
        if self.step == "frame" and self.preset in set(PRESETS) - set(_FRAME_PRESETS):
            raise DataError(
                f"preset: {self.preset!r} gives the simulated exoskeleton no frame of its own: it "
                "is part of the limb, and there is none to calibrate. Give 'anthropometric'."
            )
        presets = PRESETS if self.bench is None else _BENCH_PRESETS
        if self.preset not in presets:
            raise DataError(f"preset: expected one of {', '.join(presets)}; got {self.preset!r}.")


def rig_settings(
    protocol: Protocol,
    device: str,
    preset: str | None,
    seed: int,
    sensors: Collection[str] | None = None,
) -> RigSettings:
    """Return the settings of a protocol's rig; simulated people are realistic by default."""
    simulated_people = protocol.by_gait and device == "sim"
    default_preset = "realistic" if simulated_people else "nominal"
    if simulated_people and sensors is None:
        sensors = protocol.sensors or None
    if sensors is not None and not simulated_people:
        raise DataError(
            "sensors: they are chosen for simulated people that walk. Leave them out for a bench, "
            "a calibration or another device."
        )
    if protocol.kind == "bench" and protocol.bench is None:
        raise DataError(
            f"{protocol.name}: bench: missing; the simulated devices need to know which: "
            '"series-elastic" or "quasi-direct-drive".'
        )
    return RigSettings(
        device,
        preset or default_preset,
        seed,
        protocol.rates.sample_hz,
        bench=protocol.bench,
        loads=protocol.loads,
        condition_loads=protocol.condition_loads,
        speed_m_s=protocol.gait.speed_m_s if protocol.gait else REFERENCE_SPEED_M_S,
        step=protocol.calibration,
        sensors=None if sensors is None else checked_sensors(sensors),
    )


def hardware_settings(hardware: "Hardware", seed: int) -> RigSettings:
    """Return the settings of a rig of real devices."""
    return RigSettings("hardware", "hardware", seed, hardware=hardware)


def with_calibration(settings: RigSettings, known: CalibrationFile, count: int) -> RigSettings:
    """Return the settings of a rig whose instruments were calibrated."""
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
    rig: Rig
    if settings.hardware is not None:
        from jointz.rig.session.rigs.hardware_rig import HardwareRig

        rig = HardwareRig(settings.hardware, number)
    else:
        rig = registered_devices("rig")[settings.device].load()(settings, number)
    if settings.known is None:
        return rig
    return cast(Rig, CalibratedRig(rig, settings.known.of(rig.wearer.id)))


class CalibratedRig:
    """A rig whose calibration is overridden by a file; every other attribute is the rig's."""

    def __init__(self, rig: Rig, known: CalibrationSpec) -> None:
        self._rig = rig
        self._known = known

    @property
    def calibration(self) -> CalibrationSpec:
        """The rig's calibration, overridden by the entries of the file."""
        return self._rig.calibration.overridden_by(self._known)

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the rig, also one that only simulated rigs have (``truth``)."""
        if name.startswith("_"):  # also before ``_rig`` is set, as in unpickling
            raise AttributeError(name)
        return getattr(self._rig, name)
