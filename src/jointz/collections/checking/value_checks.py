"""Checks of a condition's tables of values."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pandas as pd

from jointz.collections.catalog_query import STANDING
from jointz.collections.checking.covariance_checks import covariance_violations
from jointz.collections.checking.entry_checks import PARAMETERS, Violation
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
#: So many timing points are not all within the first hundredth of the cycle.
_FEWEST_POINTS = 3
_CELL = ["participant", "session", "side", "timing_point", "method"]


@dataclass(frozen=True, slots=True)
class RowCheck:
    """A check of every row: all rows that fail make one finding."""

    code: str
    column: str  # column of the cell that the finding names and shows
    expected: str
    # which rows fail, given the columns of :func:`_described`
    fails: Callable[[pd.DataFrame], pd.Series]
    found: str = ""  # shown instead of the cell

    def __call__(self, spec: Entry, tables: ConditionTables) -> Iterator[Violation]:
        """Yield the finding, if there is one."""
        del spec
        failing = np.flatnonzero(self.fails(tables.rows))
        if not failing.size:
            return
        row = tables.rows.iloc[failing[0]]
        shown = self.found or _cell_text(row[self.column])
        others = f", and {len(failing) - 1} more rows" if len(failing) > 1 else ""
        file, number = tables.condition.estimates, tables.first_row + failing[0]
        where = f"{file}, row {number}, column {self.column}"
        cell = f"{shown} ({row['participant']} {row['timing_point']}{others})"
        yield self.code, where, self.expected, cell


Check = Callable[[Entry, ConditionTables], Iterator[Violation]]


def value_violations(spec: Entry, tables: ConditionTables) -> Iterator[Violation]:
    """Yield what is wrong with the values of a condition."""
    if tables.rows.empty:
        yield "no_values", tables.condition.estimates, "at least one row", "none"
        return
    described = replace(tables, rows=_described(spec, tables))
    for check in _CHECKS + (_PRINTED_CHECKS if spec.kind == "printed" else _ESTIMATE_CHECKS):
        yield from check(spec, described)
    if tables.covariance is not None:
        yield from covariance_violations(tables, spec.method.name)


def _described(spec: Entry, tables: ConditionTables) -> pd.DataFrame:
    """Return the rows, and what the checks ask of them in columns of true and false."""
    rows, masses = tables.rows, {person.id: person.mass_kg for person in spec.participants}
    value, slack = rows["value"], _ROUNDING * rows["value"].abs()
    low, high = (rows.get(end, pd.Series(np.nan, rows.index)) for end in ("ci_low", "ci_high"))
    return rows.assign(
        stands=rows["status"].isin(STANDING),
        finite=np.isfinite(value),
        is_known=rows["parameter"].isin(PARAMETERS),
        has_unit=rows["parameter"].isin(spec.units),
        in_gait=tables.condition.activity in ("walking", "running"),
        has_phase=rows["onset_gait_pct"].notna(),
        is_participant=rows["participant"].isin(masses),
        has_mass=rows["participant"].map(masses).notna(),
        has_interval=np.isfinite(low) & np.isfinite(high),
        outside=(low > value + slack) | (high < value - slack),
    )


def _standing(values: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with a value to use."""
    rows: pd.DataFrame = values[values["status"].isin(STANDING) & np.isfinite(values["value"])]
    return rows


def _cell_text(value: object) -> str:
    """Return a cell as its file may have it."""
    if isinstance(value, float):
        return "nothing" if np.isnan(value) else f"{value:.6g}"
    return repr(value)


def _is_infinite(column: str, values: pd.DataFrame) -> pd.Series:
    mask: pd.Series = np.isinf(values[column])
    return mask


def _infinite(spec: Entry, tables: ConditionTables) -> Iterator[Violation]:
    expected = "a finite number, or nothing"
    for name in map(str, tables.rows.select_dtypes("number")):
        check = RowCheck("infinite", name, expected, partial(_is_infinite, name))
        yield from check(spec, tables)
    covariance = pd.DataFrame() if tables.covariance is None else tables.covariance
    for column in covariance.select_dtypes("number"):
        if np.isinf(covariance[column]).any():
            where = f"{tables.condition.covariance}, column {column}"
            yield "infinite", where, expected, "an infinite one"


def _phase_unit(_: Entry, tables: ConditionTables) -> Iterator[Violation]:
    """Find phases that were written as fractions of the cycle: all are 1 or less."""
    rows = tables.rows[tables.rows["onset_gait_pct"].notna()]
    n_points = rows["timing_point"].nunique()
    low, high = rows["onset_gait_pct"].min(), rows["onset_gait_pct"].max()
    if n_points >= _FEWEST_POINTS and high <= 1.0:
        where = f"{tables.condition.estimates}, column onset_gait_pct"
        found = f"{low:g} to {high:g} at {n_points} timing points: fractions of the cycle?"
        yield "phase_range", where, "% of the gait cycle, 0 to 100", found


def _intervals(spec: Entry, tables: ConditionTables) -> Iterator[Violation]:
    stands = tables.rows["stands"] & tables.rows["value"].notna()
    if stands.any() and not (stands & tables.rows["has_interval"]).any():
        where = f"{tables.condition.estimates}, column ci_low"
        expected = 'intervals, or values = "printed" in entry.toml'
        yield "printed_as_estimates", where, expected, "no interval at all: printed values?"
        return
    for check in _INTERVAL_CHECKS:
        yield from check(spec, tables)


def _method_differs(spec: Entry, tables: ConditionTables) -> Iterator[Violation]:
    methods = set(tables.rows["method"])
    if spec.method.name not in methods:
        names = ", ".join(sorted({str(method) for method in methods} - {""})) or "none"
        expected = f"{names}, as in {tables.condition.estimates}"
        yield "method_differs", "method.name", expected, repr(spec.method.name)


def _per_mass(spec: Entry, tables: ConditionTables) -> Iterator[Violation]:
    """Compare values per kg with whole ones and the mass."""
    rows = _standing(tables.rows)
    masses = {person.id: person.mass_kg for person in spec.participants}
    for per_kg, whole in _PER_MASS.items():
        pair = rows[rows["parameter"] == per_kg].merge(rows[rows["parameter"] == whole], on=_CELL)
        mass = pair["participant"].map(masses).astype(float)
        ratio = pair["value_x"] * mass / pair["value_y"].where(pair["value_y"] != 0)
        wrong = (ratio - 1).abs() > _MASS_ROUNDING
        if wrong.any():
            first = pair[wrong].iloc[0]
            who = f"{first['participant']} {first['timing_point']}, and {wrong.sum() - 1} more"
            found = f"{ratio[wrong].iloc[0]:.4g} times that ({who})"
            where = f"{tables.condition.estimates}, {per_kg}"
            yield "per_mass", where, f"{whole} over mass_kg", found


# --- the checks, in the order of their findings --------------------------------------------------


def _unit_check(name: str) -> RowCheck:
    unit = PARAMETER_UNITS[name]
    wrong = f"{name} in {unit}"
    return RowCheck("unit", "unit", wrong, lambda v: (v.parameter == name) & (v.unit != unit))


def _count_check(name: str, expected: str) -> RowCheck:
    def fails(v: pd.DataFrame) -> pd.Series:
        return v[name].notna() & ((v[name] < 0) | (v[name] % 1 != 0))

    return RowCheck("count", name, expected, fails)


_CHECKS: tuple[Check, ...] = (
    RowCheck("parameter_unknown", "parameter", f"one of {', '.join(PARAMETERS)}",
             lambda v: ~v.is_known),
    *map(_unit_check, PARAMETERS),
    RowCheck("status_unknown", "status", "ok, at_bound, undecided or failed:CODE",
             lambda v: ~v.status.isin(_STATUS)),
    RowCheck("timing_point_missing", "timing_point",
             "a timing point, or a name of the place outside gait", lambda v: v.timing_point == ""),
    RowCheck("unit_missing", "parameter", "a unit under units in entry.toml for each parameter",
             lambda v: v.is_known & ~v.has_unit),
    _infinite,
    RowCheck("status_value", "value", "a value, because of its status",
             lambda v: v.stands & ~v.finite),
    RowCheck("status_value", "value", "no value, because of its status",
             lambda v: ~v.stands & v.value.notna()),
    RowCheck("phase_range", "onset_gait_pct", "0 to 100 % of the gait cycle",
             lambda v: v.has_phase & ~v.onset_gait_pct.between(0.0, 100.0)),
    _phase_unit,
)  # fmt: skip
_INTERVAL_CHECKS: tuple[Check, ...] = (
    RowCheck("interval_missing", "ci_low", "both ends of the interval",
             lambda v: v.stands & v.value.notna() & ~v.has_interval, "none"),
    RowCheck("interval", "value", "an interval that contains its value",
             lambda v: v.stands & v.has_interval & v.outside),
    RowCheck("ci_level", "ci_level", f"{_LEVEL:g}",
             lambda v: v.stands & v.value.notna() & ~((v.ci_level - _LEVEL).abs() <= _ROUNDING)),
)  # fmt: skip
_ESTIMATE_CHECKS: tuple[Check, ...] = (
    RowCheck("phase_missing", "onset_gait_pct", "% of the gait cycle",
             lambda v: v.in_gait & v.stands & (v.timing_point != ALL_POINTS) & ~v.has_phase,
             "none"),
    RowCheck("participant_unknown", "participant", "a participant of entry.toml",
             lambda v: ~v.is_participant),
    RowCheck("mass_missing", "participant", "mass_kg of the participant, for a value per kg",
             lambda v: v.stands & v.parameter.isin(_PER_MASS) & ~v.has_mass, "none"),
    RowCheck("row_twice", "parameter",
             "one row a participant, session, side, timing point, parameter and method",
             lambda v: v.duplicated([*_CELL, "parameter"]), "a second"),
    _intervals,
    RowCheck("n_used", "n_used", "at least one pulse behind a value",
             lambda v: v.stands & ~(v.n_used >= 1)),
    _count_check("n_used", "a whole number of pulses"),
    _count_check("n_excluded", "a whole number of pulses"),
    RowCheck("method_missing", "method", "the method of each value",
             lambda v: v.stands & (v.method == ""), "none"),
    _method_differs,
    _per_mass,
)  # fmt: skip
_PRINTED_CHECKS: tuple[Check, ...] = (
    RowCheck("statistic_unknown", "statistic", "one of mean, individual",
             lambda v: ~v.statistic.isin(["mean", "individual"])),
    RowCheck("n_missing", "n", "the number of people of a mean",
             lambda v: (v.statistic == "mean") & ~(v.n >= 1), "none"),
    RowCheck("count", "n", "a whole number of people", lambda v: v.n.notna() & (v.n % 1 != 0)),
    RowCheck("participant_missing", "participant", "the participant of an individual value",
             lambda v: (v.statistic == "individual") & (v.participant == ""), "nobody"),
    RowCheck("sd", "sd", "a standard deviation, or nothing", lambda v: v.sd < 0),
    RowCheck("source_missing", "source", "where it is printed: table, section or figure",
             lambda v: v.source == "", "none"),
)  # fmt: skip
