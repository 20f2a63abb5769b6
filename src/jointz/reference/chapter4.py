"""Printed numbers of chapter IV: the knee of ten people during walking.

A digit of tables 4.1 to 4.4 that the copy of the text had damaged, or that cannot be meant, is
repaired here; the number's note says what stood there. ``tests/unit/reference`` checks every
row against its printed mean.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import pandas as pd

from jointz.core.gait_phases import TIMING_POINTS
from jointz.reference import Printed, row_mean

SUBJECTS: Final = tuple(f"S{k}" for k in range(1, 11))
#: Below this an entry is 0 but for rounding: the regression ended at its bound.
NUMERICALLY_ZERO: Final = 1e-9
#: Below this an entry is nearly 0, in the unit of its table.
NEARLY_ZERO: Final = 1e-3

# --- 4.2: who walked -----------------------------------------------------------------------------

MASS: Final = Printed(73.39, 9.72, "kg", "4.2.2")

# --- tables 4.1 to 4.4: one value a participant and timing point ----------------------------------

Row = Mapping[str, Printed]
Table = Mapping[str, Row]


def _note(value: float, repaired: str) -> str:
    if repaired:
        return repaired
    if value < NUMERICALLY_ZERO:
        return "numerically 0: the bounded regression ended at its bound"
    if value < NEARLY_ZERO:
        return "nearly 0"
    return ""


def _stray(printed: str) -> str:
    return f"repaired: the copy of the text reads {printed}, with a stray leading digit"


def _split(printed: str) -> str:
    return f"repaired: the copy of the text reads '{printed}'; numerically 0"


def _row(source: str, unit: str, *values: float, **repaired: str) -> Row:
    cells = (
        Printed(value, None, unit, source, _note(value, repaired.get(subject, "")))
        for subject, value in zip(SUBJECTS, values, strict=True)
    )
    return dict(zip(SUBJECTS, cells, strict=True))


def _means(source: str, unit: str, *values: float, **notes: str) -> Row:
    cells = (
        Printed(value, None, unit, source, notes.get(point, ""))
        for point, value in zip(TIMING_POINTS, values, strict=True)
    )
    return dict(zip(TIMING_POINTS, cells, strict=True))


_K = ("Table 4.1", "N*m/rad/kg")
_B = ("Table 4.2", "N*m*s/rad/kg")
_J = ("Table 4.3", "kg*m^2")
_VAF = ("Table 4.4", "%")

# fmt: off
STIFFNESS: Final[Table] = {
    "LRE": _row(*_K, 1.88, 1.76, 4.23, 1.72, 2.12e-14, 1.58, 0.54, 6.59, 1.78, 1.23),
    "MST": _row(*_K, 0.76, 0.60, 0.17, 0.09, 0.21, 0.24, 0.71, 1.79, 0.78, 0.82),
    "TST": _row(*_K, 1.52, 0.72, 1.31, 2.03, 1.00, 1.08e-4, 0.82, 2.26, 0.60, 1.21),
    "PSW": _row(*_K, 1.91, 1.19, 0.40, 1.36, 0.97, 0.97, 1.14, 2.71, 0.97, 0.02),
    "ISW": _row(*_K, 0.75, 0.17, 0.26, 0.30, 0.008, 0.048, 0.13, 4.88e-12, 0.78, 0.70,
                S6=_stray("20.048")),
    "MSW": _row(*_K, 0.68, 0.22, 2.04e-5, 0.004, 0.62, 0.43, 0.51, 0.54, 0.69, 0.11,
                S5=_stray("20.62")),
}
STIFFNESS_MEANS: Final = _means(*_K, 2.13, 0.62, 1.15, 1.16, 0.31, 0.38)

DAMPING: Final[Table] = {
    "LRE": _row(*_B, 0.024, 0.074, 1.07e-11, 0.073, 0.073, 0.047, 0.064, 1.68e-11, 0.023, 0.008),
    "MST": _row(*_B, 0.055, 0.046, 0.076, 0.060, 0.057, 0.040, 0.043, 3.65e-12, 0.031, 0.011),
    "TST": _row(*_B, 0.051, 0.060, 0.058, 0.081, 0.028, 0.096, 0.074, 0.019, 0.066, 4.30e-4),
    "PSW": _row(*_B, 0.011, 0.038, 0.040, 0.042, 0.026, 0.014, 0.028, 0.006, 0.018, 0.072,
                S9=_stray("80.018")),
    "ISW": _row(*_B, 0.031, 0.063, 0.053, 0.053, 0.056, 0.032, 0.020, 0.028, 0.020, 0.026),
    "MSW": _row(*_B, 0.035, 0.042, 0.043, 0.049, 0.015, 0.015, 0.014, 0.025, 0.014, 0.034),
}
DAMPING_MEANS: Final = _means(*_B, 0.039, 0.042, 0.053, 0.030, 0.038, 0.029, LRE=_stray("20.039"))

#: Of device and joint together.
INERTIA: Final[Table] = {
    "LRE": _row(*_J, 0.018, 0.014, 0.001, 0.011, 0.068, 0.051, 0.047, 0.030, 0.021, 0.008,
                S4=_stray("50.011")),
    "MST": _row(*_J, 0.003, 0.010, 0.027, 0.14, 0.031, 0.065, 0.033, 0.047, 0.005, 0.002,
                S2=_stray("30.010"), S10=_stray("50.002"),
                S4="as printed: it fits the mean of its row; the one outlier"),
    "TST": _row(*_J, 1.99e-10, 0.030, 0.065, 0.014, 0.029, 0.060, 0.008, 0.017, 0.008, 0.008,
                S1=_split("1.99e- 10"), S8=_stray("50.017"), S10=_stray("10.008"),
                S4="repaired: printed 0.14, which would make the mean of its row 0.037 beside the "
                   "printed 0.024"),
    "PSW": _row(*_J, 0.024, 0.030, 0.070, 0.039, 0.051, 0.050, 0.022, 0.052, 0.032, 0.032),
    "ISW": _row(*_J, 0.019, 0.032, 0.030, 0.023, 0.032, 0.043, 0.069, 0.030, 0.018, 0.038),
    "MSW": _row(*_J, 5.02e-11, 0.011, 0.024, 0.016, 0.053, 0.029, 0.040, 0.030, 0.013, 0.011,
                S1=_split("5.02e- 11")),
}
INERTIA_MEANS: Final = _means(
    *_J, 0.027, 0.036, 0.024, 0.040, 0.033, 0.023,
    LRE=_stray("00.027"), MST=_stray("60.036"), TST=_stray("10.024"),
)

VAF: Final[Table] = {
    "LRE": _row(*_VAF, 97.51, 97.82, 93.68, 92.93, 45.20, 75.79, 94.38, 84.48, 96.95, 99.65),
    "MST": _row(*_VAF, 96.75, 98.28, 93.46, 98.96, 92.48, 94.50, 90.76, 86.50, 98.22, 99.30),
    "TST": _row(*_VAF, 96.56, 96.68, 98.62, 96.78, 93.18, 93.02, 99.24, 96.02, 99.24, 99.83),
    "PSW": _row(*_VAF, 93.54, 98.37, 64.90, 88.72, 91.20, 94.02, 94.38, 64.04, 95.19, 93.37),
    "ISW": _row(*_VAF, 91.36, 98.79, 78.31, 78.45, 80.97, 91.69, 66.85, 96.03, 93.30, 86.82),
    "MSW": _row(*_VAF, 85.41, 97.03, 80.08, 92.99, 87.95, 91.83, 90.76, 84.19, 94.07, 95.90),
}
VAF_MEANS: Final = _means(*_VAF, 87.84, 94.92, 96.92, 87.77, 86.26, 90.02)
# fmt: on

#: Tables 4.1 to 4.4 and the printed means of their rows, by what they hold.
TABLES: Final[Mapping[str, Table]] = {
    "stiffness_per_mass": STIFFNESS,
    "damping_per_mass": DAMPING,
    "inertia": INERTIA,
    "vaf": VAF,
}
MEANS: Final[Mapping[str, Row]] = {
    "stiffness_per_mass": STIFFNESS_MEANS,
    "damping_per_mass": DAMPING_MEANS,
    "inertia": INERTIA_MEANS,
    "vaf": VAF_MEANS,
}


def participant_table() -> pd.DataFrame:
    """Return tables 4.1 to 4.4 as one row a participant and timing point.

    Returns
    -------
    pandas.DataFrame
        60 rows: ``participant``, ``timing_point`` (ordered categorical), ``onset_gait_pct``,
        ``stiffness_per_mass`` (N*m/rad/kg), ``damping_per_mass`` (N*m*s/rad/kg), ``inertia``
        (kg*m^2, device and joint), ``vaf_pct``; repaired digits as in the tables' notes.

    Examples
    --------
    >>> table = participant_table()
    >>> round(float(table["vaf_pct"].mean()), 2)
    90.62
    """
    rows = [
        {
            "participant": subject,
            "timing_point": point,
            "onset_gait_pct": onset,
            "stiffness_per_mass": STIFFNESS[point][subject].value,
            "damping_per_mass": DAMPING[point][subject].value,
            "inertia": INERTIA[point][subject].value,
            "vaf_pct": VAF[point][subject].value,
        }
        for subject in SUBJECTS
        for point, onset in TIMING_POINTS.items()
    ]
    table = pd.DataFrame(rows)
    points = pd.Categorical(table["timing_point"], categories=list(TIMING_POINTS), ordered=True)
    return table.assign(timing_point=points)


# --- 4.3.2.3: quasi-stiffness ---------------------------------------------------------------------

#: 100 (Q - K) / K: of quasi-stiffness with respect to stiffness.
QUASI_STIFFNESS_DIFFERENCES: Final = _means(
    "4.3.2.3", "%", 3.44, 51.85, -214.24, -54.61, -77.72, -112.67
)
QUASI_STIFFNESS_P: Final = Printed(
    0.3374,
    None,
    "",
    "4.3.2.3",
    "unpaired t-test over six timing points against six; 'not found to not be statistically "
    "different', with one 'not' too many",
)


def implied_quasi_stiffness() -> Mapping[str, float]:
    """Return the quasi-stiffness that the printed percent differences imply.

    Returns
    -------
    mapping of str to float
        By timing point, K * (1 + difference / 100) with K the mean of the row of table 4.1
        (not the printed, rounded one), N*m/rad/kg. Quasi-stiffness itself is not printed.

    Examples
    --------
    >>> round(implied_quasi_stiffness()["TST"], 3)
    -1.31
    """
    return MappingProxyType(
        {
            point: row_mean(STIFFNESS[point]) * (1.0 + difference.value / 100.0)
            for point, difference in QUASI_STIFFNESS_DIFFERENCES.items()
        }
    )
