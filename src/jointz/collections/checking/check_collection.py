"""``jointz collect check``: problems of entries, each by itself and all together."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from jointz.collections.checking.entry_checks import (
    Violation,
    hash_violations,
    metadata_violations,
)
from jointz.collections.checking.findings import CollectionCheck, Finding
from jointz.collections.checking.value_checks import value_violations
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
    """An entry with its tables, as far as they could be read, and the findings about it."""

    name: str  # name of its folder
    entry: EntryFolder | None  # None if ``entry.toml`` could not be read
    tables: tuple[ConditionTables, ...] = ()  # of the conditions that could be read
    findings: tuple[Finding, ...] = ()


def check_collection(folder: Path) -> CollectionCheck:
    """Check every entry of a collection.

    Parameters
    ----------
    folder : pathlib.Path
        The collection, with a folder for each entry; or the folder of one entry.

    Returns
    -------
    CollectionCheck
        All findings; docs/collections.md lists the codes.

    Raises
    ------
    DataError
        If the folder does not exist, or holds no folder.
    """
    entries = checked_entries(folder)
    names = tuple(checked.name for checked in entries)
    findings = [finding for checked in entries for finding in checked.findings]
    findings += common_findings(entries)
    findings.sort(key=lambda finding: names.index(finding.entry))
    return CollectionCheck(names, tuple(findings))


def checked_entries(folder: Path) -> tuple[CheckedEntry, ...]:
    """Read and check every entry by itself."""
    is_entry = (folder / ENTRY_FILE).is_file()
    return tuple(map(check_entry, (folder.resolve(),) if is_entry else entry_folders(folder)))


def check_entry(folder: Path) -> CheckedEntry:
    """Read an entry and check it by itself."""
    try:
        entry = read_entry(folder)
    except EntryError as exc:
        return CheckedEntry(folder.name, None, (), tuple(_of_shape(folder.name, exc.problems)))
    violations = list(metadata_violations(entry))
    tables = []
    for i, condition in enumerate(entry.spec.conditions):
        try:
            tables.append(read_condition(entry, condition))
        except DataError as exc:
            violations.append(_unreadable(entry, i, exc))
    hashes = {file: sha256 for table in tables for file, sha256 in table.sha256.items()}
    violations += hash_violations(entry, hashes)
    for table in tables:
        violations += value_violations(entry.spec, table)
    findings = tuple(Finding(entry.name, *violation) for violation in violations)
    return CheckedEntry(entry.name, entry, tuple(tables), findings)


def _of_shape(name: str, problems: Sequence[str]) -> Iterator[Finding]:
    """Make findings of the sentences about a file's shape."""
    for problem in problems:
        where, _, sentence = problem.partition(": ")
        expected, _, found = sentence.removeprefix("expected ").rstrip(".").partition("; got ")
        if sentence.startswith("missing"):
            reason = sentence.partition("; ")[2].rstrip(".")
            yield Finding(name, "key_missing", where, f"a value: {reason}")
        elif sentence.startswith("unknown key"):
            yield Finding(name, "key_unknown", where, "no such key", sentence.rstrip("."))
        elif where in ("not valid TOML", ENTRY_FILE):
            yield Finding(name, "entry_unreadable", ENTRY_FILE, "a TOML file", problem.rstrip("."))
        else:
            yield Finding(name, "key_value", where, expected, found)


def _unreadable(entry: EntryFolder, i: int, exc: DataError) -> Violation:
    """Return why the tables of a condition cannot be read; printed ones show by their columns."""
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


# --- between entries -----------------------------------------------------------------------------


def common_findings(entries: Sequence[CheckedEntry]) -> list[Finding]:
    """Return what entries that are sound by themselves cannot both hold."""
    specs = {checked.name: checked.entry.spec for checked in entries if checked.entry}
    studies = [(name, spec.study) for name, spec in specs.items()]
    codes = [
        (name, code)
        for name, spec in specs.items()
        for code in dict.fromkeys(person.person for person in spec.participants)
        if code
    ]
    one_study = "a study once: keep one version, or give another id"
    one_person = "everybody once in a collection: leave them out of one entry"
    return [
        *_repeated(studies, "study_twice", "study", one_study),
        *_repeated(codes, "person_twice", "participants.person", one_person),
        *_copied_tables(entries),
    ]


def _repeated(
    values: Sequence[tuple[str, str]], code: str, where: str, expected: str
) -> Iterator[Finding]:
    """Yield values that an earlier entry has too."""
    first: dict[str, str] = {}
    for name, value in values:
        if value in first:
            yield Finding(name, code, where, expected, f"{value!r} in {first[value]} too")
        first.setdefault(value, name)


def _copied_tables(entries: Sequence[CheckedEntry]) -> Iterator[Finding]:
    """Yield tables that are those of another condition or entry, byte for byte."""
    first: dict[str, str] = {}
    for name, table in ((checked.name, table) for checked in entries for table in checked.tables):
        for file, sha256 in table.sha256.items():
            place = f"{file} ({table.condition.name})"
            if sha256 in first:
                expected = "a table of its own for each condition and entry"
                found = f"that of {first[sha256]}, byte for byte"
                yield Finding(name, "values_twice", place, expected, found)
            first.setdefault(sha256, f"{name}/{place}")
