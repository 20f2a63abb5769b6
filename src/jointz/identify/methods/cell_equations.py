"""Methods whose estimate solves normal equations of an average: point, replicates, result."""

from collections.abc import Callable

import numpy as np

from jointz.identify.methods.cell_parameters import (
    BootstrapSpread,
    Point,
    Replicates,
    parameter_estimates,
    undecided_parameters,
)
from jointz.identify.methods.cell_resampling import linear_averages
from jointz.identify.preparation.cell_data import (
    CellData,
    CellFit,
    FitSettings,
    Windows,
    check_average,
    response_of,
    vaf_pct,
    without_dust,
)
from jointz.identify.preparation.conditioning import ANGLE, TORQUE
from jointz.kernels.bounded_lsq import (
    condition_numbers,
    least_squares,
    nonnegative_least_squares,
)
from jointz.results.estimates import ParameterEstimate

Equations = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def fitted_by_equations(
    cell: CellData,
    settings: FitSettings,
    equations: Equations,
    *,
    windows: Windows | None = None,
    lag_s: float = 0.0,
    nuisance: tuple[ParameterEstimate, ...] = (),
) -> CellFit:
    """Solve the equations of the average and of its resamples."""
    used = windows or cell.filtered
    average = cell.filtered.responses().mean(axis=0)
    gram, moment = equations(used.responses().mean(axis=0)[None])
    condition = float(condition_numbers(gram)[0])
    check_average(average, condition)
    free = least_squares(gram, moment)[0]
    value, held = free, 0
    replicates = _solved(*equations(linear_averages(used, settings))).decided()
    if settings.bounded:
        bounded, active = nonnegative_least_squares(gram, moment)
        value, held = bounded[0], int(active[0])
    else:
        replicates = replicates.freed()
    point = Point(without_dust(value, average), free, held)
    what = "pulses" if used.baseline.own else "pulses and unperturbed strides"
    spread = BootstrapSpread(
        replicates, settings, what=what, rng=np.random.default_rng([settings.seed, 1])
    )
    fitted = _late(point.value @ average[:TORQUE], lag_s, settings.rate_hz)
    return CellFit(
        parameters=parameter_estimates(point, spread, settings),
        vaf_pct=vaf_pct(average, fitted),
        condition_number=condition,
        displacement_rad=float(np.abs(average[ANGLE]).max()),
        response=response_of(average, fitted, rate_hz=settings.rate_hz),
        nuisance=nuisance,
    )


def undecided(
    cell: CellData, settings: FitSettings, nuisance: tuple[ParameterEstimate, ...] = ()
) -> CellFit:
    """Return a cell that its data do not decide."""
    average = cell.filtered.responses().mean(axis=0)
    return CellFit(
        parameters=undecided_parameters(settings),
        vaf_pct=None,
        condition_number=None,
        displacement_rad=float(np.abs(average[ANGLE]).max()),
        response=None,
        nuisance=nuisance,
    )


def white_noise_sd(values: np.ndarray) -> float:
    """Return the sd of the white noise of a record, from its fourth differences."""
    fourth = np.diff(values, 4)
    return float(max(np.sqrt((fourth**2).mean() / 70.0), 1e-9 * np.ptp(values)))


def _solved(gram: np.ndarray, moment: np.ndarray) -> Replicates:
    bounded, active = nonnegative_least_squares(gram, moment)
    return Replicates(bounded, least_squares(gram, moment), active)


def _late(torque: np.ndarray, lag_s: float, rate_hz: float) -> np.ndarray:
    time = np.arange(torque.size) / rate_hz
    return np.asarray(np.interp(time - lag_s, time, torque))
