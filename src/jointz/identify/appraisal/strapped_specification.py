"""One participant analysed by the method ``strapped`` under several assumptions and windows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from jointz.core.method_names import PREDICTED, RIGID, STRAPPED
from jointz.core.priors import LogPrior, PriorsSpec, Spread
from jointz.identify.appraisal.specification import (
    Choices,
    SpecifiedCells,
    Tell,
    rigid_cells,
    why_missing,
    with_perturbations,
)
from jointz.identify.estimators import ParticipantData
from jointz.identify.preparation.assignment import assign_pulses, label_names
from jointz.identify.preparation.sources import (
    ParticipantSettings,
    RecordingInput,
    prepare_sources,
)
from jointz.identify.strapped.strapped_method import CycleHypotheses, StrappedMethod
from jointz.results.specification_curve import SpecificationEstimate

#: The longest window that the method ``rigid`` accepts, s; it is a comparison.
_RIGID_WINDOW_S: Final = 0.1
#: Sd of the logarithm of a parameter that is held.
_HELD: Final = 1e-3


@dataclass(frozen=True, slots=True)
class _Assumption:
    """Changes of the priors and hypotheses of the method."""

    priors: Mapping[str, Any] = field(default_factory=dict)
    hypotheses: CycleHypotheses = field(default_factory=CycleHypotheses)


#: Name -> what is assumed instead.
ASSUMPTIONS: Final[Mapping[str, _Assumption]] = {
    "standard": _Assumption(),
    "one_curve": _Assumption(hypotheses=CycleHypotheses(shares=(0.9,))),
    "independent_points": _Assumption(hypotheses=CycleHypotheses(shares=(0.0,))),
    "no_softening": _Assumption({"half_angle_rad": LogPrior(median=1e3, log_sd=_HELD)}),
    "no_reflex": _Assumption(
        {
            "reflex_gain": LogPrior(median=1e-6, log_sd=_HELD),
            "reflex_of_point": Spread(sd=_HELD),
        }
    ),
    # One curve over the cycle is a drift: constant K, B and J need independent points.
    "no_drift": _Assumption(
        hypotheses=CycleHypotheses(shares=(0.0,), steady=1.0),
    ),
}


@dataclass(frozen=True, slots=True)
class StrappedChoices:
    """Choices that are combined."""

    windows_s: tuple[float, ...] = (0.1, 0.15, 0.2)  # s: lengths of the window from the onset
    assumptions: tuple[str, ...] = tuple(ASSUMPTIONS)  # names among :data:`ASSUMPTIONS`

    def __post_init__(self) -> None:
        if not self.windows_s or not all(0.0 < w < np.inf for w in self.windows_s):
            raise ValueError(
                f"windows_s: expected one or more positive numbers, got {self.windows_s!r}."
            )
        if not self.assumptions or not set(self.assumptions) <= set(ASSUMPTIONS):
            raise ValueError(
                f"assumptions: expected one or more names among {', '.join(ASSUMPTIONS)}, got "
                f"{self.assumptions!r}."
            )

    @property
    def n_steps(self) -> int:
        """Number of steps that are told."""
        return len(self.assumptions) + 1


def strapped_estimates(
    participant: str,
    recordings: Sequence[RecordingInput],
    settings: ParticipantSettings,
    choices: StrappedChoices,
    *,
    tell: Tell | None = None,
) -> tuple[SpecificationEstimate, ...]:
    """Estimate K, B and J under every window and assumption, and once by the method ``rigid``.

    Misleads when it is read as a vote, as every specification curve does.
    """
    progress = tell or (lambda _step: None)
    sources = prepare_sources(recordings, settings)
    data = ParticipantData(participant, sources)
    pulses = assign_pulses(participant, sources, settings, baseline=PREDICTED, alone=True)
    missing = why_missing(sources, pulses)
    results: list[SpecifiedCells] = []
    for name in choices.assumptions:
        progress(f"{STRAPPED}, {name.replace('_', ' ')}")
        method = StrappedMethod(ASSUMPTIONS[name].hypotheses)
        estimates = method.estimate_windows(data, _assuming(settings, name), choices.windows_s)
        results += [
            SpecifiedCells(_choice(window_s, name), own.cells, missing)
            for window_s, own in zip(choices.windows_s, estimates, strict=True)
        ]
    progress(f"{RIGID}, {1e3 * _RIGID_WINDOW_S:g} ms")
    compared = with_perturbations(settings, window_s=_RIGID_WINDOW_S)
    single = Choices(baselines=(PREDICTED,), inertia_models=("pooled",))
    results += rigid_cells(participant, sources, compared, single)
    used = [cell.timing_point for result in results for cell in result.cells]
    labels = label_names(settings.perturbations, used)
    return tuple(row for result in results for row in result.rows(labels))


def _assuming(settings: ParticipantSettings, name: str) -> ParticipantSettings:
    # Validated again, as model_copy does not validate.
    values = dict(settings.priors) | dict(ASSUMPTIONS[name].priors)
    return replace(settings, priors=PriorsSpec(**values))


def _choice(window_s: float, assumption: str) -> dict[str, Any]:
    return {
        "method": STRAPPED,
        "baseline": PREDICTED,
        "window_s": window_s,
        "cutoff_hz": None,
        "inertia_model": None,
        "assumption": assumption,
    }
