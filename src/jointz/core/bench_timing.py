"""When the pulses of a bench fire: at points of a reference's cycle, or after rests."""

from collections.abc import Sequence
from math import ceil

_ROUNDING = 1e-9


def onsets_in_cycle(
    points_pct: Sequence[float], *, cycle_s: float, apart_s: float
) -> tuple[float, ...]:
    """Place pulses at points of a cycle that repeats, each as early as it can be.

    Parameters
    ----------
    points_pct : sequence of float, % of the cycle
        In the order in which they are to fire.
    cycle_s : float, s
        Of the reference.
    apart_s : float, s
        From onset to onset, at least; from the beginning to the first, too.

    Returns
    -------
    tuple of float, s
        Onsets since the reference began.

    Examples
    --------
    At 2 Hz pulses at 10 and 40 % would overlap; 0.9 s apart they do not:

    >>> onsets_in_cycle([10.0, 40.0], cycle_s=0.5, apart_s=0.9)
    (1.05, 2.2)
    """
    onsets, earliest = [], apart_s
    for pct in points_pct:
        first = pct / 100.0 * cycle_s
        cycles = max(0, ceil((earliest - first) / cycle_s - _ROUNDING))
        onsets.append(first + cycles * cycle_s)
        earliest = onsets[-1] + apart_s
    return tuple(onsets)


def onsets_after_rests(count: int, *, pause_s: float, duration_s: float) -> tuple[float, ...]:
    """Place pulses one after the other, each after a rest.

    Parameters
    ----------
    count : int
        How many.
    pause_s, duration_s : float, s
        Rest before each pulse, and its length.

    Examples
    --------
    >>> onsets_after_rests(3, pause_s=2.75, duration_s=0.25)
    (2.75, 5.75, 8.75)
    """
    return tuple(pause_s + k * (pause_s + duration_s) for k in range(count))
