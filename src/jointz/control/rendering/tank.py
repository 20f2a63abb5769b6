"""Energy tank: a stiffness rises only with energy that the damper has taken out."""

from dataclasses import dataclass
from math import isfinite

#: Share of the damper's energy that goes into the tank.
RECOVERED = 0.9
#: Longest time that the damper is credited for between two ticks, s.
_LONGEST_S = 0.02


@dataclass(slots=True)
class EnergyTank:
    """Limits the stiffness of a spring whose deviation, rate and damping are measured.

    In every tick the tank gains ``RECOVERED`` of what the damper took out since the last tick and
    what a falling stiffness releases; a rising stiffness takes 1/2 dK x^2 out of it and rises as
    far as the tank has energy. The tank starts full, with ``largest_j``, the most that it holds.
    """

    largest_j: float
    energy_j: float = 0.0
    stiffness: float | None = None  # N*m/rad, used in the last tick
    damping: float = 0.0

    def __post_init__(self) -> None:
        """Fill it."""
        self.energy_j = self.largest_j

    def limit(
        self, stiffness: float, damping: float, *, deviation: float, rate: float, elapsed_s: float
    ) -> float:
        """Return the stiffness to use in this tick, N*m/rad.

        ``deviation`` is angle less equilibrium now; ``rate`` its rate since the last tick.
        """
        if self.stiffness is None:  # the tank does not pay for the energy at the start
            self.stiffness, self.damping = stiffness, damping
            return stiffness
        if not isfinite(stiffness + damping + deviation + rate):
            return self.stiffness  # the torque is no number either, and the safety gate trips
        taken = self.damping * rate**2 * min(max(elapsed_s, 0.0), _LONGEST_S)
        available = self.energy_j + RECOVERED * taken
        per_stiffness = 0.5 * deviation**2
        rise = stiffness - self.stiffness
        if rise * per_stiffness > available:
            rise = available / per_stiffness
        self.energy_j = min(max(available - rise * per_stiffness, 0.0), self.largest_j)
        self.stiffness += rise
        self.damping = damping
        return self.stiffness
