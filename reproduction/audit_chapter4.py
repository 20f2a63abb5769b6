"""Test statistics of tables 4.1 to 4.3, as numbers, since this floor computes none.

The tests recompute them from the tables; :mod:`reproduction.audit` sets them beside the text.
"""

from collections.abc import Mapping
from statistics import fmean
from types import MappingProxyType
from typing import Final

from jointz.reference import Printed

#: p of F(5, 45), one value a participant and timing point.
POINT_P: Final[Mapping[str, float]] = MappingProxyType(
    {"stiffness_per_mass": 8.08391e-5, "damping_per_mass": 0.0997869, "inertia": 0.384703}
)
#: p of F(9, 45), from the same table.
PARTICIPANT_P: Final[Mapping[str, float]] = MappingProxyType(
    {"stiffness_per_mass": 0.0198999, "damping_per_mass": 0.0128900, "inertia": 0.0326164}
)
#: Pairs of timing points with p < 0.05, pooled error and Bonferroni over the 15 pairs.
BONFERRONI_PAIRS: Final[Mapping[str, Mapping[tuple[str, str], float]]] = MappingProxyType(
    {
        "stiffness_per_mass": MappingProxyType(
            {
                ("LRE", "MST"): 0.00247592,
                ("LRE", "ISW"): 0.000173207,
                ("LRE", "MSW"): 0.000312595,
            }
        ),
        "damping_per_mass": MappingProxyType({}),
        "inertia": MappingProxyType({}),
    }
)


def column_mean(table: Mapping[str, Mapping[str, Printed]], subject: str) -> float:
    """Return the mean of one person's numbers over the timing points of a printed table."""
    return fmean(row[subject].value for row in table.values())
