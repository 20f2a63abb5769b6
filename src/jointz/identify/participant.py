"""Impedance of one participant at every timing point, from the participant's recordings."""

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace

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
from jointz.identify.estimate_checks import check_estimates, decided_cells
from jointz.identify.estimators import METHODS, ParticipantData
from jointz.identify.over_cycle.stride_curves import (
    StrideCurves,
    mean_strides,
    stride_curves,
)
from jointz.identify.preparation.channel_clocks import clock_notes
from jointz.identify.preparation.missing_samples import missing_notes
from jointz.identify.preparation.recording_groups import Unit, recording_groups, unit_of
from jointz.identify.preparation.sources import (
    ParticipantSettings,
    RecordingInput,
    Source,
    prepare_sources,
)
from jointz.results.estimates import CellEstimate
from jointz.results.log_posterior import LogPosterior
from jointz.results.mean_stride import MeanStride


@dataclass(frozen=True, slots=True)
class ParticipantResult:
    """Estimates from one participant's recordings, and what was used and left out."""

    cells: Mapping[str, tuple[CellEstimate, ...]]  # estimates of each method, by its name
    single: tuple[PulseEstimate, ...]  # estimates from single pulses of a bench
    pulses: tuple[PulseRecord, ...]
    strides: tuple[StrideRecord, ...]
    gaps: tuple[GapRecord, ...]
    # joint posterior of all timing points, of every session and side; empty if the method has none
    log_posteriors: tuple[LogPosterior, ...] = ()
    # strides of a participant recorded without a device only, if a moment was recorded
    curves: tuple[StrideCurves, ...] = ()
    mean_strides: tuple[MeanStride, ...] = ()  # in walking
    sampling: tuple[SamplingRecord, ...] = ()
    # recordings whose footswitch does not rest at the two declared levels
    unclean_switches: tuple[str, ...] = ()
    # session and side of the perturbed recordings; "" if not stated, and on a bench
    units: tuple[Unit, ...] = ()
    notes: tuple[str, ...] = ()  # about values that cannot be estimated


def analyze_participant(
    participant: str, recordings: Sequence[RecordingInput], settings: ParticipantSettings
) -> ParticipantResult:
    """Estimate a participant's impedance by session, side and timing point or group."""
    parts: list[ParticipantResult] = []
    reported: set[int] = set()
    for unit, group in recording_groups(recordings, settings.kind):
        parts.append(_analyze_group(participant, unit, group, settings, reported))
        reported |= set(map(id, group))
    return ParticipantResult(
        cells={m: tuple(c for p in parts for c in p.cells[m]) for m in settings.methods},
        **{
            field.name: tuple(row for part in parts for row in getattr(part, field.name))
            for field in fields(ParticipantResult)
            if field.name != "cells"
        },
    )


def _analyze_group(
    participant: str,
    unit: Unit | None,
    recordings: Sequence[RecordingInput],
    settings: ParticipantSettings,
    reported: Container[int],
) -> ParticipantResult:
    """Estimate a session and side; recordings that another group has reported are not repeated."""
    sources = prepare_sources(recordings, settings)
    new = [s for s, given in zip(sources, recordings, strict=True) if id(given) not in reported]
    data = ParticipantData(participant, sources)
    estimates = {name: METHODS[name].estimate(data, settings) for name in settings.methods}
    chosen = settings.methods[0]
    cells, notes = check_estimates(estimates[chosen], sources, settings)
    # The methods that are compared keep all that may be.
    estimates = {
        name: replace(e, cells=cells if name == chosen else decided_cells(e.cells, settings))
        for name, e in estimates.items()
    }
    session, side = unit or ("", "")
    log_posteriors = [e.log_posterior for e in estimates.values() if e.log_posterior is not None]
    return ParticipantResult(
        cells={
            name: tuple(
                replace(
                    c, session=session, side=side, example=c.example if name == chosen else None
                )
                for c in e.cells
            )
            for name, e in estimates.items()
        },
        single=next((e.single for e in estimates.values() if e.single), ()),
        pulses=tuple(
            replace(p, session=session, side=side) for p in estimates[settings.methods[0]].pulses
        ),
        strides=tuple(r for source in new for r in _stride_records(participant, source, settings)),
        gaps=tuple(
            GapRecord(participant, given.file, float(a), float(b - a))
            for given in recordings  # before short gaps were filled
            if id(given) not in reported
            for a, b in find_gaps(given.recording["time"].to_numpy())
        ),
        log_posteriors=tuple(replace(p, session=session, side=side) for p in log_posteriors),
        curves=stride_curves(participant, sources) if settings.kind.by_gait else (),
        mean_strides=mean_strides(participant, new) if settings.kind.by_gait else (),
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
        notes=(
            *estimates[chosen].notes,
            *notes,
            *clock_notes([s.given.recording for s in new]),
            *(note for s in new for note in missing_notes(s.given.file, s.given.recording)),
        ),
    )


def _stride_records(
    participant: str, source: Source, settings: ParticipantSettings
) -> Iterator[StrideRecord]:
    strides = source.strides
    if strides is None:
        return
    damage_s = damage_of(source.given.recording)
    session, side = unit_of(source.given) if settings.kind.by_side else ("", "")
    recording = {
        "participant": participant,
        "recording": source.given.file,
        "condition": source.given.condition,
        "session": session,
        "side": side,
    }
    for k, (start, duration) in enumerate(zip(strides.start_s, strides.duration_s, strict=True)):
        start_s, duration_s = float(start), float(duration)
        code, detail = strides.code[k], strides.detail[k]
        if not code and (line := settings.left_out_by(source.given.file, start_s)) is not None:
            code, detail = line.code, line.reason or detail
        elif not code and source.given.condition == "unperturbed" and not source.undisturbed[k]:
            code = Exclusion.PULSE_IN_STRIDE.value
        elif code == Exclusion.GAP and (
            damage := damage_near(damage_s, start_s, start_s + duration_s)
        ):
            code, detail = Exclusion.DAMAGED_LOG.value, damage
        yield StrideRecord(
            start_s=start_s, duration_s=duration_s, code=code, detail=detail, **recording
        )
    for moment in strides.spurious_s.tolist():
        following = strides.strike_s[strides.strike_s > moment]
        yield StrideRecord(
            start_s=moment,
            duration_s=float(following[0]) - moment if following.size else float("nan"),
            code=Exclusion.SPURIOUS_STRIKE.value,
            detail="listed too soon after another heel strike; left out",
            **recording,
        )
