"""Tables 4.1 to 4.4 again: printed people, and simulated ones by both methods with their truth."""

from collections.abc import Mapping, Sequence
from math import isfinite
from statistics import fmean, stdev

import numpy as np
import pandas as pd

from jointz.core.gait_phases import TIMING_POINTS
from jointz.reference import chapter4
from jointz.reproduction.chapter4.walking import PARAMETERS, WalkedStudy
from jointz.reproduction.reproduction_tables import (
    Compared,
    ComparedTable,
    GridBlock,
    ParticipantGrid,
)

_NAMES = {"stiffness_per_mass": "Stiffness", "damping_per_mass": "Damping", "inertia": "Inertia"}
_NUMBERS = {"stiffness_per_mass": "4.1", "damping_per_mass": "4.2", "inertia": "4.3"}
_BLOCKS = {
    "dissertation": "simulated people, dissertation's method",
    "recommended": "simulated people, recommended method",
    "truth": "simulated people, truth",
}
_OTHERS = (
    "The printed people and the simulated ones share the heads of the columns and nothing else: "
    "below S1 stands the first of ten simulated people, who is nobody's copy."
)
_PRINTED_DIGITS = 3


def participant_grids(found: WalkedStudy) -> tuple[ParticipantGrid, ...]:
    """Return tables 4.1 to 4.4, a block each for print, both methods and the truth."""
    return (*(_parameter_grid(found, name) for name in PARAMETERS), _vaf_grid(found))


def _parameter_grid(found: WalkedStudy, name: str) -> ParticipantGrid:
    number = _NUMBERS[name]
    blocks = [_printed_block(name)]
    blocks += [
        _block(label, found.of(source, name), found.people, "value")
        for source, label in _BLOCKS.items()
    ]
    return ParticipantGrid(
        f"table_{number.replace('.', '_')}",
        f"{_NAMES[name]} (table {number})",
        " ".join([_OTHERS, *_remarks(found, name)]),
        PARAMETERS[name],
        chapter4.SUBJECTS,
        tuple(blocks),
    )


def _remarks(found: WalkedStudy, name: str) -> list[str]:
    remarks = []
    own = found.of("recommended", name)
    refused = int(own["value"].isna().sum())
    if refused:
        people = sorted(set(own.loc[own["value"].isna(), "participant"]))
        remarks.append(
            f"The recommended method left {refused} of {len(own)} values undecided (of "
            f"{', '.join(people)}): they are empty, and no part of an average."
        )
    at_bound = int((found.of("dissertation", name)["status"] == "at_bound").sum())
    if at_bound:
        remarks.append(f"{at_bound} of the dissertation's method stand at their bound of 0.")
    if name == "inertia":
        remarks.append(
            "Printed inertia is of device and joint together; the simulated one is of the joint, "
            "as the torque model takes off the rotor's. A simulated person has one inertia, which "
            "the recommended method weighs against six: its rows repeat nearly the same estimate "
            "and are not six findings."
        )
    return remarks


def _vaf_grid(found: WalkedStudy) -> ParticipantGrid:
    blocks = [_printed_block("vaf")]
    blocks += [
        _block(_BLOCKS[source], found.of(source, "inertia"), found.people, "vaf_pct")
        for source in ("dissertation", "recommended")
    ]
    return ParticipantGrid(
        "table_4_4",
        "Variance accounted for (table 4.4)",
        f"{_OTHERS} The VAF is that of the torque of the average response by the dissertation's "
        "method, and of its angle by the recommended one; a model has no truth of it.",
        "%",
        chapter4.SUBJECTS,
        tuple(blocks),
    )


def _printed_block(name: str) -> GridBlock:
    rows, means = chapter4.TABLES[name], chapter4.MEANS[name]
    return GridBlock(
        "printed",
        {point: tuple(rows[point][s].value for s in chapter4.SUBJECTS) for point in TIMING_POINTS},
        {point: means[point].value for point in TIMING_POINTS},
    )


def _block(label: str, rows: pd.DataFrame, people: Sequence[str], column: str) -> GridBlock:
    values: dict[tuple[str, str], float] = {
        (row["timing_point"], row["participant"]): float(row[column])
        for row in rows.to_dict("records")
    }
    cells = {
        point: tuple(_known(values.get((point, person))) for person in people)
        + (None,) * (len(chapter4.SUBJECTS) - len(people))
        for point in TIMING_POINTS
    }
    return GridBlock(label, cells, {point: _mean(row) for point, row in cells.items()})


def _known(value: float | None) -> float | None:
    return value if value is not None and isfinite(value) else None


def _mean(values: Sequence[float | None]) -> float | None:
    there = [v for v in values if v is not None]
    return fmean(there) if there else None


# --- means over people ---------------------------------------------------------------------------


def means_table(found: WalkedStudy) -> ComparedTable:
    """Return the mean over people of every parameter at every timing point."""
    rows = [_mean_row(found, name, point) for name in PARAMETERS for point in TIMING_POINTS] + [
        _vaf_row(found, point) for point in TIMING_POINTS
    ]
    return ComparedTable(
        "means",
        "Means over people",
        "Printed: the averages of tables 4.1 to 4.4; the standard deviation over the printed "
        "people, which is not printed, stands in the note. Dissertation's method: mean and "
        "standard deviation over the simulated people. The recommended mean is the mean of the "
        "population that the people are drawn from (of inertia the geometric one), with its 95 % "
        "interval; undecided values count by what they tell. Truth: the mean over the ten "
        "simulated people, whose values were drawn about the printed means, so that a mean like "
        "the printed one is no finding about the real knee.",
        tuple(rows),
    )


def _mean_row(found: WalkedStudy, name: str, point: str) -> Compared:
    table = found.population
    pooled = table[(table["parameter"] == name) & (table["timing_point"] == point)]
    mean = dict(pooled.iloc[0]) if len(pooled) else {}
    ours, truth = (found.at(source, name, point) for source in ("dissertation", "truth"))
    return Compared(
        quantity=f"{_NAMES[name].lower()} at {point}",
        unit=PARAMETERS[name],
        printed=chapter4.MEANS[name][point].value,
        dissertation=_mean(ours),
        dissertation_sd=_sd(ours),
        recommended=_known(mean.get("value")),
        recommended_low=_known(mean.get("ci_low")),
        recommended_high=_known(mean.get("ci_high")),
        truth=_mean(truth),
        note=_sd_of_printed(name, point),
    )


def _vaf_row(found: WalkedStudy, point: str) -> Compared:
    ours, theirs = (
        found.at(source, "inertia", point, column="vaf_pct")
        for source in ("dissertation", "recommended")
    )
    return Compared(
        quantity=f"VAF at {point}",
        unit="%",
        printed=chapter4.VAF_MEANS[point].value,
        dissertation=_mean(ours),
        dissertation_sd=_sd(ours),
        recommended=_mean(theirs),
        note=_sd_of_printed("vaf", point),
    )


def _sd_of_printed(name: str, point: str) -> str:
    row = chapter4.TABLES[name][point]
    sd = stdev(row[subject].value for subject in chapter4.SUBJECTS)
    return f"printed people: SD {sd:.{_PRINTED_DIGITS}g}"


def _sd(values: Sequence[float]) -> float | None:
    return stdev(values) if len(values) > 1 else None


# --- accuracy ------------------------------------------------------------------------------------


def accuracy_table(found: WalkedStudy) -> ComparedTable:
    """Return how far both methods are from the truth, and what VAF says of it."""
    errors = {
        (source, name): _errors(found, source, name)
        for source in ("dissertation", "recommended")
        for name in PARAMETERS
    }
    rows = []
    for name in PARAMETERS:
        ours, theirs = errors["dissertation", name], errors["recommended", name]
        label = _NAMES[name].lower()
        kinds = (("mean error", "bias_pct"), ("RMS error", "rms_pct"), ("coverage", "covered_pct"))
        rows += [
            Compared(
                f"{label}: {words}" + (" of the 95 % intervals" if key == "covered_pct" else ""),
                "%",
                dissertation=ours[key],
                recommended=theirs[key],
                note=_counted(ours, theirs),
            )
            for words, key in kinds
        ]
        rows.append(
            Compared(
                f"{label}: rank correlation of VAF and absolute error",
                "",
                dissertation=ours["vaf_rank"],
                note="-1 if a higher VAF always meant a smaller error",
            )
        )
    vaf = {s: found.of(s, "inertia")["vaf_pct"].dropna().tolist() for s in _BLOCKS}
    rows.append(
        Compared(
            "VAF, mean over people and timing points",
            "%",
            printed=chapter4.VAF_MEAN.value,
            printed_sd=chapter4.VAF_MEAN.sd,
            dissertation=_mean(vaf["dissertation"]),
            recommended=_mean(vaf["recommended"]),
            note=chapter4.VAF_MEAN.note,
        )
    )
    return ComparedTable(
        "accuracy",
        "What the VAF does not show",
        "Error of every estimate in % of its truth, over people and timing points, and the share "
        "of 95 % intervals that hold the truth. The VAF says how well a model follows the torque "
        "it was fitted to; a lag between angle and torque of a few milliseconds, or walking that "
        "was taken off wrongly, is followed as well, and moves stiffness, damping and inertia.",
        tuple(rows),
    )


def _errors(found: WalkedStudy, source: str, name: str) -> Mapping[str, float | None]:
    """Return bias, RMS and coverage in %, counts, and rank correlation with VAF."""
    keys = ["participant", "timing_point"]
    truth = found.of("truth", name)[[*keys, "value"]].rename(columns={"value": "truth"})
    rows = found.of(source, name).merge(truth, on=keys)
    there = rows.dropna(subset=["value"])
    told: dict[str, float | None] = {"n": len(there), "refused": len(rows) - len(there)}
    if there.empty:
        return told | dict.fromkeys(("bias_pct", "rms_pct", "covered_pct", "vaf_rank"))
    numbers = there[["value", "truth", "ci_low", "ci_high", "vaf_pct"]].to_numpy(float)
    value, true, low, high, vaf = numbers.T
    error = 100.0 * (value / true - 1.0)
    return told | {
        "bias_pct": float(error.mean()),
        "rms_pct": float(np.sqrt((error**2).mean())),
        "covered_pct": 100.0 * float(((low <= true) & (true <= high)).mean()),
        "vaf_rank": _rank_correlation(vaf, np.abs(error)),
    }


def _rank_correlation(one: np.ndarray, other: np.ndarray) -> float | None:
    """Return Spearman's coefficient, None where either does not vary."""
    return _known(float(pd.Series(one).rank().corr(pd.Series(other).rank())))


def _counted(ours: Mapping[str, float | None], theirs: Mapping[str, float | None]) -> str:
    text = f"{ours['n']:.0f} and {theirs['n']:.0f} estimates"
    if ours["refused"] or theirs["refused"]:
        text += f"; {ours['refused']:.0f} and {theirs['refused']:.0f} refused"
    return text
