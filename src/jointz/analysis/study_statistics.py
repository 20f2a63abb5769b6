"""Statistics and notes of an analysis."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from jointz.analysis.device_effect import device_effect
from jointz.analysis.level_tests import level_tests
from jointz.analysis.rate_checks import stride_warnings
from jointz.core.codes import Doubt, Exclusion, Failure
from jointz.core.events import PulseEstimate, PulseRecord, StrideRecord, row_label
from jointz.core.gait_phases import TIMING_POINTS
from jointz.core.grouping import by_key
from jointz.core.method_names import FULL_RECORD, PULSE_LIKELIHOOD, WITH_POSTERIOR
from jointz.core.study import Study
from jointz.identify.over_cycle.stride_curves import StrideCurves
from jointz.identify.participant import ParticipantResult
from jointz.identify.preparation.sources import SAME_TIME_S
from jointz.kernels.robust_spread import robust_sd
from jointz.results.estimates import CellEstimate
from jointz.results.log_posterior import LogPosterior
from jointz.results.statistics.quasi_stiffness_fit import QuasiStiffness
from jointz.results.study_analysis import NO_MEANS_ON_A_BENCH
from jointz.stats.description import onset_accuracy, stride_summary, vaf_summary

#: Number of names in a note; the tables have the others.
_MOST_NAMES = 3
_DAMAGED = Exclusion.DAMAGED_LOG.value


def study_statistics(
    study: Study,
    method: str,
    cells: Sequence[CellEstimate],
    results: Collection[ParticipantResult],
) -> dict[str, Any]:
    """Return the statistics and notes of a study."""
    pulses = tuple(p for r in results for p in r.pulses)
    strides = tuple(s for r in results for s in r.strides)
    gaps = tuple(g for r in results for g in r.gaps)
    single = tuple(p for r in results for p in r.single)
    walking = study.spec.kind == "walking"
    points = study.spec.perturbations.timing_points or TIMING_POINTS
    quasi_stiffness = quasi_stiffness_rows([c for r in results for c in r.curves], points)
    several_loads = not study.spec.of_people and len(study.spec.participants) > 1
    return {
        "onset_accuracy": onset_accuracy(pulses),
        "strides": stride_summary(strides, gaps),
        "vaf": vaf_summary(cells),
        "sampling": [asdict(s) for r in results for s in r.sampling],
        **_nuisance(cells),
        **_pulse_effects(single),
        **({"quasi_stiffness": quasi_stiffness} if quasi_stiffness else {}),
        **(level_tests(cells) if walking else {}),
        **(device_effect([m for r in results for m in r.mean_strides]) if walking else {}),
        "warnings": stride_warnings(strides) if walking else [],
        "notes": [
            *_exclusion_notes(study, pulses, strides),
            *_sign_notes(cells),
            *dict.fromkeys(note for r in results for note in r.notes),
            *_method_notes(method, cells),
            *_doubt_notes([p for r in results for p in r.log_posteriors]),
            *_inertia_notes(study, cells),
            *_single_notes(cells, single),
            *([NO_MEANS_ON_A_BENCH] if several_loads else []),
            *_switch_notes(results),
            *_session_notes(study, method, results),
            *_pulse_notes(study, pulses),
            *_quasi_stiffness_notes(results),
        ],
    }


def _nuisance(cells: Sequence[CellEstimate]) -> dict[str, Any]:
    """Return the parameters estimated beside the impedance, if there are any."""
    columns = ("participant", "timing_point", "parameter", "value", "unit", "ci_low", "ci_high",
               "status", "session", "side")  # fmt: skip
    rows = [
        {name: row[name] for name in columns}
        for cell in cells
        for row in replace(cell, parameters=cell.nuisance).rows()
    ]
    return {"nuisance": rows} if rows else {}


def _pulse_effects(single: Sequence[PulseEstimate]) -> dict[str, Any]:
    """Return the statistics of 2.2.4, if pulses of a bench had both signs."""
    pulses = [p for p in single if p.direction]
    if len({p.sign for p in pulses}) < 2:
        return {}
    from jointz.stats.pulse_effects import pulse_effects  # needed by benches only

    table = pd.DataFrame([asdict(p) for p in pulses])
    table = table.rename(columns={"participant": "case", "timing_point": "trajectory"})
    methods = list(dict.fromkeys(p.method for p in pulses))
    return {"pulse_effects": {"methods": methods, **pulse_effects(table).to_dict()}}


# --- notes ---------------------------------------------------------------------------------------


def damage_notes(inputs: Iterable[Mapping[str, Any]], pulses: Sequence[PulseRecord]) -> list[str]:
    """Name the seconds and pulses lost with damaged logs."""
    notes = []
    for file in inputs:
        steps = file.get("history", ())
        spans = [f"{a:.3f} to {b:.3f} s" for s in steps for a, b in s.get("damaged_s", ())]
        lost = [p for p in pulses if p.recording == file["file"] and p.code == _DAMAGED]
        if spans:
            notes.append(
                f"{file['file']}: the session's log is damaged from {', '.join(spans)}; these "
                f"records and {len(lost)} pulse{'s' * (len(lost) != 1)} are excluded."
            )
    return notes


def _exclusion_notes(
    study: Study, pulses: Sequence[PulseRecord], strides: Sequence[StrideRecord]
) -> list[str]:
    """Name the lines of ``exclusions.csv`` without effect."""
    starts = [(p.participant, p.recording, p.onset_s) for p in pulses]
    starts += [(s.participant, s.recording, s.start_s) for s in strides]
    return [
        f"exclusions.csv: no pulse or stride begins at {e.onset_s:g} s in {e.recording} of "
        f"{e.participant}; the line has no effect."
        for e in study.user_exclusions
        if not any(
            (person, file) == (e.participant, e.recording) and abs(t - e.onset_s) < SAME_TIME_S
            for person, file, t in starts
        )
    ]


def _sign_notes(cells: Sequence[CellEstimate]) -> list[str]:
    """Name the cells in which an inverted sign is likely."""
    refused = [c for c in cells if Failure.OPPOSITE_SIGN.status in {p.status for p in c.parameters}]
    zero = [
        cell
        for cell in cells
        if cell.vaf_pct is not None
        and cell.vaf_pct <= 0.0
        and {p.status for p in cell.parameters} == {"at_bound"}
    ]
    check = "Check the signs, and torque_acts_on."
    notes = []
    if refused:
        notes.append(f"the joint moves against the torque in {_names(refused)}. {check}")
    if zero:
        notes.append(
            f"stiffness, damping and inertia are all at 0 in {_names(zero)}: torque seems to "
            f"oppose the motion it causes. {check}"
        )
    return notes


def _method_notes(method: str, cells: Sequence[CellEstimate]) -> list[str]:
    """Name the cells that needed another method than the chosen one."""
    others = by_key((cell.method, cell) for cell in cells if cell.method != method)
    return [
        f"{_names(some)}: estimated by the method {used} instead of {method}, because the "
        "recording contains several cases."
        for used, some in others.items()
    ]


def _doubt_notes(models: Sequence[LogPosterior]) -> list[str]:
    """Name the participants whose responses may not be those of the model."""
    separate = any(m.session or m.side for m in models)
    noun = "sessions or sides" if separate else "participants"
    notes = []
    for doubt in Doubt:
        people = [m.label for m in models if doubt.value in m.doubts]
        if people:
            notes.append(
                f"{doubt.value} in {len(people)} of {len(models)} {noun} ({_first(people)}): "
                f"{doubt.meaning}."
            )
    return notes


def _inertia_notes(study: Study, cells: Sequence[CellEstimate]) -> list[str]:
    """Name the participants whose inertia is unlike that of the others."""
    if study.spec.kind == "bench":
        return []
    return [
        f"{person}: inertia is {ratio:.2g} times the median of all participants, which is "
        "unlikely. Check units, gains and the strap before using this participant's estimates."
        for person, ratio in inertias_out_of_line(cells).items()
    ]


def _single_notes(cells: Sequence[CellEstimate], single: Sequence[PulseEstimate]) -> list[str]:
    """Count the pulses of whole trials without an estimate of their own."""
    trials = [c for c in cells if c.method == FULL_RECORD and c.n_used]
    places = {(c.participant, c.timing_point) for c in trials}
    total = sum(c.n_used for c in trials)
    estimated = sum((p.participant, p.timing_point) in places for p in single)
    if estimated >= total:
        return []
    return [
        f"single_pulses.csv: {total - estimated} of {total} pulses have no estimate of their own "
        f"by {PULSE_LIKELIHOOD}: 250 ms do not determine stiffness, damping and inertia, or extend "
        "beyond the record."
    ]


def _switch_notes(results: Collection[ParticipantResult]) -> list[str]:
    """Name the footswitches that are declared as switches and look like voltages."""
    files = list(dict.fromkeys(file for r in results for file in r.unclean_switches))
    if not files:
        return []
    return [
        f"contact in {len(files)} recording(s) ({_first(files)}): declared as a switch, but the "
        "signal does not stay at two levels. If it is a voltage, which drifts or rises slowly, "
        'write kind = "voltage" and unit = "V" under [channels.contact] in study.toml; heel '
        "strikes are then detected in the voltage."
    ]


def _session_notes(study: Study, method: str, results: Collection[ParticipantResult]) -> list[str]:
    """Name the sessions whose unperturbed recordings are all of other sessions."""
    if study.spec.kind != "walking" or "pre_pulse" in (method, study.spec.perturbations.baseline):
        return []
    unless = (
        "" if method not in WITH_POSTERIOR else ", unless its own unperturbed strides were enough"
    )
    notes = []
    for result in results:
        unperturbed = {
            (s.participant, s.session, s.side)
            for s in result.strides
            if s.condition == "unperturbed"
        }
        for person, session, side in dict.fromkeys(
            (p.participant, p.session, p.side) for p in result.pulses
        ):
            sessions = {
                b for who, b, c in unperturbed if who == person and (c == side or "" in (c, side))
            }
            if session and sessions and not sessions & {session, ""}:
                names = " and ".join(f"'{name}'" for name in sorted(sessions))
                notes.append(
                    f"{row_label(person, session, side)}: no unperturbed recording of session "
                    f"'{session}'; the unperturbed motion of session {names} is used{unless}. The "
                    "device may have been placed differently."
                )
    return notes


def _pulse_notes(study: Study, pulses: Sequence[PulseRecord]) -> list[str]:
    """Name the command for bench records without pulses."""
    if pulses or study.spec.kind != "bench":
        return []
    return [
        "no recording contains a pulse, which analyze needs. Single recordings are estimated by "
        "jointz identify: joint (K, B and J under random torque or position), actuator, bandwidth."
    ]


def _quasi_stiffness_notes(results: Collection[ParticipantResult]) -> list[str]:
    """Distinguish quasi-stiffness from impedance."""
    people = {c.participant for r in results for c in r.curves}
    if not people:
        return []
    return [
        f"{len(people)} of {len(results)} participants were not perturbed, so their impedance "
        "cannot be estimated. quasi_stiffness.csv has the relation of moment and angle in their "
        "mean stride. It comes mostly from muscle activity and is no stiffness of the joint."
    ]


def _names(cells: Sequence[CellEstimate]) -> str:
    return _first([f"{cell.label} {cell.timing_point}" for cell in cells])


def _first(names: Sequence[str]) -> str:
    more = ", ..." if len(names) > _MOST_NAMES else ""
    return f"{', '.join(names[:_MOST_NAMES])}{more}"


LEVEL = 0.95
#: Fewer strides than this give no interval.
_FEWEST_STRIDES = 5


def quasi_stiffness_rows(
    curves: Sequence[StrideCurves], timing_points: Mapping[str, float]
) -> list[dict[str, Any]]:
    """Return the slopes and secants of every participant's mean stride.

    Intervals are t intervals of the delete-one jackknife over strides. They are those of the mean
    stride, assume independent strides, which consecutive ones are not quite, and do not include
    errors of motion capture and inverse dynamics.
    """
    return [row for one in curves for row in _rows(one, timing_points)]


def _rows(curves: StrideCurves, timing_points: Mapping[str, float]) -> Iterator[dict[str, Any]]:
    mean = curves.angle.mean(axis=0), curves.moment.mean(axis=0)
    whole = _of_stride(*mean, timing_points)
    halves = _half_widths(curves, timing_points)
    for estimate, half in zip(whole.estimates, halves, strict=True):
        value = estimate.value
        low, high = (None, None) if value is None or half is None else (value - half, value + half)
        yield {
            "participant": curves.participant,
            "side": curves.side,
            "timing_point": estimate.timing_point,
            "onset_gait_pct": estimate.onset_gait_pct,
            "measure": estimate.measure,
            "value": value,
            "unit": "N*m/rad",
            "ci_low": low,
            "ci_high": high,
            "ci_level": LEVEL,
            "r_squared": estimate.r_squared,
            "angle_range_rad": estimate.angle_range_rad,
            "n_strides": len(curves.angle),
            "status": estimate.status,
            "doubts": " ".join(estimate.doubts),
            "session": curves.session,
        }


def _of_stride(
    angle: np.ndarray, moment: np.ndarray, timing_points: Mapping[str, float]
) -> QuasiStiffness:
    from jointz.stats.quasi_stiffness_slopes import quasi_stiffness  # needed without pulses only

    return quasi_stiffness(angle, moment, timing_points=timing_points, moment_unit="N*m")


def _half_widths(
    curves: StrideCurves, timing_points: Mapping[str, float]
) -> Sequence[float | None]:
    """Return half of each interval; None if strides are too few or a value is missing."""
    n = len(curves.angle)
    n_estimates = 3 * len(timing_points)
    if n < _FEWEST_STRIDES:
        return [None] * n_estimates
    means = (
        (n * values.mean(axis=0) - values) / (n - 1) for values in (curves.angle, curves.moment)
    )
    left_out = np.array(
        [
            [
                np.nan if e.value is None else e.value
                for e in _of_stride(angle, moment, timing_points).estimates
            ]
            for angle, moment in zip(*means, strict=True)
        ]
    )
    errors = np.sqrt((n - 1) / n * ((left_out - left_out.mean(axis=0)) ** 2).sum(axis=0))
    halves = float(stdtrit(n - 1, (1.0 + LEVEL) / 2.0)) * errors
    return [float(half) if np.isfinite(half) else None for half in halves]


#: Robust sd beyond which somebody is out of line, and people needed to say so (Iglewicz and
#: Hoaglin 1993, How to detect and handle outliers).
_FAR = 3.5
_FEWEST = 5
#: Relative spread that people differ by anyway.
_USUAL = 0.1
_Z = 1.96


def inertias_out_of_line(cells: Sequence[CellEstimate]) -> Mapping[str, float]:
    """Return the participants with outlying inertia, and its ratio to the others' median.

    A participant's inertia is the median over timing points of those that stand. Its logarithm is
    compared with the median of all by their median absolute deviation, or a tenth where that is
    less, and its own error. A leg that is heavier than others by half is nothing unusual; a
    wrong unit, another strap or another joint is.
    """
    values: dict[str, list[tuple[float, float]]] = {}
    for cell in cells:
        p = cell.inertia
        if p is None or p.value is None or p.ci_low is None or p.ci_high is None:
            continue
        if p.value > 0.0:
            sd = (p.ci_high - p.ci_low) / (2.0 * _Z * p.value)
            values.setdefault(cell.participant, []).append((float(np.log(p.value)), sd))
    if len(values) < _FEWEST:
        return {}
    medians = {person: np.median(rows, axis=0) for person, rows in values.items()}
    logs = np.array([log for log, _ in medians.values()])
    middle = float(np.median(logs))
    spread = max(float(robust_sd(logs)), _USUAL)
    return {
        person: float(np.exp(log - middle))
        for person, (log, sd) in medians.items()
        if abs(log - middle) > _FAR * np.hypot(spread, sd)
    }
