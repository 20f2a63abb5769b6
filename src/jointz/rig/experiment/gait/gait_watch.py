"""Heel strikes, strides and phase of a walking participant at run time."""

from math import isnan

from jointz.core.protocols.protocol_models import GaitSpec
from jointz.rig.devices.interface import SensorSample
from jointz.rig.experiment.gait.phase_predictor import KneePhase, StridePhase

_NAN = float("nan")
CONTACT_LEVELS = (0.3, 0.7)  # of a contact that is 0 or 1


class GaitWatch:
    """Phase of the gait cycle at every tick.

    A sample is placed in time by how much older it is, on its device's own clock,
    than the newest of the tick; so devices need not share the host's clock.
    """

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


#: Off for at least so long before a rise counts: shorter is chatter of the switch.
_OFF_NS = 60_000_000
#: A strike is believed at once, and found false where the switch was not closed for so much
#: of the time that follows: a foot stays on the ground, a brush against the switch does not.
_CHECK_NS = 60_000_000
_CLOSED_SHARE = 0.75


class HeelStrikeDetector:
    """A Schmitt trigger with a refractory time, and second thoughts."""

    def __init__(self, *, low: float, high: float, refractory_s: float) -> None:
        if not low < high:
            raise ValueError(f"expected low < high, got {low} and {high}.")
        self._low, self._high = low, high
        self._refractory_ns = round(refractory_s * 1e9)
        self._on = True  # a contact at the very beginning is no strike
        self._off_since_ns = 0
        self._last_ns: int | None = None
        self._before_ns: int | None = None
        self._check_at_ns: int | None = None
        self._closed = self._seen = 0
        self.retracted = False

    def update(self, time_ns: int, value: float) -> int | None:
        """Process a sample and return the time of the strike that it completes, if any."""
        self.retracted = self._check_at_ns is not None and self._found_false(time_ns, value)
        if self._on:
            if value < self._low:
                self._on = False
                self._off_since_ns = time_ns
            return None
        if not value >= self._high:
            return None
        self._on = True
        if time_ns - self._off_since_ns < _OFF_NS:
            return None
        if self._last_ns is not None and time_ns - self._last_ns < self._refractory_ns:
            return None
        self._before_ns, self._last_ns = self._last_ns, time_ns
        self._check_at_ns = time_ns + _CHECK_NS
        self._closed = self._seen = 0
        return time_ns

    def _found_false(self, time_ns: int, value: float) -> bool:
        """Process a sample after a strike and return whether it shows the strike to be false."""
        self._seen += not isnan(value)
        self._closed += value >= self._low
        if self._check_at_ns is None or time_ns < self._check_at_ns:
            return False
        self._check_at_ns = None
        if self._closed >= _CLOSED_SHARE * self._seen:
            return False
        self._last_ns = self._before_ns
        return True
