"""Interpolation of short runs of missing samples."""

import numpy as np

_DEGREE = 5  # of the polynomial; in a hole of 20 ms it follows motion up to 10 Hz


def fill_holes(
    time: np.ndarray, values: np.ndarray, *, longest_s: float, allowed: np.ndarray
) -> np.ndarray:
    """Return values with runs of NaN filled by polynomials in time through their neighbours.

    A run of n samples is filled from the n + 2 samples on either side by least squares: its noise
    is about that of the others, where a spline through all of them overshoots. Runs of which a
    sample is not ``allowed`` (n,) stay, and so do steps of more than ``longest_s`` between samples,
    and runs that are too close to such a step or an end.
    """
    known = np.flatnonzero(np.isfinite(values))
    filled, missing = values.copy(), np.diff(known) - 1
    long = np.diff(time[known]) > longest_s
    stretch = np.cumsum(np.append(False, long))
    for n in np.unique(missing[~long & (missing > 0)]).tolist():
        last = np.flatnonzero(~long & (missing == n))  # sample before the hole
        last = last[(last > n) & (last + n + 2 < known.size)]
        last = last[stretch[last - n - 1] == stretch[last + n + 2]]
        last = last[allowed[known[last, None] + np.arange(1, n + 1)].all(axis=1)]
        inside = known[last, None] + np.arange(1, n + 1)
        around = known[last[:, None] + np.arange(-n - 1, n + 3)]
        near, hole = (
            ((time[at] - time[inside[:, :1]]) / longest_s)[..., None] ** np.arange(_DEGREE + 1)
            for at in (around, inside)
        )
        filled[inside] = (hole @ np.linalg.pinv(near) @ values[around][..., None])[..., 0]
    return filled
