"""Impedance of one cell: responses in, K, B and J with intervals out, by a family of methods.

Every method takes the responses of a timing point and gives the same result: K, B, J with and
without bounds, intervals, the fitted torque and its VAF. ``docs/methods.md`` says of each what
it assumes and when it misleads.
"""

from dataclasses import dataclass

import numpy as np

from jointz.identify.methods import cell_regressions
from jointz.identify.methods.cell_instruments import instrumental_variable
from jointz.identify.methods.cell_parameters import failed_parameters
from jointz.identify.methods.cell_simulation import errors_in_variables, output_error
from jointz.identify.methods.cell_weak_form import weak_form
from jointz.identify.preparation.baselines import Baseline
from jointz.identify.preparation.cell_data import (
    PARAMETERS,
    CellData,
    CellFit,
    Fit,
    FitSettings,
    Windows,
    dead_signals,
)

__all__ = [
    "BENCH_ONLY",
    "METHODS",
    "PARAMETERS",
    "CellFit",
    "FitSettings",
    "Method",
    "dead_signals",
    "failed_parameters",
    "fit_cell",
]


@dataclass(frozen=True, slots=True)
class Method:
    """How a cell is estimated."""

    name: str  # as given to ``--method``
    baseline: str  # its own baseline; the study may ask for another
    fit: Fit = cell_regressions.resampled  # from the windows of a cell to its estimate
    raw: bool = False  # whether it takes unfiltered windows or the commanded torque too

    def baseline_for(self, *, walking: bool) -> str:
        """Return its own baseline where there are strides to match, and where there are none."""
        strides_only = self.baseline == "matched_strides" and self.name != "matched_strides"
        return "unperturbed_mean" if strides_only and not walking else self.baseline


_ALL = (
    # All timing points at once, in identify/recommended/walking_estimator.py.
    Method("recommended", "predicted"),
    Method("dissertation", "unperturbed_mean"),
    Method("pre_pulse", "pre_pulse"),
    Method("matched_strides", "matched_strides"),
    Method("pilot", "unperturbed_mean", cell_regressions.pilot),
    Method("least_squares", "matched_strides", cell_regressions.unbounded),
    Method("instrumental_variable", "matched_strides", instrumental_variable, raw=True),
    Method("output_error", "matched_strides", output_error, raw=True),
    Method("errors_in_variables", "matched_strides", errors_in_variables, raw=True),
    Method("weak_form", "matched_strides", weak_form, raw=True),
    # From whole recordings; a case that is not one load is fitted as the dissertation does.
    Method("full_record", "none"),
)
#: The methods of this version by name; the first is the default.
METHODS = {method.name: method for method in _ALL}
#: Those that only a bench can be estimated by.
BENCH_ONLY = ("full_record",)


def fit_cell(
    windows: np.ndarray, signs: np.ndarray, baseline: Baseline, *, settings: FitSettings
) -> CellFit:
    """Estimate the impedance of one cell from filtered windows, as the dissertation does."""
    return cell_regressions.resampled(CellData(Windows(windows, signs, baseline)), settings)
