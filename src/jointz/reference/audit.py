"""The printed numbers against each other: where the dissertation contradicts itself.

Every number that the printed tables give is recomputed here from them; the few that need a
test statistic stand as numbers in :mod:`jointz.reference.audit_chapter4`.
"""

from collections.abc import Iterable
from dataclasses import asdict
from statistics import fmean

import pandas as pd

from jointz.reference import Finding, chapter2, chapter3, row_mean
from jointz.reference.audit_chapter4 import chapter4_findings


def audit() -> tuple[Finding, ...]:
    """Return what is inconsistent in the printed text, chapter by chapter."""
    return (
        *_chapter2_means(),
        *_chapter2_statements(),
        *_chapter3_statements(),
        *chapter4_findings(),
    )


def audit_table() -> pd.DataFrame:
    """Return the audit as a table, one row a finding.

    Returns
    -------
    pandas.DataFrame
        Columns ``where``, ``what``, ``printed``, ``recomputed``, ``kind``, ``remark``.
    """
    return pd.DataFrame([asdict(finding) for finding in audit()])


# --- chapter II ----------------------------------------------------------------------------------


def _chapter2_means() -> Iterable[Finding]:
    rows = {
        "stiffness": ("Table 2.1", chapter2.STIFFNESS_ERRORS),
        "inertia": ("Table 2.2", chapter2.INERTIA_ERRORS),
    }
    for response, (source, table) in rows.items():
        for load, row in table.items():
            printed, mean = chapter2.AVERAGE_ERRORS[load], row_mean(row)
            digits = 2 if response == "stiffness" else 1
            yield Finding(
                f"{printed.source}, {source}",
                f"mean {response} error, {load}",
                f"{printed.value:g} %",
                f"{mean:.{digits}f} %",
                "contradiction",
                "the mean of the five printed means; equal numbers of pulses a trajectory would "
                "make it the average",
            )


def _chapter2_statements() -> Iterable[Finding]:
    yield Finding(
        "2.2.2, figure 2.5",
        "cut-off of the noise torque",
        "40 Hz in the text",
        "30 Hz in the caption",
        "contradiction",
        "40 Hz is used here",
    )
    yield Finding(
        "2.2.3, eqs 2.2 to 2.6",
        "frequency of the references",
        "'omega is the frequency in Hz'",
        "stands in sin(omega t), which asks for rad/s",
        "ambiguous",
        "read as Hz, sin(2 pi f t): 0.8 to 2 Hz are the frequencies of gait",
    )
    yield Finding(
        "2.3.1, 2.4",
        "lowest bandwidth",
        f"{chapter2.BANDWIDTH_MINIMUM.value:g} Hz in the discussion",
        f"{chapter2.BANDWIDTH_40_NM.value:g} Hz in the results",
        "contradiction",
        "both may be limited by the spectral resolution",
    )
    share = chapter2.WITH_LARGER["inertia"].value
    below, above = int(share / 5), int(share / 5) + 1
    yield Finding(
        "2.4.2",
        "inertia larger with the trajectory",
        f"{share:g} %",
        f"{below} of 20 are {5 * below} %, {above} of 20 are {5 * above} %",
        "not possible",
        "a share of 20 case-trajectory combinations is a multiple of 5 %",
    )
    yield _better_at_low_frequency()
    negative = sum(p.value < 0 for row in chapter2.STIFFNESS_ERRORS.values() for p in row.values())
    yield Finding(
        "2.4.4, Table 2.1",
        "stiffness below its true value",
        f"{chapter2.UNDERESTIMATED_BY_PAIR['stiffness'].value:g} % of the combinations",
        f"at least {5 * negative} %: {negative} of 10 means are negative",
        "not possible",
        "a mean over two cases is negative only if one of them is",
    )
    yield Finding(
        "2.4.3, 2.4.4",
        "confidence in damping",
        "'confident in our estimates of stiffness and damping due to the low percent error'",
        "",
        "contradiction",
        "no damper was on the bench, so no percent error of damping exists; here a case with a "
        "known one is added",
    )


def _better_at_low_frequency() -> Finding:
    def error(trajectory: str) -> float:
        return fmean(abs(row[trajectory].value) for row in chapter2.STIFFNESS_ERRORS.values())

    slow = {name: error(name) for name in ("A", "B", "D")}
    fast = {name: error(name) for name in ("C", "E")}
    numbers = ", ".join(f"{name} {value:.1f}" for name, value in (slow | fast).items())
    return Finding(
        "2.4.3, Table 2.1",
        "lower stiffness errors at lower frequencies",
        "A, B, D (0.8 to 1.4 Hz) better than C, E (1.7 to 2 Hz)",
        f"mean size of the error, %: {numbers}",
        "contradiction",
        f"E has the smallest of the five ({min(fast.values()):.1f} %); it holds for inertia",
    )


# --- chapter III ---------------------------------------------------------------------------------


def _chapter3_statements() -> Iterable[Finding]:
    truth = chapter3.DITHER_STIFFNESS.value
    pulses = (chapter3.POSITIVE_PULSE_STIFFNESS.value, chapter3.NEGATIVE_PULSE_STIFFNESS.value)
    errors = [100.0 * (value / truth - 1.0) for value in pulses]
    yield Finding(
        "3.2, 3.3.3",
        "stiffness of the springs",
        "two springs of 150 N*m/rad in parallel",
        f"{truth:g} N*m/rad measured; parallel springs would have 300",
        "contradiction",
        "the simulated spring has the measured stiffness",
    )
    yield Finding(
        "3.2.3",
        "duration of the pulse",
        "250 ms",
        f"{75 + 150 + 75} ms: 75 + 150 + 75",
        "contradiction",
        "20 pulses with pauses of 2.75 s fill 60 s only at 250 ms: the hold is 100 ms here",
    )
    yield Finding(
        "3.3.3",
        "error of the dynamic stiffness",
        f"{chapter3.DYNAMIC_STIFFNESS_ERROR.value:g} %",
        f"{fmean(errors):.2f} % signed, {fmean(map(abs, errors)):.2f} % absolute",
        "contradiction",
        "from the two printed stiffnesses; neither gives the printed error",
    )
    models = chapter3.TORQUE_MODELS
    ratio = models["3.2"]["rotor_inertia"].value / models["3.3"]["rotor_inertia"].value
    yield Finding(
        "Table 3.1",
        "rotor inertia of model 2",
        f"{models['3.2']['rotor_inertia'].value:g} kg*m^2",
        f"{ratio:.0f} times that of model 3",
        "contradiction",
        "not physical; J and b of the row look exchanged",
    )
