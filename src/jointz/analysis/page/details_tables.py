"""The tables beside ``estimates.csv``: what stands behind each estimate, and behind each person."""

from typing import Any, Final

import numpy as np
import pandas as pd

from jointz.core.channels import PARAMETER_UNITS
from jointz.results.estimates import FIT_SOURCES, CellEstimate, ParameterEstimate
from jointz.results.participant_model import ParticipantModel
from jointz.results.study_analysis import StudyAnalysis

#: Where the uncertainty of an estimate comes from, in the order of tables and figures.
SOURCES: Final = (*FIT_SOURCES, "gain", "intrinsic")
#: Columns of ``details.csv``.
DETAIL_COLUMNS: Final = (
    "participant",
    "timing_point",
    "parameter",
    "value",
    "unit",
    "ci_low",
    "ci_high",
    "ci_level",
    "status",
    "unbounded",
    "share_at_bound",
    "onset_gait_pct",
    "centre_gait_pct",
    "displacement_rad",
    "stiffness_gravity_corrected",
    "gravity_corrected_ci_low",
    "gravity_corrected_ci_high",
    "method",
    "sd",
    *(f"sd_{source}" for source in SOURCES),
    "session",
    "side",
)
_PARAMETERS: Final = ("stiffness", "damping", "inertia")


def details_frame(analysis: StudyAnalysis) -> pd.DataFrame:
    """Return what stands behind each K, B and J, one row a cell and parameter.

    Parameters
    ----------
    analysis : StudyAnalysis
        The analysis.

    Returns
    -------
    pandas.DataFrame
        Columns :data:`DETAIL_COLUMNS`. ``sd_SOURCE`` are standard deviations, SI, and ``sd`` is
        that of all together; none where a method makes no budget. The columns of gravity belong
        to the stiffness.

    Examples
    --------
    >>> details_frame(StudyAnalysis(cells=())).empty
    True
    """
    rows = [
        _row(cell, estimate)
        for cell in analysis.cells
        for name in _PARAMETERS
        if (estimate := cell.parameter(name)) is not None
    ]
    return pd.DataFrame(rows, columns=list(DETAIL_COLUMNS))


def models_frame(analysis: StudyAnalysis) -> pd.DataFrame:
    """Return what was found about each person's joint and sensor, one row a person."""
    columns = list(ParticipantModel.__slots__)
    rows = [model.to_dict() | {"doubts": " ".join(model.doubts)} for model in analysis.models]
    return pd.DataFrame(rows, columns=columns)


def variance_shares(cell: CellEstimate, parameter: str) -> dict[str, float]:
    """Return the share of each source in the variance of an estimate, 0 to 1.

    Parameters
    ----------
    cell : CellEstimate
        The cell.
    parameter : str
        ``stiffness``, ``damping`` or ``inertia``.

    Returns
    -------
    dict of str to float
        Source -> share; empty where the method makes no budget.
    """
    variances = {name: sd**2 for name, sd in cell.budget.get(parameter, {}).items()}
    total = sum(variances.values())
    return {name: value / total for name, value in variances.items()} if total > 0.0 else {}


def _row(cell: CellEstimate, estimate: ParameterEstimate) -> dict[str, Any]:
    budget = cell.budget.get(estimate.name, {})
    corrected = cell.gravity_corrected if estimate.name == "stiffness" else None
    return {
        "participant": cell.participant,
        "timing_point": cell.timing_point,
        "parameter": estimate.name,
        "value": estimate.value,
        "unit": PARAMETER_UNITS[estimate.name],
        "ci_low": estimate.ci_low,
        "ci_high": estimate.ci_high,
        "ci_level": estimate.ci_level,
        "status": estimate.status,
        "unbounded": estimate.unbounded,
        "share_at_bound": estimate.share_at_bound,
        "onset_gait_pct": cell.onset_gait_pct,
        "centre_gait_pct": cell.centre_gait_pct,
        "displacement_rad": cell.displacement_rad,
        "stiffness_gravity_corrected": corrected.value if corrected else None,
        "gravity_corrected_ci_low": corrected.ci_low if corrected else None,
        "gravity_corrected_ci_high": corrected.ci_high if corrected else None,
        "method": cell.method,
        "sd": float(np.linalg.norm(list(budget.values()))) if budget else None,
        **{f"sd_{source}": budget.get(source) for source in SOURCES},
        "session": cell.session,
        "side": cell.side,
    }
