"""Tables beside ``estimates.csv``: details of each estimate, and doubts about each person."""

from dataclasses import astuple, fields
from typing import Any, Final

import pandas as pd

from jointz.analysis.page.withheld_values import remedies
from jointz.report.wording import ABSOLUTE, AT_ONSET
from jointz.results.estimates import CellEstimate
from jointz.results.study_analysis import StudyAnalysis
from jointz.results.unlikely_parameter import UnlikelyParameter

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
    "session",
    "side",
)


def details_frame(analysis: StudyAnalysis) -> pd.DataFrame:
    """Return the details of each K, B and J and of K and B at the onset, one row each."""
    rows = [
        row | _details(cell, name)
        for cell in analysis.cells
        for name in (*ABSOLUTE, *AT_ONSET)
        for row in cell.rows()
        if row["parameter"] == name
    ]
    return pd.DataFrame(rows, columns=list(DETAIL_COLUMNS))


def models_frame(analysis: StudyAnalysis) -> pd.DataFrame:
    """Return doubts about the model of each person, a row for each parameter that causes them."""
    parameters = [*(field.name for field in fields(UnlikelyParameter)), "remedy"]
    columns = ["participant", "session", "side", "doubts", *parameters]
    rows = [
        (p.participant, p.session, p.side, " ".join(p.doubts), *values)
        for p in analysis.log_posteriors
        for values in [(*astuple(u), u.remedy) for u in p.unlikely]
        or [(*[None] * (len(parameters) - 1), remedies(p))]
        if p.doubts
    ]
    return pd.DataFrame(rows, columns=columns).rename(columns={"name": "parameter"})


def _details(cell: CellEstimate, parameter: str) -> dict[str, Any]:
    estimate = cell.parameter(parameter)
    corrected = cell.gravity_corrected if parameter == "stiffness" else None
    return {
        "unbounded": estimate and estimate.unbounded,
        "share_at_bound": estimate and estimate.share_at_bound,
        "centre_gait_pct": cell.centre_gait_pct,
        "displacement_rad": cell.displacement_rad,
        "stiffness_gravity_corrected": corrected and corrected.value,
        "gravity_corrected_ci_low": corrected and corrected.ci_low,
        "gravity_corrected_ci_high": corrected and corrected.ci_high,
    }
