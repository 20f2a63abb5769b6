"""Certify a study: what error to expect in it, measured in its own unperturbed strides."""

import math
import os
from collections.abc import Mapping, Sequence

from jointz.analysis.participant_jobs import participant_settings, read_participant
from jointz.core.errors import DataError, StudyError
from jointz.core.gait_phases import ALL_POINTS, TIMING_POINTS
from jointz.core.study import Study
from jointz.identify.appraisal.certificate_draws import Chosen, Injection
from jointz.identify.appraisal.certificate_evidence import evidence_of
from jointz.identify.appraisal.certificate_study import (
    assembled,
    certify_participant,
    replicates_for,
)
from jointz.identify.recommended.walking_estimator import METHOD as RECOMMENDED
from jointz.io.study_reader import open_study
from jointz.results.certificate_result import Certificate, VirtualEstimate
from jointz.tasks.progress import Progress

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
    progress: Progress | None = None,
) -> Certificate:
    """Inject known responses into a walking study and estimate them: the error to expect in it.

    Parameters
    ----------
    study : Study or path
        An opened study, or its folder.
    stiffness, damping, inertia : float, mapping of str to float, or None
        What is injected at all timing points, or at some by name; N*m/rad, N*m*s/rad, kg*m^2.
        Drawn around the study's own estimates by default.
    lag_s : float, optional, s
        Lag of the injected sensor; drawn around what calibration and study say of it by
        default. One that the calibration does not expect shows what such an error would do.
    replicates : int, optional
        Injections into each participant; by default so many that the RMSE of the whole study
        is known to 10 %.
    seed : int
        Of the draws.
    progress : callable, optional
        Called with (participants done, of how many, what comes next).

    Returns
    -------
    Certificate
        Bias, RMSE and coverage to expect of K, B and J.

    Raises
    ------
    StudyError
        When recordings cannot be trusted; all of them in one message.
    ValueError
        When the study does not walk, or a value to inject makes no sense.
    """
    opened = study if isinstance(study, Study) else open_study(study)
    if opened.spec.kind != "walking":
        raise ValueError(
            "certify: expected a walking study, got kind "
            f'"{opened.spec.kind}"; a bench has loads of known impedance instead.'
        )
    people = [person.id for person in opened.spec.participants]
    replicates = replicates_for(len(people)) if replicates is None else replicates
    if replicates < 1:
        raise ValueError(f"replicates: expected at least 1, got {replicates}.")
    points = opened.spec.perturbations.timing_points or TIMING_POINTS
    injection = checked_injection(
        stiffness, damping, inertia, lag_s=lag_s, timing_points=list(points)
    )
    found: dict[str, list[VirtualEstimate]] = {}
    problems: list[str] = []
    for done, person_id in enumerate(people):
        if progress:
            progress(done, len(people), f"certificate of {person_id}")
        try:
            settings = participant_settings(opened, person_id, RECOMMENDED, resamples=2, seed=seed)
            recordings = read_participant(opened, person_id, {})
            found[person_id] = certify_participant(
                evidence_of(person_id, recordings, settings),
                injection,
                replicates=replicates,
                seed=seed,
            )
        except StudyError as exc:
            problems += exc.problems
        except DataError as exc:
            problems.append(str(exc))
    if problems:
        raise StudyError(str(opened.root), problems)
    if progress:
        progress(len(people), len(people), "done")
    window_s = opened.spec.perturbations.window_s
    return assembled(found, injection, replicates=replicates, seed=seed, window_s=window_s)


def checked_injection(
    stiffness: Chosen,
    damping: Chosen,
    inertia: Chosen,
    *,
    lag_s: float | None,
    timing_points: Sequence[str],
) -> Injection:
    """Return what is to be injected, if it can be."""
    for name, chosen in (("stiffness", stiffness), ("damping", damping), ("inertia", inertia)):
        if chosen is None:
            continue
        given = dict(chosen) if isinstance(chosen, Mapping) else {ALL_POINTS: float(chosen)}
        if isinstance(chosen, Mapping) and (unknown := sorted(set(given) - set(timing_points))):
            raise ValueError(
                f"{name}: expected timing points among {', '.join(timing_points)}, got "
                f"{', '.join(unknown)}."
            )
        for value in given.values():
            if not math.isfinite(value) or value < 0.0 or (name == "inertia" and value == 0.0):
                raise ValueError(f"{name}: expected a finite, positive value, got {value}.")
    if lag_s is not None and not 0.0 <= lag_s <= _LONGEST_LAG_S:
        raise ValueError(f"lag_s: expected 0 to {_LONGEST_LAG_S} s, got {lag_s}.")
    return Injection(stiffness, damping, inertia, lag_s)
