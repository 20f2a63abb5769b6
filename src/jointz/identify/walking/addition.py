"""A known addition to a joint, from pulses with it and without it.

Both are explained as one leg with one set of instruments: with the addition the joint has the same
stiffness and inertia more at every timing point. Errors of the instruments act on both and cancel.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from jointz.core.channels import PARAMETER_UNITS
from jointz.core.errors import DataError
from jointz.core.gait_phases import PHASES
from jointz.core.priors import AnyPrior, NormalPrior, spread_of
from jointz.core.study import AdditionSpec, ParticipantSpec
from jointz.identify.walking.bayesian_method import LegData
from jointz.identify.walking.decisions import unlikely_instruments
from jointz.identify.walking.estimands import mixed_moments
from jointz.identify.walking.gravity import thigh_angle
from jointz.identify.walking.information import GROUPS, with_more_pulses
from jointz.identify.walking.leg_model import ADDED, SHANK, SHANK_SHARE, AddedPart, LegModel
from jointz.identify.walking.posterior import LegPosterior, explain
from jointz.identify.walking.prior import LegPriors
from jointz.reference.body_segments import segment_length
from jointz.results.unlikely_parameter import UnlikelyParameter

#: Parts of an addition with their units, in the order of ``ADDED``.
PARTS: Final = {name: PARAMETER_UNITS[name] for name in ("stiffness", "inertia")}
#: Of an addition that is stated to be exact, and of a part that it does not have.
_EXACT: Final = 1e-3
#: Error -> sources of :mod:`jointz.identify.walking.information` that would be it; their priors
#: become so many times as wide.
ERRORS: Final[Mapping[str, tuple[str, ...]]] = {
    "torque gain": ("torque_error",),
    "angle gain": ("goniometer_gain", "encoder_gain", "gyroscope_gain"),
    "lag": GROUPS["lag"],
    "strap": GROUPS["strap"],
}
_WIDER: Final = 6.0
#: Sd of what the joint feels of an inertia, of it: at a timing point the shank's share is taken as
#: constant, but between stance and swing its square goes from 0.24 to 0.49 within 0.1 s (two
#: links), and it is measured to 0.035.
_FELT_SD: Final = 0.15


@dataclass(frozen=True, slots=True, eq=False)
class AdditionFit:
    """Parts of an addition as the pulses show them: stiffness and inertia, or those of a load."""

    mean: np.ndarray  # (parts,) SI
    sd: np.ndarray  # (parts,)
    more_pulses: np.ndarray  # (parts,) sds with twice the pulses
    unlikely: tuple[UnlikelyParameter, ...]  # instruments that speak against the model


def fit_addition(model: LegModel, priors: LegPriors) -> AdditionFit:
    """Fit recordings without and with an addition as one leg."""
    posterior = explain(model, priors)
    mean, sd = _moments(posterior, [fit.covariance for fit in posterior.fits])
    _, more = _moments(posterior, [with_more_pulses(model, fit) for fit in posterior.fits])
    felt_sd = _FELT_SD
    if SHANK not in model.layout.own_of_point:  # the share is not measured; its square is felt
        felt_sd = 2.0 * (1.0 - SHANK_SHARE) * priors.spec.shank_share.logit_sd
    for sds in (sd, more):
        sds[1] = np.hypot(sds[1], felt_sd * mean[1])
    unlikely = unlikely_instruments(posterior, priors.coupling.fixed)
    return AdditionFit(mean, sd, more, unlikely)


def pair_model(
    without: LegData, loaded: LegData, addition: AdditionSpec, person: ParticipantSpec | None
) -> LegModel:
    """Return the model of the timing points of both.

    Raises DataError if they have no timing point in common, or other sensors.
    """
    places = {cell.label: k for k, cell in enumerate(without.cells)}
    common = [k for k, cell in enumerate(loaded.cells) if cell.label in places]
    if not common or without.model.channels != loaded.model.channels:
        raise DataError(
            "expected the same timing points and sensors with and without the addition, got "
            f"{', '.join(places)} by {', '.join(without.model.channels)}, and "
            f"{', '.join(c.label for c in loaded.cells)} by {', '.join(loaded.model.channels)}."
        )
    parts = [_part(loaded, k, places[loaded.cells[k].label], addition, person) for k in common]
    model = without.model
    return LegModel(
        [*model.points, *(loaded.model.points[k] for k in common)],
        window_s=model.window_s,
        gravity_stiffness=without.body.gravity_stiffness,
        error=model.error,
        added=[*(None for _ in model.points), *parts],
    )


def explained_by(model: LegModel, priors: LegPriors, addition: AdditionSpec) -> dict[str, float]:
    """Return the log evidence of each error, the addition being what it is stated to be.

    That of no error has the name "".
    """
    stated = {
        name: NormalPrior(mean=value / unit, sd=max(sd / unit, _EXACT))
        for (name, unit), value, sd in zip(ADDED.items(), *stated_addition(addition), strict=True)
    }
    evidence = {}
    for error, names in {"": (), **ERRORS}.items():
        wider = {n: _wider(priors, n) for n in names if n in model.layout.shared_names}
        if error and not wider:
            continue
        lag = None if error == "lag" else priors.lag
        supposed = replace(priors, shared={**priors.shared, **stated, **wider}, lag=lag)
        fits = explain(model, supposed).fits
        evidence[error] = float(np.logaddexp.reduce([fit.log_evidence for fit in fits]))
    return evidence


def stated_addition(
    addition: AdditionSpec, names: Sequence[str] = tuple(PARTS)
) -> tuple[np.ndarray, np.ndarray]:
    """Return the parts of an addition by their names, SI, and their sds."""
    parts = [getattr(addition, name) for name in names]
    values = [(0.0, 0.0) if part is None else (part.value, part.sd) for part in parts]
    mean, sd = np.array(values).T
    return mean, sd


def _wider(priors: LegPriors, name: str) -> AnyPrior:
    usual = priors.shared.get(name) or getattr(priors.spec, name)
    key = next(name for name in ("log_sd", "logit_sd", "sd") if hasattr(usual, name))
    return usual.model_copy(update={key: _WIDER * spread_of(usual)})


def _moments(
    posterior: LegPosterior, covariances: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and sd of the addition, SI."""
    layout, units = posterior.model.layout, np.array(list(ADDED.values()))
    at = [layout.shared(name) for name in ADDED]
    means = [units * fit.theta[at] for fit in posterior.fits]
    parts = [np.outer(units, units) * c[np.ix_(at, at)] for c in covariances]
    mean, covariance = mixed_moments(posterior.weights, means, parts)
    return mean, posterior.model.error.sd_inflation * np.sqrt(np.diag(covariance))


def _part(
    loaded: LegData,
    k: int,
    partner: int,
    addition: AdditionSpec,
    person: ParticipantSpec | None,
) -> AddedPart:
    """Return what the joint feels of an addition at a timing point."""
    cell = loaded.cells[k]
    phase_pct = 100.0 * cell.phase if np.isfinite(cell.phase) else 0.0
    knee_rad, gravity = cell.predicted.posture_rad, 0.0
    if addition.gravity_nm is not None:
        gravity = addition.gravity_nm.value * float(np.cos(thigh_angle(phase_pct) - knee_rad))
    height_m = None if person is None else person.height_m
    return AddedPart(partner, gravity, felt_inertia(addition, phase_pct, knee_rad, height_m))


def felt_inertia(
    addition: AdditionSpec, phase_pct: float, knee_rad: float, height_m: float | None
) -> tuple[float, float, float]:
    """Return the inertia that the joint feels over that of the addition about the joint.

    As a polynomial, constant first, in the share s of the joint's motion that the shank makes. A
    pure inertia turns by s. The rest is the thigh's, which turns back and moves a weight with the
    knee in swing; in stance the shank turns about the ankle instead.
    """
    distance_m = addition.distance_m
    if distance_m is None:
        return 0.0, 0.0, 1.0
    if phase_pct < PHASES["PSW"][1]:
        below = segment_length("shank", height_m) / distance_m - 1.0
        return 0.0, 0.0, below**2
    thigh = segment_length("thigh", height_m) / distance_m
    across = 2.0 * thigh * float(np.cos(knee_rad))
    return thigh**2, -2.0 * thigh**2 - across, 1.0 + thigh**2 + across
