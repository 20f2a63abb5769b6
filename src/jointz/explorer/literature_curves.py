"""Published values over the gait cycle: of the dissertation, and of studies that it compares."""

from dataclasses import dataclass
from statistics import fmean, stdev

from jointz.core.gait_phases import TIMING_POINTS
from jointz.reference import chapter4, literature


@dataclass(frozen=True, slots=True)
class ReferencePoint:
    """A published value."""

    gait_pct: float  # % of the gait cycle
    value: float | None  # SI; None if only a range is stated
    low: float  # lower end of the range, SI
    high: float  # upper end of the range, SI


@dataclass(frozen=True, slots=True)
class ReferenceCurve:
    """Published values of one parameter."""

    name: str  # name of the study
    meaning: str  # meaning of value and range
    points: tuple[ReferencePoint, ...]  # in the order of the cycle


def reference_curves(joint: str, parameter: str) -> tuple[ReferenceCurve, ...]:
    """Return the published values of a parameter; empty if there are none."""
    if joint != "knee" or parameter not in chapter4.TABLES:
        return ()
    printed = ReferenceCurve(
        "dissertation, ten people",
        "printed mean and standard deviation over people (tables 4.1 to 4.3)",
        tuple(_printed(parameter, point) for point in TIMING_POINTS),
    )
    return (printed, *(_stated() if parameter == "stiffness_per_mass" else ()))


def _printed(parameter: str, point: str) -> ReferencePoint:
    row = chapter4.TABLES[parameter][point]
    values = [row[subject].value for subject in chapter4.SUBJECTS]
    mean, sd = fmean(values), stdev(values)
    return ReferencePoint(TIMING_POINTS[point], mean, mean - sd, mean + sd)


def _stated() -> tuple[ReferenceCurve, ...]:
    curves = []
    for key, study in literature.STUDIES.items():
        ranges = {p: literature.stated_stiffness_range(key, p) for p in TIMING_POINTS}
        points = tuple(
            ReferencePoint(TIMING_POINTS[point], None, *stated)
            for point, stated in ranges.items()
            if stated is not None
        )
        if points:
            meaning = "range that the dissertation's text states relative to its own mean"
            curves.append(ReferenceCurve(study.name, meaning, points))
    return tuple(curves)
