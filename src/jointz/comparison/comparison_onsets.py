"""Timing points of one name, and whether they lie at one place of the gait cycle."""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

from jointz.comparison.comparison_sources import Results
from jointz.core.errors import DataError
from jointz.core.gait_phases import phase_difference

#: Beyond the first a difference is named, beyond the second it is no difference of people.
NOTED_PCT, REFUSED_PCT = 0.5, 2.0


class OnsetGap(NamedTuple):
    """A timing point that lies apart in two results, in % of the gait cycle."""

    point: str
    first: str
    first_pct: float
    second: str
    second_pct: float
    gap_pct: float

    def __str__(self) -> str:
        return (
            f"{self.point} at {self.first_pct:.1f} % in {self.first} and at "
            f"{self.second_pct:.1f} % in {self.second}"
        )


def onset_gaps(read: Sequence[Results]) -> list[OnsetGap]:
    """Return the timing points of one name that lie apart, over the end of the cycle too."""
    gaps = []
    for one, other in combinations(read, 2):
        for point, pct in one.onsets_pct.items():
            if point not in other.onsets_pct:
                continue
            its = other.onsets_pct[point]
            gap = abs(phase_difference(pct, its))
            if gap > NOTED_PCT:
                gaps.append(OnsetGap(point, one.source.name, pct, other.source.name, its, gap))
    return gaps


def check_onsets(read: Sequence[Results]) -> None:
    """Raise where timing points of one name are not the same event."""
    apart = [gap for gap in onset_gaps(read) if gap.gap_pct > REFUSED_PCT]
    if apart:
        raise DataError(
            f"compare: timing points of one name are more than {REFUSED_PCT:g} % of the gait cycle "
            f"apart: {'; '.join(map(str, apart))}. Give both studies the same timing_points, or "
            "other names to what is measured elsewhere."
        )
