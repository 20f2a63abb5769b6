"""Columns of a frequency response, for the results of joints and actuators."""

import numpy as np

from jointz.identify.record.block_regression import t_factor
from jointz.results.series.frequency_response_curve import ResponseCurve

#: Where nothing is coherent the band is cut off here, so that files hold no infinities.
_WIDEST_BAND = 1e3


def response_curve(
    frequency_hz: np.ndarray,
    response: np.ndarray,
    *,
    relative_sd: np.ndarray,
    coherence: np.ndarray,
    n_averages: float,
    ci_level: float,
    fitted: np.ndarray | None = None,
) -> ResponseCurve:
    """Return gain, phase and a pointwise band of a response, and of a fitted model."""
    gain = np.abs(response)
    wide = t_factor(ci_level, max(2.0 * n_averages - 2.0, 1.0))
    reach = np.minimum(np.exp(np.minimum(wide * relative_sd, np.log(_WIDEST_BAND))), _WIDEST_BAND)
    columns = {
        "frequency_hz": frequency_hz,
        "gain": gain,
        "phase_rad": np.unwrap(np.angle(response)),
        "gain_low": gain / reach,
        "gain_high": gain * reach,
        "phase_sd_rad": np.minimum(relative_sd, np.pi),
        "coherence": coherence,
    }
    if fitted is not None:
        columns |= {
            "fitted_gain": np.abs(fitted),
            "fitted_phase_rad": np.unwrap(np.angle(fitted)),
        }
    return ResponseCurve(**{name: tuple(v.tolist()) for name, v in columns.items()})
