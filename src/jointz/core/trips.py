"""Stable codes: why the safety gate ended a trial."""

from jointz.core.codes import Code


class Trip(Code):
    """Why the safety gate ended a trial; codes are added to, never renamed."""

    REQUEST_NOT_FINITE = "request_not_finite", "the controller asked for a torque that is no number"
    SENSOR_NOT_FINITE = "sensor_not_finite", "a sensor gave samples that are no numbers"
    SENSOR_STALE = "sensor_stale", "a sensor gave no new sample for too long"
    SENSOR_FROZEN = (
        "sensor_frozen",
        "a sensor repeats one value while the joint moves, or its clock stops",
    )
    POSTURE = "posture", "the joint left the range of angles it may have"
    VELOCITY = "velocity", "the joint moved faster than it may"
    TEMPERATURE = "temperature", "the motor is too hot"
    DEVICE_FAULT = "device_fault", "the device reported a fault of its own"
    OVERRUN = "overrun", "the loop missed too many slots in a row"
    PULSE_COUNT = "pulse_count", "more pulses than the wearer may be given"
    BROKEN_OFF = "broken_off", "pulse after pulse was broken off and none done"
    NO_STRIDES = "no_strides", "no accepted stride for too long"
