"""Tables 2.1 and 2.2 and figure 2.6, printed beside ours."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from statistics import fmean, stdev
from typing import Any, NamedTuple

from jointz.analysis.analyze import analyze
from jointz.core.events import PulseEstimate
from jointz.core.study import Study
from jointz.io.study_reader import open_study
from jointz.reference import Printed, chapter2
from jointz.reproduction.chapter2.chapter2_numbers import PARAMETERS, UNITS
from jointz.reproduction.reproduction_tables import Compared, ComparedTable

#: Load of the protocol -> case of the dissertation.
CASES = {f"case-{case}": case for case in chapter2.CASES}


class Pair(NamedTuple):
    """A case and trajectory: truth and estimates of one parameter."""

    case: str
    trajectory: str
    parameter: str
    truth: float
    dissertation: float
    dissertation_sd: float
    recommended: float | None
    ci_low: float | None
    ci_high: float | None


class LoadStudy(NamedTuple):
    """What the analysis of one load gave, by both methods, and the gain of its torque record."""

    pairs: list[Pair]
    vaf_pct: dict[str, float]
    single: list[PulseEstimate]
    recommended_single: list[PulseEstimate]
    torque_gain: float


def analyze_load(study: Path, load: str, truth: Mapping[str, Any], seed: int) -> LoadStudy:
    """Estimate one load of ``sea-mass-spring`` by both methods."""
    opened = _only(open_study(study), load)
    analysis = analyze(opened, method="recommended", resamples=2, seed=seed)
    letter = analyze(opened, method="dissertation", resamples=2, seed=seed)
    case = CASES.get(load, load)
    single = [_external(p, opened) for p in letter.single]
    pairs = []
    for cell in analysis.cells:
        mine = [p for p in single if p.timing_point == cell.timing_point]
        for name in PARAMETERS:
            found = cell.parameter(name)
            values = [getattr(p, name) for p in mine]
            pairs.append(
                Pair(
                    case,
                    cell.timing_point,
                    name,
                    truth["load"][name],
                    fmean(values),
                    stdev(values),
                    *((found.value, found.ci_low, found.ci_high) if found else (None, None, None)),
                )
            )
    vaf = {c.timing_point: float(c.vaf_pct) for c in letter.cells if c.vaf_pct is not None}
    return LoadStudy(
        pairs,
        vaf,
        single,
        [_external(p, opened) for p in analysis.single],
        truth["torque_gain"],
    )


def _only(study: Study, load: str) -> Study:
    """Return the study of one of its loads."""
    spec = study.spec
    kept = spec.model_copy(
        update={
            "participants": tuple(p for p in spec.participants if p.id == load),
            "recordings": tuple(r for r in spec.recordings if r.participant == load),
        }
    )
    return Study(study.root, kept, study.sha256, study.units, study.group_edges)


def _external(pulse: PulseEstimate, study: Study) -> PulseEstimate:
    """Return a pulse's estimate without the intrinsic impedance."""
    known = study.spec.participant(pulse.participant).calibration
    values = asdict(pulse)
    for name in PARAMETERS:
        entry = getattr(known, f"intrinsic_{name}", None)
        values[name] -= entry.value if entry else 0.0
    return PulseEstimate(**values)


# --- tables --------------------------------------------------------------------------------------


def error_tables(pairs: Sequence[Pair], torque_gain: float) -> tuple[ComparedTable, ...]:
    """Return tables 2.1 and 2.2 and the averages of 2.3.2."""
    gain_pct = 100.0 * (torque_gain - 1.0)
    printed: dict[str, Mapping[str, Mapping[str, Printed]]] = {
        "stiffness": chapter2.STIFFNESS_ERRORS,
        "inertia": chapter2.INERTIA_ERRORS,
    }
    numbers = {"stiffness": "2.1", "inertia": "2.2"}
    tables = []
    for parameter, rows in printed.items():
        compared = [
            _error_row(f"{load}, trajectory {trajectory}", pairs, parameter, load, trajectory, cell)
            for load, cells in rows.items()
            for trajectory, cell in cells.items()
        ]
        tables.append(
            ComparedTable(
                f"{parameter}_errors",
                f"Error of {parameter} by load and trajectory (table {numbers[parameter]})",
                f"{_defined()} Percent of the truth: mean over the two cases of a load, after the "
                "plus-minus sign their standard deviation. The dissertation's method: every pulse "
                "by least squares over 100 ms of the response, perturbed minus unperturbed. "
                "Recommended: the full record. Both hold the error of the torque's calibration, "
                f"{gain_pct:+.2f} % on this bench.",
                tuple(compared),
            )
        )
    averages = [
        _error_row(f"{load}, all trajectories", pairs, parameter, load, None, number)
        for load, number in chapter2.AVERAGE_ERRORS.items()
        for parameter in [_parameter_of(load)]
    ]
    tables.append(
        ComparedTable(
            "average_errors",
            "Average errors (2.3.2)",
            "Mean and standard deviation over the ten case-trajectory pairs of a load. Of every "
            f"error of ours {gain_pct:+.2f} % is the calibration of the torque.",
            tuple(averages),
        )
    )
    return tuple(tables)


def _defined() -> str:
    """Say what the names of loads and cases mean."""
    springs = " and ".join(f"{n} = {v.value:g} N*m/rad" for n, v in chapter2.SPRINGS.items())
    inertias = " and ".join(f"{n} = {v.value:g} kg*m^2" for n, v in chapter2.INERTIAS.items())
    cases = ", ".join(
        f"case {case}: {' and '.join(loads)}" for case, loads in chapter2.CASE_LOADS.items()
    )
    return f"Springs {springs}, inertias {inertias}; {cases}."


def _parameter_of(load: str) -> str:
    return "stiffness" if load in chapter2.SPRINGS else "inertia"


def _error_row(
    quantity: str,
    pairs: Sequence[Pair],
    parameter: str,
    load: str,
    trajectory: str | None,
    printed: Printed,
) -> Compared:
    mine = [
        p
        for p in pairs
        if p.parameter == parameter
        and load in chapter2.CASE_LOADS.get(p.case, ())
        and trajectory in (None, p.trajectory)
    ]
    letter = [error_pct(p.dissertation, p.truth) for p in mine]
    ours = [error_pct(p.recommended, p.truth) for p in mine if p.recommended is not None]
    return Compared(
        quantity=quantity,
        unit="%",
        printed=printed.value,
        printed_sd=printed.sd,
        dissertation=fmean(letter),
        dissertation_sd=stdev(letter),
        recommended=fmean(ours) if ours else None,
        note=printed.note,
    )


def error_pct(value: float, truth: float) -> float:
    """Return an error in percent of the truth."""
    return 100.0 * (value / truth - 1.0)


def pair_table(pairs: Sequence[Pair]) -> ComparedTable:
    """Return every case-trajectory pair with its truth (figure 2.6)."""
    return ComparedTable(
        "pairs",
        "Every load and trajectory (figure 2.6)",
        f"Case 1A is case 1 along trajectory A. {_defined()} The load 'damper' is case 1 with a "
        "known damper, which the dissertation had not (2.4.4). The truth is that of the simulated "
        "bench: springs and inertias were drawn within their printed uncertainty. After the "
        "plus-minus sign the standard deviation over pulses.",
        tuple(
            Compared(
                quantity=f"{_pair_name(p.case, p.trajectory)}: {p.parameter}",
                unit=UNITS[p.parameter],
                dissertation=p.dissertation,
                dissertation_sd=p.dissertation_sd,
                recommended=p.recommended,
                recommended_low=p.ci_low,
                recommended_high=p.ci_high,
                truth=p.truth,
            )
            for p in pairs
        ),
    )


def _pair_name(case: str, trajectory: str) -> str:
    return f"case {case}{trajectory}" if case in chapter2.CASES else f"{case} {trajectory}"


def vaf_table(studies: Mapping[str, LoadStudy]) -> ComparedTable:
    """Return the VAF of all pairs of the four cases."""
    values = {
        f"{CASES[load]}{trajectory}": vaf
        for load, study in studies.items()
        if load in CASES
        for trajectory, vaf in study.vaf_pct.items()
    }
    above = sum(v > chapter2.VAF_LOWER_LIMIT.value for v in values.values())
    lowest = min(values, key=values.__getitem__)
    return ComparedTable(
        "vaf",
        "Variance accounted for (2.3.3)",
        "On the average response of a pair. A VAF this high goes with inertias that are off by "
        "what the tables above show.",
        (
            Compared(
                "pairs with VAF above 99.9 %", printed=19.0, dissertation=float(above), note="of 20"
            ),
            Compared(
                "lowest VAF",
                "%",
                printed=chapter2.VAF_4B.value,
                dissertation=values[lowest],
                note=f"printed: case 4B; here: case {lowest}",
            ),
        ),
    )


def other_devices() -> ComparedTable:
    """Return what the dissertation compares itself with (2.4.1)."""
    return ComparedTable(
        "other_devices",
        "Other devices (2.4.1)",
        "Errors of others as the dissertation prints them, with its own citation numbers.",
        tuple(
            Compared(
                quantity=f"{d.quantity} [{', '.join(map(str, d.citations))}]",
                unit=d.unit,
                printed=d.high,
                note=d.note,
            )
            for d in chapter2.OTHER_DEVICES
        ),
    )
