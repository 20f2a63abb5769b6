"""A switch under the heel: true contacts with jitter, bounce, misses and false ones."""

import numpy as np

from jointz.rig.sim.presets import FootswitchSettings

_LARGEST_JITTER = 3.0  # sd
_BOUNCES = 3  # openings while it chatters
_FALSE_LENGTH_S = 0.03
_FALSE_CYCLES = (0.70, 0.92)  # where in the stride false contacts come


class ContactMaker:
    """Turns strides into the times at which the switch closes and opens."""

    def __init__(
        self, settings: FootswitchSettings, *, contact_share: float, rng: np.random.Generator
    ) -> None:
        self._settings = settings
        self._share = contact_share
        self._rng = rng

    def toggles(self, start_s: float, duration_s: float) -> list[float]:
        """Return when the switch closes, opens, closes ... in one stride, in order of time."""
        settings = self._settings
        normal = self._rng.standard_normal()
        missed, false, place = self._rng.random(3).tolist()
        chatter = self._rng.random(2 * _BOUNCES).tolist()
        times: list[float] = []
        if missed >= settings.missed:
            late = settings.jitter_sd_s * min(max(normal, -_LARGEST_JITTER), _LARGEST_JITTER)
            closes = start_s + late
            times.append(closes)
            if settings.bounce_s > 0.0:
                times += sorted(closes + settings.bounce_s * share for share in chatter)
            times.append(start_s + self._share * duration_s)
        if false < settings.false:
            low, high = _FALSE_CYCLES
            begins = start_s + duration_s * (low + (high - low) * place)
            times += [begins, begins + _FALSE_LENGTH_S]
        return times
