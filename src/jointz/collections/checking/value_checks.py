"""What ``collect check`` looks at in the tables of an entry: every row, and the size of all."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pandas as pd

from jointz.collections.catalog_query import STANDING
from jointz.collections.checking.covariance_checks import covariance_findings
from jointz.collections.checking.entry_checks import PARAMETERS, Found
from jointz.collections.checking.ranges import MEDIAN_RANGES
from jointz.collections.entry_model import Entry
from jointz.collections.entry_reader import ConditionTables
from jointz.core.channels import PARAMETER_UNITS
from jointz.core.codes import Failure
from jointz.core.gait_phases import ALL_POINTS

_STATUS = {*STANDING, "undecided", *(failure.status for failure in Failure)}
_LEVEL = 0.95
#: Ends of an interval are rounded as the value is, to ten digits.
_ROUNDING = 1e-8
#: Values per kg, and masses, are rounded by people too.
_MASS_ROUNDING = 0.02
_PER_MASS = {"stiffness_per_mass": "stiffness", "damping_per_mass": "damping"}
_DEGREES = 180.0 / np.pi
#: People differ less, over all their timing points; values per kg or per degree differ more.
_MOST_APART = 20.0
#: So many timing points are not all within the first hundredth of the cycle.
_FEWEST_PLACES = 3

Check = Callable[[Entry, ConditionTables], Iterator[Found]]


def value_findings(spec: Entry, tables: ConditionTables) -> Iterator[Found]:
    """Yield what is wrong with the values of a condition."""
    if tables.rows.empty:
        yield "no_values", tables.condition.estimates, "at least one row", "none"
        return
    for check in _OF_ALL + (_OF_ESTIMATES if spec.kind == "estimates" else _OF_PRINTED):
        yield from check(spec, tables)
    if tables.covariance is not None:
        yield from covariance_findings(tables, spec.method.name)


def not_sized(spec: Entry, tables: Sequence[ConditionTables]) -> str:
    """Return what of an entry has no range to compare its size with; empty where all has.

    A value per kg is compared with the whole one, where that stands beside it.
    """
    held = {str(name) for one in tables for name in standing(one.rows)["parameter"].unique()}
    sized = MEDIAN_RANGES.get(spec.joint.name, {}).keys() & held
    sized |= {per_kg for per_kg, whole in _PER_MASS.items() if whole in sized}
    unseen = [name for name in PARAMETERS if name in held - sized]
    return f"{', '.join(unseen)} of the {spec.joint.name}" if unseen else ""


def standing(values: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with a value to use."""
    held: pd.DataFrame = values[values["status"].isin(STANDING) & np.isfinite(values["value"])]
    return held


def _rows(
    tables: ConditionTables, wrong: pd.Series, told: tuple[str, str, str], column: str
) -> Iterator[Found]:
    """Yield one finding for all rows that are wrong in the same way."""
    code, expected, found = told
    if not wrong.any():
        return
    places = np.flatnonzero(wrong.to_numpy())
    values = tables.rows
    who = " ".join(str(values[key].iloc[places[0]]) for key in ("participant", "timing_point"))
    shown = found or _cell(values[column].iloc[places[0]])
    more = f", and {len(places) - 1} more rows" if len(places) > 1 else ""
    where = f"{tables.condition.estimates}, row {tables.first_row + places[0]}, column {column}"
    yield code, where, expected, f"{shown} ({who}{more})"


def _cell(value: object) -> str:
    """Return a cell as its file may have it."""
    if isinstance(value, float):
        return "nothing" if np.isnan(value) else f"{value:.6g}"
    return repr(value)


def _labels(_: Entry, tables: ConditionTables) -> Iterator[Found]:
    values = tables.rows
    known = values["parameter"].isin(PARAMETERS)
    told = ("parameter_unknown", f"one of {', '.join(PARAMETERS)}", "")
    yield from _rows(tables, ~known, told, "parameter")
    units = values["parameter"].map(dict(PARAMETER_UNITS))
    for parameter in PARAMETERS:
        wrong = (values["parameter"] == parameter) & (values["unit"] != units)
        told = ("unit", f"{parameter} in {PARAMETER_UNITS[parameter]}", "")
        yield from _rows(tables, wrong, told, "unit")
    told = ("status_unknown", "ok, at_bound, undecided or failed:CODE", "")
    yield from _rows(tables, ~values["status"].isin(_STATUS), told, "status")
    told = ("timing_point_missing", "a timing point, or what a place without gait is called", "")
    yield from _rows(tables, values["timing_point"] == "", told, "timing_point")


def _stated_units(spec: Entry, tables: ConditionTables) -> Iterator[Found]:
    told = ("unit_missing", f"a unit for each parameter, such as {spec.units}", "")
    values = tables.rows
    known = values["parameter"].isin(PARAMETERS)
    yield from _rows(tables, known & ~values["parameter"].isin(spec.units), told, "parameter")


def _values(_: Entry, tables: ConditionTables) -> Iterator[Found]:
    values = tables.rows
    stands, there = values["status"].isin(STANDING), np.isfinite(values["value"])
    told = ("status_value", "a value, for it stands", "")
    yield from _rows(tables, stands & ~there, told, "value")
    told = ("status_value", "no value, for it does not stand", "")
    yield from _rows(tables, ~stands & values["value"].notna(), told, "value")
    low, high = 0.0, 100.0
    phase = values["onset_gait_pct"]
    told = ("phase_range", f"{low:g} to {high:g} % of the gait cycle", "")
    yield from _rows(tables, phase.notna() & ~phase.between(low, high), told, "onset_gait_pct")


def _finite(_: Entry, tables: ConditionTables) -> Iterator[Found]:
    expected = "a number, or nothing"
    for column in tables.rows.select_dtypes("number"):
        wrong = pd.Series(np.isinf(tables.rows[column]), tables.rows.index)
        yield from _rows(tables, wrong, ("infinite", expected, ""), str(column))
    covariance = pd.DataFrame() if tables.covariance is None else tables.covariance
    for column in covariance.select_dtypes("number"):
        if np.isinf(covariance[column]).any():
            where = f"{tables.condition.covariance}, column {column}"
            yield "infinite", where, expected, "an infinite one"


def _phase_unit(_: Entry, tables: ConditionTables) -> Iterator[Found]:
    """Find phases as fractions of the cycle, which all look like its very beginning."""
    told = tables.rows[tables.rows["onset_gait_pct"].notna()]
    places = told["timing_point"].nunique()
    low, high = told["onset_gait_pct"].min(), told["onset_gait_pct"].max()
    if places >= _FEWEST_PLACES and high <= 1.0:
        where = f"{tables.condition.estimates}, column onset_gait_pct"
        found = f"{low:g} to {high:g} at {places} timing points: fractions of the cycle?"
        yield "phase_range", where, "% of the gait cycle, 0 to 100", found


def _phase(_: Entry, tables: ConditionTables) -> Iterator[Found]:
    """Ask of a value in gait where in the cycle it is."""
    if tables.condition.activity not in ("walking", "running"):
        return
    values = tables.rows
    needs = values["status"].isin(STANDING) & (values["timing_point"] != ALL_POINTS)
    told = ("phase_missing", "% of the gait cycle", "none")
    yield from _rows(tables, needs & values["onset_gait_pct"].isna(), told, "onset_gait_pct")


def _people(spec: Entry, tables: ConditionTables) -> Iterator[Found]:
    values = tables.rows
    told = ("participant_unknown", "somebody of [[participants]]", "")
    wrong = ~values["participant"].isin([person.id for person in spec.participants])
    yield from _rows(tables, wrong, told, "participant")
    masses = {person.id for person in spec.participants if person.mass_kg is not None}
    per_kg = values["parameter"].isin(_PER_MASS) & values["status"].isin(STANDING)
    told = ("mass_missing", "mass_kg of the participant, for a value per kg", "none")
    yield from _rows(tables, per_kg & ~values["participant"].isin(masses), told, "participant")
    keys = ["participant", "session", "side", "timing_point", "parameter", "method"]
    told = (
        "row_twice",
        "one row a participant, session, side, timing point, parameter and method",
        "a second",
    )
    yield from _rows(tables, values.duplicated(keys), told, "parameter")


def _intervals(_: Entry, tables: ConditionTables) -> Iterator[Found]:
    values = tables.rows
    stands = values["status"].isin(STANDING) & values["value"].notna()
    low, value, high = values["ci_low"], values["value"], values["ci_high"]
    ends = pd.Series(np.isfinite(low) & np.isfinite(high), low.index)
    if stands.any() and not (stands & ends).any():
        expected = 'intervals, or values = "printed" in entry.toml'
        found = "no interval at all: printed values?"
        yield (
            "printed_as_estimates",
            f"{tables.condition.estimates}, column ci_low",
            expected,
            found,
        )
        return
    told = ("interval_missing", "both ends of the interval", "none")
    yield from _rows(tables, stands & ~ends, told, "ci_low")
    slack = _ROUNDING * value.abs()
    outside = (low > value + slack) | (high < value - slack)
    told = ("interval", "an interval that holds its value", "")
    yield from _rows(tables, stands & ends & outside, told, "value")
    level = (values["ci_level"] - _LEVEL).abs() <= _ROUNDING
    yield from _rows(tables, stands & ~level, ("ci_level", f"{_LEVEL:g}", ""), "ci_level")


def _pulses(_: Entry, tables: ConditionTables) -> Iterator[Found]:
    values = tables.rows
    stands = values["status"].isin(STANDING)
    told = ("n_used", "at least one pulse behind a value", "")
    yield from _rows(tables, stands & ~(values["n_used"] >= 1), told, "n_used")
    for column in ("n_used", "n_excluded"):
        count = values[column]
        wrong = count.notna() & ((count < 0) | (count % 1 != 0))
        yield from _rows(tables, wrong, ("count", "a whole number of pulses", ""), column)


def _method(spec: Entry, tables: ConditionTables) -> Iterator[Found]:
    values = tables.rows
    told = ("method_missing", "the method of each value", "none")
    stands = values["status"].isin(STANDING)
    yield from _rows(tables, stands & (values["method"] == ""), told, "method")
    if spec.method.name not in set(values["method"]):
        found = ", ".join(sorted({str(m) for m in values["method"]} - {""})) or "none"
        expected = f"{found}, as {tables.condition.estimates} has it"
        yield "method_differs", "method.name", expected, repr(spec.method.name)


def _sizes(spec: Entry, tables: ConditionTables) -> Iterator[Found]:
    """Compare medians with what joints have: signs, units, and the joint itself."""
    ranges = MEDIAN_RANGES.get(spec.joint.name, {})
    masses = [person.mass_kg for person in spec.participants if person.mass_kg is not None]
    mass_kg = float(np.median(masses)) if masses else None
    held = standing(tables.rows)
    for parameter, group in held.groupby("parameter", sort=True):
        median, name = float(group["value"].median()), str(parameter)
        where = f"{tables.condition.estimates}, {name}"
        if median < 0:
            found = f"{median:.4g}: is torque that on the device, or an angle turned?"
            yield "sign", where, "a median above zero", found
        elif name in ranges and not ranges[name][0] <= median <= ranges[name][1]:
            low, high = ranges[name]
            expected = f"a median of {low:g} to {high:g} {PARAMETER_UNITS[name]} for a "
            found = f"{median:.4g}{_guess(median, (low, high), mass_kg)}"
            yield "out_of_range", where, expected + spec.joint.name, found


def _guess(median: float, limits: tuple[float, float], mass_kg: float | None) -> str:
    """Say which slips would explain a median out of its range."""
    slips = {"N*m/deg for N*m/rad": _DEGREES, "degrees taken twice": 1 / _DEGREES}
    if mass_kg is not None:
        slips |= {"a value per kg for a whole one": mass_kg, "a whole one for per kg": 1 / mass_kg}
    named = [slip for slip, factor in slips.items() if limits[0] <= median * factor <= limits[1]]
    return f" ({' or '.join(named)}? another joint?)" if named else " (another joint or unit?)"


def _people_alike(_: Entry, tables: ConditionTables) -> Iterator[Found]:
    """Compare people with each other: some may be in another unit than the rest."""
    held = standing(tables.rows[tables.rows["status"] == "ok"])
    typical = held.groupby(["parameter", "timing_point"])["value"].transform("median")
    ratio = (held["value"] / typical.where(typical > 0)).dropna()
    ratio = ratio.groupby([held["parameter"], held["participant"]]).median()
    for parameter, people in ratio[~ratio.between(1 / _MOST_APART, _MOST_APART)].groupby(level=0):
        told = zip(people.index.get_level_values(1), people.tolist(), strict=True)
        shown = ", ".join(f"{who} {factor:.3g}" for who, factor in list(told)[:3])
        more = f" and {len(people) - 3} more" if len(people) > 3 else ""
        where = f"{tables.condition.estimates}, {parameter}"
        expected = f"people within a factor of {_MOST_APART:g} of the median"
        found = f"{shown}{more} times it: per kg, per degree or a sign among others?"
        yield "people_differ", where, expected, found


def _per_mass(spec: Entry, tables: ConditionTables) -> Iterator[Found]:
    """Compare values per kg with whole ones and the mass."""
    keys = ["participant", "session", "side", "timing_point", "method"]
    held = standing(tables.rows)
    masses = {person.id: person.mass_kg for person in spec.participants}
    for per_kg, whole in _PER_MASS.items():
        pair = held[held["parameter"] == per_kg].merge(held[held["parameter"] == whole], on=keys)
        mass = pair["participant"].map(masses).astype(float)
        ratio = pair["value_x"] * mass / pair["value_y"].where(pair["value_y"] != 0)
        wrong = (ratio - 1).abs() > _MASS_ROUNDING
        if wrong.any():
            first = pair[wrong].iloc[0]
            who = f"{first['participant']} {first['timing_point']}, and {wrong.sum() - 1} more"
            found = f"{ratio[wrong].iloc[0]:.4g} times that ({who})"
            where = f"{tables.condition.estimates}, {per_kg}"
            yield "per_mass", where, f"{whole} over mass_kg", found


def _printed(_: Entry, tables: ConditionTables) -> Iterator[Found]:
    values = tables.rows
    kinds = ("mean", "individual")
    told = ("statistic_unknown", f"one of {', '.join(kinds)}", "")
    yield from _rows(tables, ~values["statistic"].isin(kinds), told, "statistic")
    is_mean = values["statistic"] == "mean"
    told = ("n_missing", "how many people the mean is over", "none")
    yield from _rows(tables, is_mean & ~(values["n"] >= 1), told, "n")
    told = ("count", "a whole number of people", "")
    yield from _rows(tables, values["n"].notna() & (values["n"] % 1 != 0), told, "n")
    told = ("participant_missing", "whose value it is", "nobody")
    alone = (values["statistic"] == "individual") & (values["participant"] == "")
    yield from _rows(tables, alone, told, "participant")
    told = ("sd", "a standard deviation, or nothing", "")
    yield from _rows(tables, values["sd"] < 0, told, "sd")
    told = ("source_missing", "where it is printed: table, section or figure", "none")
    yield from _rows(tables, values["source"] == "", told, "source")


_OF_ALL: tuple[Check, ...] = (
    _labels, _stated_units, _finite, _values, _phase_unit, _sizes, _people_alike,
)  # fmt: skip
_OF_ESTIMATES: tuple[Check, ...] = (_phase, _people, _intervals, _pulses, _method, _per_mass)
_OF_PRINTED: tuple[Check, ...] = (_printed,)
