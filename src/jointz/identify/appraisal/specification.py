"""One participant analysed under every defensible set of choices."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from jointz.core.codes import Exclusion, Failure
from jointz.core.method_names import RIGID
from jointz.identify.methods.cell_estimator import CellEstimator
from jointz.identify.methods.cell_regressions import DISSERTATION
from jointz.identify.methods.cell_windows import WindowCutter
from jointz.identify.prediction.predicted_cells import PredictedCell, alike
from jointz.identify.prediction.unperturbed_prediction import (
    LEAD_SAMPLES,
    PREDICTED_ROWS,
    Predicted,
)
from jointz.identify.preparation.assignment import Candidate, assign_pulses, label_names
from jointz.identify.preparation.baselines import N_MATCHES
from jointz.identify.preparation.raw_signals import COMMAND, raw_signals
from jointz.identify.preparation.sources import (
    ParticipantSettings,
    RecordingInput,
    Source,
    prepare_sources,
)
from jointz.identify.rigid.response_checks import (
    fit_failure,
    instrument_failure,
    shared_failure,
)
from jointz.identify.rigid.response_posterior import CONSTANT_INERTIA_SD, JointPosterior
from jointz.identify.rigid.walking_estimator import WalkingEstimator
from jointz.identify.rigid.walking_evidence import Evidence
from jointz.identify.rigid.walking_responses import LONGEST_LAG_S, priors_of
from jointz.results.estimates import CellEstimate
from jointz.results.specification_curve import SpecificationEstimate

PARAMETERS = ("stiffness", "damping", "inertia")
PREDICTED = "predicted"
BASELINES = (PREDICTED, "matched_strides", "unperturbed_mean")
#: How the inertia of the timing points is bound together.
INERTIA_MODELS = ("one", "free", "pooled")
#: The method that filters: its cut-off is one of the choices.
FILTERED = "dissertation"

#: Called with the name of the next step.
Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Choices:
    """Choices that are combined."""

    # s: lengths of the window from the onset
    windows_s: tuple[float, ...] = (0.04, 0.06, 0.08, 0.1, 0.12)
    cutoffs_hz: tuple[float, ...] = (15.0, 20.0, 30.0)  # Hz: low-pass of the filtering method
    baselines: tuple[str, ...] = BASELINES  # names of baselines to subtract
    # names among :data:`INERTIA_MODELS`, for the method ``rigid``
    inertia_models: tuple[str, ...] = INERTIA_MODELS

    @property
    def n_steps(self) -> int:
        """Number of steps that are told."""
        return len(self.windows_s) + len(self.cutoffs_hz)

    def __post_init__(self) -> None:
        known = {"baselines": BASELINES, "inertia_models": INERTIA_MODELS}
        for name in self.__slots__:
            values = getattr(self, name)
            if name in known:
                valid = all(v in known[name] for v in values)
                expected = f"names among {', '.join(known[name])}"
            else:
                valid = all(0.0 < v < np.inf for v in values)
                expected = "positive numbers"
            if not values or not valid:
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

    The method ``rigid`` is run with every baseline, window and model of the inertia, and
    refuses, widens and withholds under each as it does by itself. The dissertation's is run with
    its two baselines and every cut-off and window. Misleads when it is read as a vote: many sets
    of choices that share an error agree. It shows which choice matters, not which is right.
    """
    progress = tell or (lambda _step: None)
    sources = prepare_sources(recordings, settings)
    results: list[SpecifiedCells] = []
    for window_s in choices.windows_s:
        progress(f"{RIGID}, {1e3 * window_s:g} ms")
        changed = with_perturbations(settings, window_s=window_s)
        results += rigid_cells(participant, sources, changed, choices)
    for cutoff_hz in choices.cutoffs_hz:
        progress(f"{FILTERED}, {cutoff_hz:g} Hz")
        results += _filtered(participant, recordings, settings, choices, cutoff_hz)
    used = [cell.timing_point for result in results for cell in result.cells]
    labels = label_names(settings.perturbations, used)
    return tuple(row for result in results for row in result.rows(labels))


def of_inertia_model(posterior: JointPosterior, model: str) -> JointPosterior:
    """Return the hypotheses that hold one model of the inertia, weighted among themselves."""
    if model == "pooled":
        return posterior
    free = max(p.hypothesis.inertia_sd for p in posterior.posteriors)
    chosen_sd = CONSTANT_INERTIA_SD if model == "one" else free
    kept = [p for p in posterior.posteriors if p.hypothesis.inertia_sd == chosen_sd]
    return JointPosterior.weighed(kept)


class _SpecifiedEstimator(WalkingEstimator):
    """The method ``rigid`` with another baseline, and some models of the inertia only.

    It refuses, widens and withholds as its base does. What choices have in common is done once.
    """

    def __init__(
        self, participant: str, sources: Sequence[Source], settings: ParticipantSettings
    ) -> None:
        super().__init__(participant, sources, settings)
        self._chosen = (PREDICTED, "pooled")
        self._cells: dict[tuple[str, str], tuple[PredictedCell | CellEstimate, list[str]]] = {}
        self._pooled: dict[str, tuple[Evidence | None, float, dict[str, Failure | None]]] = {}

    def under(
        self, candidates: Sequence[Candidate], *, baseline: str, inertia_model: str
    ) -> tuple[CellEstimate, ...]:
        """Return the timing points under two choices."""
        self._chosen = (baseline, inertia_model)
        return self.run(candidates).cells

    def _prepared(
        self, label: str, candidates: Sequence[Candidate]
    ) -> tuple[PredictedCell | CellEstimate, list[str]]:
        baseline = self._chosen[0]
        if (PREDICTED, label) not in self._cells:
            self._cells[PREDICTED, label] = super()._prepared(label, candidates)
        if (baseline, label) not in self._cells:
            cell, codes = self._cells[PREDICTED, label]
            if isinstance(cell, PredictedCell):
                other = with_baseline(cell, self._sources, self._settings, baseline)
                cell = other or self._without_baseline(label, len(codes))
            self._cells[baseline, label] = cell, codes
        return self._cells[baseline, label]

    def _without_baseline(self, label: str, n_pulses: int) -> CellEstimate:
        failure = Failure.NO_UNPERTURBED_STRIDES
        conditions = {source.given.condition for source in self._sources}
        if self._chosen[0] == "unperturbed_mean" and "unperturbed" not in conditions:
            failure = Failure.NO_UNPERTURBED_RECORDING
        return self._without_value(label, failure, onset=None, counts=(0, n_pulses))

    def _explained(
        self, cells: Sequence[PredictedCell], failures: dict[str, Failure | None]
    ) -> tuple[Evidence | None, float]:
        baseline, inertia_model = self._chosen
        if baseline not in self._pooled:
            self._pooled[baseline] = (*super()._explained(cells, failures), dict(failures))
        evidence, odds, pooled_failures = self._pooled[baseline]
        failures.update(pooled_failures)
        if evidence is None or inertia_model == "pooled":
            return evidence, odds
        posterior = of_inertia_model(evidence.posterior, inertia_model)
        priors = priors_of(evidence.known).scaled(self._settings.prior_scale)
        late = instrument_failure(posterior, priors, odds=odds, longest_s=LONGEST_LAG_S)
        if late:
            failures.update(shared_failure(failures, late))
            return None, odds
        # All stay in the evidence, whose posterior is that of all.
        for i, (cell, response) in enumerate(zip(evidence.cells, evidence.responses, strict=True)):
            failures[cell.label] = fit_failure(i, posterior, response)
        return replace(evidence, posterior=posterior), odds


@dataclass(frozen=True, slots=True)
class SpecifiedCells:
    """Estimates under one set of choices; missing timing points have a failure instead."""

    choice: Mapping[str, Any]  # columns of :class:`SpecificationEstimate` that state the choices
    cells: Sequence[CellEstimate]
    missing: Failure  # failure of the timing points without a cell

    def rows(self, labels: Sequence[str]) -> Iterator[SpecificationEstimate]:
        """Yield K, B and J of every timing point."""
        cells = {cell.timing_point: cell for cell in self.cells}
        for label in labels:
            for name in PARAMETERS:
                p = cells[label].parameter(name) if label in cells else None
                yield SpecificationEstimate(
                    timing_point=label,
                    parameter=name,
                    **self.choice,
                    value=p.value if p else None,
                    ci_low=p.ci_low if p else None,
                    ci_high=p.ci_high if p else None,
                    status=p.status if p else self.missing.status,
                )


def rigid_cells(
    participant: str,
    sources: Sequence[Source],
    settings: ParticipantSettings,
    choices: Choices,
) -> Iterator[SpecifiedCells]:
    """Yield the estimates of the method ``rigid`` under every baseline and inertia."""
    estimator = _SpecifiedEstimator(participant, sources, settings)
    candidates = assign_pulses(
        participant, sources, settings, baseline=estimator.baseline, alone=True
    )
    missing = why_missing(sources, candidates)
    for baseline in choices.baselines:
        for model in choices.inertia_models:
            choice = {
                "method": RIGID,
                "baseline": baseline,
                "window_s": settings.perturbations.window_s,
                "cutoff_hz": None,
                "inertia_model": model,
            }
            cells = estimator.under(candidates, baseline=baseline, inertia_model=model)
            yield SpecifiedCells(choice, cells, missing)


def _filtered(
    participant: str,
    recordings: Sequence[RecordingInput],
    settings: ParticipantSettings,
    choices: Choices,
    cutoff_hz: float,
) -> Iterator[SpecifiedCells]:
    conditioned = prepare_sources(recordings, with_perturbations(settings, cutoff_hz=cutoff_hz))
    for baseline in choices.baselines:
        if baseline == PREDICTED:
            continue
        for window_s in choices.windows_s:
            changed = with_perturbations(
                settings, cutoff_hz=cutoff_hz, window_s=window_s, baseline=baseline
            )
            estimator = CellEstimator(participant, DISSERTATION, conditioned, changed)
            candidates = assign_pulses(participant, conditioned, changed, baseline=baseline)
            choice = {
                "method": FILTERED,
                "baseline": baseline,
                "window_s": window_s,
                "cutoff_hz": cutoff_hz,
                "inertia_model": "free",
            }
            missing = why_missing(conditioned, candidates)
            yield SpecifiedCells(choice, estimator.run(candidates)[0], missing)


def why_missing(sources: Sequence[Source], candidates: Sequence[Candidate]) -> Failure:
    """Return why a timing point has no pulse."""
    if any(c.record.code == Exclusion.NO_HEEL_STRIKES for c in candidates):
        return Failure.NO_HEEL_STRIKES
    perturbed = any(source.given.condition == "perturbed" for source in sources)
    return Failure.NO_PULSES if perturbed else Failure.NO_PERTURBED_RECORDING


def with_perturbations(settings: ParticipantSettings, **changes: object) -> ParticipantSettings:
    """Return settings with other entries of ``[perturbations]``."""
    return replace(settings, perturbations=settings.perturbations.model_copy(update=changes))


#: So many unperturbed strides tell what a baseline misses.
_VIRTUAL = 200
_FEWEST_STRIDES = 12


def with_baseline(
    cell: PredictedCell, sources: Sequence[Source], settings: ParticipantSettings, baseline: str
) -> PredictedCell | None:
    """Return a timing point with another baseline than the predicted one.

    What a baseline misses is measured at virtual onsets in the strides it is made of. The mean
    of another condition is thereby blind to its own fault, the shift between the conditions:
    its intervals are too narrow, as the dissertation's are.
    """
    # Strides of another rate are brought to that of the pulses.
    rate = 1.0 / cell.period_s
    raw = [replace(s, signals=raw_signals(s, target_hz=rate)) for s in sources]
    # As long as what is predicted, both ends in it.
    window_s = cell.predicted.responses.shape[2] * cell.period_s
    cutter = WindowCutter(raw, settings, baseline=baseline, window_s=window_s)
    used = cell.used
    early = [_advanced(c, LEAD_SAMPLES * cell.period_s) for c in used]
    windows, unperturbed = cutter.cut(early)
    fine = unperturbed.valid.any(axis=1) & np.isfinite(windows).all(axis=(1, 2))
    if not fine.any():
        return None
    if baseline == "unperturbed_mean":
        valid = unperturbed.valid[fine].all(axis=0)
        middle = unperturbed.windows[fine].mean(axis=0)[valid]
        misses, strides = middle - middle.mean(axis=0), np.flatnonzero(valid)
    else:
        misses, strides = _matched_misses(cutter, early, sources)
    if strides.size < _FEWEST_STRIDES:
        return None
    used = [c for c, keep in zip(used, fine, strict=True) if keep]
    signs = np.array([c.pulse.sign for c in used])
    responses = (windows - unperturbed.mean())[fine][:, PREDICTED_ROWS] * signs[:, None, None]
    predicted = Predicted(
        responses=responses,
        misses=misses[:, PREDICTED_ROWS],
        strides=strides,
        codes=("",) * len(used),
        posture_rad=cell.predicted.posture_rad,
        unperturbed_rad=cell.predicted.unperturbed_rad,
    )
    return replace(cell, candidates=used, predicted=predicted, kept=alike(predicted))


def _advanced(candidate: Candidate, lead_s: float) -> Candidate:
    """Return a pulse whose window begins earlier."""
    pulse = replace(candidate.pulse, onset_s=candidate.pulse.onset_s - lead_s)
    return replace(candidate, pulse=pulse, elapsed_s=candidate.elapsed_s - lead_s)


def _matched_misses(
    cutter: WindowCutter, used: Sequence[Candidate], sources: Sequence[Source]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the misses of matched strides at virtual onsets, and their strides."""
    first = used[0]
    source = sources[first.source]
    if source.strides is None:
        return np.empty((0, COMMAND + 1, 1)), np.empty(0, int)
    quiet = np.flatnonzero(source.undisturbed & np.append(False, source.undisturbed[:-1]))
    chosen = quiet[:: max(1, quiet.size // _VIRTUAL)]
    elapsed = float(np.median([c.elapsed_s for c in used]))
    virtual = [
        replace(
            first,
            pulse=replace(first.pulse, onset_s=float(start) + elapsed),
            elapsed_s=elapsed,
        )
        for start in source.strides.start_s[chosen]
    ]
    windows, unperturbed = cutter.cut(virtual)
    fine = unperturbed.valid.any(axis=1) & np.isfinite(windows).all(axis=(1, 2))
    # The best match of an unperturbed stride is itself, one of so many.
    own = 1.0 / N_MATCHES
    undone = np.sqrt((1.0 + own) / (1.0 - own))
    return undone * (windows - unperturbed.mean())[fine], chosen[fine]
