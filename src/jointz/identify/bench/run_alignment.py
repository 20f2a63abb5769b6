"""Time shift between two runs along the same reference."""

import numpy as np

from jointz.core.errors import DataError

#: How far apart the beginnings are looked for, at least this share of the shorter run in common.
_SEARCH_S = 5.0
_LEAST_COMMON = 0.5
_COARSE_HZ = 100.0
#: Shifts whose error is within this share of the reference's variance of the best are as good:
#: a periodic reference has many, the smallest is taken.
_AS_GOOD = 1e-3
#: Larger disagreement, as a share of the reference's variance, is another reference.
_MOST_DIFFERENT = 0.05
_PASSES = 10
_CONVERGED_S = 1e-9


def reference_shift(
    reference: np.ndarray, other: np.ndarray, *, rate_hz: float, keep: np.ndarray, where: str
) -> float:
    """Return the delay of the other run along the reference, s."""
    variance = float(np.var(reference[keep])) if keep.any() else 0.0
    if variance <= 1e-18 * float(np.max(np.abs(reference), initial=0.0)) ** 2:
        raise DataError(
            f"{where}: expected a reference that moves, got {reference[0]:.6g} throughout. Name "
            "the channel that both runs follow with align=."
        )
    shift = _coarse(reference, other, rate_hz, keep) / rate_hz
    shift = _refined(reference, other, shift, rate_hz=rate_hz, keep=keep)
    difference, _ = _difference(reference, other, shift, rate_hz=rate_hz, keep=keep)
    share = float(np.mean(difference**2)) / variance if difference.size else np.inf
    if share > _MOST_DIFFERENT:
        raise DataError(
            f"{where}: expected two runs along one reference, got references that differ by "
            f"{100.0 * share:.3g} % of their variance at best. Pair each perturbed run with the "
            "unperturbed run of the same reference."
        )
    return shift


def _coarse(reference: np.ndarray, other: np.ndarray, rate_hz: float, keep: np.ndarray) -> int:
    """Return the best shift in samples, to one in a hundredth of a second."""
    every = max(1, round(rate_hz / _COARSE_HZ))
    first, second, kept = reference[::every], other[::every], keep[::every]
    most = round(_SEARCH_S * rate_hz / every)
    fewest = int(_LEAST_COMMON * min(first.size, second.size))
    errors: dict[int, float] = {}
    for lag in range(-most, most + 1):
        begin, end = max(0, -lag), min(first.size, second.size - lag)
        if end - begin < max(fewest, 1):
            continue
        inside = kept[begin:end]
        difference = (first[begin:end] - second[begin + lag : end + lag])[inside]
        if difference.size:
            errors[lag] = float(np.mean(difference**2))
    if not errors:
        return 0
    as_good = min(errors.values()) + _AS_GOOD * float(np.var(first))
    return every * min((lag for lag, e in errors.items() if e <= as_good), key=abs)


def _refined(
    reference: np.ndarray, other: np.ndarray, shift: float, *, rate_hz: float, keep: np.ndarray
) -> float:
    """Improve a shift by Gauss-Newton steps."""
    for _ in range(_PASSES):
        difference, slope = _difference(reference, other, shift, rate_hz=rate_hz, keep=keep)
        power = float(slope @ slope)
        if power == 0.0:
            break
        step = float(difference @ slope) / power
        shift += step
        if abs(step) < _CONVERGED_S:
            break
    return shift


def _difference(
    reference: np.ndarray, other: np.ndarray, shift: float, *, rate_hz: float, keep: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the first reference less the shifted other one, and the slope of the latter."""
    at = np.arange(reference.size) + shift * rate_hz
    used = keep & (at >= 0.0) & (at <= other.size - 1)
    grid = np.arange(other.size)
    shifted = np.interp(at[used], grid, other)
    slope = np.interp(at[used], grid, np.gradient(other) * rate_hz)
    return reference[used] - shifted, slope
