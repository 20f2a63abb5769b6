"""Pools results folders over studies and conditions, and writes tables and a page."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
from scipy.special import ndtri, stdtrit

from jointz.core.codes import Failure, NotPooled
from jointz.core.errors import DataError, OutputError, StudyError, install_advice
from jointz.core.gait_phases import ALL_POINTS, circular_mean_pct, phase_difference
from jointz.core.provenance import now, software
from jointz.io.formats.columns import file_sha256
from jointz.io.new_folder import MARKER, POOL, check_free, new_folder, write_marker
from jointz.io.relative_paths import distinct_names
from jointz.kernels.statistics.between_study_variance import random_effects
from jointz.pooling.conditions import CONDITION_COLUMNS, Condition, read_conditions
from jointz.pooling.page import draw_forests, render_pool
from jointz.pooling.plain_tables import typed_table
from jointz.pooling.pooled_result import COLUMNS, COUNTS, ONE_STUDY, UNDECIDED, PooledStudies
from jointz.pooling.results_folders import AVAILABLE, ResultsFolder, read_folder
from jointz.report.wording import ABSOLUTE, ALL_PARAMETERS, format_count
from jointz.results.base import plain
from jointz.results.estimates import FEWEST_PEOPLE

_FEWEST: Final = 2
#: Columns of a cell: rows that agree in them are pooled.
CELL: Final = ["parameter", "unit", *CONDITION_COLUMNS, "timing_point"]

Row = dict[str, Any]


def people_of(estimates: pd.DataFrame) -> pd.DataFrame:
    """Return one row a person and cell, with mean value and mean variance.

    The mean of a person's variances is the variance of a mean of fully correlated values, which is
    conservative. One undecided session or side makes the person undecided.
    """
    status, high, level = estimates["status"], estimates["ci_high"], estimates["ci_level"]
    is_available, at_bound = status.isin(AVAILABLE), status == "at_bound"
    half = (high - estimates["ci_low"]) / 2.0
    reach = half.where(~at_bound, high - estimates["value"])
    quantile = ndtri(np.where(at_bound, level, 0.5 + level / 2.0))
    rows = estimates.assign(
        value=estimates["value"].where(is_available),
        error=((reach / quantile) ** 2).where(is_available),
        has_value=is_available,
        at_bound=at_bound,
        undecided=status == "undecided",
    )
    how = {"value": "mean", "error": "mean", "gain_sd": "max", "ci_level": "first"}
    how |= dict.fromkeys(["has_value", "at_bound", "undecided"], "any")
    keys = [*CELL, "study", "participant"]
    people = rows.groupby(keys, sort=False, dropna=False).agg(how).reset_index()
    people["has_value"] &= ~people["undecided"]
    return people


def study_means(people: pd.DataFrame) -> Iterator[Row]:
    """Yield a row a study and cell, in the columns of ``studies.csv``."""
    keys = [*CELL, "study"]
    for key, group in people.groupby(keys, sort=False, dropna=False):
        used, without = group[group["has_value"]], group[~group["has_value"]]
        counts = {
            "n_people": len(used),
            "n_at_bound": int(used["at_bound"].sum()),
            "n_undecided": int(without["undecided"].sum()),
            "n_failed": int((~without["undecided"]).sum()),
        }
        yield dict(zip(keys, key, strict=True)) | counts | _mean(used)


def _mean(people: pd.DataFrame) -> Row:
    """Return the mean of a study and its standard error, or why there is none.

    Few people can look more alike than their own errors allow, and a study must not gain weight by
    that: the variance of a person is the larger one of that between people, which holds their own
    errors, and of these errors. What all people share, gains of the calibration, does not average
    out. Misleads for very few people, of whose variance little is known.
    """
    if people.empty:
        return {"status": NotPooled.NO_VALUE.value}
    n, value = len(people), float(people["value"].mean())
    if n < _FEWEST:
        return {"value": value, "status": NotPooled.ONE_PERSON.value}
    own, between = people["error"].fillna(0.0).mean(), people["value"].to_numpy().var(ddof=1)
    shared = float(people["gain_sd"].max()) * value
    if (se := float(np.hypot(np.sqrt(max(own, between) / n), shared))) == 0.0:
        return {"value": value, "status": NotPooled.NO_SPREAD.value}
    reach = float(stdtrit(n - 1, 0.5 + float(people["ci_level"].iloc[0]) / 2.0)) * se
    ends = {"ci_low": value - reach, "ci_high": value + reach}
    return {"value": value, "se": se, **ends, "status": "ok"}


#: Largest distance of timing points of one name, % of the gait cycle.
_SAME_POINT_PCT: Final = 2.0
_APART = "pool each side by itself"


def _distinct(folder: ResultsFolder, column: str) -> str:
    return " and ".join(f"{value}" for value in folder.estimates[column].drop_duplicates())


def _method(folder: ResultsFolder) -> str:
    """Describe the method, and the coupling of device and leg if it assumes one."""
    coupling = folder.settings.get("coupling")
    assumed = f"coupling {coupling}, " if coupling else ""
    baseline = folder.settings.get("baseline") or "its own"
    return f"{_distinct(folder, 'method')} ({assumed}baseline {baseline})"


def _estimand(folder: ResultsFolder) -> str:
    """Describe which K, B and J were estimated: over what time, and of the device or without."""
    window_s = folder.settings.get("window_s")
    time = "its own window" if window_s is None else f"the first {1e3 * window_s:g} ms"
    subtracted = [
        name for name in ABSOLUTE
        if any((one.get(f"intrinsic_{name}") or {}).get("value") for one in folder.calibrations)
    ]  # fmt: skip
    device = f"{', '.join(subtracted)} of the device subtracted" if subtracted else ""
    return f"mean over {time}, {device or 'device included'}"


#: What must be the same -> (how to read it, what to do where it is not).
_SAME: Final[Mapping[str, tuple[Callable[[ResultsFolder], str], str]]] = {
    "joint": (lambda f: str(f.study["joint"]), f"Impedances of joints differ: {_APART}"),
    "kind of study": (lambda f: str(f.study["kind"]), f"Walking is not a bench: {_APART}"),
    "positive direction": (
        lambda f: str(f.study["positive"]),
        "Write the same positive in each study.toml, with the channels' own positive where they "
        "differ, and run jointz analyze again",
    ),
    "method": (_method, "Run jointz analyze with one --method"),
    "estimand": (
        _estimand,
        "Use one window_s and the same kind of [calibration], and run jointz analyze again",
    ),
    "level of intervals (ci_level)": (
        lambda f: _distinct(f, "ci_level"),
        "Run jointz analyze again with this version",
    ),
}  # fmt: skip


def refusals(folders: Sequence[ResultsFolder], conditions: Sequence[Condition]) -> Iterator[str]:
    """Yield all reasons why folders cannot be pooled."""
    for what, (read, todo) in _SAME.items():
        yield from _difference(what, {f.name: read(f) for f in folders}, todo)
    units: dict[str, dict[str, str]] = {}
    for folder in folders:
        of_folder = folder.estimates[["parameter", "unit"]].drop_duplicates()
        for parameter, group in of_folder.groupby("parameter"):
            units.setdefault(str(parameter), {})[folder.name] = " and ".join(group["unit"])
    for parameter, by_folder in units.items():
        yield from _difference(f"unit of {parameter}", by_folder, "Run jointz analyze again")
    yield from _other_points(folders)
    yield from _repeats(folders, conditions)


def _difference(what: str, values: Mapping[str, str], todo: str) -> Iterator[str]:
    sides = {value: [n for n, v in values.items() if v == value] for value in values.values()}
    if len(sides) > 1:
        found = "; ".join(f"{value} in {', '.join(names)}" for value, names in sides.items())
        yield f"{what}: expected one, found {found}. {todo}."


def _other_points(folders: Sequence[ResultsFolder]) -> Iterator[str]:
    """Yield timing points of one name at different phases of the gait cycle."""
    phases: dict[str, dict[str, float]] = {}
    for folder in folders:
        known = folder.estimates.dropna(subset="onset_gait_pct")
        for point, onsets in known.groupby("timing_point", sort=False)["onset_gait_pct"]:
            phases.setdefault(str(point), {})[folder.name] = circular_mean_pct(onsets)
    for point, by_folder in phases.items():
        pairs = combinations(by_folder.values(), 2)
        if any(abs(phase_difference(a, b)) > _SAME_POINT_PCT for a, b in pairs):
            found = ", ".join(f"{pct:.1f} % in {name}" for name, pct in by_folder.items())
            yield (
                f"timing point {point}: expected onsets within {_SAME_POINT_PCT:g} % of the gait "
                f"cycle, found {found}. Name timing points by their phase, or {_APART}."
            )


def _repeats(folders: Sequence[ResultsFolder], conditions: Sequence[Condition]) -> Iterator[str]:
    """Yield folders that hold the same people's data twice."""
    for (a, of_a), (b, of_b) in combinations(zip(folders, conditions, strict=True), 2):
        both = f"{a.name} and {b.name}"
        study: Any = a.provenance.get("study_sha256")
        if a.sha256["estimates.csv"] == b.sha256["estimates.csv"]:
            yield f"{both}: estimates.csv is the same byte for byte. Name one of them."
        elif n_shared := len(a.recordings & b.recordings):
            shared = format_count(n_shared, "recording is", "recordings are")
            yield f"{both}: {shared} in both, whose people would count twice. Name one of them."
        elif study and study == b.provenance.get("study_sha256") and of_a.study != of_b.study:
            yield (
                f"{both}: analyses of the same study.toml, as the studies {of_a.study} and "
                f"{of_b.study}. Name one of them, or give both the same study in conditions.csv."
            )


PAGE: Final = "report.html"

_PathLike = str | os.PathLike[str]


def pool(
    results: Sequence[_PathLike],
    *,
    conditions: _PathLike | None = None,
    out: _PathLike | None = None,
    overwrite: bool = False,
) -> PooledStudies:
    """Pool results of several studies: one table, and means over studies.

    Parameters
    ----------
    results : sequence of path
        Results folders of ``jointz analyze``.
    conditions : path, optional
        Table with the columns ``results, study, condition, walking_speed_m_s, slope_deg, surface,
        group``, one row a folder. Without it every folder is a study of its own.
    out : path, optional
        Folder to write tables, figures and page to; needs the extra ``parquet``.
    overwrite : bool
        Replace a folder of pooled results that exists.

    Returns
    -------
    PooledStudies
        Random-effects means over studies at each timing point and condition.

    Raises
    ------
    StudyError
        If the studies cannot be pooled; a ``DataError`` with all reasons.
    OutputError
        If ``out`` exists or is one of the results folders.
    """
    paths = [Path(results)] if isinstance(results, str) else [Path(path) for path in results]
    if out is not None:
        check_out(Path(out), paths, overwrite=overwrite)
    conditions_file = None if conditions is None else Path(conditions)
    folders, of_folders = _read(paths, conditions_file)
    pooled = _pooled(folders, of_folders, conditions_file)
    if out is not None:
        write_pool(pooled, Path(out), overwrite=overwrite)
    return pooled


def check_out(out: Path, paths: Sequence[Path], *, overwrite: bool) -> None:
    """Raise unless pooled results can be written to ``out``."""
    try:
        import pyarrow  # noqa: F401 - is it installed?
    except ImportError as exc:
        raise DataError(
            "pool writes estimates.parquet with pyarrow, which is not installed. "
            f"{install_advice('parquet')}"
        ) from exc
    if any(out.resolve().is_relative_to(path.resolve()) for path in paths):
        raise OutputError(
            f"{out}: is one of the pooled folders, or inside one, which are kept. Name another "
            "folder."
        )
    check_free(out, marker=MARKER, overwrite=overwrite, made_by=POOL)


def _read(
    paths: Sequence[Path], conditions_file: Path | None
) -> tuple[list[ResultsFolder], list[Condition]]:
    """Read folders and conditions; raise DataError with all problems."""
    if not paths:
        raise DataError("pool: expected one or more results folders, got none. Name them.")
    places = [path.resolve() for path in paths]
    again = [path for k, path in enumerate(paths) if places[k] in places[:k]]
    problems = [f"{path}: named twice. Name each folder once." for path in again]
    paths = [path for k, path in enumerate(paths) if places[k] not in places[:k]]
    names = distinct_names(paths)
    conditions = [Condition(name) for name in names]
    if conditions_file is not None:
        conditions = read_conditions(conditions_file, paths, names, problems)
    read, of_read = [], []
    for path, name, condition in zip(paths, names, conditions, strict=True):
        try:
            read.append(read_folder(path, name))
            of_read.append(condition)
        except DataError as exc:
            problems.append(str(exc))
    problems += refusals(read, of_read)
    if problems:
        raise StudyError("pool", problems)
    return read, of_read


def _pooled(
    folders: Sequence[ResultsFolder], conditions: Sequence[Condition], file: Path | None
) -> PooledStudies:
    joined = [_joined(f, c) for f, c in zip(folders, conditions, strict=True)]
    estimates = typed_table(pd.concat(joined, ignore_index=True), COLUMNS["estimates"])
    ordered = _in_order(estimates)
    people = people_of(ordered)
    method = " and ".join(sorted(set(ordered["method"])))
    level = float(ordered["ci_level"].iloc[0])
    studies = typed_table(
        [row | {"method": method} for row in study_means(people)], COLUMNS["studies"]
    )
    rows = []
    for key, group in studies.groupby(CELL, sort=False, dropna=False):
        row, weights = _mean_over_studies(group, level)
        rows.append(dict(zip(CELL, key, strict=True)) | {"method": method} | row)
        studies.loc[group.index[group["status"] == "ok"], "weight_pct"] = weights
    inputs = [
        {"file": f"{folder.name}/{name}", "sha256": sha256}
        for folder in folders
        for name, sha256 in folder.sha256.items()
    ]
    if file is not None:
        inputs.append({"file": file.name, "sha256": file_sha256(file)})
    return PooledStudies(
        typed_table(rows, COLUMNS["table"]),
        studies,
        estimates,
        ci_level=level,
        notes=tuple(_notes(studies, len(people))),
        settings={
            f.name: plain(c) | {"estimates_by": f"jointz {f.provenance.get('jointz', '')}"}
            for f, c in zip(folders, conditions, strict=True)
        },
        provenance={**software(), "created": now(), "inputs": inputs},
    )


def _joined(folder: ResultsFolder, condition: Condition) -> pd.DataFrame:
    """Return the estimates of a folder with its condition."""
    about = plain(condition) | {name: folder.study[name] for name in ("joint", "kind")}
    table = folder.estimates.assign(results=folder.name, gain_sd=folder.gain_sd, **about)
    if not condition.group:
        table["group"] = table["participant"].map(folder.groups).fillna("")
    return table


def _in_order(estimates: pd.DataFrame) -> pd.DataFrame:
    """Return the rows in the order of the tables: parameter, condition, phase of the gait cycle."""
    parameters = {name: k for k, name in enumerate(ALL_PARAMETERS)}
    known = estimates.dropna(subset="onset_gait_pct")
    known = known[known["timing_point"] != ALL_POINTS]
    phases = known.groupby("timing_point")["onset_gait_pct"].apply(circular_mean_pct)
    order = pd.DataFrame(
        {
            "parameter": estimates["parameter"].map(parameters).fillna(len(parameters)),
            "condition": estimates.groupby(
                list(CONDITION_COLUMNS), sort=False, dropna=False
            ).ngroup(),
            "phase": estimates["timing_point"].map(phases),
        }
    )
    order = order.sort_values(
        ["parameter", "condition", "phase"], kind="stable", na_position="last"
    )
    return estimates.reindex(order.index).reset_index(drop=True)


def _mean_over_studies(group: pd.DataFrame, level: float) -> tuple[Row, np.ndarray | float]:
    """Return the mean over the studies of a cell, and their weights, %."""
    ok = group[group["status"] == "ok"]
    row: Row = {
        "n_studies": len(ok),
        "n_people": int(ok["n_people"].sum()),
        "n_left_out": len(group) - len(ok),
        **{name: int(group[name].sum()) for name in COUNTS},
        "status": Failure.TOO_FEW_STUDIES.status,
    }
    if ok.empty:
        return row, np.nan
    if len(ok) == 1:
        mean = {name: float(ok[name].iloc[0]) for name in ("value", "ci_low", "ci_high")}
        return row | mean | {"status": _decided(row | mean, ONE_STUDY)}, np.nan
    values, errors = ok["value"].to_numpy(), ok["se"].to_numpy()
    f = random_effects(values, errors**2, level=level, modified=True)
    names = ("i2_pct", "q", "q_p", "prediction_low", "prediction_high")
    row |= {"value": f.mean, "ci_low": f.low, "ci_high": f.high}
    row["status"] = _decided(row, "ok")
    row |= {"tau": f.tau2**0.5, "tau_low": f.tau2_low**0.5, "tau_high": f.tau2_high**0.5}
    return row | {name: getattr(f, name) for name in names}, 100.0 * f.weights


def _decided(mean: Row, status: str) -> str:
    """Return the status of a mean: of three people, and above zero with its interval."""
    return status if mean["ci_low"] > 0.0 and mean["n_people"] >= FEWEST_PEOPLE else UNDECIDED


def _notes(studies: pd.DataFrame, n_values: int) -> Iterator[str]:
    """Yield what a reader of the numbers should know."""
    is_one = len(set(studies["study"])) == 1
    if not is_one and len(studies) == len(studies.drop_duplicates(CELL)):
        stated = {name: sorted(map(str, studies[name].dropna().unique())) for name in CELL[2:]}
        differing = "; ".join(
            f"{name}: {', '.join(texts)}" for name, texts in stated.items() if len(texts) > 1
        )
        yield (
            "No two studies have the same timing point and condition, so that nothing was pooled. "
            f"Correct what is only written differently ({differing})."
        )
    columns = {"n_undecided": "undecided", "n_failed": "failed", "n_at_bound": "at their bound"}
    counts = {name: int(studies[column].sum()) for column, name in columns.items()}
    if text := ", ".join(f"{n} {name}" for name, n in counts.items() if n):
        yield (
            f"Of {n_values} values (of a person, parameter and timing point each): {text}. "
            "Undecided and failed values are counted, not pooled: if they are many, a mean "
            "represents only people whose data are informative. Values at their bound are used as "
            "they are."
        )
    for status, group in studies[studies["status"] != "ok"].groupby("status", sort=False):
        names = "; ".join(sorted(set(group["study"])))
        what = format_count(len(group), "mean of a study is", "means of studies are")
        meaning = NotPooled(str(status)).meaning
        yield f"{what} left out ({meaning}): {names}."
    cells = studies.drop_duplicates(["study", *CONDITION_COLUMNS]).groupby("study").size()
    if several := [str(study) for study, n in cells.items() if n > 1]:
        yield (
            f"{'; '.join(several)}: in several conditions, which share people and instruments; "
            "rows of different conditions are not independent."
        )


def write_pool(pooled: PooledStudies, out: Path, *, overwrite: bool = False) -> Path:
    """Write tables, figures and page of pooled results; return the page."""
    tables = {"estimates": pooled.estimates, "pooled": pooled.table, "studies": pooled.studies}
    with new_folder(out, marker=MARKER, overwrite=overwrite, made_by=POOL) as folder:
        for name, table in tables.items():
            table.to_csv(folder / f"{name}.csv", index=False)
        estimates = pooled.estimates
        estimates.to_parquet(folder / "estimates.parquet", engine="pyarrow", index=False)
        (folder / "figures").mkdir()
        figures = draw_forests(pooled)
        for name, svg in figures.items():
            (folder / "figures" / f"{name}.svg").write_text(svg, encoding="utf-8")
        (folder / PAGE).write_text(render_pool(pooled, figures), encoding="utf-8")
        content: Mapping[str, Any] = {"settings": dict(pooled.settings), "made_by": POOL}
        write_marker(folder, MARKER, {**pooled.provenance, **content})
    return out / PAGE
