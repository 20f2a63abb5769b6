"""Stable codes: why the safety gate ended a trial."""

from enum import StrEnum


class Trip(StrEnum):
    """Why the safety gate ended a trial; codes are added to, never renamed."""

    REQUEST_NOT_FINITE = "request_not_finite"
    SENSOR_NOT_FINITE = "sensor_not_finite"
    SENSOR_STALE = "sensor_stale"
    SENSOR_FROZEN = "sensor_frozen"
    POSTURE = "posture"
    VELOCITY = "velocity"
    TEMPERATURE = "temperature"
    DEVICE_FAULT = "device_fault"
    OVERRUN = "overrun"
    PULSE_COUNT = "pulse_count"
    BROKEN_OFF = "broken_off"
    NO_STRIDES = "no_strides"

    @property
    def meaning(self) -> str:
        """One sentence for messages and tables."""
        return _MEANING[self]


_MEANING = {
    Trip.REQUEST_NOT_FINITE: "the controller asked for a torque that is no number",
    Trip.SENSOR_NOT_FINITE: "a sensor gave samples that are no numbers",
    Trip.SENSOR_STALE: "a sensor gave no new sample for too long",
    Trip.SENSOR_FROZEN: "a sensor repeats one value while the joint moves, or its clock stops",
    Trip.POSTURE: "the joint left the range of angles it may have",
    Trip.VELOCITY: "the joint moved faster than it may",
    Trip.TEMPERATURE: "the motor is too hot",
    Trip.DEVICE_FAULT: "the device reported a fault of its own",
    Trip.OVERRUN: "the loop missed too many slots in a row",
    Trip.PULSE_COUNT: "more pulses than the wearer may be given",
    Trip.BROKEN_OFF: "pulse after pulse was broken off and none done",
    Trip.NO_STRIDES: "no accepted stride for too long",
}
