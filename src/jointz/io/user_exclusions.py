"""The user's own ``exclusions.csv`` of a study."""

from pathlib import Path

import numpy as np
import pandas as pd

from jointz.core.study import UserExclusion, name_problem

_COLUMNS = ("participant", "recording", "onset_s", "action")


def read_user_exclusions(root: Path) -> tuple[tuple[UserExclusion, ...], list[str]]:
    """Return the lines of a study's ``exclusions.csv``, none without the file, and its problems."""
    file = root / "exclusions.csv"
    if not file.is_file():
        return (), []
    try:
        table = pd.read_csv(file, encoding="utf-8-sig", dtype=str, keep_default_na=False)
    except (OSError, ValueError) as exc:
        return (), [f"exclusions.csv: not a readable table: {exc}."]
    missing = [c for c in _COLUMNS if c not in table.columns]
    if missing:
        return (), [f"exclusions.csv: missing column(s) {', '.join(missing)}."]
    if not isinstance(table.index, pd.RangeIndex):  # what pandas makes of rows too long
        return (), ["exclusions.csv, row 2: more values than the header has columns."]
    table = table.fillna("").assign(onset=pd.to_numeric(table["onset_s"], errors="coerce"))
    problems = [
        f"exclusions.csv, row {row}, column 'onset_s': expected a number, found '{text}'."
        for row, (text, onset) in enumerate(zip(table["onset_s"], table["onset"], strict=True), 2)
        if not np.isfinite(onset)
    ]
    bad = sorted(set(table["action"]) - {"exclude", "restore"})
    problems += [f"exclusions.csv: action '{a}'; expected exclude or restore." for a in bad]
    reasons = table["reason"].tolist() if "reason" in table.columns else []
    problems += [
        f"exclusions.csv, row {row}, column 'reason': {wrong}."
        for row, text in enumerate(reasons, 2)
        if (wrong := name_problem(" ".join(text.split())))  # a reason may have several lines
    ]
    rows = tuple(
        UserExclusion(
            participant=str(row["participant"]),
            recording=str(row["recording"]),
            onset_s=float(row["onset"]),
            action=str(row["action"]),
            reason=str(row.get("reason", "")),
        )
        for row in table.to_dict("records")
    )
    return rows, problems
