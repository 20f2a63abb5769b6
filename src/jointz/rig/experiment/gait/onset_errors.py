"""Accuracy of the onsets of pulses in the gait cycle."""

from math import sqrt

import numpy as np
import pandas as pd

from jointz.core.gait_phases import phase_difference
from jointz.gait.phase import measured_phase
from jointz.gait.strides import Strides


def onset_accuracy(
    pulses: pd.DataFrame,
    strides: Strides,
    *,
    timing_points: dict[str, float],
    strides_in_mean: int,
) -> pd.DataFrame:
    """Compare onsets with the recorded heel strikes around them.

    A pulse fires when the time since the last heel strike reaches a share p of the
    mean of the last n strides. Were strides independent with a coefficient of
    variation c, the share of the stride that it fires in would scatter with an SD
    of p c sqrt(1 + 1/n): nothing that predicts from the past alone does better.
    """
    measured_pct = measured_phase(pulses["onset_s"].to_numpy(), strides)
    walked = strides.duration_s[strides.accepted]
    variation = float(walked.std(ddof=1) / walked.mean()) if walked.size > 1 else float("nan")
    rows = []
    for name, planned in timing_points.items():
        due = phase_difference(measured_pct[pulses["timing_point"].to_numpy() == name], planned)
        error = due[~np.isnan(due)]
        rows.append(
            {
                "timing_point": name,
                "planned_pct": planned,
                "n": error.size,
                "n_missing": due.size - error.size,
                "error_mean_pct": float(error.mean()) if error.size else float("nan"),
                "error_sd_pct": float(error.std(ddof=1)) if error.size > 1 else float("nan"),
                "theory_sd_pct": planned * variation * sqrt(1.0 + 1.0 / strides_in_mean),
            }
        )
    return pd.DataFrame(rows)
