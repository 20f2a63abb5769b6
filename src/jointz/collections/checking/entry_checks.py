"""Checks of an ``entry.toml``, and of the hashes of its files."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping

from jointz.collections.checking.ranges import (
    HEIGHT_M,
    JOINT_DIRECTIONS,
    LICENCES,
    MASS_KG,
    NARROWEST_BAND_YEARS,
    OWN_LICENCE,
    RUNNING_M_S,
    STEEPEST_DEG,
    Range,
)
from jointz.collections.entry_model import Condition, Entry, Person, Place
from jointz.collections.entry_reader import EntryFolder
from jointz.core.channels import PARAMETER_UNITS
from jointz.core.errors import DataError
from jointz.core.gait_phases import FASTEST_M_S, SLOWEST_M_S
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
#: Codes on plausibility: an entry may accept them, with a reason.
ACCEPTABLE = frozenset({"out_of_range", "sign", "people_differ", "speed_range", "slope_range",
                        "mass_range", "height_range"})  # fmt: skip
_BAND = re.compile(r"(\d{1,3})(?:-(\d{1,3})|\+)")
_SPEEDS_M_S = {"walking": (SLOWEST_M_S, FASTEST_M_S), "running": RUNNING_M_S}


def metadata_violations(entry: EntryFolder) -> Iterator[Violation]:
    """Yield what is wrong with an entry's metadata."""
    spec = entry.spec
    rules = _study_rules(spec) + _people_rules(spec)
    for i, condition in enumerate(spec.conditions, 1):
        rules += _condition_rules(f"conditions[{i}]", condition)
    yield from (rule[1:] for rule in rules + _accepted_rules(spec) if rule[0])
    yield from _protocol(entry)
    if spec.licence.startswith(OWN_LICENCE):
        try:
            entry.path(f"{spec.licence}.txt")
        except DataError as exc:
            yield "file_missing", "licence", f"its text in {spec.licence}.txt", str(exc)


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
    licence, consent, joint = spec.licence, spec.ethics.consent, spec.joint
    of_people = spec.kind == "estimates"
    forbids = re.match(r"CC-BY(-NC)?-ND", licence) is not None
    is_known = licence in LICENCES or licence.startswith(OWN_LICENCE)
    directions = sorted(JOINT_DIRECTIONS.get(joint.name, ()))
    return [
        (forbids, "licence_forbids", "licence", "one that allows derived tables", licence),
        (not forbids and not is_known, "licence_unknown", "licence",
         f"an SPDX identifier such as CC-BY-4.0, or {OWN_LICENCE}NAME", repr(licence)),
        (consent == "study_only", "consent_forbids", "ethics.consent",
         "public or research: consent that reaches beyond the study", consent),
        (consent == "published" and of_people, "consent_forbids", "ethics.consent",
         "public or research, for values of single people", consent),
        (not directions, "joint_unknown", "joint.name",
         f"one of {', '.join(JOINT_DIRECTIONS)}", repr(joint.name)),
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
    rules: list[Rule] = [
        (bool(name) and n > 1, "person_twice", f"participants.{key}", "everybody once",
         f"{name!r} {n} times")
        for key, count in counts.items() for name, n in count.items()
    ]  # fmt: skip
    for i, person in enumerate(spec.participants, 1):
        rules += _person_rules(f"participants[{i}]", person)
    return rules


def _person_rules(where: str, person: Person) -> list[Rule]:
    band = f"a band of at least {NARROWEST_BAND_YEARS} years, such as 20-29 or 80+"
    return [
        _range_rule("mass_range", f"{where}.mass_kg", person.mass_kg, MASS_KG),
        _range_rule("height_range", f"{where}.height_m", person.height_m, HEIGHT_M),
        (not _is_band(person.age_band), "age_band", f"{where}.age_band", band,
         repr(person.age_band)),
    ]  # fmt: skip


def _is_band(text: str) -> bool:
    match = _BAND.fullmatch(text)
    if match is None:
        return False
    low, high = int(match[1]), match[2]
    return high is None or int(high) - low + 1 >= NARROWEST_BAND_YEARS


def _range_rule(code: str, where: str, value: float | None, limits: Range) -> Rule:
    low, high = limits
    outside = value is not None and not low <= value <= high
    return outside, code, where, f"{low:g} to {high:g}", f"{value:g}" if outside else ""


def _condition_rules(where: str, condition: Condition) -> list[Rule]:
    speed, key = condition.walking_speed_m_s, f"{where}.walking_speed_m_s"
    rules = [_range_rule("slope_range", f"{where}.slope_deg", condition.slope_deg,
                         (-STEEPEST_DEG, STEEPEST_DEG))]  # fmt: skip
    if speed is None:
        return rules
    if condition.activity not in _SPEEDS_M_S:
        expected = "no speed, or walking or running as activity"
        return [(True, "speed_range", key, expected, f"{speed:g}"), *rules]
    low, high = _SPEEDS_M_S[condition.activity]
    hint = ": km/h for m/s?" if low <= speed / 3.6 <= high else ""
    expected = f"{low:g} to {high:g} m/s"
    return [(not low <= speed <= high, "speed_range", key, expected, f"{speed:g}{hint}"), *rules]


def _accepted_rules(spec: Entry) -> list[Rule]:
    codes = f"one of {', '.join(sorted(ACCEPTABLE))}; other findings must be corrected"
    rules: list[Rule] = []
    for i, accepted in enumerate(spec.accepted, 1):
        where, code, parameter = f"accepted[{i}]", accepted.code, accepted.where.parameter
        rules += [
            (code not in ACCEPTABLE, "accepted_unknown", f"{where}.code", codes, repr(code)),
            (parameter not in ("", *PARAMETERS), "accepted_unknown", f"{where}.where.parameter",
             f"one of {', '.join(PARAMETERS)}", repr(parameter)),
        ]  # fmt: skip
    return rules


def accepts(spec: Entry, violation: Violation) -> bool:
    """Tell whether an entry accepts a violation at its place."""
    code, where = violation[:2]
    places = [accepted.where for accepted in spec.accepted if accepted.code == code]
    return code in ACCEPTABLE and any(
        place == Place() or where in _positions(spec, place) for place in places
    )


def _positions(spec: Entry, place: Place) -> Iterator[str]:
    """Yield where findings of a condition, of a parameter or of both may be."""
    for i, condition in enumerate(spec.conditions, 1):
        if place.condition not in ("", condition.name):
            continue
        for parameter in (place.parameter,) if place.parameter else PARAMETERS:
            yield f"{condition.estimates}, {parameter}"
        if not place.parameter:
            yield from (f"conditions[{i}].{key}" for key in ("walking_speed_m_s", "slope_deg"))


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
