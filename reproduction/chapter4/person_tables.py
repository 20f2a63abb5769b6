"""Tables 4.1 to 4.4 and figures 4.4 and A.1: printed people beside simulated ones."""

from collections.abc import Mapping, Sequence
from math import isfinite
from statistics import fmean, stdev
from typing import Any

import numpy as np
import pandas as pd

from jointz.core.channels import PARAMETER_UNITS
from jointz.core.gait_phases import TIMING_POINTS
from jointz.reference import chapter4, row_mean
from jointz.reference.literature import COMPARISONS, stated_stiffness_range
from reproduction import literature, printed_numbers
from reproduction.chapter4.walking import WalkedStudy
from reproduction.printed_numbers import PARAMETER_NAMES
from reproduction.printed_settings import PEOPLE
from reproduction.reproduction_tables import (
    Compared,
    ComparedTable,
    GridBlock,
    ParticipantGrid,
    compare,
    compared_table,
    heading,
    texts,
)

_BLOCKS = {
    "dissertation": "simulated people, dissertation's method",
    "recommended": "simulated people, recommended method",
    "truth": "simulated people, truth",
}
_METHODS = ("dissertation", "recommended")
#: Studies of figure A.1, by how they estimate.
STUDIES = ("tucker", "kooij", "sartori", "pfeifer")


def participant_grids(study: WalkedStudy) -> tuple[ParticipantGrid, ...]:
    """Return tables 4.1 to 4.4, a block each for print, both methods and the truth."""
    return (
        *(
            _grid(study, f"table_4_{number}", name, name, tuple(_BLOCKS))
            for number, name in enumerate(PARAMETER_NAMES, start=1)
        ),
        _grid(study, "table_4_4", "vaf", "inertia", _METHODS),
    )


def _grid(
    study: WalkedStudy, table: str, printed: str, parameter: str, sources: Sequence[str]
) -> ParticipantGrid:
    vaf = printed == "vaf"
    cells = {
        point: tuple(row[subject].value for subject in chapter4.SUBJECTS)
        for point, row in chapter4.TABLES[printed].items()
    }
    means = {point: mean.value for point, mean in chapter4.MEANS[printed].items()}
    blocks = [GridBlock("printed", cells, means)]
    for source in sources:
        rows = study.of(source, parameter).set_index(["timing_point", "participant"])
        blocks.append(
            _block(_BLOCKS[source], rows["vaf_pct" if vaf else "value"].to_dict(), study.people)
        )
    name, title, caption = heading(4, table)
    remarks = [] if vaf else _remarks(study, parameter, table)
    return ParticipantGrid(
        name,
        title,
        " ".join([caption, *remarks]),
        "%" if vaf else PARAMETER_UNITS[parameter],
        chapter4.SUBJECTS,
        tuple(blocks),
    )


def _block(label: str, values: Mapping[Any, float | None], people: Sequence[str]) -> GridBlock:
    empty = (None,) * (len(chapter4.SUBJECTS) - len(people))
    cells = {
        point: (*(_known(values.get((point, person))) for person in people), *empty)
        for point in TIMING_POINTS
    }
    return GridBlock(label, cells, {point: _mean(row) for point, row in cells.items()})


def _remarks(study: WalkedStudy, name: str, table: str) -> list[str]:
    remarks = []
    recommended = study.of("recommended", name)
    refused = recommended.loc[recommended["value"].isna(), "participant"]
    if len(refused):
        remarks.append(
            f"The recommended method left {len(refused)} of {len(recommended)} values undecided "
            f"(of {', '.join(sorted(set(refused)))}): they are empty, and no part of an average."
        )
    at_bound = int((study.of("dissertation", name)["status"] == "at_bound").sum())
    if at_bound:
        remarks.append(f"{at_bound} of the dissertation's method stand at their bound of 0.")
    remark = texts()["chapter4"][table].get("remark")
    return [*remarks, remark] if remark else remarks


def _known(value: float | None) -> float | None:
    return float(value) if value is not None and isfinite(value) else None


def _mean(values: Sequence[float | None]) -> float | None:
    known = [v for v in values if v is not None]
    return fmean(known) if known else None


def _spread(values: Sequence[float]) -> tuple[float | None, float | None]:
    """Return mean and standard deviation, None where there are too few values."""
    return _mean(values), stdev(values) if len(values) > 1 else None


def _printed_sd(name: str, point: str) -> float:
    return stdev(cell.value for cell in chapter4.TABLES[name][point].values())


# --- means over people ---------------------------------------------------------------------------


def means_table(study: WalkedStudy) -> ComparedTable:
    """Return the mean over people of every parameter at every timing point."""
    rows = []
    for name in (*PARAMETER_NAMES, "vaf"):
        for point in TIMING_POINTS:
            vaf = name == "vaf"
            parameter, column = ("inertia", "vaf_pct") if vaf else (name, "value")
            values = {s: study.at(s, parameter, point, column=column) for s in _BLOCKS}
            ours = _mean(values["recommended"]) if vaf else _population(study, name, point)
            rows.append(
                compare(
                    f"{'VAF' if vaf else PARAMETER_NAMES[name]} at {point}",
                    "%" if vaf else PARAMETER_UNITS[name],
                    chapter4.MEANS[name][point],
                    _spread(values["dissertation"]),
                    ours,
                    truth=_mean(values["truth"]),
                    note=f"printed people: SD {_printed_sd(name, point):.3g}",
                    built_in="" if vaf else PEOPLE[name],
                )
            )
    return compared_table(4, "means", rows)


def _population(study: WalkedStudy, name: str, point: str) -> tuple[float | None, ...]:
    """Return the recommended mean of people with its interval."""
    table = study.population
    rows = table[(table["parameter"] == name) & (table["timing_point"] == point)]
    if rows.empty:
        return None, None, None
    return tuple(_known(rows[column].iloc[0]) for column in ("value", "ci_low", "ci_high"))


# --- accuracy ------------------------------------------------------------------------------------

_ERRORS = {
    "bias_pct": "mean error",
    "rms_pct": "RMS error",
    "covered_pct": "coverage of the 95 % intervals",
}


def accuracy_table(study: WalkedStudy) -> ComparedTable:
    """Return how far both methods are from the truth, and what VAF says of it."""
    rows: list[Compared] = []
    for name, label in PARAMETER_NAMES.items():
        ours, theirs = (_errors(study, source, name) for source in _METHODS)
        note = f"{ours['n']} and {theirs['n']} estimates"
        if ours["refused"] or theirs["refused"]:
            note += f"; {ours['refused']} and {theirs['refused']} refused"
        rows += [
            compare(
                f"{label}: {words}", "%", dissertation=ours[key], recommended=theirs[key], note=note
            )
            for key, words in _ERRORS.items()
        ]
        rows.append(
            compare(
                f"{label}: rank correlation of VAF and absolute error",
                dissertation=ours["vaf_rank"],
                note="-1 if a higher VAF always meant a smaller error",
            )
        )
    vaf = (_mean(study.of(s, "inertia")["vaf_pct"].dropna().tolist()) for s in _METHODS)
    overall = compare(
        "VAF, mean over people and timing points", "%", printed_numbers.VAF_MEAN, *vaf
    )
    return compared_table(4, "accuracy", (*rows, overall))


def _errors(study: WalkedStudy, source: str, name: str) -> Mapping[str, Any]:
    """Return bias, RMS and coverage in %, counts, and rank correlation with VAF."""
    keys = ["participant", "timing_point"]
    truth = study.of("truth", name)[[*keys, "value"]].rename(columns={"value": "truth"})
    rows = study.of(source, name).merge(truth, on=keys)
    known = rows.dropna(subset=["value"])
    counts = {"n": len(known), "refused": len(rows) - len(known)}
    if known.empty:
        return counts | dict.fromkeys((*_ERRORS, "vaf_rank"))
    numbers = known[["value", "truth", "ci_low", "ci_high", "vaf_pct"]].to_numpy(float)
    value, true, low, high, vaf = numbers.T
    error = 100.0 * (value / true - 1.0)
    ranks = pd.Series(vaf).rank(), pd.Series(np.abs(error)).rank()
    return counts | {
        "bias_pct": float(error.mean()),
        "rms_pct": float(np.sqrt((error**2).mean())),
        "covered_pct": 100.0 * float(((low <= true) & (true <= high)).mean()),
        # Spearman's coefficient, None where either does not vary.
        "vaf_rank": _known(float(ranks[0].corr(ranks[1]))),
    }


# --- figures 4.4 and A.1 -------------------------------------------------------------------------


def impedance_figure(study: WalkedStudy) -> dict[str, Any]:
    """Return what figure 4.4 draws.

    Bars of the printed values and of the dissertation's method are the standard deviation over
    people, of the recommended method the 95 % interval of the mean, of the truth none.
    """
    return {
        "onset_pct": dict(TIMING_POINTS),
        "parameters": {name: _sources(study, name) for name in PARAMETER_NAMES},
        "quasi_stiffness": dict(chapter4.implied_quasi_stiffness()),
        "stated": {"stiffness_per_mass": _stated_ranges()},
    }


def _sources(study: WalkedStudy, name: str) -> dict[str, list[dict[str, Any]]]:
    bars: dict[str, list[dict[str, Any]]] = {
        source: [] for source in ("printed", "dissertation", "recommended", "truth")
    }
    for point in TIMING_POINTS:
        printed = row_mean(chapter4.TABLES[name][point]), _printed_sd(name, point)
        value, low, high = _population(study, name, point)
        if value is None:
            low = high = None
        bars["printed"].append(_bar(point, *printed))
        bars["dissertation"].append(_bar(point, *_spread(study.at("dissertation", name, point))))
        bars["recommended"].append({"point": point, "value": value, "low": low, "high": high})
        bars["truth"].append(_bar(point, _mean(study.at("truth", name, point))))
    return bars


def _bar(point: str, mean: float | None, sd: float | None = None) -> dict[str, Any]:
    known = mean is not None and sd is not None
    low, high = (mean - sd, mean + sd) if known else (None, None)  # type: ignore[operator]
    return {"point": point, "value": mean, "low": low, "high": high}


def _stated_ranges() -> list[dict[str, Any]]:
    """Return the only values of others that the text states: those given by a printed factor."""
    rows = []
    for study in STUDIES:
        for point in TIMING_POINTS:
            stated = stated_stiffness_range(study, point)
            if stated is not None:
                name = literature.STUDIES[study].name
                rows.append({"study": name, "point": point, "low": stated[0], "high": stated[1]})
    return rows


def literature_figure(study: WalkedStudy) -> dict[str, Any]:
    """Return what figure A.1 draws."""
    return {
        "onset_pct": dict(TIMING_POINTS),
        "stiffness": _sources(study, "stiffness_per_mass"),
        "stated": _stated_ranges(),
        "studies": [
            {
                "name": literature.STUDIES[other].name,
                "approach": literature.STUDIES[other].approach,
                "words": {point: _words(other, point) for point in TIMING_POINTS},
            }
            for other in STUDIES
        ],
    }


def _words(study: str, point: str) -> str:
    """Return what the text says of a study's stiffness at a timing point beside the printed."""
    for said in COMPARISONS:
        if (said.study, said.quantity) != (study, "stiffness") or point not in said.timing_points:
            continue
        if said.factor_low is not None and said.factor_high is not None:
            times = f"{said.factor_low:g}\N{EN DASH}{said.factor_high:g} times"
            return f"{said.relation}, {times}"
        return said.relation
    return ""
