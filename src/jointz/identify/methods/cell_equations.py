"""Methods whose estimate solves normal equations of an average: point, replicates, result."""

from collections.abc import Callable

import numpy as np

from jointz.core.estimates import ParameterEstimate
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
    """Solve the equations of the average and of its resamples.

    Parameters
    ----------
    cell : CellData
        Filtered windows: of their average VAF and response are told.
    settings : FitSettings
        Resamples, bounds, calibration, mass.
    equations : callable
        From averages (R, 4, n) to gram (R, 3, 3) and moment (R, 3) of K, B, J.
    windows : Windows, optional
        Those whose averages the equations take; the filtered ones by default.
    lag_s : float, s
        How late the torque is found to be.
    nuisance : tuple of ParameterEstimate
        What else was estimated.

    Raises
    ------
    EstimationError
        ``ill_conditioned``, ``constant_angle`` or ``constant_torque``.
    """
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
    """Return a cell that its data do not decide.

    Parameters
    ----------
    cell : CellData
        The cell.
    settings : FitSettings
        Mass, and whether values per kg are expected.
    nuisance : tuple of ParameterEstimate
        What else was looked for.
    """
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
    """Return the sd of the white noise of a record, from its fourth differences.

    Parameters
    ----------
    values : (n,) float
        A record whose motion is slow beside its samples.

    Returns
    -------
    float
        At least a billionth of the range: a record without noise still has digits.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> round(white_noise_sd(rng.normal(0.0, 2.0, 10_000)), 1)
    2.0
    """
    fourth = np.diff(values, 4)
    return float(max(np.sqrt((fourth**2).mean() / 70.0), 1e-9 * np.ptp(values)))


def _solved(gram: np.ndarray, moment: np.ndarray) -> Replicates:
    bounded, active = nonnegative_least_squares(gram, moment)
    return Replicates(bounded, least_squares(gram, moment), active)


def _late(torque: np.ndarray, lag_s: float, rate_hz: float) -> np.ndarray:
    time = np.arange(torque.size) / rate_hz
    return np.asarray(np.interp(time - lag_s, time, torque))
