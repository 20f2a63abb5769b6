"""Sources of a comparison: results folders and the published tables."""

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.channels import PARAMETER_UNITS
from jointz.core.codes import Failure
from jointz.core.errors import DataError
from jointz.core.gait_phases import ALL_POINTS, circular_mean_pct
from jointz.core.method_names import PRESENT_NAMES, present_settings
from jointz.core.study import FilesSpec
from jointz.io.formats.columns import RawTable, file_sha256
from jointz.io.formats.registry import list_columns, read_table
from jointz.io.relative_paths import distinct_names
from jointz.io.small_files import LARGEST_RESULTS, read_json
from jointz.reference.chapter4 import NUMERICALLY_ZERO, participant_table
from jointz.report.wording import PER_MASS
from jointz.results.estimates import CellEstimate
from jointz.results.log_posterior import LogPosterior
from jointz.results.statistics.comparison_rows import PersonValue, Source
from jointz.results.study_analysis import PopulationEstimate
from jointz.stats.people_likelihoods import PeopleResults
from jointz.stats.population import population_means

#: Word for the dissertation's tables 4.1 to 4.3, instead of a results folder.
PUBLISHED = "published"
_ESTIMATES, _PROVENANCE = "estimates.csv", "provenance.json"
#: Holds everybody's estimates with their errors.
ANALYSIS_FILE = "analysis.json"
_NUMBERS = ("onset_gait_pct", "value", "ci_low", "ci_high")
_UNIT = ("session", "side")
_LABELS = ("participant", "timing_point", "parameter", "unit", "method", "status")
_AVAILABLE = ("ok", "at_bound")
_MASSLESS = (Failure.MASS_MISSING.status, Failure.MASS_UNLIKELY.status, "absent")
#: No value of a joint is larger in SI units; squares of larger numbers would overflow.
_LARGEST = 1e100
_AGAIN = "Run jointz analyze again."


@dataclass(frozen=True)
class Results:
    """One source of a comparison with all its estimates."""

    source: Source  # name and people
    # (parameter, timing point, participant) -> value
    values: Mapping[tuple[str, str, str], PersonValue]
    # timing point -> % of the gait cycle, if known
    onsets_pct: Mapping[str, float] = field(default_factory=dict)
    joint: str = ""  # "" if unknown
    recordings: str = ""  # hash of ``study.toml``; "" if unknown
    version: str = ""  # version of jointz that made the results; "" if unknown
    settings: Mapping[str, Any] = field(default_factory=dict)  # of the analysis
    inputs: tuple[Mapping[str, Any], ...] = ()  # files that were read, with their hashes
    # participants with several sessions or sides, whose values are means over them
    averaged: tuple[str, ...] = ()
    # everybody's estimates with their errors; None where the folder does not hold them
    people: PeopleResults | None = None
    # (timing point, parameter) -> mean over people, as ``population.csv`` has it
    population: Mapping[tuple[str, str], PopulationEstimate] = field(default_factory=dict)

    @cached_property
    def points(self) -> tuple[str, ...]:
        """Timing points in the order of the gait cycle, else of the rows; without ``all``."""
        points = list(dict.fromkeys(point for _, point, _ in self.values if point != ALL_POINTS))
        if all(point in self.onsets_pct for point in points):
            points.sort(key=self.onsets_pct.__getitem__)
        return tuple(points)

    @cached_property
    def per_mass(self) -> bool:
        """Whether any body mass is known, even if the values are missing."""
        return any(
            v.status not in _MASSLESS for (parameter, _, _), v in self.values.items()
            if parameter in PER_MASS
        )  # fmt: skip

    @cached_property
    def shares_inertia(self) -> bool:
        """Whether an inertia is shared by all timing points."""
        return any(cell[:2] == ("inertia", ALL_POINTS) for cell in self.values)

    def value(self, parameter: str, point: str, person: str) -> PersonValue:
        """Return a value, with the status ``absent`` if there is no row."""
        name = self.source.name
        none = PersonValue(name, person, parameter, point, None, status="absent")
        return self.values.get((parameter, point, person), none)

    def shared_inertia(self, person: str) -> PersonValue:
        """Return a participant's inertia of all timing points, else the mean over them."""
        shared = self.value("inertia", ALL_POINTS, person)
        if shared.status != "absent":
            return shared
        rows = [self.value("inertia", point, person) for point in self.points]
        known = [row for row in rows if row.value is not None]
        if not known:
            return replace(shared, status=rows[0].status if rows else "absent")
        return replace(
            shared,
            value=float(np.mean([row.value for row in known])),
            status="mean_over_points",
            n_points=len(known),
            n_lacking=len(rows) - len(known),
            n_bounded=sum(row.at_bound for row in known),
        )


def read_sources(sources: Sequence[str | os.PathLike[str]]) -> tuple[Results, ...]:
    """Read all sources of a comparison."""
    paths = result_paths(sources)
    repeated = [p for p, n in Counter(p and p.resolve() for p in paths).items() if n > 1]
    if repeated:
        raise DataError(f"{repeated[0] or PUBLISHED}: given twice. Name each source once.")
    read = tuple(
        published_results() if path is None else read_results(path, name)
        for path, name in zip(paths, _names(paths), strict=True)
    )
    joints = {results.joint for results in read if results.joint}
    if len(joints) > 1:
        raise DataError(
            "compare: expected one joint, found "
            + ", ".join(f"{r.joint} in {r.source.name}" for r in read)
            + ". Impedances of different joints cannot be compared."
        )
    return read


def result_paths(sources: Sequence[str | os.PathLike[str]]) -> list[Path | None]:
    """Return the folders of the sources, None for the published tables."""
    paths = [None if isinstance(s, str) and s == PUBLISHED else Path(s) for s in sources]
    if None in paths and Path(PUBLISHED).is_dir():
        raise DataError(
            f"{PUBLISHED}: is both a folder here and the word for the dissertation's tables. Write "
            f"./{PUBLISHED} for the folder; for the tables, call jointz from another folder."
        )
    return paths


def _names(paths: Sequence[Path | None]) -> list[str]:
    """Name folders by the shortest distinct ends of their paths, never ``published``."""
    names = iter(distinct_names([path for path in paths if path is not None], taken=PUBLISHED))
    return [PUBLISHED if path is None else next(names) for path in paths]


def published_results() -> Results:
    """Return tables 4.1 to 4.3 of the dissertation as results."""
    table = participant_table()
    values = {
        (parameter, str(row["timing_point"]), str(row["participant"])): PersonValue(
            PUBLISHED,
            str(row["participant"]),
            parameter,
            str(row["timing_point"]),
            float(row[parameter]),
            status="at_bound" if row[parameter] < NUMERICALLY_ZERO else "ok",
        )
        for row in table.to_dict("records")
        for parameter in (*PER_MASS, "inertia")
    }
    onsets = {str(point): float(pct) for point, pct in
              zip(table["timing_point"], table["onset_gait_pct"], strict=True)}  # fmt: skip
    people = tuple(dict.fromkeys(map(str, table["participant"])))
    source = Source(PUBLISHED, people, ("dissertation",), published=True)
    return Results(source, values, onsets, joint="knee")


def read_results(folder: Path, name: str) -> Results:
    """Read a results folder of ``jointz analyze``."""
    provenance = _provenance(folder)
    joint = _joint(provenance, folder)
    file = folder / _ESTIMATES
    units = [n for n in _UNIT if n in (list_columns(file, FilesSpec()) or ())]
    labels = (*_LABELS, *units)
    table = read_table(file, numeric=_NUMBERS, labels=labels, files=FilesSpec(), as_written=True)
    values, averaged = _values(table, file, name)
    people = tuple(dict.fromkeys(str(p) for p in table.columns["participant"]))
    written = dict.fromkeys(map(str, table.columns["method"]))
    methods = tuple(dict.fromkeys(PRESENT_NAMES.get(m, m) for m in written))
    inputs = tuple(
        {"file": f"{name}/{used}", "sha256": file_sha256(folder / used)}
        for used in (_ESTIMATES, _PROVENANCE, ANALYSIS_FILE)
        if (folder / used).is_file()
    )
    people_results, means = _analysed(folder, provenance, values, table)
    return Results(
        Source(name, people, methods),
        values,
        _onsets(table),
        joint=joint,
        recordings=str(provenance.get("study_sha256", "")),
        version=str(provenance.get("jointz", "")),
        settings=present_settings(provenance.get("settings", {}), written),
        inputs=inputs,
        averaged=averaged,
        people=people_results,
        population={(row.timing_point, row.parameter): row for row in means},
    )


def _analysed(
    folder: Path,
    provenance: Mapping[str, Any],
    values: Mapping[tuple[str, str, str], PersonValue],
    estimates: RawTable,
) -> tuple[PeopleResults | None, Sequence[PopulationEstimate]]:
    """Return everybody's estimates with their errors, if the folder holds them, and the means."""
    file = folder / ANALYSIS_FILE
    if not file.is_file():
        return None, ()
    content = read_json(file, _AGAIN, largest=LARGEST_RESULTS)
    try:
        posteriors = [LogPosterior.from_dict(p) for p in content.get("log_posteriors", ())]
        cells = [CellEstimate.from_dict(cell) for cell in content["cells"]]
        means: Sequence[PopulationEstimate] = [
            PopulationEstimate(**row) for row in content.get("population", ())
        ]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as exc:
        raise DataError(
            f"{file}: cannot be read ({str(exc)[:200]}). {_AGAIN}", path=str(file)
        ) from exc
    _check_agreement(file, cells, estimates)
    doubted = {
        person for (name, _, person), v in values.items()
        if name in PER_MASS and v.status in _MASSLESS
    }  # fmt: skip
    masses = {p: mass for p, mass in _masses(folder, provenance).items() if p not in doubted}
    people = PeopleResults(posteriors, cells, masses)
    means = means or population_means(cells, posteriors, masses)
    return (people if people.have_errors else None), means


def _check_agreement(file: Path, cells: Sequence[CellEstimate], table: RawTable) -> None:
    """Refuse an analysis that is not the one of the estimates beside it."""
    columns = {key: table.columns[key].tolist() for key in table.columns}
    keys = [key for key in ("participant", "timing_point", "parameter", *_UNIT) if key in columns]
    rows = zip(*(columns[key] for key in keys), strict=True)
    written = dict(zip(rows, map(_number, columns["value"]), strict=True))
    analysed = {
        tuple(str(row[key]) for key in keys): row["value"] for cell in cells for row in cell.rows()
    }
    alike = written.keys() == analysed.keys() and all(
        (a is None) == (b is None) and (a is None or b is None or bool(np.isclose(a, b, rtol=1e-6)))
        for a, b in ((written[key], analysed[key]) for key in written)
    )
    if not alike:
        raise DataError(
            f"{file}: does not agree with {_ESTIMATES} beside it: another analysis, or one of both "
            f"was edited. {_AGAIN}",
            path=str(file),
        )


def _masses(folder: Path, provenance: Mapping[str, Any]) -> dict[str, float]:
    """Return the stated body masses, kg."""
    file = folder / _PROVENANCE
    try:
        stated = {p["id"]: p.get("mass_kg") for p in provenance["study"].get("participants", ())}
        masses = {str(person): float(mass) for person, mass in stated.items() if mass is not None}
    except (TypeError, KeyError, ValueError, AttributeError) as exc:
        raise DataError(
            f"{file}: participants cannot be read ({exc}). {_AGAIN}", path=str(file)
        ) from exc
    if wrong := [p for p, mass in masses.items() if not (np.isfinite(mass) and mass > 0.0)]:
        text = f"expected masses above 0 kg, got others for {', '.join(wrong)}"
        raise DataError(f"{file}: {text}. {_AGAIN}", path=str(file))
    return masses


def _provenance(folder: Path) -> dict[str, Any]:
    for name in (_ESTIMATES, _PROVENANCE):
        if not (folder / name).is_file():
            problem = "does not exist" if not folder.exists() else f"contains no {name}"
            raise DataError(
                f"{folder}: {problem}. Expected a results folder of jointz analyze, or the word "
                f"'{PUBLISHED}' for the dissertation's tables."
            )
    return read_json(folder / _PROVENANCE, _AGAIN)


def _joint(provenance: Mapping[str, Any], folder: Path) -> str:
    """Return the joint of a walking study."""
    study, settings = provenance.get("study"), provenance.get("settings", {})
    kind, joint = (study.get(k) if isinstance(study, dict) else None for k in ("kind", "joint"))
    is_stated = all(isinstance(text, str) and text for text in (kind, joint))
    if not is_stated or not isinstance(settings, dict):
        raise DataError(
            f"{folder / _PROVENANCE}: expected study with kind and joint, and settings, as jointz "
            f"analyze writes them; found study {study!r:.60}, settings {settings!r:.60}. {_AGAIN}",
            path=str(folder / _PROVENANCE),
        )
    if kind == "bench":
        raise DataError(
            f"{folder}: results of a bench study. Its participants are loads, and a mean over "
            "different loads is meaningless. Compare results of walking studies."
        )
    return str(joint)


def _values(
    table: RawTable, file: Path, name: str
) -> tuple[dict[tuple[str, str, str], PersonValue], tuple[str, ...]]:
    """Return one value for each person, and the people with several sessions or sides."""
    values: dict[tuple[str, str, str], dict[tuple[str, ...], PersonValue]] = {}
    columns = {key: column.tolist() for key, column in table.columns.items()}
    for i, parameter in enumerate(columns["parameter"]):
        row = {key: column[i] for key, column in columns.items()}
        place = (parameter, row["timing_point"], row["participant"])
        unit = tuple(row[key] for key in _UNIT if key in row)
        line = table.first_row + i
        if unit in values.get(place, ()):
            todo = "Each estimate has one row; run jointz analyze again."
            raise _row_error(file, line, f"a second {' of '.join(place)}. {todo}")
        if PARAMETER_UNITS.get(parameter) != row["unit"]:
            expected = f"expected {parameter} in {PARAMETER_UNITS.get(parameter)}"
            text = f"{expected}, found {row['unit']}. Values in different units cannot be compared."
            raise _row_error(file, line, text)
        values.setdefault(place, {})[unit] = _value(row, name, file, line)
    averaged = dict.fromkeys(person for (_, _, person), v in values.items() if len(v) > 1)
    means = {place: _person_mean([*by_unit.values()]) for place, by_unit in values.items()}
    return means, tuple(averaged)


def _person_mean(values: Sequence[PersonValue]) -> PersonValue:
    """Return the mean over a person's sessions and sides; their errors count as common."""
    undecided = [v for v in values if v.status == "undecided"]
    known = [v for v in values if v.value is not None]
    if len(values) == 1 or undecided or not known:
        return (undecided or values)[0]
    status = "ok" if any(v.status == "ok" for v in known) else known[0].status
    columns = ([getattr(v, key) for v in known] for key in ("value", "ci_low", "ci_high"))
    value, low, high = (None if None in column else float(np.mean(column)) for column in columns)
    return replace(known[0], value=value, ci_low=low, ci_high=high, status=status)


def _value(row: Mapping[str, Any], name: str, file: Path, line: int) -> PersonValue:
    available = row["status"] in _AVAILABLE
    number = _number(row["value"])
    if available == (number is None):
        value = "no value" if number is None else "a value"
        raise _row_error(file, line, f"status {row['status']!r} with {value}. {_AGAIN}")
    low, high = _number(row["ci_low"]), _number(row["ci_high"])
    if max(abs(x or 0.0) for x in (number, low, high)) > _LARGEST:
        estimate = "{parameter} {value:g} [{ci_low:g}, {ci_high:g}]".format(**row)
        todo = "Correct it, or run jointz analyze again."
        raise _row_error(file, line, f"{estimate} is not a possible value of a joint. {todo}")
    place = (row["participant"], row["parameter"], row["timing_point"])
    return PersonValue(name, *place, number, low, high, row["status"])


def _row_error(file: Path, line: int, text: str) -> DataError:
    return DataError(f"{file}, row {line}: {text}", path=str(file), row=line)


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _onsets(table: RawTable) -> dict[str, float]:
    points, onsets = table.columns["timing_point"], table.columns["onset_gait_pct"]
    means = {}
    for point in dict.fromkeys(points.tolist()):
        known = onsets[(points == point) & np.isfinite(onsets)]
        if point != ALL_POINTS and known.size:
            means[str(point)] = circular_mean_pct(known)
    return means
