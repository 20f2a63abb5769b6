r"""Test whether a joint responds linearly to pulses of both directions and several sizes.

A reflex in one direction, a contact, or a stiffness that falls with displacement leaves an average
response that a linear joint can explain. Only pulses that differ reveal it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import toeplitz
from scipy.stats import norm

from jointz.core.codes import Doubt
from jointz.identify.prediction.predicted_cells import PredictedCell
from jointz.identify.preparation.cell_data import PARAMETERS
from jointz.identify.rigid.reflex_hypothesis import LATENCIES_S, moved_by, reflex_shape
from jointz.identify.rigid.response_model import CellResponse, Posterior, response_to_kick
from jointz.identify.rigid.response_posterior import JointPosterior
from jointz.kernels.response_search import J_DEVIATION, LOG_J, PER_POINT, SHARED, B, K
from jointz.results.estimates import REACH_95, CellEstimate, ParameterEstimate, decides

#: Probability that a linear joint is doubted, for each participant and kind of comparison.
LEVEL = 1e-3
#: Fewest pulses of each kind that are compared at a timing point.
FEWEST = 8
#: Sizes with a smaller relative sd count as one size.
_ONE_SIZE = 0.15
_COMPARED = (Doubt.RESPONSES_DIFFER_WITH_DIRECTION, Doubt.RESPONSES_NOT_PROPORTIONAL)
_TINY = 1e-300


@dataclass(frozen=True, slots=True)
class Contrast:
    """A difference of responses between kinds of pulses, and its significance."""

    doubt: Doubt  # code of a significant difference
    p_value: float  # smallest p of the comparisons times their number
    # timing point -> change of K (N*m/rad), B (N*m*s/rad) and log J of the average pulse if the
    # difference belonged to one direction alone; empty for pulse sizes
    shifts: Mapping[str, np.ndarray] = field(default_factory=dict)

    @property
    def significant(self) -> bool:
        """Whether the difference is significant."""
        return self.p_value < LEVEL


@dataclass(frozen=True, slots=True, eq=False)
class _Projection:
    """Coefficient of every shape at one timing point, its variance and weight."""

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
    results = []
    for doubt in _COMPARED:
        projections = [
            projection
            for i, (cell, response) in enumerate(zip(cells, responses, strict=True))
            if (projection := _projection(doubt, i, cell, response, posterior)) is not None
        ]
        if projections:
            contrast, sizes = _pooled(doubt, projections, posterior.friction_gain().variance)
            if doubt is Doubt.RESPONSES_DIFFER_WITH_DIRECTION:
                contrast = replace(contrast, shifts=_shifts(sizes, cells, responses, posterior))
            results.append(contrast)
    return tuple(results)


def doubted(estimate: CellEstimate, compared: Sequence[Contrast]) -> CellEstimate:
    """Widen the intervals of a timing point by the effect of a difference between directions."""
    shifts = [c.shifts[estimate.timing_point] for c in compared if c.significant and c.shifts]
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
        corrected = _widened(corrected, reach["stiffness"]) if rows[0].available else None
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
    method = f"{row.ci_method}; widened by the difference between directions"
    return replace(row, ci_low=low, ci_high=high, ci_method=method)


def _projection(
    doubt: Doubt, i: int, cell: PredictedCell, response: CellResponse, posterior: JointPosterior
) -> _Projection | None:
    """Return the projections of a timing point; None if too few pulses differ."""
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
    lower = toeplitz(kick, np.zeros(n))
    scores = (responses[:, 0] - torque @ lower.T) @ weighted
    inverse = np.linalg.pinv(design)
    freedom = len(design) - design.shape[1]
    scatter = ((scores - design @ (inverse @ scores)) ** 2).sum(axis=0) / freedom
    # What the prediction misses on average turns its sign with the pulse.
    common = float(inverse[0] @ signs) ** 2 / cell.predicted.n_strides
    return _Projection(
        coefficient=inverse[0] @ scores,
        variance=scatter * (float(inverse[0] @ inverse[0]) + common),
        by_friction=inverse[0] @ responses[:, 2] @ lower.T @ weighted,
        weight=np.einsum("ij,ji->i", shapes, weighted),
    )


def _design(doubt: Doubt, sizes: np.ndarray, signs: np.ndarray) -> np.ndarray | None:
    """Return the regressors, first the one whose coefficient is zero if linear, (n, k)."""
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
    """Return the change of the angle by more stiffness and by a reflex, (2, n) rad."""
    stiffer = moved_by(i, response, posterior, pull=posterior.fitted[i])
    reflex = reflex_shape(i, response, posterior, latency_s=LATENCIES_S[0])
    return np.stack([stiffer, reflex])


def _shifts(
    sizes: np.ndarray,
    cells: Sequence[PredictedCell],
    responses: Sequence[CellResponse],
    posterior: JointPosterior,
) -> dict[str, np.ndarray]:
    """Return the change of K, B and log J of every timing point by shapes of these sizes."""
    return {
        cell.label: sizes @ _impedance_change(i, _shapes(i, response, posterior.best), posterior)
        for i, (cell, response) in enumerate(zip(cells, responses, strict=True))
    }


def _impedance_change(i: int, shapes: np.ndarray, posterior: JointPosterior) -> np.ndarray:
    """Return the change of K, B and log J by each shape in the average response, (2, 3)."""
    first, n = PER_POINT * i, posterior.best.values.size
    gains = sum(
        w * p.gains[i] for w, p in zip(posterior.weights, posterior.posteriors, strict=True)
    )
    gains = np.asarray(gains)
    inertia = gains[first + J_DEVIATION] + gains[n - SHARED + LOG_J]
    return np.asarray(shapes @ np.stack([gains[first + K], gains[first + B], inertia]).T)


def _pooled(
    doubt: Doubt, projections: Sequence[_Projection], friction_variance: float
) -> tuple[Contrast, np.ndarray]:
    """Test each shape over all timing points; return the size of the more significant, too."""
    coefficient = np.sum([p.coefficient for p in projections], axis=0)
    weight = np.sum([p.weight for p in projections], axis=0)
    # The friction gain is common to all timing points, so that its error adds up.
    by_friction = np.sum([p.by_friction for p in projections], axis=0)
    variance = np.sum([p.variance for p in projections], axis=0)
    variance = variance + by_friction**2 * friction_variance
    ratio = np.abs(coefficient) / np.sqrt(variance + _TINY)
    p_value = min(1.0, ratio.size * float(2.0 * norm.sf(ratio.max())))
    sizes = np.where(ratio == ratio.max(), coefficient / (weight + _TINY), 0.0)
    return Contrast(doubt, p_value), sizes
