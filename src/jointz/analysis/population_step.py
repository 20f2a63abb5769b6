"""What an analysis says beside its estimates: description, effects of pulses, and notes."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict
from statistics import median
from typing import Any

import pandas as pd

from jointz.analysis.likelihood_pulses import METHOD as PULSE_LIKELIHOOD
from jointz.analysis.quasi_stiffness_rows import quasi_stiffness_rows
from jointz.analysis.rate_checks import stride_warnings
from jointz.core.codes import Doubt, Exclusion, Failure
from jointz.core.events import PulseEstimate, PulseRecord, StrideRecord, row_label
from jointz.core.gait_phases import TIMING_POINTS
from jointz.core.study import Study
from jointz.identify.bench.bench_cells import METHOD as FULL_RECORD
from jointz.identify.participant import ParticipantResult
from jointz.identify.preparation.sources import SAME_TIME_S
from jointz.identify.recommended.walking_estimator import METHOD as RECOMMENDED
from jointz.results.estimates import CellEstimate
from jointz.results.participant_model import ParticipantModel
from jointz.results.study_analysis import NO_MEANS_ON_A_BENCH
from jointz.stats.description import onset_accuracy, stride_summary, vaf_summary
from jointz.stats.out_of_line import inertias_out_of_line
from jointz.stats.pulse_effects import pulse_effects

#: So many names are told; the tables hold the others.
_TOLD = 3
_DAMAGED = Exclusion.DAMAGED_LOG.value
#: A model this probable is called likely, its contrary unlikely.
_LIKELY = 0.9


def study_statistics(
    study: Study,
    method: str,
    cells: Sequence[CellEstimate],
    results: Collection[ParticipantResult],
) -> dict[str, Any]:
    """Return the statistics of a study, and the notes about them."""
    pulses = tuple(p for r in results for p in r.pulses)
    strides = tuple(s for r in results for s in r.strides)
    gaps = tuple(g for r in results for g in r.gaps)
    single = tuple(p for r in results for p in r.single)
    return {
        "onset_accuracy": onset_accuracy(pulses),
        "strides": stride_summary(strides, gaps),
        "vaf": vaf_summary(cells),
        "sampling": [asdict(s) for r in results for s in r.sampling],
        **_nuisance(cells),
        **_pulse_effects(single),
        **_quasi_stiffness(study, results),
        "warnings": stride_warnings(strides) if study.spec.kind == "walking" else [],
        "notes": [
            *_exclusion_notes(study, pulses, strides),
            *_sign_notes(cells),
            *_method_notes(method, cells),
            *_model_notes([m for r in results for m in r.models]),
            *_doubt_notes([m for r in results for m in r.models]),
            *_inertia_notes(study, cells),
            *_single_notes(cells, single),
            *_mean_notes(study),
            *_switch_notes(results),
            *_session_notes(study, method, results),
            *_pulse_notes(study, pulses),
            *_quasi_stiffness_notes(results),
        ],
    }


def _nuisance(cells: Sequence[CellEstimate]) -> dict[str, Any]:
    """Return what was estimated beside the impedance, where there is any."""
    rows = [
        {
            "participant": cell.participant,
            "timing_point": cell.timing_point,
            "parameter": p.name,
            "value": p.value,
            "unit": p.unit,
            "ci_low": p.ci_low,
            "ci_high": p.ci_high,
            "status": p.status,
            "session": cell.session,
            "side": cell.side,
        }
        for cell in cells
        for p in cell.nuisance
    ]
    return {"nuisance": rows} if rows else {}


def _quasi_stiffness(study: Study, results: Collection[ParticipantResult]) -> dict[str, Any]:
    """Return the quasi-stiffness of those who were never perturbed, where there are any."""
    curves = [c for r in results for c in r.curves]
    if not curves:
        return {}
    points = study.spec.perturbations.timing_points or TIMING_POINTS
    rows = quasi_stiffness_rows(curves, points)
    return {"quasi_stiffness": rows} if rows else {}


def _pulse_effects(single: Sequence[PulseEstimate]) -> dict[str, Any]:
    """Return the statistics of 2.2.4, where pulses of a bench went both ways."""
    rows = [p for p in single if p.direction]
    if len({p.sign for p in rows}) < 2:
        return {}
    table = pd.DataFrame(
        {
            "case": [p.participant for p in rows],
            "trajectory": [p.timing_point for p in rows],
            "trial": [p.trial for p in rows],
            "sign": [p.sign for p in rows],
            "direction": [p.direction for p in rows],
            "stiffness": [p.stiffness for p in rows],
            "inertia": [p.inertia for p in rows],
        }
    )
    methods = list(dict.fromkeys(p.method for p in rows))
    return {"pulse_effects": {"methods": methods, **pulse_effects(table).to_dict()}}


# --- notes: what the user should know and would otherwise not see --------------------------------


def damage_notes(inputs: Iterable[Mapping[str, Any]], pulses: Sequence[PulseRecord]) -> list[str]:
    """Say which seconds and pulses damaged logs cost."""
    notes = []
    for one in inputs:
        steps = one.get("history", ())
        holes = [f"{a:.3f} to {b:.3f} s" for s in steps for a, b in s.get("damaged_s", ())]
        lost = [p for p in pulses if p.recording == one["file"] and p.code == _DAMAGED]
        if holes:
            notes.append(
                f"{one['file']}: the session's log is damaged from {', '.join(holes)}; these "
                f"records and {len(lost)} pulse{'s' * (len(lost) != 1)} are left out."
            )
    return notes


def _exclusion_notes(
    study: Study, pulses: Sequence[PulseRecord], strides: Sequence[StrideRecord]
) -> list[str]:
    moments = [(p.participant, p.recording, p.onset_s) for p in pulses]
    moments += [(s.participant, s.recording, s.start_s) for s in strides]
    return [
        f"exclusions.csv: nothing begins at {e.onset_s:g} s in {e.recording} of "
        f"{e.participant}; the line had no effect."
        for e in study.user_exclusions
        if not any(
            (person, file) == (e.participant, e.recording) and abs(t - e.onset_s) < SAME_TIME_S
            for person, file, t in moments
        )
    ]


def _sign_notes(cells: Sequence[CellEstimate]) -> list[str]:
    """Say where a turned sign is the likely reason for a refusal, or for nothing but zeros."""
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
    """Say where another method than the chosen one had to be used."""
    others = [cell for cell in cells if cell.method != method]
    return [
        f"{_names([c for c in others if c.method == used])}: estimated by the method {used}, not "
        f"{method}: the recording holds several cases, or one linear load does not explain its "
        "torque."
        for used in dict.fromkeys(c.method for c in others)
    ]


def _model_notes(models: Sequence[ParticipantModel]) -> list[str]:
    """Say what the recommended method found about joints and sensors."""
    if not models:
        return []
    n = len(models)
    lags = [1e3 * m.lag_s for m in models]
    strides = [m.n_strides for m in models]
    return [
        f"lag: the angle was found to be {_spanned(lags, '.1f')} ms behind the torque (sd "
        f"{1e3 * median(m.lag_sd_s for m in models):.1f} ms); models.csv has each.",
        "resonance of soft tissue between joint and sensor: "
        f"{_told_likely([m.resonance_probability for m in models])} of {n}.",
        "one inertia for all timing points: "
        f"{_told_likely([m.constant_inertia_probability for m in models])} of {n}.",
        "stiffness and damping that change inside the window along the curve through the timing "
        f"points: {_told_likely([m.curve_probability for m in models])} of {n}.",
        f"unperturbed motion was learned from {_spanned(strides, 'd')} strides a participant.",
    ]


def _doubt_notes(models: Sequence[ParticipantModel]) -> list[str]:
    """Say in whose responses a linear joint is doubtful, and why that may be."""
    notes = []
    for doubt in Doubt:
        people = [m.label for m in models if doubt.value in m.doubts]
        if people:
            told = f"{', '.join(people[:_TOLD])}{', ...' if len(people) > _TOLD else ''}"
            notes.append(f"{doubt.value} in {_counted(people, models)} ({told}): {doubt.meaning}.")
    return notes


def _counted(some: Sequence[str], models: Sequence[ParticipantModel]) -> str:
    """Return "2 of 6 participants", or what else has a model of its own."""
    apart = any(m.session or m.side for m in models)
    return f"{len(some)} of {len(models)} {'sessions or sides' if apart else 'participants'}"


def _spanned(values: Sequence[float], form: str) -> str:
    low, high = format(min(values), form), format(max(values), form)
    return low if low == high else f"{low} to {high}"


def _told_likely(probabilities: Sequence[float]) -> str:
    """Count what is likely, open and unlikely."""
    likely = sum(p >= _LIKELY for p in probabilities)
    unlikely = sum(p <= 1.0 - _LIKELY for p in probabilities)
    open_ = len(probabilities) - likely - unlikely
    counts = {"likely": likely, "open": open_, "unlikely": unlikely}
    return ", ".join(f"{word} in {count}" for word, count in counts.items() if count)


def _inertia_notes(study: Study, cells: Sequence[CellEstimate]) -> list[str]:
    """Say whose inertia is out of line with that of the others."""
    if study.spec.kind == "bench":
        return []
    return [
        f"{person}: inertia is {ratio:.2g} times the median of all participants, out of line with "
        "theirs. Check units, gains and the strap before using this participant's estimates."
        for person, ratio in inertias_out_of_line(cells).items()
    ]


def _single_notes(cells: Sequence[CellEstimate], single: Sequence[PulseEstimate]) -> list[str]:
    """Say how many pulses of whole trials have no estimate of their own."""
    whole = [c for c in cells if c.method == FULL_RECORD and c.n_used]
    there = {(c.participant, c.timing_point) for c in whole}
    n = sum(c.n_used for c in whole)
    alone = sum((p.participant, p.timing_point) in there for p in single)
    if alone >= n:
        return []
    return [
        f"single_pulses.csv: {n - alone} of {n} pulses have no estimate of their own by "
        f"{PULSE_LIKELIHOOD}: 250 ms do not decide stiffness, damping and inertia, or leave the "
        "record."
    ]


def _mean_notes(study: Study) -> list[str]:
    """Say why a bench with several loads has no means."""
    loads = not study.spec.of_people and len(study.spec.participants) > 1
    return [NO_MEANS_ON_A_BENCH] if loads else []


def _switch_notes(results: Collection[ParticipantResult]) -> list[str]:
    """Say which footswitches are read as switches and look like voltages."""
    files = list(dict.fromkeys(file for r in results for file in r.unclean_switches))
    if not files:
        return []
    told = f"{', '.join(files[:_TOLD])}{', ...' if len(files) > _TOLD else ''}"
    return [
        f"contact in {len(files)} recording(s) ({told}): read as a switch of two levels, at which "
        "it does not rest. Where it is a voltage, which drifts or rises slowly, write kind = "
        '"voltage" and unit = "V" under [channels.contact] in study.toml: heel strikes are then '
        "found in it as in a voltage."
    ]


def _session_notes(study: Study, method: str, results: Collection[ParticipantResult]) -> list[str]:
    """Say whose pulses of one session have unperturbed recordings of other sessions only."""
    if study.spec.kind != "walking" or "pre_pulse" in (method, study.spec.perturbations.baseline):
        return []
    own = "" if method != RECOMMENDED else ", unless its own undisturbed strides were enough"
    notes = []
    for result in results:
        there = {
            (s.participant, s.session, s.side)
            for s in result.strides
            if s.condition == "unperturbed"
        }
        for person, session, side in dict.fromkeys(
            (p.participant, p.session, p.side) for p in result.pulses
        ):
            others = {b for who, b, c in there if who == person and (c == side or "" in (c, side))}
            if session and others and not others & {session, ""}:
                told = " and ".join(f"'{name}'" for name in sorted(others))
                notes.append(
                    f"{row_label(person, session, side)}: no unperturbed recording of session "
                    f"'{session}'; its unperturbed motion is that of session {told}{own}. The "
                    "device may have sat differently."
                )
    return notes


def _pulse_notes(study: Study, pulses: Sequence[PulseRecord]) -> list[str]:
    """Say where else to go with a bench record that holds no pulse."""
    if pulses or study.spec.kind != "bench":
        return []
    return [
        "no recording holds a pulse, which analyze needs. Torque models, the bandwidth of a torque "
        "loop and a load in noise are estimated from single recordings: jointz identify --help."
    ]


def _quasi_stiffness_notes(results: Collection[ParticipantResult]) -> list[str]:
    """Say what there is instead of impedance, and that it is something else."""
    people = {c.participant for r in results for c in r.curves}
    if not people:
        return []
    return [
        f"nobody was perturbed in {len(people)} of {len(results)}: no impedance can be told. "
        "quasi_stiffness.csv has how moment goes with angle in their mean stride. Muscles make "
        "most of that: it is no stiffness of the joint."
    ]


def _names(cells: Sequence[CellEstimate]) -> str:
    names = [f"{cell.label} {cell.timing_point}" for cell in cells]
    return f"{', '.join(names[:_TOLD])}{', ...' if len(names) > _TOLD else ''}"
