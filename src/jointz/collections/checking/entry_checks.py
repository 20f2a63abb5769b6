"""What ``collect check`` looks at in an ``entry.toml``, and in the hashes of its files."""

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping

from jointz.collections.checking.ranges import (
    HEIGHT_M,
    JOINT_DIRECTIONS,
    LICENCES,
    MASS_KG,
    NARROWEST_BAND_YEARS,
    OWN_LICENCE,
    RUNNING_M_S,
    STEEPEST_DEG,
)
from jointz.collections.entry_model import Entry, Place
from jointz.collections.entry_reader import EntryFolder
from jointz.core.channels import PARAMETER_UNITS
from jointz.core.errors import DataError
from jointz.core.walking_speed import FASTEST_M_S, SLOWEST_M_S
from jointz.io.formats.columns import file_sha256
from jointz.io.protocols import builtin_protocols, load_protocol

#: Code, where, what was expected, what was found.
Found = tuple[str, str, str, str]
#: Parameters that an entry may hold.
PARAMETERS = ("stiffness", "damping", "inertia", "stiffness_per_mass", "damping_per_mass")
#: Codes on plausibility: an entry may accept them, with a reason.
ACCEPTABLE = frozenset({"out_of_range", "sign", "people_differ", "speed_range", "slope_range",
                        "mass_range", "height_range"})  # fmt: skip
_BAND = re.compile(r"(\d{1,3})(?:-(\d{1,3})|\+)")


def metadata_findings(entry: EntryFolder) -> Iterator[Found]:
    """Yield what is wrong with an entry's metadata."""
    for check in _CHECKS:
        yield from check(entry.spec)
    yield from _protocol(entry)
    yield from _licence_text(entry)


def hash_findings(entry: EntryFolder, found: Mapping[str, str]) -> Iterator[Found]:
    """Yield hashes that are missing or do not fit."""
    stated = entry.spec.hashes
    for file, sha256 in found.items():
        where = f"hashes.{file}"
        if file not in stated:
            yield "hash_missing", where, "the SHA-256 of the file", "none"
        elif stated[file].lower() != sha256:
            yield (
                "hash_differs", where, f"{stated[file][:12]}..., as stated",
                f"{sha256[:12]}...: the file was changed, or is another",
            )  # fmt: skip
    for file in stated.keys() - found.keys():
        try:
            differs = file_sha256(entry.path(file)) != stated[file].lower()
        except DataError as exc:
            yield "file_missing", f"hashes.{file}", "a file of the entry", str(exc)
            continue
        except OSError as exc:
            told = f"it cannot be read ({exc.strerror})"
            yield "file_unreadable", f"hashes.{file}", "a file that can be read", told
            continue
        if differs:
            yield "hash_differs", f"hashes.{file}", f"{stated[file][:12]}..., as stated", "another"


def _licence(spec: Entry) -> Iterator[Found]:
    if re.match(r"CC-BY(-NC)?-ND", spec.licence):
        yield "licence_forbids", "licence", "one that allows derived tables", spec.licence
    elif spec.licence not in LICENCES and not spec.licence.startswith(OWN_LICENCE):
        expected = f"an SPDX identifier such as CC-BY-4.0, or {OWN_LICENCE}NAME"
        yield "licence_unknown", "licence", expected, repr(spec.licence)


def _consent(spec: Entry) -> Iterator[Found]:
    if spec.ethics.consent == "study_only":
        expected = "public or research: consent that reaches beyond the study"
        yield "consent_forbids", "ethics.consent", expected, "study_only"
    elif spec.ethics.consent == "published" and spec.kind == "estimates":
        expected = "public or research, for values of single people"
        yield "consent_forbids", "ethics.consent", expected, "published"


def _joint(spec: Entry) -> Iterator[Found]:
    name, positive = spec.joint.name, spec.joint.positive
    if name not in JOINT_DIRECTIONS:
        yield "joint_unknown", "joint.name", f"one of {', '.join(JOINT_DIRECTIONS)}", repr(name)
    elif positive not in JOINT_DIRECTIONS[name]:
        expected = f"a direction of the {name}: {', '.join(sorted(JOINT_DIRECTIONS[name]))}"
        yield "joint_direction", "joint.positive", expected, repr(positive)


def _side_and_torque(spec: Entry) -> Iterator[Found]:
    if spec.kind == "printed":
        return
    if spec.joint.side == "not_stated":
        yield "side_missing", "joint.side", "left, right or both", "not_stated"
    if spec.joint.side == "both":
        for i, person in enumerate(spec.participants):
            if person.side is None:
                where = f"participants[{i + 1}].side"
                yield "side_missing", where, "left or right: the study has both", "none"
    if spec.device.torque == "not_stated":
        yield "torque_path_missing", "device.torque", "how torque on the joint was found", ""


def _units(spec: Entry) -> Iterator[Found]:
    for parameter, unit in spec.units.items():
        where = f"units.{parameter}"
        if parameter not in PARAMETERS:
            yield "parameter_unknown", where, f"one of {', '.join(PARAMETERS)}", repr(parameter)
        elif unit != PARAMETER_UNITS[parameter]:
            yield "unit", where, PARAMETER_UNITS[parameter], repr(unit)


def _people(spec: Entry) -> Iterator[Found]:
    for key in ("id", "person"):
        count = Counter(getattr(p, key) for p in spec.participants)
        for value in (v for v, n in count.items() if v and n > 1):
            found = f"{value!r} {count[value]} times"
            yield "person_twice", f"participants.{key}", "everybody once", found
    for i, person in enumerate(spec.participants):
        where = f"participants[{i + 1}]"
        yield from _between("mass_range", f"{where}.mass_kg", person.mass_kg, MASS_KG)
        yield from _between("height_range", f"{where}.height_m", person.height_m, HEIGHT_M)
        if not _is_band(person.age_band):
            expected = f"a band of at least {NARROWEST_BAND_YEARS} years, such as 20-29 or 80+"
            yield "age_band", f"{where}.age_band", expected, repr(person.age_band)


def _is_band(text: str) -> bool:
    found = _BAND.fullmatch(text)
    if found is None:
        return False
    low, high = int(found[1]), found[2]
    return high is None or int(high) - low + 1 >= NARROWEST_BAND_YEARS


def _between(
    code: str, where: str, value: float | None, limits: tuple[float, float]
) -> Iterator[Found]:
    low, high = limits
    if value is not None and not low <= value <= high:
        yield code, where, f"{low:g} to {high:g}", f"{value:g}"


def _conditions(spec: Entry) -> Iterator[Found]:
    ranges = {"walking": (SLOWEST_M_S, FASTEST_M_S), "running": RUNNING_M_S}
    for i, condition in enumerate(spec.conditions):
        where, speed = f"conditions[{i + 1}]", condition.walking_speed_m_s
        limits = ranges.get(condition.activity)
        yield from _speed(where, speed, limits)
        steepest = (-STEEPEST_DEG, STEEPEST_DEG)
        yield from _between("slope_range", f"{where}.slope_deg", condition.slope_deg, steepest)


def _speed(where: str, speed: float | None, limits: tuple[float, float] | None) -> Iterator[Found]:
    if speed is None:
        return
    if limits is None:
        expected = "no speed, or walking or running as activity"
        yield "speed_range", f"{where}.walking_speed_m_s", expected, f"{speed:g}"
        return
    low, high = limits
    if not low <= speed <= high:
        hint = ": km/h for m/s?" if low <= speed / 3.6 <= high else ""
        expected = f"{low:g} to {high:g} m/s"
        yield "speed_range", f"{where}.walking_speed_m_s", expected, f"{speed:g}{hint}"


def _accepted(spec: Entry) -> Iterator[Found]:
    for i, accepted in enumerate(spec.accepted):
        if accepted.code not in ACCEPTABLE:
            expected = f"one of {', '.join(sorted(ACCEPTABLE))}; others must be corrected"
            yield "accepted_unknown", f"accepted[{i + 1}].code", expected, repr(accepted.code)
        if (parameter := accepted.where.parameter) not in ("", *PARAMETERS):
            where = f"accepted[{i + 1}].where.parameter"
            yield "accepted_unknown", where, f"one of {', '.join(PARAMETERS)}", repr(parameter)


def accepts(spec: Entry, found: Found) -> bool:
    """Tell whether an entry accepts what was found, there where it was found."""
    code, where = found[:2]
    told = [one.where for one in spec.accepted if one.code == code]
    return code in ACCEPTABLE and any(
        place == Place() or where in _places(spec, place) for place in told
    )


def _places(spec: Entry, place: Place) -> Iterator[str]:
    """Yield where findings of a condition, of a parameter or of both may be."""
    for i, condition in enumerate(spec.conditions):
        if place.condition not in ("", condition.name):
            continue
        for parameter in (place.parameter,) if place.parameter else PARAMETERS:
            yield f"{condition.estimates}, {parameter}"
        if not place.parameter:
            yield from (f"conditions[{i + 1}].{key}" for key in ("walking_speed_m_s", "slope_deg"))


def _licence_text(entry: EntryFolder) -> Iterator[Found]:
    """Look for the text of a licence that SPDX has not."""
    licence = entry.spec.licence
    if not licence.startswith(OWN_LICENCE):
        return
    try:
        entry.path(f"{licence}.txt")
    except DataError as exc:
        yield "file_missing", "licence", f"its text in {licence}.txt", str(exc)


def _protocol(entry: EntryFolder) -> Iterator[Found]:
    """Compare the joint with that of a protocol of jointz; others are only seen to be there."""
    told = entry.spec.protocol
    if "://" in told or told.startswith("doi:"):
        return
    is_builtin = told in builtin_protocols()
    try:
        file = told if is_builtin else entry.path(told)
    except DataError as exc:
        expected = "a protocol of jointz, a file of the entry, an address or doi:..."
        yield "file_missing", "protocol", expected, str(exc)
        return
    if not (is_builtin or told.endswith(".toml")):
        return
    try:
        joint = load_protocol(file).joint
    except DataError as exc:
        yield "protocol_unreadable", "protocol", "a protocol of jointz", str(exc)
        return
    if joint != entry.spec.joint.name:
        found = f"{entry.spec.joint.name!r}"
        yield "joint_differs", "joint.name", f"{joint}, as protocol {told} has it", found


_CHECKS: tuple[Callable[[Entry], Iterator[Found]], ...] = (
    _licence, _consent, _joint, _side_and_torque, _units, _people, _conditions, _accepted,
)  # fmt: skip
