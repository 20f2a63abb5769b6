"""Stiffness and damping that an actuator can render: stable with a load, and passive."""

from math import pi

import numpy as np
from numpy.typing import ArrayLike

from jointz.control.impedance_profile import ImpedanceProfile
from jointz.control.rendering.actuators import Actuator
from jointz.core.errors import DataError

#: Halvings of an interval of frequencies: to 1e-12 of it.
_HALVINGS = 40
#: Frequencies at which passivity is tested, logarithmic and even.
_FREQUENCIES = 1000
#: Laws whose passivity is tested at once.
_AT_ONCE = 100
#: Share of the power of the mean stride's angle that a rendered impedance must follow.
_POWER = 0.99
#: Body height, m, the shank as a share of it, and shank and foot: share of body mass, radius of
#: gyration about the knee as a share of the shank (Winter, table 4.1).
_HEIGHT_M, _SHANK_LENGTH, _MASS, _GYRATION = 1.74, 0.246, 0.061, 0.735


def default_load_inertia(profile: ImpedanceProfile) -> float:
    """Return the inertia of shank and foot about the knee for a profile's mass, kg*m^2."""
    if profile.joint != "knee":
        raise DataError(
            f"load inertia: no default for the {profile.joint}, only for the knee. Give the "
            "inertia that the actuator moves (--load-inertia, kg*m^2)."
        )
    shank = _SHANK_LENGTH * _HEIGHT_M
    return _MASS * profile.mass_kg * (_GYRATION * shank) ** 2


def stable_stiffness(actuator: Actuator, damping: ArrayLike, load_inertia: float) -> np.ndarray:
    """Return the stiffness below which the loop with an inertia is stable.

    Every stiffness from 0 to this limit is stable. On the limit the loop oscillates: the equation
    (J + inertia) s^2 + viscous s + (K + B s) exp(-s D) / (1 + s T) = 0 has a root s = jw.
    Along that curve B grows with w wherever B >= 0, so that bisection finds w.

    Parameters
    ----------
    actuator : Actuator
        The actuator.
    damping : array_like, N*m*s/rad
        Damping of the law, >= 0.
    load_inertia : float, kg*m^2
        Inertia that the actuator moves, its own apart.

    Returns
    -------
    ndarray, N*m/rad
        The limit, of the shape of ``damping``; 0 where no stiffness is stable.
    """
    wanted = np.asarray(damping, dtype=float)
    low = np.zeros_like(wanted)
    high = np.full_like(wanted, _last_frequency(actuator, load_inertia))
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        below = stability_border(actuator, middle, load_inertia)[1] < wanted
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    # Above the largest damping of the border the bisection ends at its end, where K is 0.
    limit = stability_border(actuator, 0.5 * (low + high), load_inertia)[0]
    return np.where(limit > 0.0, limit, 0.0)


def stability_border(
    actuator: Actuator, rad_s: ArrayLike, load_inertia: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return stiffness and damping at which the loop oscillates at angular frequencies > 0."""
    w = np.asarray(rad_s, dtype=float)
    inertia = load_inertia + actuator.inertia
    with np.errstate(divide="ignore", invalid="ignore"):
        point = (inertia * w**2 - 1j * w * actuator.viscous) / actuator.response(w)
        return point.real, np.where(w > 0.0, point.imag / w, -actuator.viscous)


def border_curve(
    actuator: Actuator, load_inertia: float, points: int = 400
) -> tuple[np.ndarray, np.ndarray]:
    """Return stiffness and damping, (points,) each, along the border with B >= 0 for a figure."""
    w = np.linspace(0.0, _last_frequency(actuator, load_inertia), points + 1)[1:]
    return stability_border(actuator, w, load_inertia)


def _last_frequency(actuator: Actuator, load_inertia: float) -> float:
    """Return the frequency at which the border comes back to zero stiffness, rad/s."""
    inertia = load_inertia + actuator.inertia
    lag, delay = actuator.time_constant_s, actuator.loop_delay_s
    low, high = 0.0, pi / delay
    for _ in range(_HALVINGS):
        w = 0.5 * (low + high)
        turn = np.arctan(w * lag) + w * delay - np.arctan2(actuator.viscous, inertia * w)
        low, high = (w, high) if turn < 0.5 * pi else (low, w)
    return 0.5 * (low + high)


def passivity_shortage(actuator: Actuator, stiffness: ArrayLike, damping: ArrayLike) -> np.ndarray:
    """Return the viscous friction that the actuator lacks to be passive, N*m*s/rad.

    The port is passive with any passive environment if viscous + Re[(B + K / jw) H(jw)] >= 0 at
    all frequencies up to half the control rate.

    Parameters
    ----------
    actuator : Actuator
        The actuator.
    stiffness, damping : (n,) array_like, N*m/rad and N*m*s/rad
        The law.

    Returns
    -------
    (n,) ndarray, N*m*s/rad
        0 or less where it is passive.
    """
    laws = np.column_stack([np.atleast_1d(damping), np.atleast_1d(stiffness)])
    planes = np.stack(_passivity_planes(actuator))
    # In parts: all laws by all frequencies would be gigabytes.
    parts = [laws[k : k + _AT_ONCE] for k in range(0, len(laws), _AT_ONCE)]
    least = np.concatenate([(part @ planes).min(axis=1) for part in parts])
    return np.asarray(-actuator.viscous - least)


def passive_stiffness(actuator: Actuator, damping: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and largest stiffness that are passive at dampings, N*m/rad.

    Parameters
    ----------
    actuator : Actuator
        The actuator.
    damping : (n,) array_like, N*m*s/rad
        Damping of the law.

    Returns
    -------
    low, high : (n,) ndarray, N*m/rad
        NaN where no stiffness is.
    """
    real, slope = _passivity_planes(actuator)
    with np.errstate(divide="ignore"):
        limits = -(actuator.viscous + np.atleast_1d(damping)[:, None] * real) / slope
    high = np.where(slope < 0.0, limits, np.inf).min(axis=1)
    low = np.where(slope > 0.0, limits, 0.0).max(axis=1)
    none = high < low
    return np.where(none, np.nan, low), np.where(none, np.nan, high)


def _passivity_planes(actuator: Actuator) -> tuple[np.ndarray, np.ndarray]:
    """Return, at all frequencies, the factors of B and K in the real part of the impedance."""
    last = pi * actuator.control_hz
    w = np.union1d(
        np.geomspace(1e-5 * last, last, _FREQUENCIES), np.linspace(0.0, last, _FREQUENCIES)[1:]
    )
    response = actuator.response(w)
    return response.real, response.imag / w


def stride_bandwidth_hz(profile: ImpedanceProfile) -> float:
    """Return the frequency below which the mean stride's angle has 99 % of its power, Hz."""
    power = np.abs(np.fft.rfft(profile.angle))[1:] ** 2
    share = np.cumsum(power) / power.sum()
    return float((np.argmax(share >= _POWER) + 1) / profile.stride_s)


def rendering_error(actuator: Actuator, hz: float) -> float:
    """Return by how much, of 1, a rendered impedance is off at a frequency."""
    return float(np.abs(actuator.response(2.0 * pi * hz) - 1.0))
