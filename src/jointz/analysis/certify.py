"""Certificate of a study: the error to expect, measured in its own unperturbed strides."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace

from jointz.analysis.participant_jobs import (
    participant_settings,
    read_participant,
    recommended_method,
)
from jointz.core.errors import DataError, StudyError
from jointz.core.gait_phases import ALL_POINTS, TIMING_POINTS
from jointz.core.method_names import RIGID, STRAPPED
from jointz.core.study import Study
from jointz.identify.appraisal.certificate_draws import Chosen, Injection
from jointz.identify.appraisal.certificate_study import (
    assembled,
    certify_participant,
    replicates_for,
)
from jointz.identify.estimators import ParticipantData
from jointz.identify.preparation.recording_groups import recording_groups
from jointz.identify.preparation.sources import (
    ParticipantSettings,
    RecordingInput,
    prepare_sources,
)
from jointz.identify.rigid.walking_estimator import RigidMethod
from jointz.identify.rigid.walking_evidence import Evidence
from jointz.io.study_reader import open_study
from jointz.results.certificate_result import Certificate, VirtualEstimate
from jointz.tasks.progress import Progress
from jointz.terminal.progress_bars import shown_progress

_LONGEST_LAG_S = 0.06


def certify(
    study: Study | str | os.PathLike[str],
    *,
    stiffness: Chosen = None,
    damping: Chosen = None,
    inertia: Chosen = None,
    lag_s: float | None = None,
    replicates: int | None = None,
    seed: int = 0,
    progress: Progress | bool | None = True,
) -> Certificate:
    """Estimate known responses injected into a walking study, to know the error to expect.

    The estimates are by the method ``rigid``.

    Parameters
    ----------
    study : Study or path
        An opened study, or its folder.
    stiffness, damping, inertia : float, mapping of str to float, or None
        Injected values for all timing points, or by timing point; N*m/rad, N*m*s/rad, kg*m^2.
        By default drawn around the study's own estimates.
    lag_s : float, optional, s
        Lag of the injected sensor; by default drawn around the lag of calibration and study. A
        lag that contradicts the calibration shows the effect of such an error.
    replicates : int, optional
        Injections into each participant; by default enough for an RMSE of the whole study that
        is known to 10 %.
    seed : int
        Seed of the draws.
    progress : bool or callable
        Whether to draw a progress bar in a terminal or notebook; a function is called with
        (participants done, number of participants, what comes next).

    Returns
    -------
    Certificate
        Expected bias, RMSE and coverage of K, B and J.

    Raises
    ------
    StudyError
        If recordings cannot be trusted; one message names all of them.
    ValueError
        If the study is not a walking study, or a value to inject is out of range.
    DataError
        If the study is one of a strapped device, which is not analysed by ``rigid``.
    """
    opened = study if isinstance(study, Study) else open_study(study)
    if opened.spec.kind != "walking":
        raise ValueError(
            "certify: expected a walking study, got kind "
            f'"{opened.spec.kind}"; on a bench, measure loads of known impedance instead.'
        )
    if recommended_method(opened) == STRAPPED:
        raise DataError(
            f"certify: a certificate is of the method {RIGID}, and this study is analysed by "
            f"{STRAPPED}, whose intervals include the priors that are in provenance.json. If the "
            'device is coupled rigidly, add coupling = "rigid" to study.toml.'
        )
    people = [person.id for person in opened.spec.participants]
    replicates = replicates_for(len(people)) if replicates is None else replicates
    if replicates < 1:
        raise ValueError(f"replicates: expected at least 1, got {replicates}.")
    points = opened.spec.perturbations.timing_points or TIMING_POINTS
    injection = checked_injection(
        stiffness, damping, inertia, lag_s=lag_s, timing_points=list(points)
    )
    estimates: dict[str, list[VirtualEstimate]] = {}
    problems: list[str] = []
    with shown_progress(progress=progress) as show:
        for done, person_id in enumerate(people):
            show(done, len(people), f"certificate of {person_id}")
            try:
                settings = participant_settings(opened, person_id, RIGID, resamples=2, seed=seed)
                recordings = read_participant(opened, person_id, {})
                estimates[person_id] = certify_participant(
                    evidence_of(person_id, recordings, settings),
                    injection,
                    replicates=replicates,
                    seed=seed,
                )
            except StudyError as exc:
                problems += exc.problems
            except DataError as exc:
                problems.append(str(exc))
        show(len(people), len(people), "done")
    if problems:
        raise StudyError(str(opened.root), problems)
    window_s = opened.spec.perturbations.window_s
    return assembled(estimates, injection, replicates=replicates, seed=seed, window_s=window_s)


def checked_injection(
    stiffness: Chosen,
    damping: Chosen,
    inertia: Chosen,
    *,
    lag_s: float | None,
    timing_points: Sequence[str],
) -> Injection:
    """Return the values to inject, if they are valid."""
    for name, chosen in (("stiffness", stiffness), ("damping", damping), ("inertia", inertia)):
        if chosen is None:
            continue
        values = dict(chosen) if isinstance(chosen, Mapping) else {ALL_POINTS: float(chosen)}
        if isinstance(chosen, Mapping) and (unknown := sorted(set(values) - set(timing_points))):
            raise ValueError(
                f"{name}: expected timing points among {', '.join(timing_points)}, got "
                f"{', '.join(unknown)}."
            )
        for value in values.values():
            if not math.isfinite(value) or value < 0.0 or (name == "inertia" and value == 0.0):
                raise ValueError(f"{name}: expected a finite, positive value, got {value}.")
    if lag_s is not None and not 0.0 <= lag_s <= _LONGEST_LAG_S:
        raise ValueError(f"lag_s: expected 0 to {_LONGEST_LAG_S} s, got {lag_s}.")
    return Injection(stiffness, damping, inertia, lag_s)


def evidence_of(
    participant: str, recordings: Sequence[RecordingInput], settings: ParticipantSettings
) -> tuple[Evidence, ...]:
    """Predict and explain the pulses of a participant as the method ``rigid`` does."""
    evidence = []
    for unit, group in recording_groups(recordings, settings.kind):
        session, side = unit or ("", "")
        sources = prepare_sources(group, settings)
        estimates = RigidMethod().estimate(ParticipantData(participant, sources), settings)
        if estimates.evidence is not None:
            evidence.append(replace(estimates.evidence, session=session, side=side))
    return tuple(evidence)
