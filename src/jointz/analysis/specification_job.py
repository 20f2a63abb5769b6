"""Specification curve of one participant of a study."""

import os
from collections.abc import Sequence

from jointz.analysis.participant_jobs import participant_settings, read_participant
from jointz.core.events import row_label
from jointz.core.method_names import RIGID
from jointz.core.study import Study
from jointz.identify.appraisal.specification import Choices, specification_estimates
from jointz.identify.preparation.recording_groups import recording_groups
from jointz.identify.study_kinds import WALKING
from jointz.io.study_reader import open_study
from jointz.results.specification_curve import SpecificationCurve
from jointz.tasks.progress import Progress
from jointz.terminal.progress_bars import shown_progress

_STANDARD = Choices()


def specification_curve(
    study: Study | str | os.PathLike[str],
    *,
    participant: str | None = None,
    windows_s: Sequence[float] = _STANDARD.windows_s,
    cutoffs_hz: Sequence[float] = _STANDARD.cutoffs_hz,
    baselines: Sequence[str] = _STANDARD.baselines,
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
    windows_s : sequence of float, s
        Windows from the onset; the method ``rigid`` refuses those above 0.12 s.
    cutoffs_hz : sequence of float, Hz
        Cut-offs of the dissertation's method, which filters.
    baselines : sequence of str
        ``predicted``, ``matched_strides``, ``unperturbed_mean``.
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
    choices = Choices(tuple(windows_s), tuple(cutoffs_hz), tuple(baselines))
    total = len(choices.windows_s) + len(choices.cutoffs_hz)
    settings = participant_settings(opened, who, RIGID, resamples=resamples, seed=seed)
    groups = recording_groups(read_participant(opened, who, {}), WALKING)
    by_label = {row_label(who, *unit): own for unit, own in groups if unit is not None}
    if participant is None or (label == who and len(by_label) == 1):
        label = next(iter(by_label))
    if label not in by_label:
        raise ValueError(f"participant: expected one of {'; '.join(by_label)}; got {label!r}.")
    with shown_progress(progress=progress) as show:
        done = iter(range(total))
        estimates = specification_estimates(
            who,
            by_label[label],
            settings,
            choices,
            tell=lambda what: show(next(done), total, what),
        )
        show(total, total, "done")
    return SpecificationCurve(
        participant=label,
        estimates=estimates,
        settings={
            "windows_s": list(choices.windows_s),
            "cutoffs_hz": list(choices.cutoffs_hz),
            "baselines": list(choices.baselines),
            "inertia_models": list(choices.inertia_models),
            "resamples": resamples,
            "seed": seed,
        },
    )
