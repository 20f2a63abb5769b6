"""Tables beside ``estimates.csv``: details of each estimate, and the model of each person."""

from collections.abc import Sequence
from dataclasses import astuple, fields
from typing import Any, Final

import numpy as np
import pandas as pd

from jointz.report.wording import ABSOLUTE, AT_ONSET
from jointz.results.estimates import FIT_SOURCES, CellEstimate
from jointz.results.log_posterior import LogPosterior, UnlikelyParameter
from jointz.results.participant_model import ParticipantModel
from jointz.results.study_analysis import StudyAnalysis

#: Sources of the uncertainty of an estimate, in the order of tables and figures.
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


def details_frame(analysis: StudyAnalysis) -> pd.DataFrame:
    """Return the details of each K, B and J and of K and B at the onset, one row each.

    Parameters
    ----------
    analysis : StudyAnalysis
        The analysis.

    Returns
    -------
    pandas.DataFrame
        Columns :data:`DETAIL_COLUMNS`. ``sd_SOURCE`` are standard deviations, SI, and ``sd`` is
        that of all sources together; missing if the method has no error budget. The columns of
        gravity belong to the stiffness.

    Examples
    --------
    >>> details_frame(StudyAnalysis(cells=())).empty
    True
    """
    rows = [
        row | _details(cell, name)
        for cell in analysis.cells
        for name in (*ABSOLUTE, *AT_ONSET)
        for row in cell.rows()
        if row["parameter"] == name
    ]
    return pd.DataFrame(rows, columns=list(DETAIL_COLUMNS))


def models_frame(analysis: StudyAnalysis) -> pd.DataFrame:
    """Return the model of each person's joint and sensor, one row for each person.

    Of the method ``strapped``, doubts, and a row for each parameter from which they follow.
    """
    if not analysis.models:
        return _doubts_frame(analysis.log_posteriors)
    columns = list(ParticipantModel.__slots__)
    rows = [model.to_dict() | {"doubts": " ".join(model.doubts)} for model in analysis.models]
    return pd.DataFrame(rows, columns=columns)


def _doubts_frame(posteriors: Sequence[LogPosterior]) -> pd.DataFrame:
    parameters = [field.name for field in fields(UnlikelyParameter)]
    columns = ["participant", "session", "side", "doubts", *parameters]
    rows = [
        (p.participant, p.session, p.side, " ".join(p.doubts), *values)
        for p in posteriors
        for values in [astuple(u) for u in p.unlikely] or [(None,) * len(parameters)]
        if p.doubts
    ]
    return pd.DataFrame(rows, columns=columns).rename(columns={"name": "parameter"})


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
        Source -> share; empty if the method has no error budget.
    """
    variances = {name: sd**2 for name, sd in cell.budget.get(parameter, {}).items()}
    total = sum(variances.values())
    return {name: value / total for name, value in variances.items()} if total > 0.0 else {}


def _details(cell: CellEstimate, parameter: str) -> dict[str, Any]:
    estimate, budget = cell.parameter(parameter), cell.budget.get(parameter, {})
    corrected = cell.gravity_corrected if parameter == "stiffness" else None
    return {
        "unbounded": estimate and estimate.unbounded,
        "share_at_bound": estimate and estimate.share_at_bound,
        "centre_gait_pct": cell.centre_gait_pct,
        "displacement_rad": cell.displacement_rad,
        "stiffness_gravity_corrected": corrected and corrected.value,
        "gravity_corrected_ci_low": corrected and corrected.ci_low,
        "gravity_corrected_ci_high": corrected and corrected.ci_high,
        "sd": float(np.linalg.norm(list(budget.values()))) if budget else None,
        **{f"sd_{source}": budget.get(source) for source in SOURCES},
    }
