"""The safety gate: the last stage between a request and the device.

Four reactions, from mild to hard:

- a request that is too large or changes too fast is **clamped**;
- a pulse that must not go on (gait unsteady, a stop ordered, too much of the time
  under pulses) is **faded** to zero and stays there until it is over and gait is
  steady again: the wearer is well, a step would disturb more than a ramp;
- a pulse that displaces the joint too far is **cut**: the torque of that very tick is zero,
  and stays zero until the pulse is over;
- anything measured out of bounds, and any request that is no number, **trips**: the
  torque of that very tick is zero, and of every tick after it. All codes of
  :class:`jointz.core.codes.Trip` do the same, so nothing has to be decided in a trip.
"""

from math import inf, isfinite, nan

from jointz.core.codes import Trip
from jointz.core.limits import DUTY_WINDOW_S, SafetyLimits
from jointz.core.session_log import Flag
from jointz.rig.devices.interface import ActuatorSample

_CLAMPED, _FADING, _TRIPPED = int(Flag.CLAMPED), int(Flag.FADING), int(Flag.TRIPPED)
_CUT = int(Flag.CUT)
#: Every sensor must have given a sample so long after the first tick; torque is zero until then.
_START_S = 1.0
#: A goniometer that repeats a value while the actuator turns faster than this is frozen,
_MOVING_RAD_S = 0.5
#: and so is an encoder that does while the goniometer moves by more than this.
_MOVED_RAD = 0.1
#: A request this large is invalid; so is one that is not a number.
_NO_TORQUE_NM = 1e9


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
    pulses_before : int
        Pulses of the condition that began in earlier stretches: they count.

    Attributes
    ----------
    cut : bool
        Whether the pulse that is on displaced the joint too far.
    displacement_rad : float or None, rad
        Limit of the displacement by a pulse, None for none.
    tripped : Trip or None
        The first trip; it stays.
    detail : str
        Limit and value of the trip.
    fade_s : float, s
        Limit of the time in which torque fades to zero.
    fading : bool
        Whether a pulse is being faded out; lasts until it is over and gait is steady.
    flags : int
        Bits of :class:`jointz.core.session_log.Flag` for this tick.
    """

    __slots__ = (
        "_encoder",
        "_encoder_from",
        "_fade_step",
        "_goniometer",
        "_largest",
        "_last_time_ns",
        "_limits",
        "_most_frozen",
        "_most_pulse_ticks",
        "_most_waited",
        "_moving",
        "_overran",
        "_overruns",
        "_place",
        "_pulse_ticks",
        "_pulses",
        "_repeated_ticks",
        "_sent",
        "_step",
        "_stopped_ticks",
        "_waited",
        "_was_pulse",
        "_window",
        "cut",
        "detail",
        "displacement_rad",
        "fade_s",
        "fading",
        "flags",
        "tripped",
    )

    def __init__(
        self,
        limits: SafetyLimits,
        *,
        control_period_s: float,
        torque_per_ampere: float,
        pulses_before: int = 0,
    ) -> None:
        self._limits = limits
        self._largest = min(limits.torque_nm, limits.current_a * torque_per_ampere)
        self._step = limits.torque_rate_nm_s * control_period_s
        self._fade_step = self._largest * control_period_s / limits.fade_s
        self._most_frozen = limits.sensor_age_s / control_period_s
        self._most_waited = _START_S / control_period_s
        # One byte a tick of the last ten seconds: 1 where a pulse was on.
        self._window = bytearray(max(1, round(DUTY_WINDOW_S / control_period_s)))
        self._most_pulse_ticks = limits.pulse_duty * len(self._window)
        self._place = self._pulse_ticks = self._waited = 0
        self._pulses = pulses_before
        self._repeated_ticks = self._stopped_ticks = self._overruns = 0
        self._last_time_ns = -1
        self._goniometer = self._encoder = self._encoder_from = nan
        self._sent = 0.0
        self._was_pulse = self._overran = self._moving = False
        self.tripped: Trip | None = None
        self.detail = ""
        self.fading = self.cut = False
        self.displacement_rad = limits.displacement_rad
        self.fade_s = limits.fade_s
        self.flags = 0

    def trip(self, code: Trip, detail: str) -> None:
        """Trip; the first trip stands."""
        if self.tripped is None:
            self.tripped, self.detail = code, f"{code.meaning}: {detail}"

    def overran(self, missed_slots: int) -> None:
        """Take note of slots missed just before this tick."""
        self._overran = True
        self._overruns += missed_slots
        if self._overruns >= self._limits.consecutive_overruns:
            text = f"{self._overruns} slots in a row, limit {self._limits.consecutive_overruns}"
            self.trip(Trip.OVERRUN, text)

    def check(
        self,
        requested_nm: float,
        sample: ActuatorSample | None,
        *,
        angle: float,
        age_s: float,
        steady: bool,
        pulse_active: bool,
        displacement: float | None = None,
    ) -> float:
        """Return the torque to send, N*m.

        ``age_s`` is that of the stalest sensor, infinite until each has given a sample.
        ``displacement`` is that by the pulse that is on, ``LOOK_AHEAD_S`` from now; None where none
        is on or it has no limit.
        """
        if self.tripped is None:
            if self._overran:
                self._overran = False
            else:
                self._overruns = 0
            if sample is not None:
                self._check_sample(sample)
            if age_s == inf:
                return self._held()
            self._check_sensors(sample, angle, age_s)
            if not abs(requested_nm) < _NO_TORQUE_NM:
                self.trip(Trip.REQUEST_NOT_FINITE, f"{requested_nm} N*m")
            self._check_pulse(pulse_active=pulse_active, steady=steady)
            if displacement is None:
                self.cut = False
            else:
                self._check_displacement(displacement)
        if self.tripped is not None:
            return self._off()
        if self.cut:
            self.flags = _CUT
            self._sent = 0.0
            return 0.0
        self._sent = self._faded() if self.fading else self._clamped(requested_nm)
        return self._sent

    def _check_sample(self, sample: ActuatorSample) -> None:
        """Check the values that the actuator measured."""
        limits = self._limits
        if sample.faults:
            self.trip(Trip.DEVICE_FAULT, f"bits {sample.faults:#x}")
        if not isfinite(sample.angle + sample.velocity + sample.current + sample.temperature_c):
            self.trip(Trip.SENSOR_NOT_FINITE, "actuator")
        if not limits.angle_min_rad <= sample.angle <= limits.angle_max_rad:
            self.trip(Trip.POSTURE, self._range_text("encoder", sample.angle))
        speed = abs(sample.velocity)
        if speed > limits.velocity_rad_s:
            self.trip(Trip.VELOCITY, f"{speed:.1f} rad/s, limit {limits.velocity_rad_s:g} rad/s")
        if sample.temperature_c > limits.temperature_c:
            text = f"{sample.temperature_c:.0f} degC, limit {limits.temperature_c:g} degC"
            self.trip(Trip.TEMPERATURE, text)
        self._moving = speed > _MOVING_RAD_S

    def _held(self) -> float:
        """Send zero torque before every sensor has given a sample."""
        self._waited += 1
        if self._waited > self._most_waited:
            self.trip(Trip.SENSOR_STALE, f"a sensor gave no sample in the first {_START_S:g} s")
        if self.tripped is not None:
            return self._off()
        self.flags = _CLAMPED
        self._sent = 0.0
        return 0.0

    def _check_sensors(self, sample: ActuatorSample | None, angle: float, age_s: float) -> None:
        """Check the goniometer, the age of everything, and one sensor against the other."""
        limits = self._limits
        if not limits.angle_min_rad <= angle <= limits.angle_max_rad:
            if isfinite(angle):
                self.trip(Trip.POSTURE, self._range_text("goniometer", angle))
            else:
                self.trip(Trip.SENSOR_NOT_FINITE, "goniometer")
        if age_s > limits.sensor_age_s:
            text = f"the stalest is {age_s:.3f} s old, limit {limits.sensor_age_s:g} s"
            self.trip(Trip.SENSOR_STALE, text)
        if angle != self._goniometer:
            self._goniometer, self._repeated_ticks = angle, 0
        elif self._moving:
            self._repeated_ticks += 1
            if self._repeated_ticks > self._most_frozen:
                self.trip(Trip.SENSOR_FROZEN, f"goniometer at {angle:.3f} rad")
        if sample is not None:
            self._check_encoder(sample, angle)

    def _check_encoder(self, sample: ActuatorSample, angle: float) -> None:
        if sample.device_time_ns > self._last_time_ns:
            self._last_time_ns, self._stopped_ticks = sample.device_time_ns, 0
        else:
            self._stopped_ticks += 1
            if self._stopped_ticks > self._most_frozen:
                self.trip(Trip.SENSOR_FROZEN, "the actuator's clock stands still")
        if sample.angle != self._encoder:
            self._encoder, self._encoder_from = sample.angle, angle
        elif abs(angle - self._encoder_from) > _MOVED_RAD:
            self.trip(Trip.SENSOR_FROZEN, f"encoder at {sample.angle:.3f} rad")

    def _check_pulse(self, *, pulse_active: bool, steady: bool) -> None:
        """Count pulses and their duty, and fade the one that must not go on."""
        window, place = self._window, self._place
        self._pulse_ticks += pulse_active - window[place]
        window[place] = pulse_active
        self._place = place + 1 if place + 1 < len(window) else 0
        if not pulse_active:
            self._was_pulse = False
            self.fading = self.fading and not steady
            return
        # Torque that is faded for a stop is no pulse that begins.
        if steady and not self._was_pulse:
            self._was_pulse = True
            self._pulses += 1
            if self._pulses > self._limits.pulse_count:
                self.trip(Trip.PULSE_COUNT, f"limit {self._limits.pulse_count}")
        if not steady or self._pulse_ticks > self._most_pulse_ticks:
            self.fading = True

    def _check_displacement(self, displacement: float) -> None:
        """Cut the pulse that displaces the joint too far; what is no number is too far."""
        limit = self.displacement_rad
        if limit is not None and not abs(displacement) <= limit:
            self.cut = True

    def _off(self) -> float:
        self.flags = _TRIPPED
        self.fading = self.cut = False
        self._sent = 0.0
        return 0.0

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
