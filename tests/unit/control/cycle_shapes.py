"""Curves over one cycle from which profiles are made."""

import numpy as np
from scipy.interpolate import PchipInterpolator

PHASE = np.arange(100) / 100
#: The dissertation's mean knee (tables 4.1 and 4.2) of a person of 75 kg at its timing points.
TIMING_PCT = (7.0, 21.5, 40.5, 56.0, 68.5, 81.0)
KNEE_STIFFNESS = (159.8, 46.5, 86.3, 87.0, 23.3, 28.5)  # N*m/rad
KNEE_DAMPING = (2.93, 3.15, 3.98, 2.25, 2.85, 2.18)  # N*m*s/rad


def through(values):
    """Return a smooth periodic curve through values at the timing points."""
    at = np.array(TIMING_PCT) / 100
    around = PchipInterpolator(np.concatenate([at - 1, at, at + 1]), np.tile(values, 3))
    return around(PHASE)


def waves(mean, harmonics, shift=0.0):
    """Return mean * (1 + cosines); the relative amplitude of each harmonic is a value."""
    turns = 2.0 * np.pi * (PHASE - shift)
    return mean * (1.0 + sum(share * np.cos(n * turns) for n, share in harmonics.items()))


def steps(low, high, *windows):
    """Return high in windows of the phase and low elsewhere."""
    inside = np.zeros(PHASE.size, dtype=bool)
    for start, end in windows:
        at = np.arange(round(100 * start), round(100 * end))
        inside[at] = True
    return np.where(inside, high, low)


def flat(value):
    """Return the same value at all phases."""
    return np.full(PHASE.size, float(value))


KNEE_K, KNEE_B = through(KNEE_STIFFNESS), through(KNEE_DAMPING)
