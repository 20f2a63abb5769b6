"""Plans of new perturbation experiments, and the precision that recorded ones can reach."""

import os
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from math import inf, pi
from pathlib import Path
from typing import Any

from jointz.analysis.participant_jobs import coupling_of, participant_settings, read_participant
from jointz.analysis.planned_half_widths import reached_half_widths
from jointz.analysis.saved_analysis import load, study_of
from jointz.analysis.study_protocol import study_protocol
from jointz.core.errors import DataError
from jointz.core.method_names import BAYESIAN, WITH_POSTERIOR
from jointz.core.priors import PriorsSpec
from jointz.core.protocols.protocol import Protocol
from jointz.core.study import CalibrationSpec, ParticipantSpec, Study
from jointz.identify.walking.coupling import COUPLINGS
from jointz.io.protocols import load_protocol
from jointz.io.study_reader import open_study
from jointz.planning.laboratory import SENSORS, Actuator, Laboratory
from jointz.planning.plan_result import Plan
from jointz.planning.planner import LEGS, Planner
from jointz.planning.schedule import Schedule, recorded_schedule, schedule_of_protocol
from jointz.planning.unperturbed_walking import recorded_walking, stored_walking
from jointz.planning.wishes import made_wishes, out_of_range
from jointz.report.wording import format_count
from jointz.tasks.engine import on_one_thread
from jointz.tasks.progress import Progress

_MASS_KG, _HEIGHT_M = 75.0, 1.75
_STEPS = LEGS + 5
_FASTEST_HZ = 500.0
#: More noise than any sensor has, rad or rad/s.
_NOISIEST = 1.0
_WALKING = (
    "stored, that of a recorded walker, whose knee angle 0.1 s after an onset is predicted within "
    "0.8 degrees. Record three to five minutes of your own: --pilot"
)


def plan(  # noqa: PLR0913 - the options of the command, all by keyword
    protocol: str | os.PathLike[str] | Protocol,
    *,
    pilot: str | os.PathLike[str] | Study | None = None,
    sensors: Mapping[str, float | None] | None = None,
    calibration: CalibrationSpec | None = None,
    mass_kg: float | None = None,
    height_m: float | None = None,
    torque_nm: float | None = None,
    bandwidth_hz: float | None = None,
    seed: int = 1,
    progress: Progress | None = None,
    **wishes: Any,
) -> Plan:
    """Plan a walking experiment before anybody is measured.

    Parameters
    ----------
    protocol : path, str or Protocol
        Walking protocol with pulses; its timing points, gaps and limits are kept.
    pilot : path or Study, optional
        Study with three to five minutes of the lab's own unperturbed walking. Its sensors,
        calibration, torque model, coupling and participants are those of the plan. Without it, the
        variability of a recorded walker is taken, and the plan says so.
    sensors : mapping of str to float or None, optional
        ``goniometer``, ``encoder``, ``gyroscopes`` with their white noise, rad or rad/s, None for
        that of a usual one. By default those of the pilot, else the protocol's, else a goniometer.
    calibration : CalibrationSpec, optional
        What is known of the instruments; by default the pilot's.
    mass_kg, height_m : float, optional
        Of a typical participant; by default the pilot's people, else 75 kg and 1.75 m.
    torque_nm : float, optional, N*m
        Largest torque of the device; by default the protocol's limit, else its largest pulse.
    bandwidth_hz : float, optional, Hz
        Of the torque, a first-order lag; 13 Hz by default.
    seed : int
        Of the legs that are drawn from the priors.
    progress : callable, optional
        Called with steps done, steps in all and what was done.
    **wishes : optional
        Fields of :class:`~jointz.planning.wishes.Wishes`: wanted limits, such as
        ``half_width_pct=25``. Without, the plan states what the protocol's own number of pulses
        gives.

    Returns
    -------
    Plan
        With ``refused`` wishes, each with the nearest possible one.

    Raises
    ------
    DataError
        If the protocol has no pulses in walking, the pilot no unperturbed strides, or numbers are
        out of range.

    Examples
    --------
    >>> plan("walking_doublets", motion_deg=99.0)
    Traceback (most recent call last):
    ...
    jointz.core.errors.DataError: plan: motion_deg: expected 0.5 to 18, got 99.
    """
    wanted = made_wishes(wishes)
    spec = protocol if isinstance(protocol, Protocol) else load_protocol(protocol)
    schedule = schedule_of_protocol(spec)
    largest = max(size for pulse in spec.shapes for size in pulse.sizes_nm)
    problems = out_of_range(
        ("torque_nm", torque_nm, 0.5, 300.0, " N*m"),
        ("bandwidth_hz", bandwidth_hz, 1.0, 200.0, " Hz"),
        ("mass_kg", mass_kg, 10.0, 300.0, " kg"),
        ("height_m", height_m, 0.8, 2.6, " m"),
        ("seed", seed, 0, inf, ""),
    )
    if problems:
        raise DataError("plan: " + "; ".join(problems) + ".")
    if torque_nm is None:
        torque_nm = spec.safety.torque_nm or largest
    actuator = _actuator(torque_nm, bandwidth_hz)
    tell = _Teller(progress)
    files: dict[str, Any] = {}
    if pilot is None:
        lab, walking = _usual_lab(spec, schedule, sensors, actuator), _WALKING
    else:
        study = pilot if isinstance(pilot, Study) else open_study(pilot)
        files = {"pilot": study.root.name, "pilot_sha256": study.sha256}
        lab, walking = lab_of_study(study, schedule, actuator)
        if sensors is not None:
            lab = lab.with_sensors(_beside_pilot(_known_sensors(sensors), lab))
    tell("walking")
    body = {"mass_kg": mass_kg, "height_m": height_m}
    stated = {name: value for name, value in body.items() if value is not None}
    people = tuple(person.model_copy(update=stated) for person in lab.people)
    lab = replace(lab, people=people, calibration=calibration or lab.calibration)
    planner = Planner(schedule, lab, wanted, walking=walking, seed=seed, tell=tell)
    made = on_one_thread(partial(planner.plan, spec))
    return replace(made, provenance={**made.provenance, **files})


def plan_recorded(
    results: str | os.PathLike[str],
    *,
    study: str | os.PathLike[str] | None = None,
    seed: int = 1,
    progress: Progress | None = None,
    **wishes: Any,
) -> Plan:
    """Return what a study that was recorded and analysed could see, and what it could not.

    Parameters
    ----------
    results : path
        Results folder of ``jointz analyze`` by the method ``bayesian``.
    study : path, optional
        Folder of the study; by default the one with its name beside the results.
    seed : int
        Of the legs that are drawn from the priors.
    progress : callable, optional
        Called with steps done, steps in all and what was done.
    **wishes : optional
        Fields of :class:`~jointz.planning.wishes.Wishes`.

    Returns
    -------
    Plan
        As if the same pulses had been planned, with the half-widths that were reached.

    Raises
    ------
    DataError
        If the study is not found, or is none of pulses in walking.
    """
    wanted = made_wishes(wishes)
    folder = Path(results)
    analysis = load(folder)
    recorded = study_of(analysis, folder, study)
    if recorded is None:
        raise DataError(f"{folder}: the study is not beside the results. Name it: --study-folder.")
    if analysis.settings.get("method") not in WITH_POSTERIOR:
        raise DataError(
            f"{folder}: expected results of the method {BAYESIAN}, got "
            f"{analysis.settings.get('method')}. Analyse the study by it: jointz analyze."
        )
    done = study_protocol(recorded, analysis.pulses, analysis.strides, asked_by="plan")
    people = len({c.participant for c in analysis.cells})
    schedule = recorded_schedule(
        recorded.root.resolve().name,
        done.pulses,
        done.timing_points,
        done.per_point,
        done.gap_strides,
        window_s=float(analysis.settings["window_s"]),
        strides=len(analysis.strides) / people,
        participants=people,
    )
    largest = max(size for pulse in done.pulses for size in pulse.sizes_nm)
    tell = _Teller(progress)
    lab, walking = lab_of_study(recorded, schedule, _actuator(largest, None), analysis.coupling)
    tell("walking")
    planner = Planner(schedule, lab, wanted, walking=walking, seed=seed, tell=tell)
    made = on_one_thread(partial(planner.plan, None))
    files = {"study": recorded.root.name, "study_sha256": recorded.sha256}
    return replace(
        made, reached=reached_half_widths(analysis.cells), provenance={**made.provenance, **files}
    )


def _actuator(torque_nm: float, bandwidth_hz: float | None) -> Actuator:
    if bandwidth_hz is None:
        return Actuator(torque_nm)
    return Actuator(torque_nm, time_constant_s=1.0 / (2.0 * pi * bandwidth_hz))


def _known_sensors(sensors: Mapping[str, float | None]) -> dict[str, float | None]:
    """Return the sensors in their order; raise DataError for others, and without a goniometer."""
    unknown = sorted(set(sensors) - set(SENSORS))
    if unknown or "goniometer" not in sensors:
        raise DataError(
            f"plan: expected a goniometer, and with it any of {', '.join(list(SENSORS)[1:])}; got "
            f"{', '.join(sensors) or 'none'}."
        )
    if wrong := [
        name for name, noise in sensors.items() if noise is not None and not 0.0 < noise < _NOISIEST
    ]:
        raise DataError(
            f"plan: expected noise above 0 and below {_NOISIEST:g} rad or rad/s of "
            f"{', '.join(wrong)}."
        )
    return {name: sensors[name] for name in SENSORS if name in sensors}


def _beside_pilot(sensors: dict[str, float | None], lab: Laboratory) -> dict[str, float | None]:
    """Return sensors beside a pilot; raise DataError for noise that its recordings show."""
    if known := [n for n, sd in sensors.items() if sd is not None and n in lab.noise]:
        raise DataError(
            f"plan: the pilot's recordings have the noise of {', '.join(known)}. Name the sensor "
            "without a noise."
        )
    return sensors


def _usual_lab(
    spec: Protocol,
    schedule: Schedule,
    sensors: Mapping[str, float | None] | None,
    actuator: Actuator,
) -> Laboratory:
    """Return a lab with stored walking, by default with the sensors of the protocol."""
    if sensors is None:
        sensors = dict.fromkeys(spec.sensors or ("goniometer",))
    noise = {n: SENSORS[n][1] if sd is None else sd for n, sd in _known_sensors(sensors).items()}
    gait = spec.gait
    walking = stored_walking(
        schedule.timing_points,
        {SENSORS[n][0]: sd for n, sd in noise.items()},
        window_s=schedule.design.window_s,
        rate_hz=min(spec.rates.sample_hz, _FASTEST_HZ),
        stride_s=1.1 if gait is None else gait.assumed_stride_s,
        n_strides=schedule.teaching_strides,
    )
    person = ParticipantSpec(id="typical", mass_kg=_MASS_KG, height_m=_HEIGHT_M)
    return Laboratory((person,), (walking,), noise, actuator, joint=spec.joint)


class _Teller:
    """Progress in steps."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress, self._done = progress, 0

    def __call__(self, what: str) -> None:
        self._done = min(self._done + 1, _STEPS)
        if self._progress is not None:
            self._progress(self._done, _STEPS, what)


#: People of a pilot whose walking is used.
_MOST_WALKERS = 4


def lab_of_study(
    study: Study, schedule: Schedule, actuator: Actuator, coupling: str | None = None
) -> tuple[Laboratory, str]:
    """Return the lab of a study, and where its walking is from, in words.

    The coupling is that which the study states, or another one.
    """
    spec = study.spec
    if spec.kind != "walking" or spec.joint != "knee":
        raise DataError(
            f"pilot: expected walking of the knee, got {spec.kind} of the {spec.joint}."
        )
    walkers, strides = [], 0
    people = spec.participants[:_MOST_WALKERS]
    for person in people:
        settings = participant_settings(study, person.id, BAYESIAN, resamples=1, seed=0)
        recordings = read_participant(study, person.id, {})
        walking = recorded_walking(
            recordings,
            settings,
            who=person.id,
            timing_points=schedule.timing_points,
            window_s=schedule.design.window_s,
            n_strides=schedule.teaching_strides,
        )
        walkers.append(walking)
        strides += next(iter(walking.values())).n_recorded
    channels = set.intersection(*(set(next(iter(w.values())).channels) for w in walkers))
    first = people[0]
    own = [e for e in spec.recordings if e.participant == first.id]
    lab = Laboratory(
        people=people,
        walking=tuple(walkers),
        noise={name: noise for name, (channel, noise) in SENSORS.items() if channel in channels},
        actuator=actuator,
        calibration=study.spec.calibration_of(own[0]),
        torque_model=spec.torque_model,
        priors=spec.priors or PriorsSpec(),
        joint=spec.joint,
        coupling=COUPLINGS[coupling or coupling_of(study, BAYESIAN)],
    )
    who = format_count(len(people), "person", "people")
    where = study.root.resolve().name
    return lab.with_sensors(lab.noise), f"{strides} unperturbed strides of {who} of {where}"
