"""The printed numbers against each other: where the dissertation contradicts itself.

Every number that the printed tables give is recomputed here from them; the few that need a
test statistic stand as numbers in :mod:`reproduction.audit_chapter4`. The sentences stand in
``audit.toml``.
"""

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from itertools import combinations
from statistics import fmean, stdev
from typing import Any, Literal

from jointz.reference import chapter2, chapter3, chapter4, row_mean
from reproduction import printed_numbers
from reproduction.audit_chapter4 import (
    BONFERRONI_PAIRS,
    PARTICIPANT_P,
    POINT_P,
    column_mean,
)

Kind = Literal["contradiction", "not possible", "ambiguous", "not reproduced", "worth knowing"]


@dataclass(frozen=True, slots=True)
class Finding:
    """One printed statement beside what the printed numbers give."""

    where: str  # table, section or figure of the dissertation
    what: str  # subject of the statement
    printed: str  # statement with its unit
    # value by the printed tables and numbers, with its unit; empty where none can be computed
    recomputed: str
    # ``contradiction``: two printed numbers exclude each other; ``not possible``: no data give the
    # number; ``ambiguous``: it can be read in several ways; ``not reproduced``: one value a
    # participant and timing point does not give it; ``worth knowing``
    kind: Kind
    remark: str  # consequence, and how it is settled here


def audit() -> tuple[Finding, ...]:
    """Return what is inconsistent in the printed text, chapter by chapter."""
    return (
        *_chapter2_means(),
        *_chapter2_statements(),
        *_chapter3_statements(),
        *_chapter4_tables(),
        *_chapter4_averages(),
        *_chapter4_statistics(),
        *_quasi_stiffness(),
    )


@cache
def _sentences() -> Mapping[str, Mapping[str, str]]:
    file = files("reproduction").joinpath("audit.toml")
    return tomllib.loads(file.read_text(encoding="utf-8"))


def _finding(name: str, /, **values: Any) -> Finding:
    """Return a finding of ``audit.toml`` with its values filled in."""
    values |= {"chapter2": chapter2, "chapter3": chapter3, "chapter4": chapter4}
    values["printed_numbers"] = printed_numbers
    texts: dict[str, Any] = {k: t.format(**values) for k, t in _sentences()[name].items()}
    return Finding(**texts)


# --- chapter II ----------------------------------------------------------------------------------


def _chapter2_means() -> Iterable[Finding]:
    tables = (
        ("stiffness", "Table 2.1", printed_numbers.STIFFNESS_ERRORS, 2),
        ("inertia", "Table 2.2", printed_numbers.INERTIA_ERRORS, 1),
    )
    for response, source, table, digits in tables:
        for load, row in table.items():
            number, mean = printed_numbers.AVERAGE_ERRORS[load], f"{row_mean(row):.{digits}f}"
            values = {"number": number, "mean": mean, "load": load}
            yield _finding("mean_error", table=source, response=response, **values)


def _chapter2_statements() -> Iterable[Finding]:
    yield _finding("cutoff")
    yield _finding("frequency")
    yield _finding("bandwidth")
    share = printed_numbers.WITH_LARGER["inertia"].value
    below = int(share / 5)
    counts = {"below": below, "below_pct": 5 * below, "above": below + 1}
    yield _finding("inertia_larger", share=share, above_pct=5 * below + 5, **counts)
    errors = {
        t: fmean(abs(row[t].value) for row in printed_numbers.STIFFNESS_ERRORS.values())
        for t in "ABDCE"
    }
    listed = ", ".join(f"{name} {value:.1f}" for name, value in errors.items())
    yield _finding("low_frequency", errors=listed, smallest=min(errors["C"], errors["E"]))
    negative = sum(
        p.value < 0 for row in printed_numbers.STIFFNESS_ERRORS.values() for p in row.values()
    )
    yield _finding("stiffness_below", negative=negative, negative_pct=5 * negative)
    yield _finding("damping_confidence")


# --- chapter III ---------------------------------------------------------------------------------


def _chapter3_statements() -> Iterable[Finding]:
    truth = chapter3.DITHER_STIFFNESS.value
    pulses = (
        printed_numbers.POSITIVE_PULSE_STIFFNESS.value,
        printed_numbers.NEGATIVE_PULSE_STIFFNESS.value,
    )
    errors = [100.0 * (value / truth - 1.0) for value in pulses]
    yield _finding("springs", truth=truth)
    yield _finding("pulse")
    yield _finding("dynamic_stiffness", signed=fmean(errors), absolute=fmean(map(abs, errors)))
    second, third = (chapter3.TORQUE_MODELS[n]["rotor_inertia"].value for n in ("3.2", "3.3"))
    yield _finding("rotor_inertia", ratio=second / third)


# --- chapter IV ----------------------------------------------------------------------------------


def _chapter4_tables() -> Iterable[Finding]:
    terminal = chapter4.INERTIA["TST"]
    mean = row_mean(terminal)
    as_printed = mean + (0.14 - terminal["S4"].value) / len(terminal)
    yield _finding("inertia_of_s4", as_printed=as_printed, mean=mean)
    zero = _cells_below(0.0, chapter4.NUMERICALLY_ZERO)
    nearly = _cells_below(chapter4.NUMERICALLY_ZERO, chapter4.NEARLY_ZERO)
    cells = len(chapter4.STIFFNESS) * len(chapter4.SUBJECTS)
    yield _finding("bound", zero=len(zero), nearly=len(nearly), cells=cells)
    yield _finding("vaf_of_s7", repeated=_repeated_vaf())
    pilot = ", ".join(f"{column_mean(chapter4.VAF, s):.2f}" for s in ("S2", "S3"))
    first, second = (printed_numbers.PILOT_VAF[number].value for number in ("1", "2"))
    yield _finding("pilot", pilot=pilot, first=first, second=second)


def _cells_below(low: float, high: float) -> set[tuple[str, str]]:
    tables = (chapter4.STIFFNESS, chapter4.DAMPING, chapter4.INERTIA)
    return {
        (point, subject)
        for table in tables
        for point, row in table.items()
        for subject, cell in row.items()
        if low <= cell.value < high
    }


def _repeated_vaf() -> str:
    """Return VAFs of S7 that are printed twice, in its column or beside it."""
    vaf = {point: row["S7"].value for point, row in chapter4.VAF.items()}
    pairs = [(a, b) for a, b in combinations(vaf, 2) if vaf[a] == vaf[b]]
    beside = [p for p, row in chapter4.VAF.items() if row["S7"].value == row["S9"].value]
    return "; ".join(
        [
            *(f"{vaf[a]:g} % at {a} and {b}" for a, b in pairs),
            *(f"{vaf[point]:g} % at {point} as S9" for point in beside),
        ]
    )


def _chapter4_averages() -> Iterable[Finding]:
    damping = {point: cell.value for point, cell in chapter4.DAMPING_MEANS.items()}
    point = min(damping, key=damping.__getitem__)
    yield _finding("lowest_damping", lowest=damping[point], point=point)
    stance = ("LRE", "MST", "TST", "PSW")
    values = " ".join(f"{damping[point]:.3f}" for point in stance)
    yield _finding("damping_in_stance", values=values, points=", ".join(stance))
    means = stdev(row_mean(row) for row in chapter4.VAF.values())
    entries = [cell.value for row in chapter4.VAF.values() for cell in row.values()]
    spread = {"of_means": means, "of_entries": stdev(entries)}
    yield _finding("vaf_sd", entries=len(entries), **spread)


def _chapter4_statistics() -> Iterable[Finding]:
    factors = (("timing_point", "timing point", POINT_P), ("participant", "subject", PARTICIPANT_P))
    for parameter, name in printed_numbers.PARAMETER_NAMES.items():
        for factor, word, p_values in factors:
            limit, p = printed_numbers.FACTOR_P_BELOW[parameter, factor].value, p_values[parameter]
            if p >= limit:
                yield _finding("effect", word=word, name=name, limit=limit, p=p)
    for parameter, name in printed_numbers.PARAMETER_NAMES.items():
        stated = list(printed_numbers.PAIRS[parameter].values()).count("different")
        pairs = BONFERRONI_PAIRS[parameter]
        listed = ", ".join("-".join(pair) for pair in pairs) or "none"
        yield _finding("pairs", name=name, stated=stated, found=len(pairs), listed=listed)


def _quasi_stiffness() -> Iterable[Finding]:
    apart = [d.value for d in chapter4.QUASI_STIFFNESS_DIFFERENCES.values()]
    yield _finding("quasi_stiffness", differences=", ".join(f"{value:.0f}" for value in apart))
    yield _finding("unpaired_test")
    implied = chapter4.implied_quasi_stiffness().values()
    yield _finding("winter", implied=", ".join(f"{value:.3f}" for value in implied))
