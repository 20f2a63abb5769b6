"""Simulation of a cell's angle from its measured torque, with errors in one or both records."""

import numpy as np

from jointz.identify.methods.cell_equations import fitted_by_equations, undecided, white_noise_sd
from jointz.identify.methods.cell_estimator import CellMethod
from jointz.identify.preparation.cell_data import (
    RAW_ANGLE,
    RAW_TORQUE,
    CellData,
    CellFit,
    FitSettings,
    check_average,
    check_samples,
    lag_sd,
)
from jointz.identify.preparation.conditioning import TORQUE
from jointz.kernels.bounded_lsq import (
    condition_numbers,
    nonnegative_least_squares,
    normal_equations,
)
from jointz.kernels.series.second_order_averages import Drive, DrivenFit, fit_driven, refit
from jointz.results.estimates import ParameterEstimate

#: Initial values of a free lag, s.
_START_LAGS_S = (0.0, -0.008, 0.008)
#: Least initial inertia, as a share of torque over acceleration.
_FLOOR = 1e-2
#: Fewest samples for a torque that is linear between samples.
_FEWEST_SAMPLES = 10


def output_error(cell: CellData, settings: FitSettings) -> CellFit:
    """Fit the angle that the average torque drives from rest, with white weights.

    All error is that of the angle; the torque is taken as measured, without lag. The inertia
    stays positive, which the simulation needs.
    """
    return _fitted(cell, settings, lag_sd_s=0.0, torque_noise=False)


def errors_in_variables(cell: CellData, settings: FitSettings) -> CellFit:
    """Fit the average response with noise in angle and torque, and a lag between them.

    The criterion is that of :mod:`jointz.kernels.series.second_order`. The lag is free within 20 ms
    or the margin of the windows; a lag under ``[calibration]`` is removed before, and its sd is the
    prior of the remaining lag. A lag at the end of its range is ``undecided``.
    """
    known = settings.calibration.angle_lag_s or settings.calibration.torque_lag_s
    sd = lag_sd(settings.calibration) if known else None
    return _fitted(cell, settings, lag_sd_s=sd, torque_noise=True)


def _fitted(
    cell: CellData, settings: FitSettings, *, lag_sd_s: float | None, torque_noise: bool
) -> CellFit:
    filtered = cell.filtered.responses().mean(axis=0)
    gram, moment, _ = normal_equations(filtered[None])
    check_average(filtered, float(condition_numbers(gram)[0]))
    windows = cell.unfiltered()
    average = windows.responses().mean(axis=0)
    lead, n = windows.lead, filtered.shape[1]
    check_samples(
        n, _FEWEST_SAMPLES, method="errors_in_variables" if torque_noise else "output_error"
    )
    angle, torque = average[RAW_ANGLE, lead : lead + n], average[RAW_TORQUE]
    noise = white_noise_sd(angle), white_noise_sd(torque) if torque_noise else 0.0
    drive = Drive(lead, 1.0 / settings.rate_hz, noise, lag_sd_s)
    start = nonnegative_least_squares(gram, moment)[0][0]
    floor = _FLOOR * np.abs(filtered[TORQUE]).max() / np.abs(filtered[2]).max()
    start[2] = max(start[2], floor)
    fit = _best(angle, torque, start, drive, bounded=settings.bounded)
    nuisance = _lag(fit, drive)
    if not fit.converged or (nuisance and nuisance[0].status == "undecided"):
        return undecided(cell, settings, nuisance)

    def equations(averages: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        angles = averages[:, RAW_ANGLE, lead : lead + n]
        return refit(fit, angles, averages[:, RAW_TORQUE], drive)

    return fitted_by_equations(
        cell,
        settings,
        equations,
        windows=windows,
        lag_s=float(fit.values[3]),
        nuisance=nuisance,
    )


def _best(
    angle: np.ndarray, torque: np.ndarray, kbj: np.ndarray, drive: Drive, *, bounded: bool
) -> DrivenFit:
    """Return the fit of least cost among those from several lags."""
    lags = _START_LAGS_S if drive.lag_sd_s is None else (0.0,)
    fits = [
        fit_driven(angle, torque, np.array([*kbj, lag]), drive, bounded=bounded) for lag in lags
    ]
    return min(fits, key=lambda fit: fit.cost if fit.converged else np.inf)


def _lag(fit: DrivenFit, drive: Drive) -> tuple[ParameterEstimate, ...]:
    """Return the lag of the torque behind the angle, if it was estimated."""
    if drive.lag_sd_s == 0.0:
        return ()
    lag = float(fit.values[3])
    inside = fit.converged and abs(lag) < drive.lead * drive.step_s
    value = lag if inside else None
    return (ParameterEstimate("torque_lag", value, None, None, "ok" if inside else "undecided"),)


OUTPUT_ERROR = CellMethod("output_error", "matched_strides", output_error, raw=True)
ERRORS_IN_VARIABLES = CellMethod(
    "errors_in_variables", "matched_strides", errors_in_variables, raw=True
)
