"""Low-pass filtering without phase."""

import numpy as np
from scipy.signal import butter, sosfiltfilt

#: Order of the filter that runs forward and backward.
_ORDER = 4
#: Reflected samples that extend a record at either end, as in scipy (MATLAB: 3 order).
_PADDING = 3 * (_ORDER + 1)
#: How many samples :func:`lowpass_zero_phase` needs at least.
SHORTEST_RECORD = _PADDING + 1


def lowpass_zero_phase(x: np.ndarray, *, cutoff_hz: float, rate_hz: float) -> np.ndarray:
    """Return the record low-passed by a Butterworth of order 4 run forward and backward.

    ``x`` (..., n): time along the last axis; a NaN spreads over its whole row. The gain at the
    cutoff is 1/2 (-6 dB): the square of the single run's. Some periods of the cutoff next to the
    ends are not to be trusted: filter before cutting windows, or damping is biased. Steady initial
    states (scipy's ``sosfiltfilt``); method: Gustafsson 1996, doi:10.1109/78.492552.
    """
    values = np.asarray(x, dtype=np.float64)
    if not 0.0 < cutoff_hz < rate_hz / 2.0:
        raise ValueError(
            f"lowpass_zero_phase: expected 0 < cutoff_hz < rate_hz / 2 = {rate_hz / 2.0:g} Hz, "
            f"got {cutoff_hz:g} Hz. Lower the cutoff or record faster."
        )
    n = values.shape[-1] if values.ndim else 0
    if n < SHORTEST_RECORD:
        raise ValueError(
            f"lowpass_zero_phase: expected at least {SHORTEST_RECORD} samples along the last axis "
            f"for order {_ORDER}, got {n}. Give a longer record."
        )
    sections = butter(_ORDER, cutoff_hz, fs=rate_hz, output="sos")
    return np.asarray(sosfiltfilt(sections, values, axis=-1, padlen=_PADDING))
