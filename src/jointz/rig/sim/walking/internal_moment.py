"""Internal moment of the knee in unperturbed walking."""

from math import exp

import numpy as np
from scipy.interpolate import CubicSpline

from jointz.rig.sim.people import Person

# % of the gait cycle -> N*m/kg, extension positive: landmarks of able-bodied adults at natural
# cadence (shape as in Winter 1991, The Biomechanics and Motor Control of Human Gait), rounded.
_LANDMARKS = {
    2.0: -0.30,
    7.0: 0.25,
    14.0: 0.60,
    28.0: 0.0,
    42.0: -0.20,
    60.0: 0.20,
    72.0: 0.05,
    84.0: -0.10,
    93.0: -0.30,
    98.0: -0.25,
}
_EXTENSION = -1.0  # the simulated knee's positive direction is flexion
_SIZE_SD = 0.2  # over people, of the logarithm
_SHIFT_SD_CYCLES = 0.015
_LARGEST_DEVIATION = 3.0  # sd


def internal_moment(person: Person, cycles: np.ndarray) -> np.ndarray:
    """Return the moment of muscles and ligaments on the shank along the unperturbed path, N*m.

    It is positive in flexion; each person has an own size and timing of the curve. ``cycles`` are
    gait phases; whole numbers are heel strikes.

    >>> from jointz.rig.sim.people import draw_person
    >>> moment = internal_moment(draw_person(0, seed=1), np.linspace(0.0, 1.0, 101))
    >>> bool(moment.min() < -20.0), bool(10.0 < moment.max() < 50.0)
    (True, True)
    """
    deviations = person.stream("moment").standard_normal(2)
    size, shift = deviations.clip(-_LARGEST_DEVIATION, _LARGEST_DEVIATION).tolist()
    scale = _EXTENSION * person.mass_kg * exp(_SIZE_SD * size)
    return np.asarray(scale * _mean_curve(cycles - _SHIFT_SD_CYCLES * shift))


def _mean_curve(cycles: np.ndarray) -> np.ndarray:
    """Return the mean moment over body mass, N*m/kg, extension positive."""
    knots, values = np.array(list(_LANDMARKS)) / 100.0, np.array(list(_LANDMARKS.values()))
    spline = CubicSpline(
        np.append(knots, knots[0] + 1.0), np.append(values, values[0]), bc_type="periodic"
    )
    return np.asarray(spline(knots[0] + np.mod(cycles - knots[0], 1.0)))
