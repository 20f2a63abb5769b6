"""Units of columns in logs of known devices, for files that state none.

A log is known by columns that only it has. What is said of a column comes from the
documentation of its maker, and its description says so.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from jointz.core.acquisition import Signal
from jointz.io.formats.losses import NOTE

#: Fields of a Dephy ActPack as flexsea streams and logs them: integers before the gear.
_DEPHY: Mapping[str, tuple[str, str]] = {
    "state_time": ("ms", "the device's clock"),
    "mot_ang": ("turn/16384", "counts of the motor's encoder, before the gear"),
    "mot_vel": ("deg/s", "of the motor, before the gear"),
    "mot_cur": ("mA", "q-axis current of the motor"),
    "mot_volt": ("mV", "q-axis voltage of the motor"),
    "batt_volt": ("mV", "of the battery"),
    "batt_curr": ("mA", "of the battery"),
    "temperature": ("degC", "of the case"),
    "ank_ang": ("turn/16384", "counts of the joint's encoder"),
    "status_ex": ("", "bits of the execute board"),
    **{f"accel{axis}": ("", "counts of the IMU, 8192 a standard gravity") for axis in "xyz"},
    **{f"gyro{axis}": ("", "counts of the IMU") for axis in "xyz"},
}
_DEPHY_MARKS = ("state_time", "mot_ang", "mot_cur")

#: Attributes of an actuator of opensourceleg, which scripts log under these names.
_OPENSOURCELEG: Mapping[str, tuple[str, str]] = {
    "motor_position": ("rad", "before the gear"),
    "motor_velocity": ("rad/s", "before the gear"),
    "motor_acceleration": ("rad/s^2", "before the gear"),
    "motor_current": ("mA", "of the motor"),
    "motor_voltage": ("mV", "of the motor"),
    "motor_torque": ("N*m", "before the gear"),
    "output_position": ("rad", "after the gear"),
    "output_velocity": ("rad/s", "after the gear"),
    "output_torque": ("N*m", "after the gear"),
    "battery_voltage": ("mV", "of the battery"),
    "battery_current": ("mA", "of the battery"),
    "case_temperature": ("degC", "of the case"),
    "winding_temperature": ("degC", "of the winding, estimated"),
}
#: Where a log may be in other units than the documentation says.
_EXCEPT = {"opensourceleg": "; a release with osl.units may have logged in those"}
#: Both sides of the gear under the library's own names: no other log has them.
_OUTPUT_MARKS = ("output_position", "output_velocity", "output_torque")
_MOTOR_MARKS = ("motor_position", "motor_velocity", "motor_current", "motor_torque")


def with_vendor_units(signals: Sequence[Signal]) -> tuple[tuple[Signal, ...], str]:
    """Give the columns of a known log their units; others stay as they are."""
    names = {_attribute(signal.name) for signal in signals}
    if names.issuperset(_DEPHY_MARKS):
        return _known(signals, _DEPHY, "Dephy ActPack"), "Dephy ActPack"
    if names & set(_OUTPUT_MARKS) and names & set(_MOTOR_MARKS):
        return _known(signals, _OPENSOURCELEG, "opensourceleg"), "opensourceleg"
    return tuple(signals), ""


def _known(
    signals: Sequence[Signal], units: Mapping[str, tuple[str, str]], whose: str
) -> tuple[Signal, ...]:
    described = []
    for signal in signals:
        unit, what = units.get(_attribute(signal.name), ("", ""))
        if what and not signal.unit and not signal.is_text:
            description = (
                f"{NOTE}{what}; unit by the documentation of {whose}{_EXCEPT.get(whose, '')}"
            )
            signal = replace(signal, unit=unit, description=description)
        described.append(signal)
    return tuple(described)


def _attribute(name: str) -> str:
    """Return the last part of a name: ``knee.motor_current`` and ``knee:motor_current``."""
    return name.replace(":", ".").rpartition(".")[2].strip().lower()
