"""Section of a simulated study's report: estimates beside the truth."""

from typing import Any

import numpy as np
import pandas as pd

from jointz.core.channels import PARAMETER_UNITS
from jointz.report.wording import (
    PARAMETERS,
    format_interval,
    format_number,
    format_signed,
    parameter_name,
    point_name,
)

_Row = dict[str, Any]


def truth_section(truth: pd.DataFrame) -> _Row:
    """Return errors and coverage by parameter, and every estimate beside its truth."""
    known = truth.dropna(subset=["truth", "estimate"])
    summary = []
    for name in PARAMETERS:
        rows = known[known["parameter"] == name]
        errors = rows["error_pct"].to_numpy(float)
        errors = errors[np.isfinite(errors)]  # a truth of zero has no error in %
        if errors.size:
            summary.append(
                {
                    "name": parameter_name(name),
                    "rms_pct": float(np.sqrt(np.mean(errors**2))),
                    "bias_pct": float(errors.mean()),
                    "covered": int(rows["covered"].astype(bool).sum()),
                    "n": len(rows),
                }
            )
    return {"summary": summary, "rows": [_row(row) for row in truth.to_dict("records")]}


def _row(row: dict[Any, Any]) -> _Row:
    numbers = (row[key] for key in ("estimate", "ci_low", "ci_high"))
    finite = (None if x is None or not np.isfinite(x) else float(x) for x in numbers)
    return {
        "participant": row["participant"],
        "name": point_name(str(row["timing_point"])),
        "parameter": parameter_name(row["parameter"]),
        "unit": PARAMETER_UNITS[row["parameter"]],
        "truth": format_number(row["truth"]),
        "estimate": format_interval(*finite),
        "error": f"{format_signed(row['error_pct'], decimals=1)} %",
        "covered": "yes" if row["covered"] is True or row["covered"] == 1 else "no",
    }
