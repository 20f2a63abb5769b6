"""Units, clock and winding temperature of a Dephy actuator."""

from math import expm1, pi
from typing import Annotated

from pydantic import Field

from jointz.core.checked_model import Check, CheckedModel, Problem
from jointz.core.limits import Positive

#: The encoder of the motor counts so many a turn, before the gear.
COUNTS_PER_TURN = 16_384
_RAD_PER_COUNT = 2.0 * pi / COUNTS_PER_TURN
_RAD_PER_DEG = pi / 180.0
#: ``state_time`` counts ms in 32 bits; signed or not, it wraps around after 49.7 days.
_WRAP_MS = 2**32
#: A stamp that runs ahead of the host's clock by more is invalid.
_AHEAD_MS = 1000
_MOST_GROWTH = 50.0


class Units:
    """Units and directions of one actuator: its integers, before the gear, and the joint's SI."""

    def __init__(self, *, gear_ratio: float, sign: int, zero_counts: int) -> None:
        self._sign = sign
        self._zero = zero_counts
        self._per_count = sign * _RAD_PER_COUNT / gear_ratio
        self._per_deg = sign * _RAD_PER_DEG / gear_ratio

    def angle(self, counts: int) -> float:
        """Return the angle of the output, rad."""
        return self._per_count * (counts - self._zero)

    def velocity(self, deg_s: int) -> float:
        """Return the velocity of the output, rad/s."""
        return self._per_deg * deg_s

    def current(self, milliamperes: int) -> float:
        """Return the motor current in the study's direction, A."""
        return self._sign * 1e-3 * milliamperes

    def milliamperes(self, current: float) -> int:
        """Return the command for a current in the study's direction, mA."""
        return self._sign * round(1e3 * current)


class DeviceClock:
    """Device time in ns out of a counter of ms in 32 bits.

    A stamp that went back, or ran ahead of the host by more than a second, is invalid: the
    device was restarted, or the sample is corrupt.
    """

    def __init__(self) -> None:
        self._stamp: int | None = None
        self._host_ns = 0
        self.time_ns = 0

    def elapsed_ms(self, stamp_ms: int, host_ns: int) -> int | None:
        """Process a stamp and return the ms since the previous one; None if it is invalid."""
        stamp = stamp_ms % _WRAP_MS
        if self._stamp is None:
            self._stamp, self._host_ns, self.time_ns = stamp, host_ns, stamp * 1_000_000
            return 1
        elapsed = (stamp - self._stamp) % _WRAP_MS
        if elapsed > (host_ns - self._host_ns) // 1_000_000 + _AHEAD_MS:
            return None
        if elapsed:
            self._stamp, self._host_ns = stamp, host_ns
            self.time_ns += elapsed * 1_000_000
        return elapsed


Celsius = Annotated[float, Field(gt=0, le=200)]


class WindingSpec(CheckedModel):
    """How a winding warms up, and how hot it may become.

    The defaults are those that opensourceleg 3.5 uses for this motor (fitted by its authors after
    Lin et al., a two-node model of winding and case); nobody of jointz measured them. The current
    is derated linearly from the first temperature to the second.
    """

    capacitance_j_k: Positive = 16.3
    to_case_k_w: Positive = 1.07
    resistance_ohm: Positive = 0.376
    resistance_at_c: float = 65.0
    resistance_per_k: Annotated[float, Field(ge=0)] = 0.00393
    winding_derate_c: Celsius = 70.0
    winding_limit_c: Celsius = 110.0
    case_derate_c: Celsius = 60.0
    case_limit_c: Celsius = 80.0

    def checks(self) -> tuple[Check, ...]:
        """Return what holds between the temperatures."""
        return (self._derated_before_the_limit,)

    def _derated_before_the_limit(self) -> list[Problem]:
        return [
            Problem((f"{part}_derate_c",), f"expected less than {part}_limit_c, got {derate:g}.")
            for part in ("winding", "case")
            if (derate := getattr(self, f"{part}_derate_c")) >= getattr(self, f"{part}_limit_c")
        ]


class Winding:
    r"""Temperature of a winding, which nothing measures, from case temperature and current.

    .. math:: C \dot T = I^2 R (1 + \alpha (T - T_R)) - (T - T_{case}) / W

    Each step is exact for a current and a case that stay as they are. At first the winding is
    taken to be as warm as the case, which is too cold where a warm actuator is taken up again
    after a restart of the program: wait five minutes then.
    """

    def __init__(self, spec: WindingSpec) -> None:
        self._spec = spec
        self._started = False
        self.temperature_c = self.case_c = 25.0

    def warm(self, current: float, case_c: float, *, elapsed_s: float) -> None:
        """Process a sample."""
        spec = self._spec
        if not self._started:
            self._started, self.temperature_c = True, case_c
        self.case_c = case_c
        heat = current * current * spec.resistance_ohm
        above = self.temperature_c - spec.resistance_at_c
        flow = heat * (1.0 + spec.resistance_per_k * above)
        flow -= (self.temperature_c - case_c) / spec.to_case_k_w
        # Above 25 A the decay is a growth: the copper's resistance outruns the cooling.
        decay = (1.0 / spec.to_case_k_w - heat * spec.resistance_per_k) / spec.capacitance_j_k
        over_s = -expm1(min(_MOST_GROWTH, -decay * elapsed_s)) / decay if decay else elapsed_s
        self.temperature_c += flow / spec.capacitance_j_k * over_s

    def rest(self, elapsed_s: float) -> None:
        """Cool down without current; does nothing before the first sample."""
        if self._started:
            self.warm(0.0, self.case_c, elapsed_s=elapsed_s)

    @property
    def share(self) -> float:
        """Share of the largest current that may flow, 1 when cool and 0 at a limit."""
        spec = self._spec
        winding = (spec.winding_limit_c - self.temperature_c) / (
            spec.winding_limit_c - spec.winding_derate_c
        )
        case = (spec.case_limit_c - self.case_c) / (spec.case_limit_c - spec.case_derate_c)
        return min(1.0, max(0.0, winding), max(0.0, case))

    @property
    def too_hot(self) -> bool:
        """Whether winding or case is at its limit."""
        spec = self._spec
        return self.temperature_c >= spec.winding_limit_c or self.case_c >= spec.case_limit_c
