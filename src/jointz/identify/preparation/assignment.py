"""Assignment of pulses to timing points or groups, with a code for each excluded pulse."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise

import numpy as np

from jointz.core.codes import LISTED, Exclusion
from jointz.core.errors import DataError
from jointz.core.events import PulseRecord
from jointz.core.gait_phases import (
    ALL_POINTS,
    TIMING_POINTS,
    circular_mean_pct,
    nearest_timing_point,
    phase_difference,
)
from jointz.core.recording import damage_near, damage_of
from jointz.core.study import GroupSpec, PerturbationsSpec
from jointz.gait.phase import gait_phase, measured_phase
from jointz.identify.preparation.pulses import Pulse
from jointz.identify.preparation.sources import ParticipantSettings, Source


@dataclass(frozen=True, slots=True)
class Candidate:
    """A pulse with its timing point and, if it is excluded, its code."""

    source: int  # index of the recording among the sources
    pulse: Pulse
    record: PulseRecord
    elapsed_s: float  # s: time since the last heel strike, or since the start of a bench trial
    # % of the gait cycle: phase of the onset, predicted from the strides before it
    predicted_pct: float | None = None


def assign_pulses(
    participant: str,
    sources: Sequence[Source],
    settings: ParticipantSettings,
    *,
    baseline: str,
    alone: bool = False,
) -> list[Candidate]:
    """Return every pulse with its timing point or group, and a code if it is excluded.

    A pulse's timing point is the one its table names; otherwise the time since the last heel
    strike over the mean of the last three accepted strides, modulo one, takes the nearest timing
    point. A named timing point that the measured phase contradicts excludes the pulse, and
    DataError is raised if there are many. An unreliable phase excludes a pulse only if its timing
    point or its baseline depends on the phase. ``alone`` keeps the only usable pulse of a timing
    point.
    """
    candidates: list[Candidate] = []
    for index, source in enumerate(sources):
        if source.input.condition == "perturbed" and source.pulses:
            candidates += _candidates(participant, index, source, settings, baseline=baseline)
    named = [c for c in candidates if c.record.target_pct is not None]
    check_labels([(c.pulse, c.record, c.predicted_pct) for c in named])
    usable = Counter(c.record.timing_point for c in candidates if not c.record.code)
    lone = Exclusion.LONE_PULSE.value
    return [
        replace(c, record=replace(c.record, code=lone))
        if not (alone or c.record.code) and usable[c.record.timing_point] == 1
        else c
        for c in candidates
    ]


def _candidates(
    participant: str,
    index: int,
    source: Source,
    settings: ParticipantSettings,
    *,
    baseline: str,
) -> list[Candidate]:
    onsets = np.array([p.onset_s for p in source.pulses])
    window_s, file = settings.perturbations.window_s, source.input.file
    by_gait, grouped = settings.kind.by_gait, settings.perturbations.group is not None
    unnamed = np.array([not p.timing_point for p in source.pulses])
    needs_phase = (baseline != "pre_pulse") | (by_gait and not grouped) & unnamed
    phase_pct, elapsed_s, phase_codes = _phases(onsets, source, settings, needs_phase)
    labels = _labels(source, phase_pct, settings)
    overlap_codes = _overlaps(source.pulses, window_s)
    _, window_codes = source.signals.cut(onsets, before_s=0.0, after_s=window_s)
    damage_s, guard_s = damage_of(source.input.recording), source.signals.guard_s
    nameless = Exclusion.OUTSIDE_GROUPS if grouped else Exclusion.NO_HEEL_STRIKES
    outside = is_outside(onsets, source)
    measured_pct = np.full(onsets.size, np.nan)
    if source.strides is not None:
        measured_pct = measured_phase(onsets, source.strides)
    candidates = []
    for k, pulse in enumerate(source.pulses):
        last_s = max(window_s, _known(pulse.duration_s) or 0.0)
        damage = damage_near(damage_s, pulse.onset_s - guard_s, pulse.onset_s + last_s + guard_s)
        user = settings.left_out_by(file, pulse.onset_s)
        target_pct = settings.timing_points.get(labels[k]) if by_gait else None
        # A pulse is timed by the predicted phase, and the measured one of an irregular stride
        # differs from it: a name is wrong if it contradicts both.
        phases = (_known(measured_pct[k]), None if phase_codes[k] else _known(phase_pct[k]))
        conflicts = [contradicts(pulse, pct, target_pct) for pct in phases if pct is not None]
        contradiction = conflicts[0] if conflicts and all(conflicts) else ""
        codes = (
            Exclusion.EDGE_OF_RECORD.value if outside[k] else "",
            Exclusion.DAMAGED_LOG.value if damage else "",
            phase_codes[k],
            "" if labels[k] else nameless.value,
            Exclusion.LABEL_CONTRADICTS_PHASE.value if contradiction else "",
            overlap_codes[k],
            window_codes[k],
        )
        code = next(filter(None, codes), "")
        detail = "its onset lies outside the perturbed samples" if outside[k] else damage
        if code == Exclusion.LABEL_CONTRADICTS_PHASE.value:
            detail = contradiction
        record = PulseRecord(
            participant=participant,
            recording=file,
            onset_s=pulse.onset_s,
            duration_s=_known(pulse.duration_s),
            amplitude=_known(pulse.amplitude),
            timing_point=labels[k],
            target_pct=target_pct,
            measured_pct=_known(measured_pct[k]),
            code=user.code if user else code,
            detail=user.reason if user else detail,
        )
        candidates.append(
            Candidate(index, pulse, record, float(elapsed_s[k]), _known(phase_pct[k]))
        )
    return candidates


def _known(value: float) -> float | None:
    return None if np.isnan(value) else float(value)


def is_outside(onsets: np.ndarray, source: Source) -> np.ndarray:
    """Return whether onsets lie before or after all samples of a recording, (n,) bool."""
    time = source.input.recording["time"].to_numpy()
    return np.asarray((onsets < time[0]) | (onsets > time[-1]))


def _phases(
    onsets: np.ndarray, source: Source, settings: ParticipantSettings, needed: np.ndarray
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Return predicted phase (%), time since the last strike (s) and codes of each onset.

    An unreliable phase has a code if the phase is needed, and is NaN otherwise.
    """
    unknown = np.full(onsets.size, np.nan)
    if not settings.kind.by_gait and source.strides is None:
        return unknown, onsets - source.input.recording["time"].to_numpy()[0], [""] * onsets.size
    if source.strides is None:
        return unknown, unknown, [""] * onsets.size
    if source.strides.start_s.size == 0:
        codes = np.where(needed, Exclusion.NO_HEEL_STRIKES.value, "")
        return unknown, unknown, codes.tolist()
    phase = gait_phase(onsets, source.strides)
    known = needed | (np.array(phase.code) == "")
    codes = np.where(known, phase.code, "")
    return np.where(known, phase.pct, np.nan), phase.elapsed_s, codes.tolist()


def _labels(source: Source, phase_pct: np.ndarray, settings: ParticipantSettings) -> list[str]:
    """Return each pulse's timing point, group, trial or case; "" if it has none."""
    group = settings.perturbations.group
    if group is not None:
        return _group_labels(source, group, settings)
    attrs = source.input.recording.attrs
    # Trials of one session are repetitions of one case.
    case = attrs["session"] or attrs["trial"] or "all_pulses"
    labels = []
    for pulse, pct in zip(source.pulses, phase_pct, strict=True):
        nearest = "" if np.isnan(pct) else nearest_timing_point(pct, settings.timing_points)
        labels.append(pulse.timing_point or (nearest if settings.kind.by_gait else case))
    if ALL_POINTS in labels:
        file = source.input.file
        raise DataError(
            f'{file}: a timing point, session or trial is called "{ALL_POINTS}", which means all '
            "of them. Give it another name.",
            path=file,
        )
    return labels


def _group_labels(source: Source, group: GroupSpec, settings: ParticipantSettings) -> list[str]:
    recording = source.input.recording
    time, values = recording["time"].to_numpy(), recording[group.channel].to_numpy()
    onsets = [p.onset_s for p in source.pulses]
    at_onset = values[np.clip(np.searchsorted(time, onsets), 0, time.size - 1)]
    index = np.digitize(at_onset, settings.group_edges) - 1
    names = group_names(group)
    return [
        names[i] if 0 <= i < len(names) and np.isfinite(x) else ""
        for i, x in zip(index, at_onset, strict=True)
    ]


def label_names(perturbations: PerturbationsSpec, seen: Sequence[str]) -> list[str]:
    """Return the groups or timing points that a study has results for, in their order.

    Default timing points without a pulse are left out, unless none has a pulse.
    """
    if perturbations.group is not None:
        return group_names(perturbations.group)
    points = perturbations.timing_points or TIMING_POINTS
    ordered = sorted(points, key=lambda name: points[name])
    if perturbations.timing_points is None and seen:
        ordered = [name for name in ordered if name in seen]
    return list(dict.fromkeys([*ordered, *seen]))


def group_names(group: GroupSpec) -> list[str]:
    """Return the names of the groups, with edges and unit as in the study file."""
    unit = f" {group.unit}" if group.unit else ""
    return [f"{a:g}..{b:g}{unit}" for a, b in pairwise(group.edges)]


def _overlaps(pulses: Sequence[Pulse], window_s: float) -> list[str]:
    codes = [""] * len(pulses)
    latest_s = -np.inf  # a long pulse may outlast a short one inside it; NaN is ignored
    for i, (pulse, following) in enumerate(pairwise(pulses)):
        latest_s = max(latest_s, pulse.onset_s + pulse.duration_s)
        if following.onset_s < pulse.onset_s + window_s:
            codes[i] = Exclusion.OVERLAPPING_PULSE.value
        if following.onset_s < latest_s:
            codes[i + 1] = Exclusion.OVERLAPPING_PULSE.value
    return codes


#: Largest distance of a pulse from the timing point that its table names, % of the gait cycle. The
#: eight phases of the cycle reach at most 9.5 % from their middles.
_FARTHEST_PCT = 10.0
#: Share and number of contradicted pulses from which the table or the heel strikes are wrong.
_MOST_SHARE, _FEWEST = 0.2, 3
#: Share of the pulses that a cause has to explain.
_EXPLAINED = 0.8
#: Distances of the other leg's heel strikes, % of the gait cycle.
_OTHER_LEG_PCT = (40.0, 60.0)
_CODE = Exclusion.LABEL_CONTRADICTS_PHASE.value

_Labelled = tuple[Pulse, PulseRecord, float | None]  # the last is the predicted phase, %


def contradicts(pulse: Pulse, phase_pct: float | None, target_pct: float | None) -> str:
    """Return how far a pulse is from the timing point of its table, "" if it may be there."""
    if not pulse.timing_point or phase_pct is None or target_pct is None:
        return ""
    if abs(phase_difference(phase_pct, target_pct)) <= _FARTHEST_PCT:
        return ""
    return f"at {phase_pct:.1f} % of the gait cycle, {pulse.timing_point} is at {target_pct:g} %"


def check_labels(pulses: Sequence[_Labelled]) -> None:
    """Refuse pulses of which many contradict their table, in one recording or in all together."""
    known = [
        row
        for row in pulses
        if row[0].timing_point and row[1].code not in LISTED and _phase(row) is not None
    ]
    files = [list(rows) for _, rows in groupby(known, key=lambda row: row[1].recording)]
    for rows in (*files, known):
        wrong = [r for _, r, _ in rows if r.code == _CODE]
        if len(wrong) < _FEWEST or len(wrong) <= _MOST_SHARE * len(rows):
            continue
        names = ", ".join(dict.fromkeys(r.recording for r in wrong))
        raise DataError(
            f"{names}: {len(wrong)} of {len(rows)} pulses lie more than {_FARTHEST_PCT:g} % of the "
            f"gait cycle from the timing point that the pulse table names, such as the one at "
            f"{wrong[0].onset_s:.6g} s: {wrong[0].detail}. {_likely_cause(rows)} Correct the "
            "table's timing_point, or the heel strikes if the table is right. Without the column "
            "timing_point every pulse takes the timing point nearest to its phase.",
            path=wrong[0].recording,
        )


def _phase(row: _Labelled) -> float | None:
    _, record, predicted_pct = row
    return predicted_pct if record.measured_pct is None else record.measured_pct


def _likely_cause(known: Sequence[_Labelled]) -> str:
    """Return the likely cause of the contradictions, in words."""
    pairs = np.array([(_phase(row), row[1].target_pct) for row in known], dtype=float)
    phases, targets = pairs[:, 0], pairs[:, 1]
    for step, neighbour in ((-1, "before"), (1, "after")):
        # Pulse k has the phase that the table names at the row after or before it.
        if _share_near(phases, np.roll(targets, step)) >= _EXPLAINED:
            return (
                f"Each name fits the pulse {neighbour} it: are the names of the table moved by "
                "one pulse?"
            )
    differences = np.asarray(phase_difference(phases - targets, 0.0))
    shift = float(phase_difference(circular_mean_pct(differences), 0.0))
    if _share_near(differences, np.full(differences.size, shift)) >= _EXPLAINED:
        low, high = _OTHER_LEG_PCT
        leg = "of the other leg, or " if low <= abs(shift) <= high else ""
        way = "later" if shift > 0 else "earlier"
        return (
            f"Most are about {abs(shift):.0f} % {way} than their names say: are the heel strikes "
            f"{leg}of an inverted or delayed footswitch, or the onsets of another clock?"
        )
    return "Is it the table of another trial, or are the footswitch or timing_points wrong?"


def _share_near(phases: np.ndarray, targets: np.ndarray) -> float:
    near = np.abs(phase_difference(phases - targets, 0.0)) <= _FARTHEST_PCT
    return float(np.mean(near)) if near.size else 0.0
