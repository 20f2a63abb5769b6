"""Checks that every method's estimates pass before they are reported."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from jointz.core.codes import Failure
from jointz.core.events import row_label
from jointz.core.method_names import BAYESIAN, FULL_RECORD
from jointz.gait.timestamps import rate_hz
from jointz.identify.estimators import Estimates
from jointz.identify.prediction.clock_checks import clock_failure
from jointz.identify.preparation.calibration import value_of
from jointz.identify.preparation.command_slope import DOUBTED, REFUSED, pulse_slope
from jointz.identify.preparation.instrument_checks import (
    angle_failure,
    is_clipped,
    is_held,
    torque_failure,
)
from jointz.identify.preparation.sensor_agreement import choose_sensors
from jointz.identify.preparation.sources import ParticipantSettings, Source
from jointz.identify.regression.cell_parameters import failed_parameters
from jointz.results.estimates import FEWEST_PULSES, CellEstimate
from jointz.results.impedance_limits import (
    beyond_limits,
    reaches_zero,
    unit_question,
    withhold_impossible,
    without_negative,
)

#: Failures whatever a method says: torque or clock are not those of the pulses.
_OF_TORQUE_OR_CLOCK = (
    Failure.TORQUE_UNLIKE_COMMAND,
    Failure.OUT_OF_STEP,
    Failure.CLOCKS_DRIFT,
)


def check_estimates(
    estimates: Estimates, sources: Sequence[Source], settings: ParticipantSettings
) -> tuple[tuple[CellEstimate, ...], tuple[str, ...]]:
    """Return the cells without values that cannot be, and notes about them.

    A method that was asked for by name keeps its values, of which none that may be zero or
    negative is ``ok``; the notes are its doubts.
    """
    # Trials and conditions of one file are sources of their own.
    failures: list[tuple[Failure, set[tuple[str, float]]]] = []
    cells: list[CellEstimate] = []
    notes: list[str] = []
    for source in sources:
        failure, note = _instrument_failure(source, settings)
        if failure is not None:
            failures.append((failure, {(source.given.file, p.onset_s) for p in source.pulses}))
        if note and estimates.cells:
            label = row_label(estimates.cells[0].participant)
            notes.append(f"{label}, {source.given.file}: {note}.")
    every = {(p.recording, p.onset_s) for p in estimates.pulses}
    clocks = _clock_failure(estimates, sources, settings)
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
    if not estimates.cells or estimates.cells[0].method == BAYESIAN:
        return False
    choice = choose_sensors([s for s in sources if s.given.condition == "perturbed" and s.pulses])
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


def _clock_failure(
    estimates: Estimates, sources: Sequence[Source], settings: ParticipantSettings
) -> tuple[Failure, str] | None:
    """Return why the clock of the angle is wrong, and by how much."""
    if not estimates.cells:
        return None
    return clock_failure(estimates.cells[0].participant, sources, settings)


def _instrument_failure(
    source: Source, settings: ParticipantSettings
) -> tuple[Failure | None, str]:
    """Return why no method may use a perturbed recording, if so, and a note about its torque."""
    recording = source.given.recording
    if source.given.condition != "perturbed" or not source.pulses:
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
    gain = value_of(source.given.calibration.torque_gain, 1.0)
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
    # Methods for walking have checks of their own, whose reasons stay, and so does the reason of a
    # load that is none.
    last = settings.kind.by_gait or failure is Failure.TORQUE_UNLIKE_COMMAND
    # The limits of a parameter that is undecided are wrong, too.
    limited = failure in _OF_TORQUE_OR_CLOCK
    own = last and not any(
        p.available or (limited and p.status == "undecided") for p in cell.parameters
    )
    if failure is None or own or not cell.n_used:
        parameters = withhold_impossible(cell.parameters)
        return cell if parameters == cell.parameters else replace(cell, parameters=parameters)
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
