"""The torque of a pulse over time."""

from itertools import accumulate

from jointz.core.protocols.pulse_models import Pulse


class PulseWaveform:
    """Torque of a pulse over the time since its onset."""

    __slots__ = ("_parts", "duration_ns")

    def __init__(self, pulse: Pulse) -> None:
        ends_s = accumulate(part.duration_s for part in pulse.course)
        ends_ns = [round(end_s * 1e9) for end_s in ends_s]
        begins_ns = [0, *ends_ns[:-1]]
        self._parts = [
            (end_ns, begin_ns, part.begin, part.end)
            for begin_ns, end_ns, part in zip(begins_ns, ends_ns, pulse.course, strict=True)
        ]
        self.duration_ns = ends_ns[-1]

    def displacements(self, *, ahead_s: float, actuator_lag_s: float) -> list[float]:
        """Return how far the torque to come moves a free inertia, for every ms of the pulse.

        For 1 N*m and 1 kg*m^2, within ``ahead_s``, of an actuator that is ``actuator_lag_s`` late.
        """
        since_ms = round(1e-6 * self.duration_ns)
        ahead_ms, lag_ms = round(1e3 * ahead_s), round(1e3 * actuator_lag_s)
        shares = [self.share((k - lag_ms) * 1_000_000) for k in range(since_ms + ahead_ms)]
        weights = [1e-6 * (ahead_ms - k) for k in range(ahead_ms)]
        return [
            sum(w * shares[k + i] for i, w in enumerate(weights) if k + i < len(shares))
            for k in range(since_ms)
        ]

    def share(self, elapsed_ns: int) -> float:
        """Return the share of the amplitude, -1..1."""
        if elapsed_ns < 0:
            return 0.0
        for end_ns, begin_ns, begin, end in self._parts:
            if elapsed_ns < end_ns:
                before, after = elapsed_ns - begin_ns, end_ns - elapsed_ns
                return (begin * after + end * before) / (end_ns - begin_ns)
        return 0.0
