"""Certificate of a study: the error to expect, from simulated people in its own protocol."""

import os

from jointz.analysis.analyze import NO_CERTIFICATE, VIRTUAL_PEOPLE, analyze
from jointz.core.errors import DataError
from jointz.core.study import Study
from jointz.results.certificate_result import Certificate
from jointz.tasks.engine import Engine
from jointz.tasks.progress import Progress


def certify(
    study: Study | str | os.PathLike[str],
    *,
    people: int = VIRTUAL_PEOPLE,
    seed: int = 0,
    engine: Engine | None = None,
    progress: Progress | bool | None = True,
) -> Certificate:
    """Let simulated people walk the protocol of a study, to know the error to expect.

    They are of the preset ``realistic``, which has what the estimator does not model, and are
    analysed as the study is. The study is analysed, too, and compared with them.

    Parameters
    ----------
    study : Study or path
        An opened study, or its folder.
    people : int
        Number of simulated people.
    seed : int
        Seed of the people.
    engine : Engine, optional
        Engine that simulates several people at once (:func:`jointz.tasks.engine.open_engine`).
    progress : bool or callable
        Whether to draw a progress bar in a terminal or notebook; a function is called with
        (people done, number of people, what comes next).

    Returns
    -------
    Certificate
        Expected bias, RMSE and coverage of K, B and J; its ``status`` is ``cannot_promise`` if
        the study's people are unlike the simulated ones.

    Raises
    ------
    StudyError
        If recordings cannot be trusted; one message names all of them.
    DataError
        If simulated people cannot repeat the study's pulses, or its method is not ``bayesian``.
    ValueError
        If ``people`` is less than 1.
    """
    if people < 1:
        raise ValueError(f"people: expected at least 1, got {people}.")
    analysis = analyze(
        study, resamples=2, seed=seed, certify=people, engine=engine, progress=progress
    )
    if analysis.certificate is None:
        notes = [note for note in analysis.statistics["notes"] if note.startswith(NO_CERTIFICATE)]
        raise DataError(notes[-1].removeprefix(NO_CERTIFICATE))
    return analysis.certificate
