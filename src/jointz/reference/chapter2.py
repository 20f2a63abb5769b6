"""Printed numbers of chapter II: the series-elastic knee exoskeleton on the bench."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from jointz.reference import OtherDevice, Printed

CASES: Final = ("1", "2", "3", "4")
TRAJECTORIES: Final = ("A", "B", "C", "D", "E")

# --- 2.2.3: the loads ----------------------------------------------------------------------------

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

# --- tables 2.1 and 2.2: percent error, mean and SD, by load and trajectory ----------------------


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

# --- 2.3.1: bandwidth and intrinsic impedance ----------------------------------------------------

_RESOLUTION = (
    "may be limited by spectral resolution: a 30-lag Blackman-Tukey window at 1 kHz reads 10 Hz as "
    "26.9 Hz and 17.2 Hz as 29.5 Hz"
)
BANDWIDTH_20_NM: Final = Printed(26.8, None, "Hz", "2.3.1", _RESOLUTION)
BANDWIDTH_40_NM: Final = Printed(
    17.2, None, "Hz", "2.3.1", f"the discussion says 17.6 Hz; {_RESOLUTION}"
)
BANDWIDTH_MINIMUM: Final = Printed(
    17.6, None, "Hz", "2.4", "the results (2.3.1) say 17.2 Hz for the 40 N*m signal"
)
INTRINSIC_STIFFNESS: Final = Printed(0.388, 0.194, "N*m/rad", "2.3.1")
INTRINSIC_DAMPING: Final = Printed(0.163, 0.0130, "N*m*s/rad", "2.3.1")
INTRINSIC_INERTIA: Final = Printed(0.00100, 2.65e-5, "kg*m^2", "2.3.1")

# --- 2.3.2: average errors -----------------------------------------------------------------------

AVERAGE_ERRORS: Final[Mapping[str, Printed]] = MappingProxyType(
    {
        "k1": Printed(-2.15, 3.49, "%", "2.3.2", "the mean of its row in table 2.1 is -1.53 %"),
        "k2": Printed(-2.51, 5.73, "%", "2.3.2", "the mean of its row in table 2.1 is -2.91 %"),
        "I1": Printed(-15.2, 10.91, "%", "2.3.2", "the mean of its row in table 2.2 is -14.8 %"),
        "I2": Printed(-13.1, 5.91, "%", "2.3.2", "the mean of its row in table 2.2 is -13.5 %"),
    }
)

# --- 2.3.3: VAF and the ANOVAs without significance ----------------------------------------------

VAF_LOWER_LIMIT: Final = Printed(99.9, None, "%", "2.3.3", "every pair except 4B lies above")
VAF_4B: Final = Printed(95.0, None, "%", "2.3.3", "the one exception")
SIGNIFICANCE_LEVEL: Final = 0.05
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

# --- 2.4, 2.4.1, 2.4.2, 2.4.4: claims ------------------------------------------------------------

STIFFNESS_ERROR_LIMIT: Final = Printed(3.0, None, "%", "2.4", "stiffness errors under this")
INERTIA_ERROR_RANGE: Final = (
    Printed(13.0, None, "%", "2.4", "inertia errors range from about this"),
    Printed(15.0, None, "%", "2.4", "to about this"),
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
OUTPUT_TORQUE_VARIATION: Final = Printed(
    10.0, None, "%", "2.4.4", "up to about this much, in a prior study of the exoskeleton"
)

# --- 2.4.1: other devices ------------------------------------------------------------------------

OTHER_DEVICES: Final = (
    OtherDevice("stiffness error", 5.0, 5.0, "%", (2,), "2.4.1", "reported average"),
    OtherDevice("stiffness error", 15.0, 15.0, "%", (54,), "2.4.1", "for 13 of 18 trials"),
    OtherDevice("inertia error", 15.0, 15.0, "%", (54,), "2.4.1", "for 16 of 18 trials; Tucker"),
)
