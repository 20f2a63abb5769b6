"""How uncertain estimates would remain if more were known, from the normal posterior."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from jointz.identify.walking.estimands import log_gradient, mixed_moments
from jointz.identify.walking.leg_model import REFLEX, Layout, LegModel
from jointz.identify.walking.map_fit import MapFit, MapSearch
from jointz.identify.walking.posterior import LegPosterior

#: Source -> shared parameters that a measurement would give together, those of sensors that are
#: there.
GROUPS: Final[Mapping[str, tuple[str, ...]]] = {
    "strap": (
        "device_share",
        "strap_hz",
        "strap_damping",
        "skin_share",
        "goniometer_hz",
        "goniometer_damping",
        "shank_hz",
        "shank_damping",
        "thigh_hz",
        "thigh_damping",
    ),
    "lag": ("sensor_delay_s", "sensor_lag_s", "encoder_delay_s", "gyroscope_delay_s"),
    "softening": ("half_angle_rad", "softening_power"),
    "reflex": (
        "reflex_gain",
        "reflex_latency_s",
        "reflex_time_s",
        "reflex_position",
        "reflex_shortening",
    ),
    "friction": ("friction_nm",),
    "gain": ("torque_error", "goniometer_gain", "encoder_gain", "gyroscope_gain"),
    "inertia": ("inertia",),
}
#: Twice as many pulses of every shape.
PULSES: Final = "pulses"
_TIMES: Final = 2


def remaining_sds(posterior: LegPosterior) -> dict[str, np.ndarray]:
    """Return the sds of all logarithms (estimand * point) that each source would leave.

    A group of parameters is known if it is fixed at the mode. :data:`PULSES` repeats all pulses.
    """
    parts = [_covariances(posterior.model, fit) for fit in posterior.fits]
    means = [mean for mean, _ in parts]
    sds = {}
    for source in (*GROUPS, PULSES):
        left = [covariances[source] for _, covariances in parts]
        _, covariance = mixed_moments(posterior.weights, means, left)
        sds[source] = posterior.model.error.sd_inflation * np.sqrt(np.diag(covariance))
    return sds


def _covariances(model: LegModel, fit: MapFit) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return the mean of all logarithms, and their covariance if a source were known."""
    mean, gradient = log_gradient(model, fit)
    left = {n: _conditional(fit.covariance, places_of(model.layout, n)) for n in GROUPS}
    left[PULSES] = with_more_pulses(model, fit)
    return mean, {name: gradient @ c @ gradient.T for name, c in left.items()}


def places_of(layout: Layout, source: str) -> np.ndarray:
    """Return the places of a source's parameters, of sensors that are there."""
    names = [name for name in GROUPS[source] if name in layout.shared_names]
    places = [layout.shared(name) for name in names]
    if source == "reflex":  # its deviation at every timing point, too
        places += [layout.own(point, REFLEX) for point in range(layout.n_points)]
    return np.array(places)


def _conditional(covariance: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return the covariance of all parameters if some are known."""
    among = covariance[np.ix_(known, known)]
    return np.asarray(covariance - covariance[:, known] @ np.linalg.solve(among, covariance[known]))


def with_more_pulses(model: LegModel, fit: MapFit) -> np.ndarray:
    """Return the covariance of all parameters with twice the pulses."""
    points = [
        replace(point, shapes=tuple(replace(s, n_pulses=_TIMES * s.n_pulses) for s in point.shapes))
        for point in model.points
    ]
    return MapSearch(model.with_points(points), fit.prior).covariance_at(fit.theta)
