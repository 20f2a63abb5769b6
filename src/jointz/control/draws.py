"""Draws of a profile's curves from their intervals."""

import numpy as np

from jointz.control.impedance_profile import ImpedanceProfile
from jointz.results.estimates import REACH_95

#: Draws that intervals of derived figures rest on, and their seed.
DRAWS, SEED = 200, 46


def drawn_curves(profile: ImpedanceProfile) -> tuple[np.ndarray, np.ndarray]:
    """Return draws of stiffness and damping, (200, n) each.

    Errors are alike at all phases: a curve lies high or low as a whole. Both are log-normal and
    independent of each other.
    """
    z = np.random.default_rng(SEED).standard_normal((2, DRAWS, 1))
    spread_k = np.log(profile.stiffness_high / profile.stiffness_low) / (2.0 * REACH_95)
    spread_b = np.log(profile.damping_high / profile.damping_low) / (2.0 * REACH_95)
    return profile.stiffness * np.exp(z[0] * spread_k), profile.damping * np.exp(z[1] * spread_b)
