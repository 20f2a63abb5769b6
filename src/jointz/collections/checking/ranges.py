"""Limits of an entry: joints, directions, licences, and sizes of impedance.

The ranges are for medians over a condition's people and timing points, not for single values. Each
spans a factor of less than 57, so that no median stays inside when degrees are taken for radians.
They are wide on purpose: to find wrong units and wrong joints, not to judge a measurement.

Where they come from. Knee: the dissertation's tables 4.1 to 4.3 (0.31 to 2.13 N*m/rad/kg, 0.029 to
0.053 N*m*s/rad/kg) and its comparisons (:mod:`jointz.reference.literature`). Ankle in stance: the
abstract of Ficanha et al. 2018, J. Medical Devices 12, 011010 (means of 1.14 to 5.43 N*m/rad/kg and
0.016 to 0.080 N*m*s/rad/kg, four people), extended downwards for swing, where we judged. All else
is judged, to about a factor of two, from our knowledge of the field and from neighbouring joints,
without a number that was looked up: the studies we had in mind are Koopman et al. 2016, IEEE T.
Robotics 32, 920 (hip), Formica et al. 2012, J. Neurophysiol. (wrist), and Bennett et al. 1992, Exp.
Brain Res. (elbow). Inertias are judged from the size of the segments beyond the joint, from a small
to a large adult, with as much again for a device. An entry whose joint is stiffer for a reason,
such as maximal contraction, says so under ``accepted``.
"""

from collections.abc import Mapping
from types import MappingProxyType

Range = tuple[float, float]

_FLEXION = frozenset({"flexion", "extension"})
_ABDUCTION = frozenset({"abduction", "adduction"})
_ROTATION = frozenset({"internal_rotation", "external_rotation"})

#: Joint -> directions that one may call positive.
JOINT_DIRECTIONS: Mapping[str, frozenset[str]] = MappingProxyType(
    {
        "ankle": frozenset({"dorsiflexion", "plantarflexion", "inversion", "eversion"}),
        "knee": _FLEXION | _ABDUCTION | _ROTATION,
        "hip": _FLEXION | _ABDUCTION | _ROTATION,
        "trunk": _FLEXION,
        "neck": _FLEXION,
        "shoulder": _FLEXION | _ABDUCTION | _ROTATION,
        "elbow": _FLEXION,
        "forearm": frozenset({"pronation", "supination"}),
        "wrist": _FLEXION | {"radial_deviation", "ulnar_deviation"},
        "finger": _FLEXION | _ABDUCTION,
    }
)

#: Joint -> parameter -> range of the median over a condition, SI; others are not checked.
MEDIAN_RANGES: Mapping[str, Mapping[str, Range]] = MappingProxyType({
    "ankle": {
        "stiffness": (9.0, 500.0), "damping": (0.15, 8.5), "inertia": (0.003, 0.17),
        "stiffness_per_mass": (0.12, 6.8), "damping_per_mass": (0.002, 0.11),
    },
    "knee": {
        "stiffness": (5.0, 280.0), "damping": (0.3, 17.0), "inertia": (0.015, 0.84),
        "stiffness_per_mass": (0.07, 3.9), "damping_per_mass": (0.004, 0.22),
    },
    "hip": {
        "stiffness": (12.0, 670.0), "damping": (0.5, 28.0), "inertia": (0.1, 5.6),
        "stiffness_per_mass": (0.16, 9.0), "damping_per_mass": (0.007, 0.39),
    },
    "shoulder": {"stiffness": (3.0, 170.0), "damping": (0.2, 11.0), "inertia": (0.05, 2.8)},
    "elbow": {"stiffness": (1.0, 56.0), "damping": (0.06, 3.3), "inertia": (0.01, 0.56)},
    "wrist": {"stiffness": (0.25, 14.0), "damping": (0.003, 0.17), "inertia": (0.0006, 0.034)},
})  # fmt: skip

#: Of people, kg and m: below and above are other units, or other species.
MASS_KG: Range = (8.0, 300.0)
HEIGHT_M: Range = (0.6, 2.4)
#: Where people run, m/s.
RUNNING_M_S: Range = (1.2, 8.0)
STEEPEST_DEG = 35.0
#: Narrower bands of age could identify people, years.
NARROWEST_BAND_YEARS = 5

#: SPDX identifiers of licences that let values go into a table with others.
LICENCES = frozenset(
    {
        "0BSD", "Apache-2.0", "BSD-2-Clause", "BSD-3-Clause", "CC-BY-3.0", "CC-BY-4.0",
        "CC-BY-NC-4.0", "CC-BY-NC-SA-4.0", "CC-BY-SA-4.0", "CC-PDDC", "CC0-1.0",
        "CDLA-Permissive-1.0",
        "CDLA-Permissive-2.0", "CDLA-Sharing-1.0", "DL-DE-BY-2.0", "DL-DE-ZERO-2.0",
        "etalab-2.0", "MIT", "ODbL-1.0", "ODC-By-1.0", "OGL-UK-3.0", "PDDL-1.0",
    }
)  # fmt: skip
#: Prefix of a licence that SPDX does not list; its text is then in the entry's folder.
OWN_LICENCE = "LicenseRef-"
