"""Heel strikes, strides and phase of a walking participant at run time."""

from jointz.core.protocols.protocol_models import GaitSpec
from jointz.rig.devices.interface import SensorSample
from jointz.rig.experiment.gait.heel_strike_detector import HeelStrikeDetector
from jointz.rig.experiment.gait.phase_predictor import KneePhase, StridePhase

_NAN = float("nan")
CONTACT_LEVELS = (0.3, 0.7)  # of a contact that is 0 or 1


class GaitWatch:
    """Phase of the gait cycle at every tick.

    A sample is placed in time by how much older it is, on its device's own clock,
    than the newest of the tick; so devices need not share the host's clock.
    """

    __slots__ = (
        "_counted",
        "_detector",
        "_knee",
        "last_stride_ns",
        "phase_pct",
        "retracted",
        "shadow_phase_pct",
        "steady",
        "strides",
    )

    def __init__(
        self, gait: GaitSpec, contact_levels: tuple[float, float] = CONTACT_LEVELS
    ) -> None:
        low, high = contact_levels
        self._detector = HeelStrikeDetector(low=low, high=high, refractory_s=gait.refractory_s)
        self._knee = KneePhase(gait)
        self.strides = StridePhase(gait)
        self.steady = self.retracted = self._counted = False
        self.phase_pct = self.shadow_phase_pct = _NAN
        self.last_stride_ns = 0

    def update(self, slot_ns: int, angle: list[SensorSample], contact: list[SensorSample]) -> bool:
        """Process the samples of a tick and return whether an accepted stride ended."""
        stride = self.retracted = False
        for sample in contact:
            at_ns = slot_ns - contact[-1].device_time_ns + sample.device_time_ns
            strike = self._detector.update(at_ns, sample.value)
            if self._detector.retracted:
                self.strides.retract()
                self.retracted = self._counted
            if strike is not None:
                stride = self._counted = self.strides.strike(at_ns)
        for sample in angle:
            self._knee.update(
                slot_ns - angle[-1].device_time_ns + sample.device_time_ns, sample.value
            )
        if stride or not self.last_stride_ns:
            self.last_stride_ns = slot_ns
        self.steady = self.strides.steady(slot_ns)
        self.phase_pct = self.strides.phase_pct(slot_ns) if self.steady else _NAN
        self.shadow_phase_pct = self._knee.phase_pct(slot_ns)
        return stride
