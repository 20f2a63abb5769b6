"""The safety gate: the last stage between a request and the device.

A request that is too large or changes too fast is clamped. What is measured out
of bounds trips the gate: the torque of that very tick is zero, and of every tick
after it. A pulse is faded out, not cut, where gait becomes unsteady: the wearer is
well, and a step would disturb more than a ramp.
"""

from math import isfinite, nan

from jointz.core.limits import SafetyLimits
from jointz.core.session_log import Flag
from jointz.core.trips import Trip
from jointz.devices.interface import ActuatorSample

_CLAMPED, _FADING, _TRIPPED = int(Flag.CLAMPED), int(Flag.FADING), int(Flag.TRIPPED)
#: Pulses may fill their share of the last so many seconds.
_DUTY_WINDOW_S = 10.0
#: A goniometer that repeats a value while the actuator turns faster than this is frozen,
_MOVING_RAD_S = 0.5
#: and so is an encoder that does while the goniometer moves by more than this.
_MOVED_RAD = 0.1


class SafetyGate:
    """Lets a torque through, clamps it, fades it or trips.

    Parameters
    ----------
    limits : SafetyLimits
        The device's own, tightened by the protocol.
    control_period_s : float, s
        Of the loop.
    torque_per_ampere : float, N*m/A
        Of the actuator, for the limit of the current.

    Attributes
    ----------
    tripped : Trip or None
        The first trip; it stays.
    detail : str
        Limit and value of the trip.
    fading : bool
        Whether a pulse is being faded out.
    flags : int
        Bits of :class:`jointz.core.session_log.Flag` for this tick.
    """

    __slots__ = (
        "_duty_left",
        "_duty_most",
        "_encoder",
        "_encoder_angle",
        "_fade_step",
        "_frozen_ticks",
        "_largest",
        "_last_angle",
        "_last_time_ns",
        "_limits",
        "_most_frozen",
        "_overran",
        "_overruns",
        "_pulses",
        "_sent",
        "_stale_ticks",
        "_step",
        "_was_pulse",
        "detail",
        "fading",
        "flags",
        "tripped",
    )

    def __init__(
        self, limits: SafetyLimits, *, control_period_s: float, torque_per_ampere: float
    ) -> None:
        self._limits = limits
        self._largest = min(limits.torque_nm, limits.current_a * torque_per_ampere)
        self._step = limits.torque_rate_nm_s * control_period_s
        self._fade_step = self._largest * control_period_s / limits.fade_s
        self._most_frozen = limits.sensor_age_s / control_period_s
        self._duty_most = limits.pulse_duty * _DUTY_WINDOW_S / control_period_s
        self._duty_left = self._duty_most
        self._frozen_ticks = self._stale_ticks = self._overruns = self._pulses = 0
        self._last_time_ns = -1
        self._last_angle = self._encoder = self._encoder_angle = nan
        self._sent = 0.0
        self._was_pulse = self._overran = False
        self.tripped: Trip | None = None
        self.detail = ""
        self.fading = False
        self.flags = 0

    def trip(self, code: Trip, detail: str) -> None:
        """Trip; the first trip stands.

        Parameters
        ----------
        code : Trip
            Why.
        detail : str
            Limit and value.
        """
        if self.tripped is None:
            self.tripped, self.detail = code, f"{code.meaning}: {detail}"

    def overran(self, missed_slots: int) -> None:
        """Take note of slots missed just before this tick.

        Parameters
        ----------
        missed_slots : int
            How many.
        """
        self._overran = True
        self._overruns += missed_slots
        if self._overruns >= self._limits.consecutive_overruns:
            told = f"{self._overruns} slots in a row, limit {self._limits.consecutive_overruns}"
            self.trip(Trip.OVERRUN, told)

    def check(
        self,
        requested_nm: float,
        sample: ActuatorSample | None,
        *,
        angle: float,
        age_s: float,
        steady: bool,
        pulse_active: bool,
    ) -> float:
        """Return the torque to send, N*m.

        Parameters
        ----------
        requested_nm : float, N*m
            What the controller asks for.
        sample : ActuatorSample or None
            The newest of this tick, None where none came.
        angle : float, rad
            The goniometer's newest.
        age_s : float, s
            Of the stalest of the sensors; infinite before the first sample.
        steady : bool
            Whether a pulse may go on.
        pulse_active : bool
            Whether a pulse is asked for.
        """
        if not self._overran:
            self._overruns = 0
        self._overran = False
        self._check_measured(sample, angle, age_s)
        if not isfinite(requested_nm):
            self.trip(Trip.REQUEST_NOT_FINITE, f"{requested_nm} N*m")
        self._check_pulse(pulse_active=pulse_active, steady=steady)
        if self.tripped is not None:
            self.flags = _TRIPPED
            self.fading = False
            self._sent = 0.0
            return 0.0
        self._sent = self._faded() if self.fading else self._clamped(requested_nm)
        return self._sent

    def _check_measured(self, sample: ActuatorSample | None, angle: float, age_s: float) -> None:
        limits = self._limits
        if sample is None or sample.device_time_ns <= self._last_time_ns:
            self._stale_ticks += 1
        else:
            self._stale_ticks = 0
            self._last_time_ns = sample.device_time_ns
            self._check_sample(sample, angle)
        if not limits.angle_min_rad <= angle <= limits.angle_max_rad:
            # The first ticks may come before the goniometer's first sample.
            if angle == angle:
                self.trip(Trip.POSTURE, self._range_text("goniometer", angle))
            elif self._last_angle == self._last_angle or age_s == 0.0:
                self.trip(Trip.SENSOR_NOT_FINITE, "goniometer")
        self._last_angle = angle
        if age_s > limits.sensor_age_s or self._stale_ticks > self._most_frozen:
            self.trip(Trip.SENSOR_STALE, f"limit {limits.sensor_age_s:g} s")

    def _check_sample(self, sample: ActuatorSample, angle: float) -> None:
        limits = self._limits
        if sample.faults:
            self.trip(Trip.DEVICE_FAULT, f"bits {sample.faults:#x}")
        if not isfinite(sample.angle + sample.velocity + sample.current + sample.temperature_c):
            self.trip(Trip.SENSOR_NOT_FINITE, "actuator")
            return
        if not limits.angle_min_rad <= sample.angle <= limits.angle_max_rad:
            self.trip(Trip.POSTURE, self._range_text("encoder", sample.angle))
        if abs(sample.velocity) > limits.velocity_rad_s:
            told = f"{sample.velocity:.1f} rad/s, limit {limits.velocity_rad_s:g} rad/s"
            self.trip(Trip.VELOCITY, told)
        if sample.temperature_c > limits.temperature_c:
            told = f"{sample.temperature_c:.0f} degC, limit {limits.temperature_c:g} degC"
            self.trip(Trip.TEMPERATURE, told)
        self._check_frozen(sample, angle)

    def _check_frozen(self, sample: ActuatorSample, angle: float) -> None:
        if angle != self._last_angle:
            self._frozen_ticks = 0
        elif abs(sample.velocity) > _MOVING_RAD_S:
            self._frozen_ticks += 1
            if self._frozen_ticks > self._most_frozen:
                self.trip(Trip.SENSOR_FROZEN, f"goniometer at {angle:.3f} rad")
        if sample.angle != self._encoder:
            self._encoder, self._encoder_angle = sample.angle, angle
        elif abs(angle - self._encoder_angle) > _MOVED_RAD:
            self.trip(Trip.SENSOR_FROZEN, f"encoder at {sample.angle:.3f} rad")

    def _check_pulse(self, *, pulse_active: bool, steady: bool) -> None:
        """Count pulses and their duty, and fade the one that must not go on."""
        self._duty_left = min(self._duty_left + self._limits.pulse_duty, self._duty_most)
        if not pulse_active:
            # The request between pulses is small: what is left of a fade ends with the pulse.
            self._was_pulse = self.fading = False
            return
        if not self._was_pulse:
            self._was_pulse = True
            self._pulses += 1
            if self._pulses > self._limits.pulse_count:
                self.trip(Trip.PULSE_COUNT, f"limit {self._limits.pulse_count}")
        self._duty_left -= 1.0
        if not steady or self._duty_left < 0.0:
            self.fading = True

    def _faded(self) -> float:
        self.flags = _FADING
        sent, step = self._sent, self._fade_step
        return sent - step if sent > step else sent + step if sent < -step else 0.0

    def _clamped(self, requested_nm: float) -> float:
        low = max(-self._largest, self._sent - self._step)
        high = min(self._largest, self._sent + self._step)
        if low <= requested_nm <= high:
            self.flags = 0
            return requested_nm
        self.flags = _CLAMPED
        return low if requested_nm < low else high

    def _range_text(self, sensor: str, angle: float) -> str:
        limits = self._limits
        return (
            f"{sensor} {angle:.2f} rad, limits {limits.angle_min_rad:.2f} to "
            f"{limits.angle_max_rad:.2f} rad"
        )
