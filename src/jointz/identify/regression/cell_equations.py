"""Methods whose estimate solves normal equations of an average: point, replicates, result."""

from collections.abc import Callable

import numpy as np

from jointz.identify.preparation.cell_data import (
    CellData,
    CellFit,
    FitSettings,
    check_average,
    response_of,
    vaf_pct,
    without_rounding,
)
from jointz.identify.preparation.conditioning import ANGLE, TORQUE
from jointz.identify.regression.cell_parameters import (
    BootstrapSpread,
    Point,
    Replicates,
    Spread,
    parameter_estimates,
)
from jointz.identify.regression.cell_resampling import linear_averages
from jointz.kernels.bounded_lsq import (
    condition_numbers,
    least_squares,
    nonnegative_least_squares,
    normal_equations,
)

#: Gram matrices (n, 3, 3) and moments (n, 3) of averages (n, 4, samples).
Equations = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def torque_on_motion(averages: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the normal equations of torque on angle, velocity and acceleration."""
    gram, moment, _ = normal_equations(averages)
    return gram, moment


def fitted_by_equations(
    cell: CellData,
    settings: FitSettings,
    equations: Equations,
    *,
    rng: np.random.Generator | None = None,
) -> CellFit:
    """Solve the equations of the average and of its resamples."""
    windows = cell.filtered
    average = windows.responses().mean(axis=0)
    gram, moment = equations(average[None])
    point, condition = solve_average(gram, moment, average, bounded=settings.bounded)
    replicates = solve_resamples(*equations(linear_averages(windows, settings)), settings)
    rng = rng or np.random.default_rng([settings.seed, 1])
    spread = BootstrapSpread(
        replicates, settings, with_strides=windows.baseline.has_strides, rng=rng
    )
    return cell_fit(average, point, spread, settings, condition=condition)


def solve_average(
    gram: np.ndarray, moment: np.ndarray, average: np.ndarray, *, bounded: bool
) -> tuple[Point, float]:
    """Return the solution for an average response and its condition number."""
    condition = float(condition_numbers(gram)[0])
    check_average(average, condition)
    free = least_squares(gram, moment)[0]
    if not bounded:
        return Point(without_rounding(free, average), free, 0), condition
    values, active = nonnegative_least_squares(gram, moment)
    return Point(without_rounding(values[0], average), free, int(active[0])), condition


def solve_resamples(gram: np.ndarray, moment: np.ndarray, settings: FitSettings) -> Replicates:
    """Return the solutions for resampled averages, without those that are singular."""
    values, active = nonnegative_least_squares(gram, moment)
    replicates = Replicates(values, least_squares(gram, moment), active).decided()
    return replicates if settings.bounded else replicates.unconstrained()


def cell_fit(
    average: np.ndarray,
    point: Point,
    spread: Spread,
    settings: FitSettings,
    *,
    condition: float,
) -> CellFit:
    """Return a fit with its intervals, and the torque that it gives at the average motion."""
    fitted = point.value @ average[:TORQUE]
    return CellFit(
        parameters=parameter_estimates(point, spread, settings),
        vaf_pct=vaf_pct(average, fitted),
        condition_number=condition,
        displacement_rad=float(np.abs(average[ANGLE]).max()),
        response=response_of(average, fitted, rate_hz=settings.rate_hz),
    )
