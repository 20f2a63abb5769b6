"""The evidence of a participant: the recommended method run once, without its report."""

from collections.abc import Sequence

from jointz.identify.preparation.assignment import assign_pulses
from jointz.identify.preparation.sources import ParticipantSettings, Source
from jointz.identify.recommended.walking_estimator import WalkingEstimator
from jointz.identify.recommended.walking_evidence import Evidence


def evidence_of(
    participant: str, sources: Sequence[Source], settings: ParticipantSettings
) -> Evidence | None:
    """Predict and explain the pulses of a participant as the recommended method does.

    Parameters
    ----------
    participant : str
        The id.
    sources : sequence of Source
        The participant's recordings, made ready.
    settings : ParticipantSettings
        What the study asks for.

    Returns
    -------
    Evidence or None
        None where nothing could be explained.
    """
    estimator = WalkingEstimator(participant, sources, settings)
    estimator.run(
        assign_pulses(participant, sources, settings, baseline=estimator.baseline, alone=True)
    )
    return estimator.evidence
