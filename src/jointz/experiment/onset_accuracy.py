"""Where in the gait cycle the pulses fired, against where they should have."""

from math import sqrt

import pandas as pd

from jointz.gait.phase import stride_containing
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

    Parameters
    ----------
    pulses : pandas.DataFrame
        ``onset_s, timing_point``.
    strides : Strides
        Of the same recording.
    timing_points : dict of str to float
        Timing point -> % of the gait cycle.
    strides_in_mean : int
        n.

    Returns
    -------
    pandas.DataFrame
        One row a timing point: ``timing_point, planned_pct, n, error_mean_pct,
        error_sd_pct, theory_sd_pct`` (SD realised in this recording).
    """
    onset_s, names = pulses["onset_s"].to_numpy(), pulses["timing_point"].to_numpy()
    index = stride_containing(onset_s, strides)
    inside = index >= 0
    inside[inside] = strides.accepted[index[inside]]
    index, names = index[inside], names[inside]
    share_pct = 100.0 * (onset_s[inside] - strides.start_s[index]) / strides.duration_s[index]
    walked = strides.duration_s[strides.accepted]
    variation = float(walked.std(ddof=1) / walked.mean()) if walked.size > 1 else float("nan")
    rows = []
    for name, planned in timing_points.items():
        at = names == name
        # A pulse late in the cycle may fire after the next strike: -2 %, not 98 %.
        error = (share_pct[at] - planned + 50.0) % 100.0 - 50.0
        rows.append(
            {
                "timing_point": name,
                "planned_pct": planned,
                "n": int(at.sum()),
                "error_mean_pct": float(error.mean()) if error.size else float("nan"),
                "error_sd_pct": float(error.std(ddof=1)) if error.size > 1 else float("nan"),
                "theory_sd_pct": planned * variation * sqrt(1.0 + 1.0 / strides_in_mean),
            }
        )
    return pd.DataFrame(rows)
