"""Printed numbers and statements of chapters II to IV that only the reproduction compares.

As in :mod:`jointz.reference`, nothing is corrected: a note says what is wrong with a number.
"""

from collections.abc import Mapping
from itertools import combinations
from types import MappingProxyType
from typing import Final, Literal

from jointz.core.gait_phases import TIMING_POINTS
from jointz.reference import Printed

#: Of the tests of chapters II and IV.
SIGNIFICANCE_LEVEL: Final = 0.05

# --- 2.2: cases and trajectories ------------------------------------------------------------------

CASES: Final = ("1", "2", "3", "4")
TRAJECTORIES: Final = ("A", "B", "C", "D", "E")

# --- 2.2.3: the loads -----------------------------------------------------------------------------

#: The two springs; their own uncertainty, 8.5 and 5.1 %, exceeds the printed errors.
SPRINGS: Final[Mapping[str, Printed]] = MappingProxyType(
    {
        "k1": Printed(168.0, 14.3, "N*m/rad", "2.2.3"),
        "k2": Printed(273.0, 13.9, "N*m/rad", "2.2.3"),
    }
)
INERTIAS: Final[Mapping[str, Printed]] = MappingProxyType(
    {
        "I1": Printed(0.0364, 4.97e-5, "kg*m^2", "2.2.3"),
        "I2": Printed(0.0700, 2.04e-4, "kg*m^2", "2.2.3"),
    }
)
#: Spring and inertia of every case.
CASE_LOADS: Final[Mapping[str, tuple[str, str]]] = MappingProxyType(
    {"1": ("k1", "I1"), "2": ("k2", "I1"), "3": ("k1", "I2"), "4": ("k2", "I2")}
)

# --- tables 2.1 and 2.2: percent error, mean and SD, by load and trajectory -----------------------


def _row(source: str, *values: tuple[float, float]) -> Mapping[str, Printed]:
    cells = (Printed(mean, sd, "%", source) for mean, sd in values)
    return MappingProxyType(dict(zip(TRAJECTORIES, cells, strict=True)))


STIFFNESS_ERRORS: Final[Mapping[str, Mapping[str, Printed]]] = MappingProxyType(
    {
        "k1": _row(
            "Table 2.1", (3.73, 0.51), (-2.54, 2.37), (-5.14, 1.32), (-2.44, 0.01), (-1.27, 0.99)
        ),
        "k2": _row(
            "Table 2.1", (-0.28, 0.51), (-0.49, 1.20), (-12.70, 1.83), (-0.16, 0.83), (-0.94, 4.25)
        ),
    }
)
INERTIA_ERRORS: Final[Mapping[str, Mapping[str, Printed]]] = MappingProxyType(
    {
        "I1": _row(
            "Table 2.2", (-1.80, 6.34), (-11.5, 4.63), (-30.2, 19.8), (-11.0, 8.87), (-19.6, 2.00)
        ),
        "I2": _row(
            "Table 2.2", (-12.9, 3.16), (-9.32, 5.45), (-22.7, 16.2), (-7.31, 0.22), (-15.1, 12.3)
        ),
    }
)

# --- 2.3.2: average errors ------------------------------------------------------------------------

AVERAGE_ERRORS: Final[Mapping[str, Printed]] = MappingProxyType(
    {
        "k1": Printed(-2.15, 3.49, "%", "2.3.2", "the mean of its row in table 2.1 is -1.53 %"),
        "k2": Printed(-2.51, 5.73, "%", "2.3.2", "the mean of its row in table 2.1 is -2.91 %"),
        "I1": Printed(-15.2, 10.91, "%", "2.3.2", "the mean of its row in table 2.2 is -14.8 %"),
        "I2": Printed(-13.1, 5.91, "%", "2.3.2", "the mean of its row in table 2.2 is -13.5 %"),
    }
)

# --- 2.3.3: VAF and the ANOVAs without significance -----------------------------------------------

VAF_LOWER_LIMIT: Final = Printed(99.9, None, "%", "2.3.3", "every pair except 4B lies above")
VAF_4B: Final = Printed(95.0, None, "%", "2.3.3", "the one exception")
_LISTED = "2.3.3"
_E_IS_CONFOUNDED = (
    "reference E, as we read it, rises at all four onsets, so that type and direction are one "
    "factor and must have one p-value; only one of them is listed"
)
#: By parameter and effect, then case-trajectory pair: all p-values that are printed. Every other
#: ANOVA has p < 0.05; none is adjusted for the 80 of them.
ANOVA_NOT_SIGNIFICANT: Final[Mapping[tuple[str, str], Mapping[str, Printed]]] = MappingProxyType(
    {
        ("stiffness", "type"): MappingProxyType({}),
        ("inertia", "type"): MappingProxyType(
            {
                "1C": Printed(0.835, source=_LISTED),
                "2E": Printed(0.754, source=_LISTED, note=_E_IS_CONFOUNDED),
            }
        ),
        ("stiffness", "direction"): MappingProxyType(
            {"4C": Printed(0.469, source=_LISTED), "4D": Printed(0.190, source=_LISTED)}
        ),
        ("inertia", "direction"): MappingProxyType(
            {
                "1A": Printed(0.826, source=_LISTED),
                "2A": Printed(0.056, source=_LISTED),
                "4E": Printed(0.384, source=_LISTED, note=_E_IS_CONFOUNDED),
            }
        ),
    }
)

# --- 2.4, 2.4.2, 2.4.4: claims --------------------------------------------------------------------

BANDWIDTH_MINIMUM: Final = Printed(
    17.6, None, "Hz", "2.4", "the results (2.3.1) say 17.2 Hz for the 40 N*m signal"
)
#: By row of the tables: the trajectories that break "better at higher values".
HIGHER_IS_BETTER_EXCEPT: Final[Mapping[str, str]] = MappingProxyType(
    {"stiffness": "C", "inertia": "A"}
)

#: Share of ANOVAs with p < 0.05, by effect; ``all`` over both.
SIGNIFICANT_SHARES: Final[Mapping[str, Printed]] = MappingProxyType(
    {
        "type": Printed(95.0, None, "%", "2.4.2", "38 of 40, as 2.3.3 lists"),
        "direction": Printed(87.5, None, "%", "2.4.2", "35 of 40, as 2.3.3 lists"),
        "all": Printed(91.0, None, "%", "2.4.2", "'over 91 %': 73 of 80 are 91.25 %"),
    }
)
#: How often the mean of positive pulses is the larger.
POSITIVE_LARGER: Final[Mapping[str, Printed]] = MappingProxyType(
    {
        "stiffness": Printed(55.0, None, "%", "2.4.2", "11 of 20"),
        "inertia": Printed(40.0, None, "%", "2.4.2", "8 of 20"),
    }
)
#: How often the mean of pulses with the trajectory is the larger.
WITH_LARGER: Final[Mapping[str, Printed]] = MappingProxyType(
    {
        "stiffness": Printed(75.0, None, "%", "2.4.2", "15 of 20"),
        "inertia": Printed(
            36.3, None, "%", "2.4.2", "no k of 20 gives 36.3 %: 7 are 35 %, 8 are 40 %"
        ),
    }
)

DAMPING_SD_OVER_MEAN: Final = Printed(
    1.4, None, "", "2.4.4", "SD of the damping at least this many means in 95 % of conditions"
)
DAMPING_NOISY_SHARE: Final = Printed(95.0, None, "%", "2.4.4", "see DAMPING_SD_OVER_MEAN")
#: How often an estimate falls below the true value: by trajectory, and by case and trajectory.
UNDERESTIMATED_BY_TRAJECTORY: Final[Mapping[str, Printed]] = MappingProxyType(
    {
        "stiffness": Printed(80.0, None, "%", "2.4.4", "4 of 5 over both springs of table 2.1"),
        "inertia": Printed(100.0, None, "%", "2.4.4", "5 of 5 over both inertias of table 2.2"),
    }
)
UNDERESTIMATED_BY_PAIR: Final[Mapping[str, Printed]] = MappingProxyType(
    {
        "stiffness": Printed(
            35.0,
            None,
            "%",
            "2.4.4",
            "cannot hold: 9 of the 10 means of table 2.1 are negative, each over two cases, so "
            "at least 9 of the 20 pairs, 45 %, fall below",
        ),
        "inertia": Printed(95.0, None, "%", "2.4.4", "19 of 20"),
    }
)

# --- 3.3: the actuator on the bench ---------------------------------------------------------------

CHIRP_RMS: Final = Printed(0.33, None, "N*m", "3.3.1", "model 3.3")
POSITIVE_PULSE_STIFFNESS: Final = Printed(145.13, 2.45, "N*m/rad", "3.3.3")
NEGATIVE_PULSE_STIFFNESS: Final = Printed(162.57, 2.96, "N*m/rad", "3.3.3")
DYNAMIC_STIFFNESS_ERROR: Final = Printed(
    5.29,
    None,
    "%",
    "3.3.3",
    "the printed stiffnesses give 5.10 % (signed errors averaged) or 5.96 % (absolute ones)",
)

# --- 3.3.4: the pilot -----------------------------------------------------------------------------

PILOT_VAF: Final[Mapping[str, Printed]] = MappingProxyType(
    {
        "1": Printed(97.83, None, "%", "3.3.4"),
        "2": Printed(84.84, None, "%", "3.3.4"),
        "mean": Printed(91.3, None, "%", "3.3.4", "3.4 rounds to about 91 %"),
    }
)
#: Largest and smallest average over the timing points.
PILOT_RANGES: Final[Mapping[str, tuple[Printed, Printed]]] = MappingProxyType(
    {
        "stiffness_per_mass": (
            Printed(2.99, None, "N*m/rad/kg", "3.3.4"),
            Printed(0.11, None, "N*m/rad/kg", "3.3.4"),
        ),
        "damping_per_mass": (
            Printed(0.06, None, "N*m*s/rad/kg", "3.3.4"),
            Printed(0.04, None, "N*m*s/rad/kg", "3.3.4"),
        ),
        "inertia": (
            Printed(0.05, None, "kg*m^2", "3.3.4"),
            Printed(0.01, None, "kg*m^2", "3.3.4"),
        ),
    }
)

# --- 3.4: other devices ---------------------------------------------------------------------------

#: 3.4 explains the larger damping of the pilot by the window and this VAF of others.
OTHER_VAF: Final = Printed(72.0, None, "%", "3.4", "about; ours about 91 %")
SECOND_ORDER_VAF: Final = Printed(
    97.0, None, "%", "3.4.1", "more than this in earlier work [67]: second order, time invariant"
)

# --- 4.2: timing points, parameters, people -------------------------------------------------------

#: The dissertation's numbers 1 to 6 of the timing points (4.3.2.2).
POINT_NUMBERS: Final[Mapping[int, str]] = MappingProxyType(dict(enumerate(TIMING_POINTS, start=1)))

#: Parameters of tables 4.1 to 4.3, and their names in sentences.
PARAMETER_NAMES: Final[Mapping[str, str]] = MappingProxyType(
    {"stiffness_per_mass": "stiffness", "damping_per_mass": "damping", "inertia": "inertia"}
)

N_PARTICIPANTS: Final = Printed(10.0, None, "", "4.2.2", "4 of them female")

# --- 4.3.1: the exoskeleton and gait --------------------------------------------------------------

SPM_THRESHOLD: Final = Printed(
    4.299,
    None,
    "",
    "4.3.1",
    "paired two-tailed t over the gait cycle, NWC and ENP; the statistic is nowhere beyond it",
)

# --- 4.3.2.1: averages ----------------------------------------------------------------------------

#: Largest and smallest average over the timing points, as the text says.
RANGES: Final[Mapping[str, tuple[Printed, Printed]]] = MappingProxyType(
    {
        "stiffness_per_mass": (
            Printed(2.13, None, "N*m/rad/kg", "4.3.2.1", "at LRE"),
            Printed(0.31, None, "N*m/rad/kg", "4.3.2.1"),
        ),
        "damping_per_mass": (
            Printed(0.053, None, "N*m*s/rad/kg", "4.3.2.1"),
            Printed(
                0.030,
                None,
                "N*m*s/rad/kg",
                "4.3.2.1",
                "the lowest mean of table 4.2 is 0.029, at MSW",
            ),
        ),
        "inertia": (
            Printed(0.040, None, "kg*m^2", "4.3.2.1"),
            Printed(0.023, None, "kg*m^2", "4.3.2.1"),
        ),
    }
)
VAF_MEAN: Final = Printed(
    90.62, 4.32, "%", "4.3.2.1", "the SD is that of the six timing-point means"
)
VAF_MEAN_ROUNDED: Final = Printed(
    91.0, None, "%", "4.4", "about; 'across all subjects and timing points'"
)

# --- 4.3.2.2: what influences impedance -----------------------------------------------------------

_REPLICATES = "one value a participant and timing point does not give it; see reproduction.audit"
#: Upper limits of the p-values, by parameter and factor: 'all linear models found timing point
#: and subject to be significant (p < 0.001)'.
FACTOR_P_BELOW: Final[Mapping[tuple[str, str], Printed]] = MappingProxyType(
    {
        (parameter, factor): Printed(
            0.001,
            None,
            "",
            "4.3.2.2",
            "" if (parameter, factor) == ("stiffness_per_mass", "timing_point") else _REPLICATES,
        )
        for parameter in PARAMETER_NAMES
        for factor in ("timing_point", "participant")
    }
)

PairClaim = Literal["different", "similar", "not stated"]
_Pair = tuple[int, int]

#: Numbers of the timing points that differ from all others, and pairs called similar.
_DIFFER_FROM_ALL: Final[Mapping[str, tuple[int, ...]]] = MappingProxyType(
    {"stiffness_per_mass": (1, 2), "damping_per_mass": (3,), "inertia": (4,)}
)
_SIMILAR: Final[Mapping[str, frozenset[_Pair]]] = MappingProxyType(
    {
        "stiffness_per_mass": frozenset({(3, 4), (5, 6)}),
        "damping_per_mass": frozenset({(4, 6), (1, 2), (1, 5), (2, 5)}),
        "inertia": frozenset({(2, 5), (1, 3), (3, 6)}),
    }
)
_DIFFERENT: Final[Mapping[str, frozenset[_Pair]]] = MappingProxyType(
    {"inertia": frozenset({(1, 6)})}
)


def _claim(parameter: str, pair: _Pair) -> PairClaim:
    if set(pair) & set(_DIFFER_FROM_ALL[parameter]) or pair in _DIFFERENT.get(parameter, ()):
        return "different"
    return "similar" if pair in _SIMILAR[parameter] else "not stated"


#: What the text says of every pair of timing points, by parameter and pair, Bonferroni at 0.05.
#: Pairs of two groups (such as stiffness 3 and 5) are not stated, though the grouping suggests
#: that they differ. 'Similar' is a test that did not reject; no equivalence was tested.
PAIRS: Final[Mapping[str, Mapping[tuple[str, str], PairClaim]]] = MappingProxyType(
    {
        parameter: MappingProxyType(
            {
                (POINT_NUMBERS[i], POINT_NUMBERS[j]): _claim(parameter, (i, j))
                for i, j in combinations(POINT_NUMBERS, 2)
            }
        )
        for parameter in _DIFFER_FROM_ALL
    }
)
