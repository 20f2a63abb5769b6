"""Weak form of a cell's equation: integrals with test functions in place of derivatives."""

import numpy as np

from jointz.identify.methods.cell_equations import fitted_by_equations, white_noise_sd
from jointz.identify.methods.cell_estimator import CellMethod
from jointz.identify.preparation.cell_data import (
    RAW_ANGLE,
    RAW_TORQUE,
    CellData,
    CellFit,
    FitSettings,
    check_samples,
)
from jointz.kernels.weak_form import FEWEST_SAMPLES, bumps, weak_equations, weak_fit

#: Least noise of the weights, as a share of the range: sums of samples differ from integrals if
#: torque has a corner.
_LEAST_NOISE = 3e-4


def weak_form(cell: CellData, settings: FitSettings) -> CellFit:
    """Fit K, B, J to the integrated equation of the unfiltered average.

    Generalised least squares with the covariance of the integrals of white noise of angle and
    torque (:mod:`jointz.kernels.weak_form`); the size of that noise is estimated from the average.
    Resamples are solved with the same weights.
    """
    windows = cell.unfiltered()
    last = windows.recorded.shape[2] - windows.lead
    check_samples(last, FEWEST_SAMPLES, method="weak_form")
    average = windows.responses().mean(axis=0)[:, :last]
    angle, torque = average[RAW_ANGLE], average[RAW_TORQUE]
    functions = bumps(last, step_s=1.0 / settings.rate_hz)
    sd = [white_noise_sd(values) for values in (angle, torque)]
    floor = [_LEAST_NOISE * np.abs(values).max() for values in (angle, torque)]
    weights = (max(sd[0], floor[0]), max(sd[1], floor[1]) or 1.0)
    whitener = weak_fit(angle, torque, functions, noise_sd=weights)

    def equations(averages: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        angles, torques = averages[:, RAW_ANGLE, :last], averages[:, RAW_TORQUE, :last]
        return weak_equations(angles, torques, functions, whitener, angle_sd=sd[0])

    return fitted_by_equations(cell, settings, equations, windows=windows)


WEAK_FORM = CellMethod("weak_form", "matched_strides", weak_form, raw=True)
