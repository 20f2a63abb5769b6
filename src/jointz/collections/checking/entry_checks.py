"""Checks of an ``entry.toml``, and of the hashes of its files."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping

from jointz.collections.entry_model import Entry
from jointz.collections.entry_reader import EntryFolder
from jointz.core.channels import PARAMETER_UNITS
from jointz.core.errors import DataError
from jointz.io.formats.columns import file_sha256
from jointz.io.protocols import builtin_protocols, load_protocol

#: Code, where, what was expected, what was found.
Violation = tuple[str, str, str, str]
#: Whether a rule is violated, and the violation.
Rule = tuple[bool, str, str, str, str]
#: Parameters that an entry may hold.
PARAMETERS = (
    "stiffness",
    "damping",
    "inertia",
    "stiffness_per_mass",
    "damping_per_mass",
    "stiffness_onset",
    "damping_onset",
)
_FLEXION = frozenset({"flexion", "extension"})
_ABDUCTION = frozenset({"abduction", "adduction"})
_ROTATION = frozenset({"internal_rotation", "external_rotation"})
#: Joint -> directions that one may call positive.
_JOINT_DIRECTIONS: Mapping[str, frozenset[str]] = {
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
_BAND = re.compile(r"(\d{1,3})(?:-(\d{1,3})|\+)")
#: Narrower bands of age could identify people, years.
_NARROWEST_BAND_YEARS = 5


def metadata_violations(entry: EntryFolder) -> Iterator[Violation]:
    """Yield what is wrong with an entry's metadata."""
    rules = _study_rules(entry.spec) + _people_rules(entry.spec)
    yield from (rule[1:] for rule in rules if rule[0])
    yield from _protocol(entry)


def hash_violations(entry: EntryFolder, hashes: Mapping[str, str]) -> Iterator[Violation]:
    """Yield stated hashes that are missing or differ from those of the files."""
    stated = entry.spec.hashes
    for file, sha256 in hashes.items():
        where = f"hashes.{file}"
        if file not in stated:
            yield "hash_missing", where, "the SHA-256 of the file", "none"
        elif stated[file].lower() != sha256:
            found = f"{sha256[:12]}...: the file was changed, or is another"
            yield "hash_differs", where, f"{stated[file][:12]}..., as stated", found
    for file in stated.keys() - hashes.keys():
        where = f"hashes.{file}"
        try:
            if file_sha256(entry.path(file)) != stated[file].lower():
                yield "hash_differs", where, f"{stated[file][:12]}..., as stated", "another"
        except DataError as exc:
            yield "file_missing", where, "a file of the entry", str(exc)
        except OSError as exc:
            found = f"it cannot be read ({exc.strerror})"
            yield "file_unreadable", where, "a file that can be read", found


def _study_rules(spec: Entry) -> list[Rule]:
    joint, of_people = spec.joint, spec.kind == "estimates"
    directions = sorted(_JOINT_DIRECTIONS.get(joint.name, ()))
    return [
        (not directions, "joint_unknown", "joint.name",
         f"one of {', '.join(_JOINT_DIRECTIONS)}", repr(joint.name)),
        (bool(directions) and joint.positive not in directions, "joint_direction",
         "joint.positive", f"a direction of the {joint.name}: {', '.join(directions)}",
         repr(joint.positive)),
        (of_people and joint.side == "not_stated", "side_missing", "joint.side",
         "left, right or both", "not_stated"),
        *((of_people and joint.side == "both" and person.side is None, "side_missing",
           f"participants[{i}].side", "left or right: the study has both", "none")
          for i, person in enumerate(spec.participants, 1)),
        (of_people and spec.device.torque == "not_stated", "torque_path_missing",
         "device.torque", "how torque on the joint was measured or computed", ""),
        *((name not in PARAMETERS, "parameter_unknown", f"units.{name}",
           f"one of {', '.join(PARAMETERS)}", repr(name)) for name in spec.units),
        *((name in PARAMETERS and unit != PARAMETER_UNITS[name], "unit", f"units.{name}",
           PARAMETER_UNITS.get(name, ""), repr(unit)) for name, unit in spec.units.items()),
    ]  # fmt: skip


def _people_rules(spec: Entry) -> list[Rule]:
    counts = {
        key: Counter(getattr(person, key) for person in spec.participants)
        for key in ("id", "person")
    }
    band = f"a band of at least {_NARROWEST_BAND_YEARS} years, such as 20-29 or 80+"
    return [
        *((bool(name) and n > 1, "person_twice", f"participants.{key}", "everybody once",
           f"{name!r} {n} times")
          for key, count in counts.items() for name, n in count.items()),
        *((not _is_band(person.age_band), "age_band", f"participants[{i}].age_band", band,
           repr(person.age_band))
          for i, person in enumerate(spec.participants, 1)),
    ]  # fmt: skip


def _is_band(text: str) -> bool:
    match = _BAND.fullmatch(text)
    if match is None:
        return False
    low, high = int(match[1]), match[2]
    return high is None or int(high) - low + 1 >= _NARROWEST_BAND_YEARS


def _protocol(entry: EntryFolder) -> Iterator[Violation]:
    """Compare the joint with that of a protocol of jointz; other files must only exist."""
    name, joint = entry.spec.protocol, entry.spec.joint.name
    if "://" in name or name.startswith("doi:"):
        return
    is_builtin = name in builtin_protocols()
    try:
        file = name if is_builtin else entry.path(name)
    except DataError as exc:
        expected = "a protocol of jointz, a file of the entry, an address or doi:..."
        yield "file_missing", "protocol", expected, str(exc)
        return
    if not (is_builtin or name.endswith(".toml")):
        return
    try:
        planned = load_protocol(file).joint
    except DataError as exc:
        yield "protocol_unreadable", "protocol", "a protocol of jointz", str(exc)
        return
    if planned != joint:
        yield "joint_differs", "joint.name", f"{planned}, as in protocol {name}", repr(joint)
