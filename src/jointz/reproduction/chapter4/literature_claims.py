"""Figures 4.4 and A.1 again: impedance over the gait cycle, and what is stated of others."""

from math import isfinite
from statistics import fmean, stdev
from typing import Any

from jointz.core.gait_phases import TIMING_POINTS
from jointz.reference import chapter4, literature, row_mean
from jointz.reproduction.chapter4.walking import PARAMETERS, WalkedStudy

#: Studies of figure A.1, by how they estimate.
STUDIES = ("tucker", "kooij", "sartori", "pfeifer")


def impedance_figure(found: WalkedStudy) -> dict[str, Any]:
    """Return what figure 4.4 draws.

    Bars of the printed values and of the dissertation's method are the standard deviation over
    people, of the recommended method the 95 % interval of the mean, of the truth none.
    """
    return {
        "onset_pct": dict(TIMING_POINTS),
        "parameters": {
            name: {
                "printed": [_printed(name, point) for point in TIMING_POINTS],
                "dissertation": [
                    _over_people(found, name, "dissertation", point) for point in TIMING_POINTS
                ],
                "recommended": [_population(found, name, point) for point in TIMING_POINTS],
                "truth": [
                    _bar(point, _over_people(found, name, "truth", point)["value"])
                    for point in TIMING_POINTS
                ],
            }
            for name in PARAMETERS
        },
        "quasi_stiffness": dict(chapter4.implied_quasi_stiffness()),
        "stated": {"stiffness_per_mass": _stated_ranges()},
    }


def _bar(
    point: str, value: float | None = None, low: float | None = None, high: float | None = None
) -> dict[str, Any]:
    return {"point": point, "value": value, "low": low, "high": high}


def _printed(name: str, point: str) -> dict[str, Any]:
    row = chapter4.TABLES[name][point]
    sd = stdev(row[subject].value for subject in chapter4.SUBJECTS)
    mean = row_mean(row)
    return _bar(point, mean, mean - sd, mean + sd)


def _over_people(found: WalkedStudy, name: str, source: str, point: str) -> dict[str, Any]:
    values = found.at(source, name, point)
    if len(values) < 2:
        return _bar(point, *values)
    mean, sd = fmean(values), stdev(values)
    return _bar(point, mean, mean - sd, mean + sd)


def _population(found: WalkedStudy, name: str, point: str) -> dict[str, Any]:
    table = found.population
    rows = table[(table["parameter"] == name) & (table["timing_point"] == point)]
    if rows.empty or not isfinite(float(rows["value"].iloc[0])):
        return _bar(point)
    value, low, high = (float(rows[column].iloc[0]) for column in ("value", "ci_low", "ci_high"))
    return _bar(point, value, low, high)


def _stated_ranges() -> list[dict[str, Any]]:
    """Return the only values of others that the text states: those given by a printed factor."""
    rows = []
    for study in STUDIES:
        for point in TIMING_POINTS:
            stated = literature.stated_stiffness_range(study, point)
            if stated is not None:
                name = literature.STUDIES[study].name
                rows.append({"study": name, "point": point, "low": stated[0], "high": stated[1]})
    return rows


def literature_figure(found: WalkedStudy) -> dict[str, Any]:
    """Return what figure A.1 draws."""
    whole = impedance_figure(found)
    return {
        "onset_pct": whole["onset_pct"],
        "stiffness": whole["parameters"]["stiffness_per_mass"],
        "stated": whole["stated"]["stiffness_per_mass"],
        "studies": [
            {
                "name": literature.STUDIES[study].name,
                "approach": literature.STUDIES[study].approach,
                "words": {point: _words(study, point) for point in TIMING_POINTS},
            }
            for study in STUDIES
        ],
    }


def _words(study: str, point: str) -> str:
    """Return what the text says of a study's stiffness at a timing point beside the printed."""
    for said in literature.COMPARISONS:
        if (said.study, said.quantity) != (study, "stiffness") or point not in said.timing_points:
            continue
        if said.factor_low is not None and said.factor_high is not None:
            times = f"{said.factor_low:g}\N{EN DASH}{said.factor_high:g} times"
            return f"{said.relation}, {times}"
        return said.relation
    return ""
