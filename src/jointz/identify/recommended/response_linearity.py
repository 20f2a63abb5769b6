r"""Whether pulses of both directions, and of several sizes, are answered as by a linear joint.

A reflex that acts in one direction, a contact, or a stiffness that falls with the displacement
leave an average response that a linear joint explains: stiffness, damping and their drift follow
it. Only pulses that differ can tell.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.stats import norm

from jointz.core.codes import Doubt
from jointz.identify.preparation.cell_data import PARAMETERS
from jointz.identify.recommended.reflex_hypothesis import LATENCIES_S, moved_by, reflex_shape
from jointz.identify.recommended.response_model import CellResponse, Posterior, response_to_kick
from jointz.identify.recommended.response_posterior import JointPosterior
from jointz.identify.recommended.walking_responses import PredictedCell
from jointz.kernels.response_search import J_DEVIATION, LOG_J, PER_POINT, SHARED, B, K
from jointz.results.estimates import REACH_95, CellEstimate, ParameterEstimate, decides

#: Chance that a linear joint is called another, a participant and a kind of pulses.
LEVEL = 1e-3
#: Pulses of each kind at a timing point, below which nothing is compared there.
FEWEST = 8
#: Sizes whose spread (sd) is a smaller share of their mean are one.
_ONE_SIZE = 0.15
_COMPARED = (Doubt.RESPONSES_DIFFER_WITH_DIRECTION, Doubt.RESPONSES_NOT_PROPORTIONAL)
_TINY = 1e-300


@dataclass(frozen=True, slots=True)
class Contrast:
    """How responses differ between kinds of pulses, against what chance does."""

    doubt: Doubt  # what it would mean
    p_value: float  # of the most telling of the comparisons, times their number
    # timing point -> what the difference does to K (N*m/rad), B (N*m*s/rad) and the logarithm of J
    # of the average pulse, if one direction alone has it; empty for sizes
    shifts: Mapping[str, np.ndarray] = field(default_factory=dict)

    @property
    def stands(self) -> bool:
        """Whether a linear joint would hardly differ as much."""
        return self.p_value < LEVEL


@dataclass(frozen=True, slots=True, eq=False)
class _Told:
    """What one timing point tells: coefficient, its variance and weight for every shape."""

    coefficient: np.ndarray
    variance: np.ndarray
    by_friction: np.ndarray
    weight: np.ndarray


def contrasts(
    cells: Sequence[PredictedCell], responses: Sequence[CellResponse], posterior: JointPosterior
) -> tuple[Contrast, ...]:
    r"""Compare the responses to pulses of both directions, and of several sizes.

    What the measured torque does not explain of every response is projected on what a change of
    the stiffness, and a late answer (30 ms, twitch of 40 ms, to the velocity of stretch) would
    make of it, weighted with the noise. The projections are regressed on the size of the pulse,
    on its size times its direction, and on a constant: of a linear joint the latter two are
    zero. Their errors are those of the scatter of the pulses, of the friction gain, and of the
    prediction, which both directions have with opposite signs. Each shape is tested over all
    timing points together; at single ones, a friction model that is wrong there would be taken
    for a joint that is not linear.

    It misleads where the friction model is wrong in one direction only, or where walkers brace
    themselves against one of them; and a reflex that both directions meet alike, or one to
    pulses of one direction and size, is not seen. For sizes, a half-wave-rectified reflex without
    threshold is proportional too.
    """
    found = []
    for doubt in _COMPARED:
        told = [
            one
            for i, (cell, response) in enumerate(zip(cells, responses, strict=True))
            if (one := _told(doubt, i, cell, response, posterior)) is not None
        ]
        if told:
            contrast, sizes = _together(doubt, told, posterior.friction_gain().variance)
            if doubt is Doubt.RESPONSES_DIFFER_WITH_DIRECTION:
                contrast = replace(contrast, shifts=_shifts(sizes, cells, responses, posterior))
            found.append(contrast)
    return tuple(found)


def doubted(estimate: CellEstimate, found: Sequence[Contrast]) -> CellEstimate:
    """Widen a timing point's intervals by what a difference between directions does to them."""
    shifts = [c.shifts[estimate.timing_point] for c in found if c.stands and c.shifts]
    if not shifts:
        return estimate
    sizes = {p.name: p.unbounded or 0.0 for p in estimate.parameters}
    shift = np.abs(shifts[0]) * (1.0, 1.0, sizes["inertia"])
    reach = dict(zip(PARAMETERS, shift.tolist(), strict=True))
    for name in PARAMETERS[:2]:
        per_kg = f"{name}_per_mass"
        if sizes.get(per_kg):
            reach[per_kg] = reach[name] * abs(sizes[per_kg] / sizes[name])
    rows = tuple(_widened(row, reach.get(row.name, 0.0)) for row in estimate.parameters)
    corrected = estimate.gravity_corrected
    if corrected is not None:
        corrected = _widened(corrected, reach["stiffness"]) if rows[0].stands else None
    budget = {
        name: {**sources, "model": float(np.hypot(sources["model"], reach[name] / REACH_95))}
        for name, sources in estimate.budget.items()
    }
    return replace(estimate, parameters=rows, gravity_corrected=corrected, budget=budget)


def _widened(row: ParameterEstimate, reach: float) -> ParameterEstimate:
    if row.value is None or row.ci_low is None or row.ci_high is None:
        return row
    low, high = max(row.ci_low - reach, 0.0), row.ci_high + reach
    if row.status == "ok" and not decides(row.value, 0.5 * (high - low)):
        return ParameterEstimate(row.name, None, None, None, "undecided", unbounded=row.unbounded)
    made = f"{row.ci_method}; widened by the difference between directions"
    return replace(row, ci_low=low, ci_high=high, ci_method=made)


def _told(
    doubt: Doubt, i: int, cell: PredictedCell, response: CellResponse, posterior: JointPosterior
) -> _Told | None:
    """Return what a timing point tells of a doubt; None where too few pulses differ."""
    n, best = response.angle.size, posterior.best
    responses = cell.predicted.responses[cell.kept][:, :, :n]
    signs = np.array([c.pulse.sign for c in cell.used])
    torque = responses[:, 1] + best.friction_gain * responses[:, 2]
    usual = torque.mean(axis=0)
    sizes = torque @ usual / (usual @ usual)
    design = _design(doubt, sizes, signs)
    if design is None:
        return None
    kick = response_to_kick(best, i, period_s=response.period_s, n=n)
    shapes = _shapes(i, response, best)
    weighted = response.weights() @ shapes.T
    lower = np.tril(kick[np.subtract.outer(np.arange(n), np.arange(n)).clip(0)])
    scores = (responses[:, 0] - torque @ lower.T) @ weighted
    inverse = np.linalg.pinv(design)
    freedom = len(design) - design.shape[1]
    scatter = ((scores - design @ (inverse @ scores)) ** 2).sum(axis=0) / freedom
    # What the prediction misses on average turns its sign with the pulse.
    common = float(inverse[0] @ signs) ** 2 / cell.predicted.n_strides
    return _Told(
        coefficient=inverse[0] @ scores,
        variance=scatter * (float(inverse[0] @ inverse[0]) + common),
        by_friction=inverse[0] @ responses[:, 2] @ lower.T @ weighted,
        weight=np.einsum("ij,ji->i", shapes, weighted),
    )


def _design(doubt: Doubt, sizes: np.ndarray, signs: np.ndarray) -> np.ndarray | None:
    """Return what responses are regressed on, first what is zero of a linear joint, (n, k)."""
    both = min((signs > 0).sum(), (signs < 0).sum()) >= FEWEST
    larger = sizes > sizes.mean()
    several = min(larger.sum(), (~larger).sum()) >= FEWEST
    several &= float(sizes.std()) > _ONE_SIZE * float(sizes.mean())
    by_direction, constant = sizes * np.sign(signs), np.ones_like(sizes)
    if doubt is Doubt.RESPONSES_DIFFER_WITH_DIRECTION:
        columns = [by_direction, sizes, *([constant] if several else [])] if both else []
    else:
        columns = [constant, sizes, *([by_direction] if both else [])] if several else []
    return np.column_stack(columns) if columns else None


def _shapes(i: int, response: CellResponse, posterior: Posterior) -> np.ndarray:
    """Return what more stiffness, and a reflex, would add to the angle, (2, n) rad."""
    stiffer = moved_by(i, response, posterior, pull=posterior.fitted[i])
    reflex = reflex_shape(i, response, posterior, latency_s=LATENCIES_S[0])
    return np.stack([stiffer, reflex])


def _shifts(
    sizes: np.ndarray,
    cells: Sequence[PredictedCell],
    responses: Sequence[CellResponse],
    posterior: JointPosterior,
) -> dict[str, np.ndarray]:
    """Return what shapes of these sizes do to every timing point, those too that told nothing."""
    return {
        cell.label: sizes @ _moved(i, _shapes(i, response, posterior.best), posterior)
        for i, (cell, response) in enumerate(zip(cells, responses, strict=True))
    }


def _moved(i: int, shapes: np.ndarray, posterior: JointPosterior) -> np.ndarray:
    """Return what the shapes in the average do to K, B and the logarithm of J, (2, 3)."""
    first, n = PER_POINT * i, posterior.best.values.size
    gains = sum(
        w * p.gains[i] for w, p in zip(posterior.weights, posterior.posteriors, strict=True)
    )
    gains = np.asarray(gains)
    inertia = gains[first + J_DEVIATION] + gains[n - SHARED + LOG_J]
    return np.asarray(shapes @ np.stack([gains[first + K], gains[first + B], inertia]).T)


def _together(
    doubt: Doubt, told: Sequence[_Told], friction_variance: float
) -> tuple[Contrast, np.ndarray]:
    """Test each shape over all timing points together; say how large the likelier one is, (2,)."""
    coefficient = np.sum([one.coefficient for one in told], axis=0)
    weight = np.sum([one.weight for one in told], axis=0)
    # The friction gain is the same for all: its error adds up.
    by_friction = np.sum([one.by_friction for one in told], axis=0)
    variance = np.sum([one.variance for one in told], axis=0) + by_friction**2 * friction_variance
    pooled = np.abs(coefficient) / np.sqrt(variance + _TINY)
    p_value = min(1.0, pooled.size * float(2.0 * norm.sf(pooled.max())))
    sizes = np.where(pooled == pooled.max(), coefficient / (weight + _TINY), 0.0)
    return Contrast(doubt, p_value), sizes
