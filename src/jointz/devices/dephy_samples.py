"""Samples of a Dephy actuator: out of flexsea's dictionaries, checked, in SI."""

from collections.abc import Mapping
from types import MappingProxyType

from jointz.core.errors import DeviceError
from jointz.devices.dephy_units import DeviceClock, Units, Winding
from jointz.devices.interface import ActuatorSample

I2T, TOO_HOT, CLOCK, GARBAGE = 1, 2, 4, 8
FAULT_NAMES: Mapping[int, str] = MappingProxyType(
    {
        I2T: "average current (I2t) limit of the firmware",
        TOO_HOT: "winding (estimated) or case too hot",
        CLOCK: "the device's clock went back: it was restarted",
        GARBAGE: "values that cannot be",
    }
)
#: Bit of ``status_ex``. Single bits flip on the way: two samples in a row make a fault.
_STATUS_I2T = 0b10
_BELIEVED = {I2T: 2, CLOCK: 2, GARBAGE: 3}
_FIELDS = ("state_time", "mot_ang", "mot_vel", "mot_cur", "batt_volt", "temperature", "status_ex")
#: mA, mV, degrees Celsius: beyond these a field is garbage.
_MOST_MA, _MOST_MV, _COLDEST_C, _HOTTEST_C = 80_000, 100_000, -30, 200


class Samples:
    """Makes samples of what flexsea gives, and watches over clock, winding and faults."""

    def __init__(self, name: str, units: Units, winding: Winding) -> None:
        self._name = name
        self._units = units
        self._winding = winding
        self._clock = DeviceClock()
        self._in_a_row = dict.fromkeys(_BELIEVED, 0)
        self.dropped = 0

    def begin(self) -> None:
        """Reset the counts of faults before another activation."""
        self._in_a_row = dict.fromkeys(_BELIEVED, 0)

    def take(self, data: Mapping[str, int], host_ns: int) -> ActuatorSample | None:
        """Return a sample in SI; None where it is the one before again, or garbage for once."""
        try:
            stamp, counts, deg_s, milliamperes, millivolts, case_c, status = [
                data[name] for name in _FIELDS
            ]
        except KeyError as exc:
            raise DeviceError(
                self._name,
                f"expected the fields {', '.join(_FIELDS)}; {exc} is missing. Is it an ActPack, "
                "and is firmware what it runs?",
            ) from exc
        sane = (
            -_MOST_MA <= milliamperes <= _MOST_MA
            and 0 <= millivolts <= _MOST_MV
            and _COLDEST_C <= case_c <= _HOTTEST_C
        )
        elapsed_ms = self._clock.elapsed_ms(stamp, host_ns) if sane else 0
        faults = self._believed(GARBAGE, seen=not sane)
        faults |= self._believed(CLOCK, seen=elapsed_ms is None)
        if not elapsed_ms and not faults:
            self.dropped += 1
            return None
        units, winding = self._units, self._winding
        current = units.current(milliamperes)
        if sane and elapsed_ms:
            winding.warm(current, case_c, elapsed_s=1e-3 * elapsed_ms)
        faults |= self._believed(I2T, seen=bool(status & _STATUS_I2T))
        return ActuatorSample(
            device_time_ns=self._clock.time_ns,
            host_time_ns=host_ns,
            angle=units.angle(counts),
            velocity=units.velocity(deg_s),
            current=current,
            voltage=1e-3 * millivolts,
            temperature_c=winding.temperature_c,
            faults=faults | (TOO_HOT if winding.too_hot else 0),
        )

    def _believed(self, fault: int, *, seen: bool) -> int:
        """Return the fault's bit once it was seen often enough in a row."""
        count = self._in_a_row[fault] + 1 if seen else 0
        self._in_a_row[fault] = count
        return fault if count >= _BELIEVED[fault] else 0
