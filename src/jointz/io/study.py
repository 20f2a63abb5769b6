"""Open a study folder: read ``study.toml`` and report all its problems at once."""

import difflib
import hashlib
import os
import re
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, get_args

import pandas as pd
from pydantic import BaseModel, ValidationError

from jointz.core.channels import CHANNEL_UNITS, CONDITIONS, LABEL_CHANNELS
from jointz.core.errors import DataError, StudyError, UnitError
from jointz.core.study import FilesSpec, Study, StudySpec, UserExclusion
from jointz.io.registry import list_columns
from jointz.io.units import conversion, si_unit_of

_VARIABLE = re.compile(r"\$\{(\w+)(?::-([^}]*))?\}|\$(\w+)")
_EXCLUSION_COLUMNS = ("participant", "recording", "onset_s", "action", "reason", "time")

Problems = list[str]
Unit = tuple[str, float, float]


def open_study(path: str | os.PathLike[str]) -> Study:
    """Open a study and check everything that can be checked without reading samples.

    Parameters
    ----------
    path : path
        The folder that holds ``study.toml``, or the file itself.

    Returns
    -------
    Study
        The study, ready for :func:`jointz.analyze`.

    Raises
    ------
    StudyError
        With every problem found: unknown keys, units, missing files and columns.
    DataError
        When there is no ``study.toml``.
    """
    file = Path(path)
    file = file / "study.toml" if file.is_dir() else file
    if not file.is_file():
        raise DataError(
            f"{file}: no study.toml found. Give the folder that holds study.toml "
            "(docs/study-format.md shows one to start from).",
            path=str(file),
        )
    text = file.read_bytes()
    raw = _parse(file, text)
    spec, problems = _validate(raw)
    units, edges, unit_problems = _units(raw)
    problems += unit_problems + list(_reference_problems(raw)) + _file_problems(raw, file.parent)
    exclusions, exclusion_problems = _user_exclusions(file.parent)
    problems += exclusion_problems
    if spec is None or problems:
        raise StudyError(str(file), problems)
    return Study(
        root=file.parent,
        spec=spec,
        sha256=hashlib.sha256(text).hexdigest(),
        units=units,
        group_edges=edges,
        user_exclusions=exclusions,
    )


def data_file(root: Path, file: str) -> Path:
    """Return the path of a file named in a study, variables expanded.

    Parameters
    ----------
    root : pathlib.Path
        The study's folder; a relative name starts there.
    file : str
        The name; ``${NAME}`` and ``${NAME:-default}`` are expanded.

    Raises
    ------
    DataError
        When a variable is not set and has no default.
    """

    def value(match: re.Match[str]) -> str:
        name = match.group(1) or match.group(3)
        found = os.environ.get(name, match.group(2))
        if found is None:
            raise DataError(f"'{file}': the environment variable {name} is not set. Set it.")
        return found

    return root / _VARIABLE.sub(value, file)


def _parse(file: Path, text: bytes) -> dict[str, Any]:
    try:
        return tomllib.loads(text.decode("utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as exc:
        raise StudyError(str(file), [f"not valid TOML: {exc}"]) from exc


def _validate(raw: Mapping[str, Any]) -> tuple[StudySpec | None, Problems]:
    try:
        return StudySpec.model_validate(raw), []
    except ValidationError as exc:
        return None, [_sentence(dict(error)) for error in exc.errors()]


def _sentence(error: Mapping[str, Any]) -> str:
    place = _place(error["loc"])
    kind = error["type"]
    if kind == "extra_forbidden":
        known = _known_keys(error["loc"][:-1])
        close = difflib.get_close_matches(str(error["loc"][-1]), known, n=1)
        hint = f" Did you mean '{close[0]}'?" if close else f" Known keys: {', '.join(known)}."
        return f"{place}: unknown key.{hint}"
    if kind == "missing":
        return f"{place}: missing; it is required."
    if place == "jointz":
        return f"jointz: schema version {error['input']!r} is not one this version reads (1)."
    message = str(error["msg"]).removeprefix("Value error, ")
    return f"{place}: {message}; got {error['input']!r}."


def _place(location: tuple[str | int, ...]) -> str:
    place = ""
    for part in location:
        place += f"[{part + 1}]" if isinstance(part, int) else f".{part}" if place else str(part)
    return place


def _known_keys(location: tuple[str | int, ...]) -> list[str]:
    model: Any = StudySpec
    for part in location:
        if isinstance(model, type) and issubclass(model, BaseModel):
            model = model.model_fields[str(part)].annotation if part in model.model_fields else None
        else:
            model = next((a for a in get_args(model) if a not in (str, type(None), ...)), None)
        options = [a for a in get_args(model) if isinstance(a, type) and issubclass(a, BaseModel)]
        if options and type(None) in get_args(model):
            model = options[0]
    if isinstance(model, type) and issubclass(model, BaseModel):
        return sorted(model.model_fields)
    return []


def _table(raw: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    value = raw.get(key)
    return value if isinstance(value, Mapping) else {}


def _entries(raw: Mapping[str, Any], key: str) -> list[Mapping[str, Any]]:
    value = raw.get(key)
    return [e for e in value if isinstance(e, Mapping)] if isinstance(value, list) else []


def _units(raw: Mapping[str, Any]) -> tuple[dict[str, Unit], tuple[float, ...], Problems]:
    """Convert the unit of every channel; problems instead of exceptions."""
    units: dict[str, Unit] = {}
    problems: Problems = []
    for name, channel in _table(raw, "channels").items():
        unit = channel.get("unit") if isinstance(channel, Mapping) else None
        if unit is None or not isinstance(unit, str):
            units[name] = (CHANNEL_UNITS.get(name, ("1",))[0], 1.0, 0.0)
            continue
        try:
            units[name] = _channel_unit(name, unit)
        except UnitError as exc:
            problems.append(f"channels.{name}.unit: {exc}")
    edges, edge_problems = _group_edges(raw, units)
    return units, edges, problems + edge_problems


def _channel_unit(name: str, unit: str) -> Unit:
    if name in LABEL_CHANNELS or name == "contact":
        return ("1", 1.0, 0.0)
    allowed = CHANNEL_UNITS.get(name)
    if allowed is None:
        return si_unit_of(unit)
    failures = []
    for si_unit in allowed:
        try:
            return (si_unit, *conversion(unit, si_unit))
        except UnitError as exc:
            failures.append(exc)
    raise failures[0]


def _group_edges(
    raw: Mapping[str, Any], units: Mapping[str, Unit]
) -> tuple[tuple[float, ...], Problems]:
    group = _table(_table(raw, "perturbations"), "group")
    edges, channel = group.get("edges"), group.get("channel")
    if not isinstance(edges, list) or not isinstance(channel, str) or channel not in units:
        return (), []
    unit = group.get("unit")
    try:
        factor, offset = conversion(str(unit), units[channel][0]) if unit else (1.0, 0.0)
    except UnitError as exc:
        return (), [f"perturbations.group.unit: {exc}"]
    return tuple(factor * float(e) + offset for e in edges if isinstance(e, (int, float))), []


def _reference_problems(raw: Mapping[str, Any]) -> Iterator[str]:
    """Yield what only the whole file shows: names that nothing stands behind."""
    channels = _table(raw, "channels")
    ids = [str(p.get("id")) for p in _entries(raw, "participants") if "id" in p]
    for name, count in Counter(ids).items():
        if count > 1:
            yield f"participants: id '{name}' is given {count} times. Ids must be unique."
    cells: Counter[tuple[str, ...]] = Counter()
    for i, entry in enumerate(_entries(raw, "recordings"), start=1):
        person = str(entry.get("participant", ""))
        if person and person not in ids:
            yield (
                f"recordings[{i}].participant: '{person}' is not among the participants "
                f"({', '.join(ids) or 'none'})."
            )
        condition = CONDITIONS.get(str(entry.get("condition", "")).lower(), "")
        if "condition" not in entry and "condition" not in channels:
            yield (
                f'recordings[{i}]: no condition. Give condition = "unperturbed" or '
                '"perturbed", or say with [channels.condition] which column holds it.'
            )
        cells[(person, condition, str(entry.get("session", "")), str(entry.get("side", "")))] += 1
    for (person, condition, session, _), count in cells.items():
        if count > 1:
            which = f", session '{session}'" if session else ""
            yield (
                f"recordings: {count} recordings for participant '{person}', condition "
                f"'{condition or 'in the file'}'{which}. One cell has one recording: give each "
                "its own session, or remove the others."
            )
    yield from _channel_problems(raw, channels)
    yield from _perturbation_problems(raw, channels)


def _channel_problems(raw: Mapping[str, Any], channels: Mapping[str, Any]) -> Iterator[str]:
    recordings = _entries(raw, "recordings")
    if channels and "angle" not in channels:
        yield "channels.angle: missing; every study needs the joint's angle."
    if "time" not in channels and "sample_rate_hz" not in raw:
        yield "channels.time: missing; without a time column give sample_rate_hz."
    no_device = {"no_device", "nwc"}
    need_torque = any(str(r.get("condition", "")).lower() not in no_device for r in recordings)
    from_current = "current" in channels and "torque_model" in raw
    if need_torque and "torque" not in channels and not from_current:
        yield "channels.torque: missing; give it, or channels.current and [torque_model]."
    for name, channel in channels.items():
        if not isinstance(channel, Mapping):
            continue
        if "kind" in channel and name != "contact":
            yield f"channels.{name}.kind: only channels.contact has a kind."
        if "values" in channel and name not in LABEL_CHANNELS:
            yield f"channels.{name}.values: only condition, trial and cycle have values."
    for value in _table(_table(channels, "condition"), "values").values():
        if str(value).lower() not in CONDITIONS:
            yield (
                f"channels.condition.values: '{value}' is no condition; expected unperturbed, "
                "perturbed or no_device."
            )


def _perturbation_problems(raw: Mapping[str, Any], channels: Mapping[str, Any]) -> Iterator[str]:
    settings = _table(raw, "perturbations")
    source = settings.get("source")
    perturbed = [
        (i, r)
        for i, r in enumerate(_entries(raw, "recordings"), start=1)
        if CONDITIONS.get(str(r.get("condition", "perturbed")).lower()) == "perturbed"
    ]
    if source in ("command", "reference") and source not in channels:
        yield f"perturbations.source: '{source}' needs [channels.{source}]."
    for i, entry in perturbed:
        if source == "table" and "perturbations" not in entry:
            yield f'recordings[{i}].perturbations: missing; perturbations.source is "table".'
        told = {"command", "reference"} & set(channels) or "perturbations" in entry
        if source is None and not told:
            yield (
                f"recordings[{i}]: nothing says when the pulses are. Give [channels.command], "
                'a table (perturbations = "FILE.csv"), or perturbations.source.'
            )
    if settings.get("baseline") == "predicted":
        yield (
            'perturbations.baseline: "predicted" is not in this version; expected pre_pulse, '
            "unperturbed_mean or matched_strides."
        )
    group = _table(settings, "group")
    if group and group.get("channel") not in channels:
        yield (
            f"perturbations.group.channel: '{group.get('channel')}' is not among the channels "
            f"({', '.join(channels)})."
        )


def _file_problems(raw: Mapping[str, Any], root: Path) -> Problems:
    """Find missing files and columns of all recordings, without reading samples."""
    problems: Problems = []
    try:
        files = FilesSpec.model_validate(raw.get("files", {}))
    except ValidationError:
        return []  # reported already, and nothing can be read without it
    columns = {
        name: channel["column"]
        for name, channel in _table(raw, "channels").items()
        if isinstance(channel, Mapping) and "column" in channel
    }
    checked: set[str] = set()
    for i, entry in enumerate(_entries(raw, "recordings"), start=1):
        for key in ("file", "perturbations"):
            name = entry.get(key)
            if not isinstance(name, str) or (key == "file" and name in checked):
                continue
            place = f"recordings[{i}].{key}"
            path_problem = _problem_of(lambda n=name: _existing(root, n))  # type: ignore[misc]
            if path_problem:
                problems.append(f"{place}: {path_problem}")
            elif key == "file":
                checked.add(name)
                problems += _column_problems(place, data_file(root, name), columns, files)
    return problems


def _existing(root: Path, name: str) -> None:
    path = data_file(root, name)
    if not path.is_file():
        raise DataError(f"file '{path}' does not exist. Correct the name or bring the file.")


def _problem_of(check: Callable[[], object]) -> str | None:
    try:
        check()
    except DataError as exc:
        return str(exc)
    return None


def _column_problems(
    place: str, path: Path, columns: Mapping[str, str | int], files: FilesSpec
) -> Problems:
    try:
        there = list_columns(path, files)
    except DataError as exc:
        return [f"{place}: {exc}"]
    if there is None or not files.header:
        return []
    missing = {n: c for n, c in columns.items() if isinstance(c, str) and c not in there}
    if not missing:
        return []
    wanted = []
    for channel, column in missing.items():
        close = difflib.get_close_matches(column, there, n=1)
        hint = f" (did you mean '{close[0]}'?)" if close else ""
        wanted.append(f"'{column}' for channel '{channel}'{hint}")
    return [
        f"{place}: {path.name} has no column {', no column '.join(wanted)}. It has: "
        f"{', '.join(there)}.{_layout_hint(there)}"
    ]


def _layout_hint(there: list[str]) -> str:
    for mark, name in ((";", "a semicolon"), ("\t", "a tab")):
        if len(there) == 1 and mark in there[0]:
            return f" The columns seem to be separated by {name}: set delimiter under [files]."
    return ""


def _user_exclusions(root: Path) -> tuple[tuple[UserExclusion, ...], Problems]:
    """Read the user's own ``exclusions.csv``, where there is one."""
    file = root / "exclusions.csv"
    if not file.is_file():
        return (), []
    try:
        table = pd.read_csv(file, dtype=str, keep_default_na=False)
        missing = [c for c in _EXCLUSION_COLUMNS[:4] if c not in table.columns]
        if missing:
            return (), [f"exclusions.csv: missing column(s) {', '.join(missing)}."]
        rows = tuple(
            UserExclusion(
                participant=str(row["participant"]),
                recording=str(row["recording"]),
                onset_s=float(row["onset_s"]),
                action=str(row["action"]),
                reason=str(row.get("reason", "")),
            )
            for row in table.to_dict("records")
        )
    except (ValueError, pd.errors.ParserError) as exc:
        return (), [f"exclusions.csv: {exc}."]
    bad = sorted({r.action for r in rows} - {"exclude", "restore"})
    problems = [f"exclusions.csv: action '{a}'; expected exclude or restore." for a in bad]
    return rows, problems
