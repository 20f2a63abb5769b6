"""Open a study folder: read ``study.toml`` and report all its problems at once."""

import difflib
import hashlib
import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from jointz.core.channels import (
    CHANNEL_UNITS,
    CONDITIONS,
    HEEL_STRIKES,
    LABEL_CHANNELS,
    MOTION_SENSORS,
    OPPOSITE_DIRECTION,
)
from jointz.core.errors import DataError, StudyError, UnitError
from jointz.core.events import row_label
from jointz.core.study import FilesSpec, RecordingSpec, Study, StudySpec
from jointz.core.units import conversion
from jointz.io.column_units import OVER_MASS, Unit, channel_unit
from jointz.io.file_kinds import special_kind
from jointz.io.formats.registry import CLOCK_SUFFIXES, list_columns
from jointz.io.pulse_tables import read_pulses
from jointz.io.recordings import StudyRecording, read_recording
from jointz.io.small_files import file_content, parse_toml
from jointz.io.study_files import (
    PART,
    data_file,
    named_as_written,
    needed_channels,
    shown_file,
    study_of_recording,
)
from jointz.io.toml_problems import open_questions, shape_problems
from jointz.io.user_exclusions import read_user_exclusions

Problems = list[str]


class OpenedStudy(Study):
    """A study that was opened and checked, with its recordings."""

    @property
    def recordings(self) -> tuple[StudyRecording, ...]:
        """Recordings in the order of ``study.toml``; each is read when ``read()`` is called."""
        return tuple(StudyRecording(self, entry) for entry in self.spec.recordings)

    def __repr__(self) -> str:
        spec = self.spec
        return (
            f"<{spec.kind} study {self.root.resolve().name!r}: {spec.joint}, "
            f"{len(spec.participants)} participants, {len(spec.recordings)} recordings>"
        )


def open_study(path: str | os.PathLike[str]) -> OpenedStudy:
    """Open a study and check everything that can be checked without reading samples.

    Parameters
    ----------
    path : path
        The folder that holds ``study.toml``, or the file itself.

    Returns
    -------
    OpenedStudy
        The study, ready for :func:`jointz.analyze`; ``recordings`` holds one object a recording,
        whose ``read()`` gives its samples.

    Raises
    ------
    StudyError
        With every problem found: unknown keys, units, missing files and columns.
    DataError
        When there is no ``study.toml``.
    """
    file = Path(path)
    file = file / "study.toml" if os.path.isdir(file) else file
    absent = (
        f"{file}: no study.toml found. Give the folder that holds study.toml "
        "(docs/study-format.md shows one to start from)."
    )
    text = file_content(file, absent=absent)
    raw = parse_toml(str(file), text, error=StudyError)
    if asked := open_questions(raw):
        raise StudyError(str(file), asked)
    spec, problems = None, []
    try:
        spec = StudySpec.model_validate(raw)
    except ValidationError as exc:
        problems = shape_problems(exc, StudySpec, raw)
    units, edges, unit_problems = _units(raw)
    problems += unit_problems + list(_reference_problems(raw)) + _rate_problems(raw)
    is_sound = spec is not None and not problems
    faulty_files, file_problems = _file_problems(raw, file.parent)
    problems += file_problems
    exclusions, exclusion_problems = read_user_exclusions(file.parent)
    problems += exclusion_problems
    if spec is None:
        raise StudyError(str(file), problems)
    study = OpenedStudy(
        root=file.parent,
        spec=spec,
        sha256=hashlib.sha256(text).hexdigest(),
        units=units,
        group_edges=edges,
        user_exclusions=exclusions,
    )
    if is_sound:
        sound = [entry for entry in spec.recordings if entry.file not in faulty_files]
        problems += _content_problems(study, sound, samples=bool(problems))
    if problems:
        raise StudyError(str(file), list(dict.fromkeys(problems)))
    return study


def _content_problems(
    study: Study, entries: Sequence[RecordingSpec], *, samples: bool
) -> Iterator[str]:
    """Yield what is wrong in pulse tables and, where people correct the study anyway, samples."""
    for entry in entries:
        try:
            if entry.perturbations is not None:
                read_pulses(study_of_recording(study, entry), entry)
        except DataError as exc:
            yield str(exc)
        try:
            if samples:
                read_recording(study, entry)
        except DataError as exc:
            yield str(exc)


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
        channel = channel if isinstance(channel, Mapping) else {}
        problems += _clock_problems(name, _table(channel, "time").get("unit"))
        unit = channel.get("unit")
        if unit is None or not isinstance(unit, str):
            units[name] = (CHANNEL_UNITS.get(name, ("1",))[0], 1.0, 0.0)
            continue
        try:
            units[name] = channel_unit(name, unit, kind=channel.get("kind"))
        except UnitError as exc:
            analog = name == "contact" and channel.get("kind") != "voltage"
            hint = ' A footswitch in V has kind = "voltage".' if analog else ""
            problems.append(f"channels.{name}.unit: {exc}{hint}")
    edges, edge_problems = _group_edges(raw, units)
    for i, entry in enumerate(_entries(raw, "recordings"), start=1):
        if changes := _table(entry, "channels"):
            merged = {name: _changed_channel(raw, entry, name) for name in changes}
            found = [p for p in _units({"channels": merged})[2] if p not in problems]
            problems += [f"recordings[{i}].{problem}" for problem in found]
    return units, edges, problems + edge_problems


def _clock_problems(name: str, unit: Any) -> Iterator[str]:
    """Yield a unit of a channel's own clock that is none of time."""
    try:
        if isinstance(unit, str):
            channel_unit("time", unit)
    except UnitError as exc:
        yield f"channels.{name}.time.unit: {exc}"


def _changed_channel(raw: Mapping[str, Any], entry: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return what a study and one of its recordings say about a channel."""
    channel = {**_table(_table(raw, "channels"), name), **_table(_table(entry, "channels"), name)}
    if (part := entry.get("part")) is None:
        return channel
    if isinstance(clock := channel.get("time"), Mapping):
        channel["time"] = _in_part(clock, part)
    return _in_part(channel, part)


def _in_part(named: Mapping[str, Any], part: Any) -> dict[str, Any]:
    column = named.get("column")
    own = {"column": column.replace(PART, str(part))} if isinstance(column, str) else {}
    return {**named, **own}


def _group_edges(
    raw: Mapping[str, Any], units: Mapping[str, Unit]
) -> tuple[tuple[float, ...], Problems]:
    group = _table(_table(raw, "perturbations"), "group")
    edges, channel = group.get("edges"), group.get("channel")
    if not isinstance(edges, list) or not isinstance(channel, str) or channel not in units:
        return (), []
    unit = group.get("unit")
    try:
        si_unit = units[channel][0]
        if channel in CHANNEL_UNITS:  # what is per body mass is multiplied by it
            si_unit = si_unit.removesuffix(OVER_MASS)
        factor, offset = conversion(str(unit), si_unit) if unit else (1.0, 0.0)
    except UnitError as exc:
        return (), [f"perturbations.group.unit: {exc}"]
    return tuple(factor * e + offset for e in edges if isinstance(e, (int, float))), []


def _reference_problems(raw: Mapping[str, Any]) -> Iterator[str]:
    """Yield what only the whole file shows: names that refer to nothing."""
    channels = _table(raw, "channels")
    ids = [str(p.get("id")) for p in _entries(raw, "participants") if "id" in p]
    for name, count in Counter(ids).items():
        if count > 1:
            yield f"participants: id '{name}' is given {count} times. Ids must be unique."
    for i, entry in enumerate(_entries(raw, "recordings"), start=1):
        person = str(entry.get("participant", ""))
        if person and person not in ids:
            yield (
                f"recordings[{i}].participant: '{person}' is not among the participants "
                f"({', '.join(ids) or 'none'})."
            )
        if "condition" not in entry and "condition" not in channels:
            yield (
                f'recordings[{i}]: no condition. Give condition = "unperturbed" or '
                '"perturbed", or say with [channels.condition] which column holds it.'
            )
    yield from _cell_problems(raw)
    yield from _side_problems(raw)
    yield from _channel_problems(raw, channels)
    yield from _change_problems(raw, channels)
    yield from _mass_problems(raw, channels)
    yield from _perturbation_problems(raw, channels)


def _cell_problems(raw: Mapping[str, Any]) -> Iterator[str]:
    """Yield what would put two recordings into one cell, or two cells under one name."""
    cells = Counter(
        (
            str(entry.get("participant", "")),
            _condition_of(entry),
            str(entry.get("session", "")),
            str(entry.get("side", "")),
        )
        for entry in _entries(raw, "recordings")
        if _condition_of(entry) or "condition" not in entry
    )
    for (person, condition, session, side), count in cells.items():
        if count > 1:
            which = f", session '{session}'" if session else ""
            which += f", side '{side}'" if side else ""
            yield (
                f"recordings: {count} recordings for participant '{person}', condition "
                f"'{condition or 'in the file'}'{which}. One cell has one recording: join its "
                "trials into one file (where time begins again, [channels.trial] names the column "
                "that tells them apart), or remove the others. Another session is another day (on "
                "a bench another case) and is estimated apart."
            )
    labels = Counter(row_label(*unit) for unit in {(p, s, side) for p, _, s, side in cells})
    for label, count in labels.items():
        if count > 1 and raw.get("kind") == "walking":
            yield (
                f"recordings: '{label}' would name two rows: an id or a session holds what another "
                "recording states as its session or side. Change the id or the session."
            )


def _side_problems(raw: Mapping[str, Any]) -> Iterator[str]:
    """Yield pulses of an unknown side, where the motion of both legs would be taken off."""
    entries = _entries(raw, "recordings") if raw.get("kind") == "walking" else []
    sides = {
        (str(entry.get("participant", "")), entry.get("side"))
        for entry in entries
        if "condition" not in entry or _condition_of(entry) == "unperturbed"
    }
    for i, entry in enumerate(entries, start=1):
        person = str(entry.get("participant", ""))
        pulses = "condition" not in entry or _condition_of(entry) == "perturbed"
        if pulses and "side" not in entry and {(person, "left"), (person, "right")} <= sides:
            yield (
                f"recordings[{i}].side: missing, and '{person}' has unperturbed recordings of both "
                f"sides: state the side of {entry.get('file')}."
            )


def _condition_of(entry: Mapping[str, Any]) -> str:
    """Return the condition of a recording, "" where it gives none that is known."""
    return CONDITIONS.get(str(entry.get("condition", "")).strip().lower(), "")


def _channel_problems(raw: Mapping[str, Any], channels: Mapping[str, Any]) -> Iterator[str]:
    if isinstance(raw.get("channels"), Mapping):  # said already where it is no table
        yield from _missing_channels(raw, channels)
    for name, channel in channels.items():
        if isinstance(channel, Mapping):
            yield from _key_problems(name, channel, raw)
    for value in _table(_table(channels, "condition"), "values").values():
        if str(value).lower() not in CONDITIONS:
            yield (
                f"channels.condition.values: '{value}' is no condition; expected unperturbed, "
                "perturbed or no_device."
            )


def _key_problems(name: str, channel: Mapping[str, Any], raw: Mapping[str, Any]) -> Iterator[str]:
    """Yield keys that belong to other channels, and directions that cannot be turned."""
    if "positive" in channel:
        yield from _direction_problems(name, channel["positive"], raw)
    if "kind" in channel and name != "contact":
        yield f"channels.{name}.kind: only channels.contact has a kind."
    if name in LABEL_CHANNELS and {"scale", "invert"} & set(channel):
        yield f"channels.{name}: labels have no scale and no sign. Remove scale and invert."
    if "values" in channel and name not in ("condition", "trial"):
        yield f"channels.{name}.values: only condition and trial have values."
    if "time" in channel and name in ("time", HEEL_STRIKES, *LABEL_CHANNELS):
        yield f"channels.{name}.time: only samples have a clock of their own. Remove the key."
    if "threshold" in channel and name != "trigger":
        yield f"channels.{name}.threshold: only channels.trigger has a threshold."
    if name == HEEL_STRIKES and {"scale", "invert"} & set(channel):
        yield f"channels.{name}: times have no scale and no sign. Remove scale and invert."
    if name == "trigger" and {"scale", "invert"} & set(channel):
        yield "channels.trigger: either level may be the idle one. Remove scale and invert."


def _change_problems(raw: Mapping[str, Any], channels: Mapping[str, Any]) -> Iterator[str]:
    """Yield changes in recordings of channels that the study does not have, or cannot turn."""
    for i, entry in enumerate(_entries(raw, "recordings"), start=1):
        for name, change in _table(entry, "channels").items():
            if name not in channels:
                yield (
                    f"recordings[{i}].channels.{name}: the study has no channel '{name}'. A "
                    f"recording changes channels of the study: give [channels.{name}], too."
                )
            elif isinstance(change, Mapping):
                yield from (
                    f"recordings[{i}].{problem}" for problem in _key_problems(name, change, raw)
                )


def _mass_problems(raw: Mapping[str, Any], channels: Mapping[str, Any]) -> Iterator[str]:
    """Yield people without a mass where a channel is per body mass."""
    units = {n: c.get("unit") for n, c in channels.items() if isinstance(c, Mapping)}
    per_mass = [n for n, u in units.items() if n in CHANNEL_UNITS and str(u).endswith(OVER_MASS)]
    people = [str(p.get("id")) for p in _entries(raw, "participants") if "mass_kg" not in p]
    if per_mass and people:
        yield (
            f"channels.{per_mass[0]}.unit: '{units[per_mass[0]]}' is per body mass. Give mass_kg "
            f"of {', '.join(people)}."
        )


def _missing_channels(raw: Mapping[str, Any], channels: Mapping[str, Any]) -> Iterator[str]:
    channels = {**channels, **_joined_everywhere(raw)}
    if "angle" not in channels:
        yield "channels.angle: missing; every study needs the joint's angle."
    conditions = [_condition_of(r) for r in _entries(raw, "recordings")]
    # A bench that nothing perturbs may be a calibration: a hinge swung by hand has no torque.
    unmoved = raw.get("kind") == "bench" and set(conditions) <= {"unperturbed", "no_device"}
    need_torque = any(c != "no_device" for c in conditions) and not unmoved
    from_current = "current" in channels and "torque_model" in raw
    if need_torque and "torque" not in channels and not from_current:
        yield "channels.torque: missing; give it, or channels.current and [torque_model]."


def _joined_everywhere(raw: Mapping[str, Any]) -> dict[str, Any]:
    """Return the channels that joined files bring to every recording."""
    joined = [
        {name for one in _entries(entry, "joined") for name in _table(one, "channels")}
        for entry in _entries(raw, "recordings")
    ]
    return dict.fromkeys(set.intersection(*joined) if joined else ())


def _rate_problems(raw: Mapping[str, Any]) -> Problems:
    """Ask for a rate where there is no time."""
    if "time" in _table(raw, "channels") or "sample_rate_hz" in raw or "channels" not in raw:
        return []
    if _clocks_are_known(raw):
        return []
    return [
        "channels.time: missing; without a time column sample_rate_hz is needed: give it (the rate "
        "of your recorder, no guess: it scales K, B and J)."
    ]


def _clocks_are_known(raw: Mapping[str, Any]) -> bool:
    """Return whether all samples have a clock: of their channels, or in files that know theirs."""
    channels = [
        channel
        for name, channel in _table(raw, "channels").items()
        if isinstance(channel, Mapping) and name != HEEL_STRIKES
    ]
    files = [str(entry.get("file")).lower() for entry in _entries(raw, "recordings")]
    return all("time" in channel for channel in channels) or all(
        file.endswith(CLOCK_SUFFIXES) for file in files
    )


def _direction_problems(name: str, direction: Any, raw: Mapping[str, Any]) -> Iterator[str]:
    """Yield a direction that cannot be turned into the study's."""
    if name in ("time", "contact", "trigger", HEEL_STRIKES, *LABEL_CHANNELS):
        yield f"channels.{name}.positive: {name} has no direction. Remove the key."
        return
    study_direction = raw.get("positive", StudySpec.model_fields["positive"].default)
    both = (study_direction, direction)
    if not all(isinstance(one, str) and one in OPPOSITE_DIRECTION for one in both):
        return  # reported already
    opposite = OPPOSITE_DIRECTION[study_direction]
    if direction not in (study_direction, opposite):
        yield (
            f"channels.{name}.positive: expected the study's '{study_direction}' or its opposite "
            f"'{opposite}', got '{direction}'. Correct it, or the "
            "study's positive."
        )


def _perturbation_problems(raw: Mapping[str, Any], channels: Mapping[str, Any]) -> Iterator[str]:
    channels = {**channels, **_joined_everywhere(raw)}
    settings = _table(raw, "perturbations")
    source = settings.get("source")
    shown = {"command", "trigger", "reference"}
    if isinstance(source, str) and source in shown and source not in channels:
        yield f"perturbations.source: '{source}' needs [channels.{source}]."
    for i, entry in enumerate(_entries(raw, "recordings"), start=1):
        if "condition" in entry and _condition_of(entry) != "perturbed":
            continue
        if source == "table" and "perturbations" not in entry:
            yield f'recordings[{i}].perturbations: missing; perturbations.source is "table".'
        has_pulses = not shown.isdisjoint(channels) or "perturbations" in entry
        if source is None and not has_pulses:
            yield (
                f"recordings[{i}]: nothing says when the pulses are. Give [channels.command], "
                '[channels.trigger], a table (perturbations = "FILE.csv"), or perturbations.source.'
            )
    channel = _table(settings, "group").get("channel")
    if isinstance(channel, str) and (channel not in channels or channel in LABEL_CHANNELS):
        known = [name for name in channels if name not in LABEL_CHANNELS]
        yield (
            f"perturbations.group.channel: '{channel}' is not among the channels of numbers "
            f"({', '.join(known)})."
        )


def _file_problems(raw: Mapping[str, Any], root: Path) -> tuple[set[str], Problems]:
    """Find missing files and columns of all recordings, without reading samples."""
    problems: Problems = []
    faulty: set[str] = set()
    conditions = {_condition_of(entry) for entry in _entries(raw, "recordings")}
    moments_only = raw.get("kind") == "walking" and conditions == {"no_device"}
    checked: set[tuple[str, ...]] = set()
    of_sensors: dict[str, list[Problems]] = {}
    for i, entry in enumerate(_entries(raw, "recordings"), start=1):
        n_before = len(problems)
        files = _layout({**_table(raw, "files"), **_table(entry, "files")})
        if files is None:
            continue  # reported already, and nothing can be read without it
        merged = {name: _changed_channel(raw, entry, name) for name in _table(raw, "channels")}
        # Heel strikes may be events, which are no columns.
        merged |= {f"{n}.time": c["time"] for n, c in merged.items() if _table(c, "time")}
        columns = {n: c["column"] for n, c in merged.items() if "column" in c and n != HEEL_STRIKES}
        needed = needed_channels(columns, _condition_of(entry) or None, moments_only=moments_only)
        for key in ("file", "perturbations", "heel_strikes"):
            name = entry.get(key)
            key_of_check = (str(name), *(str(columns[n]) for n in needed))
            if not isinstance(name, str) or key_of_check in checked:
                continue
            place = f"recordings[{i}].{key}"
            path_problem = _path_problem(root, name)
            if path_problem:
                problems.append(f"{place}: {path_problem}")
            elif key == "file":
                checked.add(key_of_check)
                needed_columns = {n: columns[n] for n in needed if n not in MOTION_SENSORS}
                problems += _column_problems(place, root, name, needed_columns, files)
                for n in (n for n in needed if n in MOTION_SENSORS):
                    lacks = _column_problems(place, root, name, {n: columns[n]}, files)
                    of_sensors.setdefault(n, []).append(lacks)
        problems += _joined_problems(entry, root, f"recordings[{i}].joined", columns, files)
        if len(problems) > n_before:
            faulty.add(str(entry.get("file")))
    # A recording may lack a sensor; if all of them do, its column is misspelt.
    for found in of_sensors.values():
        problems += found[0] if all(found) else []
    return faulty, problems


def _layout(raw: Mapping[str, Any]) -> FilesSpec | None:
    try:
        return FilesSpec.model_validate(raw)
    except ValidationError:
        return None


def _joined_problems(
    entry: Mapping[str, Any],
    root: Path,
    place: str,
    own: Mapping[str, str | int],
    own_files: FilesSpec,
) -> Problems:
    problems: Problems = []
    if not (joined_files := _entries(entry, "joined")):
        return problems
    taken = _known_columns(root, str(entry.get("file")), own, own_files)
    for k, joined in enumerate(joined_files, start=1):
        name = joined.get("file")
        if not isinstance(name, str):
            continue  # reported already
        if path_problem := _path_problem(root, name):
            problems.append(f"{place}[{k}].file: {path_problem}")
            continue
        part = {**joined, "part": entry["part"]} if "part" in entry else joined
        channels = {n: _changed_channel(joined, part, n) for n in _table(joined, "channels")}
        columns = {n: c["column"] for n, c in channels.items() if "column" in c}
        files = _layout(_table(joined, "files"))
        if files is not None:
            problems += _column_problems(f"{place}[{k}].file", root, name, columns, files)
        problems += [f"{place}[{k}].{problem}" for problem in _units(joined)[2]]
        if twice := sorted((set(columns) & set(taken)) - {"time"}):
            problems.append(
                f"{place}[{k}].channels: {', '.join(twice)}: {entry.get('file')}, or another file "
                "joined to it, has the channel too. Leave one of them out."
            )
        taken |= columns
    return problems


def _known_columns(
    root: Path, file: str, columns: Mapping[str, str | int], files: FilesSpec
) -> dict[str, str | int]:
    """Return those of the columns that a file is known to have."""
    try:
        with named_as_written(root, file) as path:
            known = set(map(str, list_columns(path, files) or ()))
    except DataError:
        return {}
    return {name: column for name, column in columns.items() if str(column) in known}


def _path_problem(root: Path, name: str) -> str:
    """Return why a file cannot be read, "" where it is there."""
    try:
        path = data_file(root, name)
    except DataError as exc:
        return str(exc)
    if os.path.isfile(path):  # unlike Path.is_file it holds for names no system takes
        return ""
    shown = name if "$" in name else path
    if kind := special_kind(path):
        return f"'{shown}' is {kind}; expected a file. Name a recording."
    return f"file '{shown}' does not exist. Correct the name or bring the file."


def _column_problems(
    place: str, root: Path, file: str, columns: Mapping[str, str | int], files: FilesSpec
) -> Problems:
    try:
        with named_as_written(root, file) as path:
            columns_of_file = list_columns(path, files)
    except DataError as exc:
        return [f"{place}: {exc}"]
    if columns_of_file is None or not files.header:
        return []
    missing = {n: c for n, c in columns.items() if isinstance(c, str) and c not in columns_of_file}
    if not missing:
        return []
    shown = shown_file(file) if "$" in file else path.name
    sentences = []
    for channel, column in missing.items():
        close = difflib.get_close_matches(column, columns_of_file, n=1)
        hint = f" (did you mean '{close[0]}'?)" if close else ""
        sentences.append(f"'{column}' for channel '{channel}'{hint}")
    return [
        f"{place}: {shown} has no column {', no column '.join(sentences)}. It has: "
        f"{', '.join(columns_of_file)}.{_layout_hint(columns_of_file)}"
    ]


def _layout_hint(columns: list[str]) -> str:
    for mark, name in ((";", "a semicolon"), ("\t", "a tab")):
        if len(columns) == 1 and mark in columns[0]:
            return f" The columns seem to be separated by {name}: set delimiter under [files]."
    return ""
