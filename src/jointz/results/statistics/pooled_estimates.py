"""Unbounded estimates of a cell with their errors, undecided ones included."""

from dataclasses import dataclass, replace

import numpy as np

from jointz.results.estimates import CellEstimate

#: The source of error that is another one at every timing point; all others are alike there.
_OWN = "noise"
#: The source that one calibration gives to everybody.
_GAIN = "gain"
#: Value per kg -> what it is of.
_WHOLE = {"stiffness_per_mass": "stiffness", "damping_per_mass": "damping"}


@dataclass(frozen=True, slots=True)
class UnboundedEstimate:
    """An estimate without bounds, whether or not its cell was decided."""

    value: float  # the estimate, SI
    noise_sd: float  # sd of the errors that are independent between timing points, SI
    # sd of the errors that timing points share or that are similar at neighbouring ones (lag,
    # gains, friction, changes of K and B inside the window, the model), SI
    systematic_sd: float
    gain_sd: float = 0.0  # sd of the errors of the gains, which are part of the systematic ones, SI

    @property
    def sd(self) -> float:
        """Of all errors together."""
        return float(np.hypot(self.noise_sd, self.systematic_sd))


def has_budget(cell: CellEstimate) -> bool:
    """Return whether a cell has an error budget."""
    return bool(cell.budget)


def estimate_without_priors(cell: CellEstimate, name: str) -> UnboundedEstimate | None:
    """Return the estimate of a parameter without the priors of K, B and J.

    A mean over people must not count the prior once per person: where data decide nothing, all
    estimates are the prior's mean, and agree.
    """
    estimate, parameter = unbounded_estimate(cell, name), cell.parameter(name)
    if estimate is None or parameter is None or parameter.status.startswith("failed"):
        return None
    whole = _WHOLE.get(name, name)
    shift, variance = cell.prior_effects.get(whole, (0.0, 0.0))
    base = cell.parameter(whole)
    per = 1.0 if base is None or not base.unbounded else abs(estimate.value / base.unbounded)
    systematic = np.sqrt(max(estimate.systematic_sd**2 + per**2 * variance, 0.0))
    return replace(estimate, value=estimate.value - per * shift, systematic_sd=float(systematic))


def unbounded_estimate(cell: CellEstimate, name: str) -> UnboundedEstimate | None:
    """Return a parameter with its standard errors, undecided ones included.

    An undecided cell holds information: leaving it out, or putting 0 for it, would bias a mean
    over people towards those whose data decide.
    """
    whole = _WHOLE.get(name, name)
    parameter, base = cell.parameter(name), cell.parameter(whole)
    sources = cell.budget.get(whole)
    if parameter is None or base is None or not sources:
        return None
    if parameter.unbounded is None or not base.unbounded:
        return None
    per = abs(parameter.unbounded / base.unbounded)
    systematic = [sd for source, sd in sources.items() if source != _OWN]
    return UnboundedEstimate(
        value=parameter.unbounded,
        noise_sd=per * sources.get(_OWN, 0.0),
        systematic_sd=per * float(np.linalg.norm(systematic)),
        gain_sd=per * sources.get(_GAIN, 0.0),
    )
