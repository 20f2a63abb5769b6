"""Measurement of the simulated knee's internal moment by inverse dynamics."""

import numpy as np

from jointz.rig.sim.walking.plant_build import PlantBuild


class MomentMeasurement:
    """Gain error and white noise of one stretch; purpose and segment seed the noise."""

    def __init__(self, build: PlantBuild, *, purpose: str, segment: int) -> None:
        self.gain = build.instruments.moment_gain
        self._sd_nm = build.preset.moment.noise_sd_nm
        self._rng = build.person.stream(f"moment noise {purpose}", segment)

    def errors(self, n: int) -> np.ndarray:
        """Return the noise of the next samples, N*m."""
        return np.asarray(self._sd_nm * self._rng.standard_normal(n))
