"""A rig whose instruments a calibration file knows better than the rig does."""

from collections.abc import Mapping
from typing import Any

from jointz.core.clock import Clock
from jointz.core.study import CalibrationSpec, DeviceSpec
from jointz.devices.interface import Devices, Rig, Wearer


class CalibratedRig:
    """A rig with entries of a calibration over its own; all else is the rig's."""

    def __init__(self, rig: Rig, known: CalibrationSpec) -> None:
        self._rig = rig
        self._known = known

    @property
    def wearer(self) -> Wearer:
        """The participant."""
        return self._rig.wearer

    @property
    def calibration(self) -> CalibrationSpec:
        """The rig's calibration, overridden by the entries of the file."""
        return self._rig.calibration.overridden_by(self._known)

    @property
    def device(self) -> DeviceSpec | None:
        """The mass on the moving segment."""
        return self._rig.device

    def open(self, condition: str, *, worn: bool, segment: int, clock: Clock) -> Devices:
        """Return the devices of the rig, ``UNCONFIGURED``."""
        return self._rig.open(condition, worn=worn, segment=segment, clock=clock)

    def notes(self) -> Mapping[str, Any]:
        """Return what the rig says of itself."""
        return self._rig.notes()

    def __getattr__(self, name: str) -> Any:
        """Return what only some rigs have: the truth, of a simulated one."""
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._rig, name)
