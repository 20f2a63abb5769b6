"""Regressions of the average torque on the average motion of a cell.

``resampled``
    The dissertation (4.2.3) and its kin with another baseline: K, B, J >= 0, pulses resampled.
``pilot``
    The pilot (3.2.4): one bounded fit to the average, no bootstrap.
``unbounded``
    Ordinary least squares.
"""

import numpy as np

from jointz.identify.methods.cell_parameters import (
    BootstrapSpread,
    JackknifeSpread,
    Point,
    Replicates,
    Spread,
    parameter_estimates,
)
from jointz.identify.methods.cell_resampling import (
    linear_averages,
    redrawn_averages,
    shifted,
    shown_by,
)
from jointz.identify.preparation.calibration import twist_sd
from jointz.identify.preparation.cell_data import (
    CellData,
    CellFit,
    FitSettings,
    check_average,
    lag_sd,
    response_of,
    vaf_pct,
    without_dust,
)
from jointz.identify.preparation.conditioning import ANGLE, TORQUE
from jointz.kernels.bounded_lsq import (
    bootstrap_fits,
    condition_numbers,
    least_squares,
    nonnegative_least_squares,
    normal_equations,
)
from jointz.kernels.resampling import resample_weights


def resampled(cell: CellData, settings: FitSettings) -> CellFit:
    """Fit K, B, J >= 0 to resampled averages, as 4.2.3 does.

    VAF near 100 % says that the average response looks second-order. It does
    not say that K, B, J are right: a lag, a wrong baseline or a wrong torque
    gain leave it untouched (SCIENCE trap 1).
    """
    windows = cell.filtered
    responses = windows.responses()
    average = responses.mean(axis=0)
    point, condition = _plug_in(average, bounded=settings.bounded)
    rng = np.random.default_rng(settings.seed)
    weights = resample_weights(len(responses), settings.n_resamples, rng)
    only_pulses = settings.letter or windows.baseline.own
    known = settings.calibration
    if only_pulses and not (lag_sd(known) or twist_sd(known)):
        fits = bootstrap_fits(weights, responses)
        replicates = Replicates(fits.bounded, fits.unbounded, fits.active)
    else:
        replicates = fitted_averages(redrawn_averages(windows, settings, rng, weights))
    replicates = replicates.decided()
    if not settings.bounded:
        replicates = replicates.freed()
    if settings.letter:
        mean = replicates.bounded.mean(axis=0)
        point = Point(without_dust(mean, average), point.unbounded, point.held)
    what = "pulses" if only_pulses else "pulses and unperturbed strides"
    spread = BootstrapSpread(replicates, settings, what=what, rng=rng)
    return _finished(average, point, spread, settings, condition=condition)


def pilot(cell: CellData, settings: FitSettings) -> CellFit:
    """Fit K, B, J >= 0 to the average response, as the pilot did (3.2.4).

    The pilot printed no interval; this one is a delete-one jackknife over the pulses. The
    baseline is held fixed: its own error is not in the interval.
    """
    responses = cell.filtered.responses()
    average = responses.mean(axis=0)
    point, condition = _plug_in(average, bounded=settings.bounded)
    n = len(responses)
    left_out = fitted_averages((n * average - responses) / (n - 1)).decided()
    if not settings.bounded:
        left_out = left_out.freed()
    moved = _moved_by_instruments(average, point, settings)
    spread = JackknifeSpread(left_out, moved, settings)
    return _finished(average, point, spread, settings, condition=condition)


def _moved_by_instruments(average: np.ndarray, point: Point, settings: FitSettings) -> np.ndarray:
    """Return how far one sd of the lag and one of torque seen as angle move K, B and J, (3,)."""
    known, rate_hz = settings.calibration, settings.rate_hz
    late = average.copy()
    late[TORQUE] = shifted(average[TORQUE], np.array([lag_sd(known)]), rate_hz=rate_hz)
    moved = _plug_in(late, bounded=False)[0].value - point.unbounded
    sd = twist_sd(known)
    if not sd:
        return np.asarray(moved)
    twisted = average.copy()
    twisted[:TORQUE] -= sd * shown_by(average[TORQUE], rate_hz=rate_hz)
    turned = _plug_in(twisted, bounded=False)[0].value - point.unbounded
    return np.asarray(np.hypot(moved, turned))


def unbounded(cell: CellData, settings: FitSettings) -> CellFit:
    """Regress torque on angle, velocity and acceleration, without bounds.

    Errors of the angle, and torque that arises inside the joint, bias it (SCIENCE trap 4);
    averaging n pulses divides that bias by n.
    """
    average = cell.filtered.responses().mean(axis=0)
    point, condition = _plug_in(average, bounded=False)
    replicates = fitted_averages(linear_averages(cell.filtered, settings)).decided().freed()
    rng = np.random.default_rng(settings.seed)
    spread = BootstrapSpread(replicates, settings, what=resampled_things(cell), rng=rng)
    return _finished(average, point, spread, settings, condition=condition)


def resampled_things(cell: CellData) -> str:
    """Say what resampling draws: strides too, where they make the baseline."""
    return "pulses" if cell.filtered.baseline.own else "pulses and unperturbed strides"


def fitted_averages(averages: np.ndarray) -> Replicates:
    """Return the bounded and unbounded fits to averages."""
    gram, moment, _ = normal_equations(averages)
    bounded, active = nonnegative_least_squares(gram, moment)
    return Replicates(bounded, least_squares(gram, moment), active)


def _plug_in(average: np.ndarray, *, bounded: bool) -> tuple[Point, float]:
    gram, moment, _ = normal_equations(average[None])
    condition = float(condition_numbers(gram)[0])
    check_average(average, condition)
    free = least_squares(gram, moment)[0]
    if not bounded:
        return Point(without_dust(free, average), free, 0), condition
    found, active = nonnegative_least_squares(gram, moment)
    return Point(without_dust(found[0], average), free, int(active[0])), condition


def _finished(
    average: np.ndarray,
    point: Point,
    spread: Spread,
    settings: FitSettings,
    *,
    condition: float,
) -> CellFit:
    fitted = point.value @ average[:TORQUE]
    return CellFit(
        parameters=parameter_estimates(point, spread, settings),
        vaf_pct=vaf_pct(average, fitted),
        condition_number=condition,
        displacement_rad=float(np.abs(average[ANGLE]).max()),
        response=response_of(average, fitted, rate_hz=settings.rate_hz),
    )
