"""``jointz collect check``: what is wrong with entries, each by itself and all together."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from jointz.collections.checking.copy_checks import copied_tables, copied_values
from jointz.collections.checking.entry_checks import (
    Found,
    accepts,
    hash_findings,
    metadata_findings,
)
from jointz.collections.checking.findings import CollectionCheck, Finding
from jointz.collections.checking.value_checks import not_sized, value_findings
from jointz.collections.entry_model import ENTRY_FILE
from jointz.collections.entry_reader import (
    ConditionTables,
    EntryFolder,
    columns_of,
    entry_folders,
    read_condition,
    read_entry,
)
from jointz.core.errors import DataError, EntryError


@dataclass(frozen=True, slots=True)
class CheckedEntry:
    """An entry, what it holds as far as it could be read, and what was found in it."""

    name: str  # its folder
    entry: EntryFolder | None  # none where ``entry.toml`` could not be read
    tables: tuple[ConditionTables, ...] = ()  # of the conditions that could be read
    findings: tuple[Finding, ...] = ()  # everything found; that which the entry itself accepts
    accepted: tuple[Finding, ...] = ()


def check_collection(folder: Path) -> CollectionCheck:
    """Check every entry of a collection.

    Parameters
    ----------
    folder : pathlib.Path
        The collection, with a folder for each entry; or the folder of one entry.

    Returns
    -------
    CollectionCheck
        Everything found; docs/collections.md lists the codes.

    Raises
    ------
    DataError
        When the folder is none, or holds no folder.
    """
    checked = checked_entries(folder)
    findings = [finding for one in checked for finding in one.findings]
    findings += common_findings(checked)
    names = tuple(one.name for one in checked)
    accepted = tuple(finding for one in checked for finding in one.accepted)
    order = {name: k for k, name in enumerate(names)}
    findings.sort(key=lambda finding: order[finding.entry])
    unseen = [(one, not_sized(one.entry.spec, one.tables)) for one in checked if one.entry]
    told = tuple(f"{one.name}: {parameters}" for one, parameters in unseen if parameters)
    return CollectionCheck(names, tuple(findings), accepted, told)


def checked_entries(folder: Path) -> tuple[CheckedEntry, ...]:
    """Read and check every entry by itself."""
    one = (folder / ENTRY_FILE).is_file()
    return tuple(map(check_entry, (folder.resolve(),) if one else entry_folders(folder)))


def check_entry(folder: Path) -> CheckedEntry:
    """Read an entry and check it by itself."""
    try:
        entry = read_entry(folder)
    except EntryError as exc:
        problems = exc.problems
        return CheckedEntry(folder.name, None, (), tuple(_of_shape(folder.name, problems)))
    found = list(metadata_findings(entry))
    tables = []
    for i, condition in enumerate(entry.spec.conditions):
        try:
            tables.append(read_condition(entry, condition))
        except DataError as exc:
            found.append(_unread(entry, i, exc))
    hashes = {file: sha256 for one in tables for file, sha256 in one.sha256.items()}
    found += hash_findings(entry, hashes)
    for one in tables:
        found += value_findings(entry.spec, one)
    findings, accepted = _sorted_out(entry, found)
    return CheckedEntry(entry.name, entry, tuple(tables), findings, accepted)


def _of_shape(name: str, problems: Sequence[str]) -> Iterator[Finding]:
    """Make findings of the sentences about a file's shape."""
    for problem in problems:
        where, _, told = problem.partition(": ")
        expected, _, found = told.removeprefix("expected ").rstrip(".").partition("; got ")
        if told.startswith("missing"):
            why = told.partition("; ")[2].rstrip(".")
            yield Finding(name, "key_missing", where, f"a value: {why}")
        elif told.startswith("unknown key"):
            yield Finding(name, "key_unknown", where, "no such key", told.rstrip("."))
        elif where in ("not valid TOML", ENTRY_FILE):
            yield Finding(name, "entry_unreadable", ENTRY_FILE, "a TOML file", problem.rstrip("."))
        else:
            yield Finding(name, "key_value", where, expected, found)


def _unread(entry: EntryFolder, i: int, exc: DataError) -> Found:
    """Say why the tables of a condition cannot be read; printed ones are known by their columns."""
    file = entry.spec.conditions[i].estimates
    where = f"conditions[{i + 1}].estimates"
    try:
        columns = columns_of(entry, file)
    except DataError:
        columns = ()
    if entry.spec.kind == "estimates" and "statistic" in columns and "ci_low" not in columns:
        found = f"the columns of printed values in {file}"
        return "printed_as_estimates", where, "the columns of estimates.csv", found
    return "table_unreadable", where, "tables that can be read", str(exc)


def _sorted_out(
    entry: EntryFolder, found: Iterable[Found]
) -> tuple[tuple[Finding, ...], tuple[Finding, ...]]:
    """Tell what the entry itself accepts from what it must correct."""
    told = [(Finding(entry.name, *one), accepts(entry.spec, one)) for one in found]
    return (
        tuple(finding for finding, accepted in told if not accepted),
        tuple(finding for finding, accepted in told if accepted),
    )


# --- between entries -----------------------------------------------------------------------------


def common_findings(checked: Sequence[CheckedEntry]) -> list[Finding]:
    """Return what entries that are sound by themselves cannot both hold."""
    tables = [(one.name, table) for one in checked for table in one.tables]
    of_people = {one.name for one in checked if one.entry and one.entry.spec.kind == "estimates"}
    return [
        *_studies_twice(checked),
        *_codes_twice(checked),
        *copied_tables(tables),
        *copied_values([(name, table) for name, table in tables if name in of_people]),
    ]


def _studies_twice(checked: Sequence[CheckedEntry]) -> Iterator[Finding]:
    first: dict[str, str] = {}
    for one in checked:
        if one.entry is None:
            continue
        study = one.entry.spec.study
        if study in first:
            found = f"{study!r} in {first[study]} too"
            expected = "a study once: keep one version, or give another id"
            yield Finding(one.name, "study_twice", "study", expected, found)
        first.setdefault(study, one.name)


def _codes_twice(checked: Sequence[CheckedEntry]) -> Iterator[Finding]:
    first: dict[str, str] = {}
    for one in checked:
        people = one.entry.spec.participants if one.entry else ()
        codes = dict.fromkeys(person.person for person in people if person.person)
        for code in codes:
            if code in first:
                expected = "everybody once in a collection: leave them out of one entry"
                found = f"{code!r} in {first[code]} too"
                yield Finding(one.name, "person_twice", "participants.person", expected, found)
        first |= {code: one.name for code in codes if code not in first}
