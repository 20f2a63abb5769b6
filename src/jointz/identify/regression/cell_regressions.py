"""Regressions of the average torque on the average motion of a cell.

``resampled``
    The dissertation (4.2.3) and its kin with another baseline: K, B, J >= 0, pulses resampled.
``pilot``
    The pilot (3.2.4): one bounded fit to the average, no bootstrap.
``unbounded``
    Ordinary least squares.
"""

from dataclasses import replace

import numpy as np

from jointz.identify.preparation.calibration import twist_sd
from jointz.identify.preparation.cell_data import (
    CellData,
    CellFit,
    FitSettings,
    lag_sd,
    without_rounding,
)
from jointz.identify.preparation.conditioning import TORQUE
from jointz.identify.regression.cell_equations import (
    cell_fit,
    fitted_by_equations,
    solve_average,
    solve_resamples,
    torque_on_motion,
)
from jointz.identify.regression.cell_estimator import CellMethod
from jointz.identify.regression.cell_parameters import (
    BootstrapSpread,
    JackknifeSpread,
    Point,
    Replicates,
)
from jointz.identify.regression.cell_resampling import redrawn_averages, shifted, shown_by
from jointz.kernels.bounded_lsq import bootstrap_fits
from jointz.kernels.resampling import resample_weights


def resampled(cell: CellData, settings: FitSettings) -> CellFit:
    """Fit K, B, J >= 0 to resampled averages, as 4.2.3 does.

    VAF near 100 % says that the average response looks second-order. It does
    not say that K, B, J are right: a lag, a wrong baseline or a wrong torque
    gain do not lower it (SCIENCE trap 1).
    """
    windows, known = cell.filtered, settings.calibration
    responses = windows.responses()
    average = responses.mean(axis=0)
    point, condition = _plug_in(average, bounded=settings.bounded)
    rng = np.random.default_rng(settings.seed)
    weights = resample_weights(len(responses), settings.n_resamples, rng)
    with_strides = windows.baseline.has_strides and not settings.as_published
    if with_strides or lag_sd(known) or twist_sd(known):
        averages = redrawn_averages(windows, settings, rng, weights)
        replicates = solve_resamples(*torque_on_motion(averages), settings)
    else:
        fits = bootstrap_fits(weights, responses)
        replicates = Replicates(fits.bounded, fits.unbounded, fits.active).decided()
        replicates = replicates if settings.bounded else replicates.unconstrained()
    if settings.as_published:
        mean = replicates.bounded.mean(axis=0)
        point = Point(without_rounding(mean, average), point.unbounded, point.held)
    spread = BootstrapSpread(replicates, settings, with_strides=with_strides, rng=rng)
    return cell_fit(average, point, spread, settings, condition=condition)


def pilot(cell: CellData, settings: FitSettings) -> CellFit:
    """Fit K, B, J >= 0 to the average response, as the pilot did (3.2.4).

    The pilot printed no interval; this one is a delete-one jackknife over the pulses. The
    baseline is held fixed: its own error is not in the interval.
    """
    responses = cell.filtered.responses()
    average = responses.mean(axis=0)
    point, condition = _plug_in(average, bounded=settings.bounded)
    n = len(responses)
    left_out = solve_resamples(*torque_on_motion((n * average - responses) / (n - 1)), settings)
    spread = JackknifeSpread(left_out, _instrument_errors(average, point, settings), settings)
    return cell_fit(average, point, spread, settings, condition=condition)


def unbounded(cell: CellData, settings: FitSettings) -> CellFit:
    """Regress torque on angle, velocity and acceleration, without bounds.

    Errors of the angle, and torque that arises inside the joint, bias it (SCIENCE trap 4);
    averaging n pulses divides that bias by n.

    Parameters
    ----------
    cell : CellData
        Windows of a timing point, case or group, and their baseline.
    settings : FitSettings
        Bootstrap resamples, seed and bounds.
    """
    rng = np.random.default_rng(settings.seed)
    return fitted_by_equations(cell, replace(settings, bounded=False), torque_on_motion, rng=rng)


def _plug_in(average: np.ndarray, *, bounded: bool) -> tuple[Point, float]:
    return solve_average(*torque_on_motion(average[None]), average, bounded=bounded)


def _instrument_errors(average: np.ndarray, point: Point, settings: FitSettings) -> np.ndarray:
    """Return how far one sd of the lag and one of torque seen as angle move K, B and J, (3,)."""
    known, rate_hz = settings.calibration, settings.rate_hz
    late = average.copy()
    late[TORQUE] = shifted(average[TORQUE], np.array([lag_sd(known)]), rate_hz=rate_hz)
    twisted = average.copy()
    if sd := twist_sd(known):
        twisted[:TORQUE] -= sd * shown_by(average[TORQUE], rate_hz=rate_hz)
    moved = [_plug_in(a, bounded=False)[0].value - point.unbounded for a in (late, twisted)]
    return np.asarray(np.hypot(*moved) if sd else moved[0])


DISSERTATION = CellMethod("dissertation", "unperturbed_mean", resampled)
PRE_PULSE = CellMethod("pre_pulse", "pre_pulse", resampled)
MATCHED_STRIDES = CellMethod("matched_strides", "matched_strides", resampled)
PILOT = CellMethod("pilot", "unperturbed_mean", pilot)
LEAST_SQUARES = CellMethod("least_squares", "matched_strides", unbounded)
