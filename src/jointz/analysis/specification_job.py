"""Specification curve of one participant of a study."""

import os
from collections.abc import Sequence
from dataclasses import asdict
from itertools import count

from jointz.analysis.participant_jobs import (
    participant_settings,
    read_participant,
    recommended_method,
)
from jointz.core.events import row_label
from jointz.core.method_names import RECOMMENDED, RIGID, STRAPPED
from jointz.core.study import Study
from jointz.identify.appraisal.specification import Choices, Tell, specification_estimates
from jointz.identify.appraisal.strapped_specification import StrappedChoices, strapped_estimates
from jointz.identify.preparation.recording_groups import recording_groups
from jointz.identify.study_kinds import WALKING
from jointz.io.study_reader import open_study
from jointz.results.specification_curve import SpecificationCurve
from jointz.tasks.progress import Progress
from jointz.terminal.progress_bars import shown_progress

_STANDARD, _STANDARD_STRAPPED = Choices(), StrappedChoices()


def specification_curve(  # noqa: PLR0913 - a public face, keywords only
    study: Study | str | os.PathLike[str],
    *,
    participant: str | None = None,
    method: str = RECOMMENDED,
    windows_s: Sequence[float] | None = None,
    cutoffs_hz: Sequence[float] | None = None,
    baselines: Sequence[str] | None = None,
    assumptions: Sequence[str] | None = None,
    resamples: int = 200,
    seed: int = 0,
    progress: Progress | bool | None = True,
) -> SpecificationCurve:
    """Analyse a participant of a walking study under every defensible set of choices.

    Parameters
    ----------
    study : Study or path
        An opened study, or its folder.
    participant : str, optional
        The id, with session and side if there are several, as in tables: ``S01, left``. By
        default the first.
    method : str
        ``strapped``, ``rigid``, or ``recommended`` for the one that analyses the study unless
        another is asked for. ``strapped`` is compared with one fit by ``rigid``, ``rigid`` with
        the dissertation's method.
    windows_s : sequence of float, optional
        Windows from the onset, s. ``rigid`` refuses those above 0.12 s, ``strapped`` those above
        0.25 s.
    cutoffs_hz : sequence of float, optional
        Cut-offs of the dissertation's method, which filters, Hz; of ``rigid`` only.
    baselines : sequence of str, optional
        ``predicted``, ``matched_strides``, ``unperturbed_mean``; of ``rigid`` only.
    assumptions : sequence of str, optional
        Names among :data:`~jointz.identify.appraisal.strapped_specification.ASSUMPTIONS`; of
        ``strapped`` only.
    resamples, seed : int
        Resamples and seed of the dissertation's bootstrap.
    progress : bool or callable
        Whether to draw a progress bar in a terminal or notebook; a function is called with
        (steps done, number of steps, what comes next).

    Returns
    -------
    SpecificationCurve
        K, B and J of every timing point under every set of choices; a status says why a value
        is missing.

    Raises
    ------
    StudyError, DataError
        If recordings cannot be trusted.
    ValueError
        If the study is not a walking study or has no such participant, or a choice is out of
        range.
    """
    opened = study if isinstance(study, Study) else open_study(study)
    if opened.spec.kind != "walking":
        raise ValueError(
            f'specification_curve: expected a walking study, got kind "{opened.spec.kind}".'
        )
    people = [person.id for person in opened.spec.participants]
    label = people[0] if participant is None else participant
    who = next((p for p in people if f"{label},".startswith(f"{p},")), None)
    if who is None:
        raise ValueError(f"participant: expected one of {', '.join(people)}; got {label!r}.")
    name = _chosen(opened, method)
    choices: Choices | StrappedChoices
    if name == STRAPPED:
        _refuse(name, cutoffs_hz=cutoffs_hz, baselines=baselines)
        choices = StrappedChoices(
            tuple(_STANDARD_STRAPPED.windows_s if windows_s is None else windows_s),
            tuple(_STANDARD_STRAPPED.assumptions if assumptions is None else assumptions),
        )
    else:
        _refuse(name, assumptions=assumptions)
        choices = Choices(
            tuple(_STANDARD.windows_s if windows_s is None else windows_s),
            tuple(_STANDARD.cutoffs_hz if cutoffs_hz is None else cutoffs_hz),
            tuple(_STANDARD.baselines if baselines is None else baselines),
        )
    settings = participant_settings(opened, who, name, resamples=resamples, seed=seed)
    groups = recording_groups(read_participant(opened, who, {}), WALKING)
    by_label = {row_label(who, *unit): own for unit, own in groups if unit is not None}
    if participant is None or (label == who and len(by_label) == 1):
        label = next(iter(by_label))
    if label not in by_label:
        raise ValueError(f"participant: expected one of {'; '.join(by_label)}; got {label!r}.")
    with shown_progress(progress=progress) as show:
        total, done = choices.n_steps, count()
        tell: Tell = lambda what: show(next(done), total, what)  # noqa: E731 - of two calls
        own = by_label[label]
        estimates = (
            strapped_estimates(who, own, settings, choices, tell=tell)
            if isinstance(choices, StrappedChoices)
            else specification_estimates(who, own, settings, choices, tell=tell)
        )
        show(total, total, "done")
    return SpecificationCurve(
        participant=label,
        estimates=estimates,
        settings={
            **{name: list(values) for name, values in asdict(choices).items()},
            "resamples": resamples,
            "seed": seed,
        },
    )


def _chosen(study: Study, method: str) -> str:
    """Return the method whose choices are varied."""
    if method not in (RECOMMENDED, RIGID, STRAPPED):
        raise ValueError(
            f"method: expected {RECOMMENDED}, {STRAPPED} or {RIGID}; got {method!r}, which has no "
            "specification curve."
        )
    if method != RECOMMENDED:
        return method
    # A study with a baseline of its own, too, is analysed under all of them.
    return STRAPPED if recommended_method(study) == STRAPPED else RIGID


def _refuse(method: str, **choices: Sequence[float] | Sequence[str] | None) -> None:
    """Refuse choices that a method does not have."""
    for name, values in choices.items():
        if values is not None:
            other = RIGID if method == STRAPPED else STRAPPED
            raise ValueError(
                f"{name}: the method {method} has no such choice. Remove it, or add "
                f'method="{other}".'
            )
