"""Sessions and sides of one person: the label of their rows, and one value a person for means."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from jointz.core.gait_phases import mean_phase
from jointz.core.grouping import by_key

if TYPE_CHECKING:
    from jointz.results.estimates import CellEstimate, ParameterEstimate


def person_cells(cells: Sequence["CellEstimate"]) -> tuple["CellEstimate", ...]:
    """Return one cell a participant, timing point and method: sessions and sides averaged.

    All sessions and sides count alike. Their errors are taken to be fully shared, since they have
    instruments, prior and model in common: variances are averaged, which is cautious. Of the
    recommended method undecided cells count by their unbounded value, and the average is undecided
    where one of them is; of other methods only values that stand count.
    """
    groups = by_key(((c.participant, c.timing_point, c.method), c) for c in cells)
    return tuple(
        cells_of_group[0] if len(cells_of_group) == 1 else _average(cells_of_group)
        for cells_of_group in groups.values()
    )


def _average(cells: Sequence["CellEstimate"]) -> "CellEstimate":
    kept = (
        [c for c in cells if c.budget]
        or [c for c in cells if any(p.available for p in c.parameters)]
        or list(cells)
    )
    covariances = [c.covariance for c in kept if c.covariance is not None]
    # A session or side may lack a parameter that another one has.
    names = dict.fromkeys(p.name for c in kept for p in c.parameters)
    budgets = dict.fromkeys(name for c in kept for name in c.budget)
    effects = dict.fromkeys(name for c in kept for name in c.prior_effects)
    return replace(
        kept[0],
        session="",
        side="",
        onset_gait_pct=mean_phase([c.onset_gait_pct for c in kept]),
        centre_gait_pct=mean_phase([c.centre_gait_pct for c in kept]),
        parameters=tuple(_parameter(kept, name) for name in names),
        vaf_pct=None,
        n_used=sum(c.n_used for c in cells),
        n_excluded=sum(c.n_excluded for c in cells),
        condition_number=None,
        displacement_rad=None,
        response=None,
        example=None,
        nuisance=(),
        gravity_corrected=None,
        budget={name: _budget(kept, name) for name in budgets},
        through_instruments={},
        prior_effects={name: _prior_effect(kept, name) for name in effects},
        covariance=tuple(map(tuple, np.mean(covariances, axis=0).tolist()))
        if covariances
        else None,
    )


def _counting(cells: Sequence["CellEstimate"], name: str) -> list["CellEstimate"]:
    """Return the cells whose value of a parameter counts."""
    known = ((c, c.parameter(name)) for c in cells)
    return [c for c, p in known if p and (p.available if not c.budget else p.unbounded is not None)]


def _parameter(cells: Sequence["CellEstimate"], name: str) -> "ParameterEstimate":
    known = [c for c in cells if c.parameter(name)]
    estimates = [p for c in _counting(known, name) or known[:1] if (p := c.parameter(name))]
    statuses = {p.status for p in estimates}
    stands = statuses <= {"ok", "at_bound"}
    status = "ok" if stands and "ok" in statuses else estimates[0].status
    return replace(
        estimates[0],
        value=_mean([p.value for p in estimates]) if stands else None,
        ci_low=_mean([p.ci_low for p in estimates]) if stands else None,
        ci_high=_mean([p.ci_high for p in estimates]) if stands else None,
        unbounded=_mean([p.unbounded for p in estimates]),
        status=status if stands or len(statuses) == 1 else "undecided",
    )


def _budget(cells: Sequence["CellEstimate"], name: str) -> dict[str, float]:
    known = [c for c in cells if name in c.budget]
    parts = [c.budget[name] for c in _counting(known, name) or known[:1]]
    return {
        source: float(np.sqrt(np.mean([part.get(source, 0.0) ** 2 for part in parts])))
        for source in dict.fromkeys(source for part in parts for source in part)
    }


def _prior_effect(cells: Sequence["CellEstimate"], name: str) -> tuple[float, float]:
    pairs = [c.prior_effects.get(name, (0.0, 0.0)) for c in _counting(cells, name) or cells[:1]]
    shift, variance = np.mean(pairs, axis=0).tolist()
    return shift, variance


def _mean(values: Sequence[float | None]) -> float | None:
    known = [v for v in values if v is not None]
    return float(np.mean(known)) if len(known) == len(values) else None
