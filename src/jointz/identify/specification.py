"""One participant analysed under every defensible set of choices."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from jointz.core.estimates import CellEstimate, ParameterEstimate
from jointz.core.specification_curve import SpecificationEstimate
from jointz.identify.assignment import assign_pulses
from jointz.identify.calibration import pooled_calibration
from jointz.identify.cell_estimator import CellEstimator
from jointz.identify.cells import METHODS
from jointz.identify.certificate_evidence import evidence_of
from jointz.identify.raw_signals import takes_out_intrinsic
from jointz.identify.response_decision import Decision, NaturalSize, decided_parameters
from jointz.identify.response_posterior import CONSTANT_INERTIA_SD, JointPosterior
from jointz.identify.sources import ParticipantSettings, RecordingInput, Source, prepare_sources
from jointz.identify.specification_baselines import with_baseline
from jointz.identify.walking_estimator import METHOD as RECOMMENDED
from jointz.identify.walking_responses import PredictedCell, explain_responses, priors_of

PARAMETERS = ("stiffness", "damping", "inertia")
PREDICTED = "predicted"
#: How the inertia of the timing points is bound together.
INERTIA_MODELS = ("one", "free", "pooled")
#: The method that filters: what its cut-off does is the dissertation's question.
FILTERED = "dissertation"

#: Called with what comes next.
Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Choices:
    """What is combined.

    Parameters
    ----------
    windows_s : tuple of float, s
        From the onset.
    cutoffs_hz : tuple of float, Hz
        Of the method that filters.
    baselines : tuple of str
        Subtracted: ``predicted``, ``matched_strides``, ``unperturbed_mean``.
    inertia_models : tuple of str
        Of :data:`INERTIA_MODELS`; for the recommended method.

    Raises
    ------
    ValueError
        When a window or cut-off is not positive, a name unknown, or a list empty.
    """

    windows_s: tuple[float, ...] = (0.04, 0.06, 0.08, 0.1, 0.12, 0.15)
    cutoffs_hz: tuple[float, ...] = (15.0, 20.0, 30.0)
    baselines: tuple[str, ...] = (PREDICTED, "matched_strides", "unperturbed_mean")
    inertia_models: tuple[str, ...] = INERTIA_MODELS

    def __post_init__(self) -> None:
        known = {"baselines": (PREDICTED, "matched_strides", "unperturbed_mean")}
        known["inertia_models"] = INERTIA_MODELS
        for name in self.__slots__:
            values = getattr(self, name)
            if name in known:
                fine = all(v in known[name] for v in values)
                expected = f"names among {', '.join(known[name])}"
            else:
                fine = all(0.0 < v < np.inf for v in values)
                expected = "positive numbers"
            if not values or not fine:
                raise ValueError(f"{name}: expected one or more {expected}, got {values!r}.")


def specification_estimates(
    participant: str,
    recordings: Sequence[RecordingInput],
    settings: ParticipantSettings,
    choices: Choices,
    *,
    tell: Tell | None = None,
) -> tuple[SpecificationEstimate, ...]:
    """Estimate K, B and J of a participant under every set of choices.

    Parameters
    ----------
    participant : str
        The id.
    recordings : sequence of RecordingInput
        All recordings of this participant.
    settings : ParticipantSettings
        What the study asks for; its own window, cut-off and baseline are not used.
    choices : Choices
        What is combined.
    tell : callable, optional
        Called with what comes next.

    Notes
    -----
    The recommended method is run with every baseline, window and model of the inertia; pulses
    are predicted once, for the longest window. The dissertation's is run with its two baselines
    and every cut-off and window. Misleads when it is read as a vote: many sets of choices that
    share an error agree. It shows which choice matters, not which is right.
    """
    told = tell or _silent
    longest = max(choices.windows_s)
    settings = _asked(settings, window_s=longest)
    sources = prepare_sources(recordings, settings)
    found: list[SpecificationEstimate] = []
    evidence = evidence_of(participant, sources, settings)
    cells = evidence.cells if evidence else ()
    for baseline in choices.baselines:
        told(f"{RECOMMENDED}, {baseline}")
        beside = [
            cell if baseline == PREDICTED else with_baseline(cell, sources, settings, baseline)
            for cell in cells
        ]
        usable = [cell for cell in beside if cell is not None]
        if usable:
            found += _recommended(usable, sources, settings, choices, baseline)
    for cutoff_hz in choices.cutoffs_hz:
        told(f"{FILTERED}, {cutoff_hz:g} Hz")
        found += _filtered(participant, recordings, settings, choices, cutoff_hz)
    return tuple(found)


def of_inertia_model(posterior: JointPosterior, model: str) -> JointPosterior:
    """Return the hypotheses that hold one model of the inertia, weighted among themselves.

    Parameters
    ----------
    posterior : JointPosterior
        All hypotheses.
    model : str
        ``one`` for all timing points, ``free`` at each, or ``pooled``: all hypotheses.
    """
    if model == "pooled":
        return posterior
    free = max(p.hypothesis.inertia_sd for p in posterior.posteriors)
    wanted = CONSTANT_INERTIA_SD if model == "one" else free
    kept = [p for p in posterior.posteriors if p.hypothesis.inertia_sd == wanted]
    return JointPosterior.weighed(kept)


def _recommended(
    cells: Sequence[PredictedCell],
    sources: Sequence[Source],
    settings: ParticipantSettings,
    choices: Choices,
    baseline: str,
) -> Iterator[SpecificationEstimate]:
    known = pooled_calibration(
        [sources[c.source].given.calibration for cell in cells for c in cell.candidates]
    )
    for window_s in choices.windows_s:
        posterior, responses = explain_responses(cells, priors_of(known), window_s=window_s)
        for model in choices.inertia_models:
            own = of_inertia_model(posterior, model)
            for i, cell in enumerate(cells):
                recording = sources[cell.candidates[0].source].given.recording
                decision = Decision(
                    known=known,
                    subtract_intrinsic=not takes_out_intrinsic(recording),
                    mass_kg=settings.mass_kg,
                    natural=NaturalSize.of(responses[i]),
                )
                for p in decided_parameters(i, own, decision):
                    if p.name in PARAMETERS:
                        yield _row(cell.label, p, RECOMMENDED, baseline, window_s, None, model)


def _filtered(
    participant: str,
    recordings: Sequence[RecordingInput],
    settings: ParticipantSettings,
    choices: Choices,
    cutoff_hz: float,
) -> Iterator[SpecificationEstimate]:
    conditioned = prepare_sources(recordings, _asked(settings, cutoff_hz=cutoff_hz))
    for baseline in choices.baselines:
        if baseline == PREDICTED:
            continue
        for window_s in choices.windows_s:
            asked = _asked(settings, cutoff_hz=cutoff_hz, window_s=window_s, baseline=baseline)
            estimator = CellEstimator(participant, METHODS[FILTERED], conditioned, asked)
            candidates = assign_pulses(participant, conditioned, asked, baseline=baseline)
            cells: Sequence[CellEstimate] = estimator.run(candidates)[0]
            for cell in cells:
                for p in cell.parameters:
                    if p.name in PARAMETERS:
                        yield _row(
                            cell.timing_point, p, FILTERED, baseline, window_s, cutoff_hz, "free"
                        )


def _asked(settings: ParticipantSettings, **changes: object) -> ParticipantSettings:
    return replace(settings, perturbations=settings.perturbations.model_copy(update=changes))


def _row(
    timing_point: str,
    p: ParameterEstimate,
    method: str,
    baseline: str,
    window_s: float,
    cutoff_hz: float | None,
    inertia_model: str,
) -> SpecificationEstimate:
    return SpecificationEstimate(
        timing_point=timing_point,
        parameter=p.name,
        method=method,
        baseline=baseline,
        window_s=window_s,
        cutoff_hz=cutoff_hz,
        inertia_model=inertia_model,
        value=p.value,
        ci_low=p.ci_low,
        ci_high=p.ci_high,
        status=p.status,
    )


def _silent(what: str) -> None:
    del what
