"""One participant's recordings to impedance at every timing point."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace

from jointz.core.codes import Exclusion
from jointz.core.events import (
    GapRecord,
    PulseEstimate,
    PulseRecord,
    SamplingRecord,
    StrideRecord,
)
from jointz.core.recording import damage_near, damage_of
from jointz.gait.heel_strikes import is_unclean_switch
from jointz.gait.timestamps import find_gaps, rate_hz
from jointz.identify.bench.bench_cells import METHOD as FULL_RECORD
from jointz.identify.bench.bench_cells import FullRecordEstimator
from jointz.identify.methods.cell_estimator import CellEstimator
from jointz.identify.methods.cells import METHODS
from jointz.identify.over_cycle.stride_curves import StrideCurves, stride_curves
from jointz.identify.preparation.assignment import assign_pulses
from jointz.identify.preparation.recording_groups import Unit, recording_groups, unit_of
from jointz.identify.preparation.sources import (
    ParticipantSettings,
    RecordingInput,
    Source,
    prepare_sources,
)
from jointz.identify.recommended.walking_estimator import METHOD as RECOMMENDED
from jointz.identify.recommended.walking_estimator import WalkingEstimator
from jointz.identify.recommended.walking_evidence import Evidence
from jointz.results.estimates import CellEstimate
from jointz.results.participant_model import ParticipantModel


@dataclass(frozen=True, slots=True)
class ParticipantResult:
    """Everything found in one participant's recordings."""

    cells: Mapping[str, tuple[CellEstimate, ...]]  # method -> cells
    single: tuple[PulseEstimate, ...]  # pulses of a bench, each by itself
    pulses: tuple[PulseRecord, ...]  # every one found
    strides: tuple[StrideRecord, ...]
    gaps: tuple[GapRecord, ...]
    # what the recommended method found about joint and sensor, of every session and side
    models: tuple[ParticipantModel, ...] = ()
    evidence: tuple[Evidence, ...] = ()  # what it explained, and by what
    # strides of somebody who was never perturbed, where a moment was recorded
    curves: tuple[StrideCurves, ...] = ()
    sampling: tuple[SamplingRecord, ...] = ()  # how fast each recording was sampled
    # recordings whose footswitch, declared as one of two levels, does not rest at two
    unclean_switches: tuple[str, ...] = ()
    # session and side of the perturbed recordings; "" where the study does not state them, and on a
    # bench
    units: tuple[Unit, ...] = ()


def analyze_participant(
    participant: str, recordings: Sequence[RecordingInput], settings: ParticipantSettings
) -> ParticipantResult:
    """Estimate a participant's impedance by session, side and timing point or group."""
    parts: list[ParticipantResult] = []
    known: set[int] = set()
    for unit, group in recording_groups(recordings, walking=settings.walking):
        parts.append(_analyze_group(participant, unit, group, settings, known))
        known |= set(map(id, group))
    return ParticipantResult(
        cells={m: tuple(c for p in parts for c in p.cells[m]) for m in settings.methods},
        **{
            name: tuple(one for part in parts for one in getattr(part, name))
            for name in ParticipantResult.__slots__
            if name != "cells"
        },
    )


def _analyze_group(
    participant: str,
    unit: Unit | None,
    recordings: Sequence[RecordingInput],
    settings: ParticipantSettings,
    known: Container[int],
) -> ParticipantResult:
    """Estimate a session and side; strides of recordings known by another one are not repeated."""
    sources = prepare_sources(recordings, settings)
    new = [s for s, given in zip(sources, recordings, strict=True) if id(given) not in known]
    cells: dict[str, tuple[CellEstimate, ...]] = {}
    pulses: dict[str, list[PulseRecord]] = {}
    single: tuple[PulseEstimate, ...] = ()
    model: ParticipantModel | None = None
    evidence: Evidence | None = None
    for name in settings.methods:
        estimator = _estimator(name, participant, sources, settings)
        candidates = assign_pulses(
            participant,
            sources,
            settings,
            baseline=estimator.baseline,
            alone=name == RECOMMENDED,
        )
        cells[name], pulses[name] = estimator.run(candidates)
        single = single or estimator.single
        if isinstance(estimator, WalkingEstimator):
            model, evidence = estimator.model, estimator.evidence
    session, side = unit or ("", "")
    return ParticipantResult(
        cells={
            name: tuple(replace(c, session=session, side=side) for c in own)
            for name, own in cells.items()
        },
        single=single,
        pulses=tuple(replace(p, session=session, side=side) for p in pulses[settings.methods[0]]),
        strides=tuple(_stride_records(participant, new, settings)),
        gaps=tuple(_gap_records(participant, new)),
        models=() if model is None else (replace(model, session=session, side=side),),
        evidence=() if evidence is None else (replace(evidence, session=session, side=side),),
        curves=stride_curves(participant, sources) if settings.walking else (),
        sampling=tuple(
            SamplingRecord(
                participant,
                source.given.file,
                source.given.condition,
                rate_hz(source.given.recording["time"].to_numpy()),
            )
            for source in new
        ),
        unclean_switches=tuple(
            source.given.file for source in new if is_unclean_switch(source.given.recording)
        ),
        units=() if unit is None else (unit,),
    )


def _estimator(
    name: str, participant: str, sources: Sequence[Source], settings: ParticipantSettings
) -> CellEstimator | FullRecordEstimator | WalkingEstimator:
    if name == FULL_RECORD:
        return FullRecordEstimator(participant, sources, settings)
    if name == RECOMMENDED:
        return WalkingEstimator(participant, sources, settings)
    return CellEstimator(participant, METHODS[name], sources, settings)


def _stride_records(
    participant: str, sources: Sequence[Source], settings: ParticipantSettings
) -> list[StrideRecord]:
    records = []
    for source in sources:
        strides = source.strides
        if strides is None:
            continue
        damage_s = damage_of(source.given.recording)
        session, side = unit_of(source.given) if settings.walking else ("", "")
        for k in range(strides.start_s.size):
            start_s = float(strides.start_s[k])
            code, detail = strides.code[k], strides.detail[k]
            if not code:
                undisturbed = bool(source.undisturbed[k])
                code, own = _own_code(source, start_s, undisturbed=undisturbed, settings=settings)
                detail = own or detail
            elif code == Exclusion.GAP:
                spoilt = damage_near(damage_s, start_s, start_s + float(strides.duration_s[k]))
                code, detail = (Exclusion.DAMAGED_LOG.value, spoilt) if spoilt else (code, detail)
            records.append(
                StrideRecord(
                    participant=participant,
                    recording=source.given.file,
                    condition=source.given.condition,
                    start_s=start_s,
                    duration_s=float(strides.duration_s[k]),
                    code=code,
                    detail=detail,
                    session=session,
                    side=side,
                )
            )
    return records


def _gap_records(participant: str, sources: Sequence[Source]) -> list[GapRecord]:
    return [
        GapRecord(participant, source.given.file, float(a), float(b - a))
        for source in sources
        for a, b in find_gaps(source.given.recording["time"].to_numpy())
    ]


def _own_code(
    source: Source, start_s: float, *, undisturbed: bool, settings: ParticipantSettings
) -> tuple[str, str]:
    """Return why a stride of good length is not used, in the user's words too; "" where it is."""
    line = settings.left_out_by(source.given.file, start_s)
    if line is not None:
        return Exclusion.USER.value, line.reason
    if source.given.condition == "unperturbed" and not undisturbed:
        return Exclusion.PULSE_IN_STRIDE.value, ""
    return "", ""
