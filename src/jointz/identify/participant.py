"""Impedance of one participant at every timing point, from the participant's recordings."""

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from jointz.core.codes import Exclusion, Failure
from jointz.core.events import (
    GapRecord,
    PulseEstimate,
    PulseRecord,
    SamplingRecord,
    StrideRecord,
    row_label,
)
from jointz.core.method_names import BAYESIAN, FULL_RECORD
from jointz.core.recording import damage_near, damage_of
from jointz.gait.heel_strikes import is_unclean_switch
from jointz.gait.timestamps import find_gaps, rate_hz
from jointz.identify.estimators import METHODS, Estimates, ParticipantData
from jointz.identify.over_cycle.stride_curves import StrideCurves, mean_strides, stride_curves
from jointz.identify.prediction.clock_checks import clock_failure
from jointz.identify.preparation.calibration import value_of
from jointz.identify.preparation.channel_clocks import clock_notes
from jointz.identify.preparation.command_slope import DOUBTED, REFUSED, pulse_slope
from jointz.identify.preparation.instrument_checks import (
    angle_failure,
    is_clipped,
    is_held,
    torque_failure,
)
from jointz.identify.preparation.missing_samples import missing_notes
from jointz.identify.preparation.recording_groups import Unit, recording_groups, unit_of
from jointz.identify.preparation.sensor_agreement import choose_sensors
from jointz.identify.preparation.sources import (
    ParticipantSettings,
    RecordingInput,
    Source,
    prepare_sources,
)
from jointz.identify.regression.cell_parameters import failed_parameters
from jointz.results.estimates import FEWEST_PULSES, CellEstimate
from jointz.results.impedance_limits import (
    beyond_limits,
    reaches_zero,
    unit_question,
    withhold_impossible,
    without_negative,
)
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
    new = [s for s, r in zip(sources, recordings, strict=True) if id(r) not in reported]
    data = ParticipantData(participant, sources)
    estimates = {name: METHODS[name].estimate(data, settings) for name in settings.methods}
    chosen = settings.methods[0]
    cells, notes = check_estimates(estimates[chosen], sources, settings)
    # The methods to compare with keep their values, unless too few pulses or their sign forbid it.
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
        pulses=tuple(replace(p, session=session, side=side) for p in estimates[chosen].pulses),
        strides=tuple(r for source in new for r in _stride_records(participant, source, settings)),
        gaps=tuple(
            GapRecord(participant, r.file, float(start), float(end - start))
            for r in recordings  # before short gaps were filled
            if id(r) not in reported
            for start, end in find_gaps(r.recording["time"].to_numpy())
        ),
        log_posteriors=tuple(replace(p, session=session, side=side) for p in log_posteriors),
        curves=stride_curves(participant, sources) if settings.kind.by_gait else (),
        mean_strides=mean_strides(participant, new) if settings.kind.by_gait else (),
        sampling=tuple(
            SamplingRecord(
                participant,
                source.input.file,
                source.input.condition,
                rate_hz(source.input.recording["time"].to_numpy()),
            )
            for source in new
        ),
        unclean_switches=tuple(
            source.input.file for source in new if is_unclean_switch(source.input.recording)
        ),
        units=() if unit is None else (unit,),
        notes=(
            *estimates[chosen].notes,
            *notes,
            *clock_notes([s.input.recording for s in new]),
            *(note for s in new for note in missing_notes(s.input.file, s.input.recording)),
        ),
    )


def _stride_records(
    participant: str, source: Source, settings: ParticipantSettings
) -> Iterator[StrideRecord]:
    strides = source.strides
    if strides is None:
        return
    damage_s = damage_of(source.input.recording)
    session, side = unit_of(source.input) if settings.kind.by_side else ("", "")
    recording = {
        "participant": participant,
        "recording": source.input.file,
        "condition": source.input.condition,
        "session": session,
        "side": side,
    }
    for k, (start, duration) in enumerate(zip(strides.start_s, strides.duration_s, strict=True)):
        start_s, duration_s = float(start), float(duration)
        code, detail = strides.code[k], strides.detail[k]
        if not code and (line := settings.left_out_by(source.input.file, start_s)) is not None:
            code, detail = line.code, line.reason or detail
        elif not code and source.input.condition == "unperturbed" and not source.undisturbed[k]:
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


#: Failures that also make limits wrong: torque or clock do not belong to the pulses.
_OF_TORQUE_OR_CLOCK = (Failure.TORQUE_UNLIKE_COMMAND, Failure.OUT_OF_STEP, Failure.CLOCKS_DRIFT)


def check_estimates(
    estimates: Estimates, sources: Sequence[Source], settings: ParticipantSettings
) -> tuple[tuple[CellEstimate, ...], tuple[str, ...]]:
    """Return the cells without impossible values, and notes about what was withheld.

    A method that was requested by name keeps its values, of which none that may be zero or
    negative is ``ok``; the notes name the reasons to doubt them.
    """
    if not estimates.cells:
        return (), ()
    participant = estimates.cells[0].participant
    # Trials and conditions of one file are sources of their own.
    failures: list[tuple[Failure, set[tuple[str, float]]]] = []
    cells: list[CellEstimate] = []
    notes: list[str] = []
    for source in sources:
        failure, note = _instrument_failure(source, settings)
        if failure is not None:
            failures.append((failure, {(source.input.file, p.onset_s) for p in source.pulses}))
        if note:
            notes.append(f"{row_label(participant)}, {source.input.file}: {note}.")
    every = {(p.recording, p.onset_s) for p in estimates.pulses}
    clocks = clock_failure(participant, sources, settings)
    if clocks is not None:
        failures.insert(0, (clocks[0], every))
        notes.append(f"{clocks[0].value}: {clocks[0].meaning}: {clocks[1]}.")
    if _sensors_contradict_angle(estimates, sources):
        failures.append((Failure.SENSORS_DISAGREE, every))
    for cell in estimates.cells:
        used = {
            (p.recording, p.onset_s)
            for p in estimates.pulses
            if p.timing_point == cell.timing_point and not p.code
        }
        failure = next((failure for failure, pulses in failures if pulses & used), None)
        checked = _checked(cell, failure, settings)
        notes += _notes(cell, failure, asked=settings.method_asked_for)
        cells.append(cell if settings.method_asked_for else checked)
    return decided_cells(cells, settings), tuple(notes)


def _sensors_contradict_angle(estimates: Estimates, sources: Sequence[Source]) -> bool:
    """Return whether sensors contradict the angle; ``bayesian`` judges them by itself."""
    if estimates.cells[0].method == BAYESIAN:
        return False
    choice = choose_sensors([s for s in sources if s.input.condition == "perturbed" and s.pulses])
    return choice.disagree or choice.goniometer_gain is not None


def decided_cells(
    cells: Iterable[CellEstimate], settings: ParticipantSettings
) -> tuple[CellEstimate, ...]:
    """Return the cells of any method, without values of too few pulses or that may be negative."""
    return tuple(_decided(cell, settings) for cell in cells)


def _decided(cell: CellEstimate, settings: ParticipantSettings) -> CellEstimate:
    failed = all(p.status.startswith("failed:") for p in cell.parameters)
    # Whole trials are one long record, in which pulses are not counted.
    if not failed and cell.n_used < FEWEST_PULSES and cell.method != FULL_RECORD:
        return _failed(cell, Failure.TOO_FEW_PULSES, settings)
    parameters = tuple(map(without_negative, cell.parameters))
    gravity = cell.gravity_corrected and without_negative(cell.gravity_corrected)
    return replace(cell, parameters=parameters, gravity_corrected=gravity)


def _instrument_failure(
    source: Source, settings: ParticipantSettings
) -> tuple[Failure | None, str]:
    """Return why no method may use a perturbed recording, if so, and a note about its torque."""
    recording = source.input.recording
    if source.input.condition != "perturbed" or not source.pulses:
        return None, ""
    if failure := angle_failure(recording):
        return failure, ""
    torque = recording["torque"].to_numpy()
    finite = np.isfinite(torque)
    torque = torque if finite.all() else torque[finite]
    if not torque.size:
        return Failure.CONSTANT_TORQUE, ""
    if is_held(torque, rate_hz(recording["time"].to_numpy())):
        return Failure.TORQUE_HELD, ""
    if not settings.kind.by_gait and is_clipped(torque):
        return Failure.TORQUE_SATURATED, ""
    # Of steps of the angle and of a reference the amplitude is no torque.
    if settings.perturbations.source in ("angle", "reference"):
        return None, ""
    if failure := torque_failure(recording, source.pulses):
        return failure, ""
    return _command_failure(source)


def _command_failure(source: Source) -> tuple[Failure | None, str]:
    """Return a failure if the torque of pulses is unlike its command, and a note with its size."""
    gain = value_of(source.input.calibration.torque_gain, 1.0)
    recorded = pulse_slope(source)
    slope = recorded if gain == 1.0 else pulse_slope(source, gain)
    if recorded is None or slope is None:
        return None, ""
    if not slope.exceeds(DOUBTED):
        explained = f"{recorded}, which torque_gain {gain:g} of [calibration] explains"
        return None, explained if recorded.exceeds(DOUBTED) else ""
    cause = "check units and gains of both"
    if not recorded.exceeds(DOUBTED):
        cause = f"check torque_gain {gain:g} of [calibration], without which they agree"
    failure = Failure.TORQUE_UNLIKE_COMMAND if slope.exceeds(REFUSED) else None
    return failure, f"{slope}; {cause}"


def _checked(
    cell: CellEstimate, failure: Failure | None, settings: ParticipantSettings
) -> CellEstimate:
    # Methods for walking have checks of their own, whose failures stay, and so do those of a load
    # whose torque is unlike its command.
    keeps_own_failure = settings.kind.by_gait or failure is Failure.TORQUE_UNLIKE_COMMAND
    # The limits of a parameter that is undecided are wrong, too.
    limited = failure in _OF_TORQUE_OR_CLOCK
    has_own_failure = keeps_own_failure and not any(
        p.available or (limited and p.status == "undecided") for p in cell.parameters
    )
    if failure is None or has_own_failure or not cell.n_used:
        return replace(cell, parameters=withhold_impossible(cell.parameters))
    return _failed(cell, failure, settings)


def _failed(cell: CellEstimate, failure: Failure, settings: ParticipantSettings) -> CellEstimate:
    empty = failed_parameters(
        failure, mass_kg=settings.mass_kg, wants_per_mass=settings.kind.per_mass
    )
    return replace(cell, parameters=empty, covariance=None, gravity_corrected=None)


def _notes(cell: CellEstimate, failure: Failure | None, *, asked: bool) -> list[str]:
    """Return what a reader must know of values that are withheld, or kept because asked for."""
    if not any(p.available for p in cell.parameters):
        return []
    where = f"{row_label(cell.participant)}, {cell.timing_point}"
    kept = f" The values stay, because the method {cell.method} was asked for." if asked else ""
    if failure is not None:
        return [f"{where}: {failure.value}: {failure.meaning}.{kept}"]
    if beyond_limits(cell.parameters):
        values = {p.name: p.value for p in cell.parameters if p.value is not None}
        return [f"{where}: {unit_question(values)}{kept}"]
    low = [p.name for p in cell.parameters if reaches_zero(p)]
    if not low:
        return []
    return [f"{where}: {', '.join(low)} may be zero or negative, which no joint or load is."]
