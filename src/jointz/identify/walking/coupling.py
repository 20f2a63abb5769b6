"""Couplings of device and leg: their priors, their hypotheses, and the data that they use.

A device that moves with the bone is a strap that is stiff, a device share that changes nothing, and
no skin or softening.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Final

import numpy as np

from jointz.core.priors import (
    AnyPrior,
    LogPrior,
    NormalPrior,
    PriorsSpec,
    SharePrior,
    Spread,
    spread_of,
)


@dataclass(frozen=True, slots=True)
class ModelError:
    """Errors of the model that the posterior does not include."""

    share: float  # of the response, correlated over 30 ms
    floor_rad: float  # of an angle, at least
    sd_inflation: float  # factor by which Laplace's sds are too small
    damping_sd: float  # of the logarithm of B


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """A hypothesis about gait cycle, leg and goniometer, with the priors that it sets."""

    follows_cycle: float  # share of the variance of K, B and J that follows one curve of the cycle
    constant_share: float = 0.6  # of a point's own variance, that which is constant in the window
    shared: Mapping[str, AnyPrior] = field(default_factory=dict)  # instead of the usual priors
    inertia_sd: float | None = None  # of a point's log J about the shared one; None: as usual
    prior_probability: float = 1.0  # prior probability over that of the others


#: Sd of a fixed parameter: the search needs one above zero.
_KNOWN = 0.01


@dataclass(frozen=True, slots=True)
class Coupling:
    """Assumptions of one coupling."""

    hypotheses: tuple[Hypothesis, ...]
    #: Starts of the search off the prior's mean: changes of K on its scale, of shared parameters.
    starts: Sequence[tuple[float, Mapping[str, float]]]
    priors: PriorsSpec
    fit_s: float  # data after the onset that are used, if longer than the window
    is_strap: bool
    error: ModelError
    fewest_for_curve: int  # timing points of a curve over the cycle
    twist_sd: float  # rad/(N*m): of the angle shown per torque, if it is not calibrated

    @property
    def fixed(self) -> frozenset[str]:
        """Names of parameters that the coupling fixes."""
        stated = {name: getattr(self.priors, name) for name in self.priors.model_fields_set}
        return frozenset(name for name, prior in stated.items() if spread_of(prior) <= _KNOWN)

    def hypotheses_of(
        self, spec: PriorsSpec, *, several_sensors: bool, phases: int
    ) -> tuple[Hypothesis, ...]:
        """Return the hypotheses that a study is open to.

        Sensors beside the goniometer show what it sits on; a curve goes through timing points
        whose ``phases``, so many, are known; and what a study states is not supposed otherwise.
        """
        known = spec.model_fields_set - self.fixed
        supposed = self.hypotheses
        if "inertia_of_point" in known:  # by the study
            first = supposed[0].inertia_sd
            supposed = tuple(replace(h, inertia_sd=None) for h in supposed if h.inertia_sd == first)
        if several_sensors:
            known |= set(NO_TISSUE)
        return tuple(
            h
            for h in supposed
            if known.isdisjoint(h.shared)
            and (phases >= self.fewest_for_curve or not h.follows_cycle)
        )

    def spec(self, stated: PriorsSpec) -> PriorsSpec:
        """Return the priors of the coupling with those that a study states."""
        of_study = {name: getattr(stated, name) for name in stated.model_fields_set}
        return self.priors.model_copy(update=of_study)


#: Of a goniometer alone: either its mount on the skin resonates, or it follows the bone.
NO_TISSUE: Final = {
    "goniometer_hz": LogPrior(median=149.0, log_sd=_KNOWN),
    "goniometer_damping": LogPrior(median=0.3, log_sd=_KNOWN),
}

#: A soft strap is a mode of its own.
STRAP = Coupling(
    hypotheses=tuple(
        Hypothesis(follows, shared=tissue)
        for follows, tissue in product((0.9, 0.0), ({}, NO_TISSUE))
    ),
    starts=((-0.4, {"inertia": -0.45, "strap_hz": 0.35}), (0.0, {"strap_hz": -0.8})),
    priors=PriorsSpec(),
    fit_s=0.2,
    is_strap=True,
    # Reflex, friction and lag share what B does, so that it was 5 to 14 % too high in every world
    # that was tried; Laplace's sds: self-simulation.
    error=ModelError(share=0.015, floor_rad=np.deg2rad(0.02), sd_inflation=1.1, damping_sd=0.08),
    fewest_for_curve=1,
    twist_sd=0.0,
)

#: Priors of K and B of a point: a person's level and the gait cycle tell little about it.
_OVER_CYCLE_SD = 1.0
#: Of K and B of a point by itself, what changes in the window is 4 % (sd) of the value.
_STEADY = 1.0 - (0.04 / _OVER_CYCLE_SD) ** 2
#: Spread of the inertia over the cycle: a shank that moves alone, or with the thigh.
_INERTIA_SDS = (0.01, 0.35)
_CURVE_CHANCE = 1.0 / 3.0
#: A curve over the cycle changes K and B in the window as much as that of a strap.
_FOLLOWS = 0.9 * (0.6 / _OVER_CYCLE_SD) ** 2


def _hypotheses() -> Iterator[Hypothesis]:
    """Yield hypotheses about tissue, the gait cycle and the inertia."""
    for tissue, follows, inertia_sd in product((NO_TISSUE, {}), (0.0, _FOLLOWS), _INERTIA_SDS):
        prior_probability = _CURVE_CHANCE if follows else 1.0 - _CURVE_CHANCE
        yield Hypothesis(follows, _STEADY, tissue, inertia_sd, prior_probability)


RIGID = Coupling(
    hypotheses=tuple(_hypotheses()),
    starts=((-0.4, {"inertia": -0.45}),),
    priors=PriorsSpec(
        inertia_unknown_body=LogPrior(median=0.08, log_sd=1.0),
        stiffness_over_cycle=Spread(sd=_OVER_CYCLE_SD),
        damping_over_cycle=Spread(sd=_OVER_CYCLE_SD),
        sensor_delay_s=LogPrior(median=0.002, log_sd=0.5),
        sensor_lag_s=LogPrior(median=0.007, log_sd=1.0),
        torque_error=NormalPrior(mean=0.0, sd=5e-4),
        friction_nm=LogPrior(median=0.1, log_sd=1.0),
        device_share=LogPrior(median=0.03, log_sd=_KNOWN),
        strap_hz=LogPrior(median=140.0, log_sd=_KNOWN),
        strap_damping=LogPrior(median=0.3, log_sd=_KNOWN),
        skin_share=SharePrior(median=0.01, logit_sd=_KNOWN),
        half_angle_rad=LogPrior(median=100.0, log_sd=_KNOWN),
        softening_power=NormalPrior(mean=1.6, sd=_KNOWN),
    ),
    fit_s=0.0,
    is_strap=False,
    error=ModelError(share=0.001, floor_rad=2e-5, sd_inflation=1.0, damping_sd=0.0),
    fewest_for_curve=4,
    twist_sd=3e-4,
)

#: ``coupling`` of a study -> its assumptions.
COUPLINGS: Final[Mapping[str, Coupling]] = {"strap": STRAP, "rigid": RIGID}
