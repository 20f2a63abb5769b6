"""The evidence of a participant: the recommended method run once, without its report."""

from collections.abc import Sequence
from dataclasses import replace

from jointz.identify.estimators import ParticipantData
from jointz.identify.preparation.recording_groups import recording_groups
from jointz.identify.preparation.sources import (
    ParticipantSettings,
    RecordingInput,
    prepare_sources,
)
from jointz.identify.recommended.walking_estimator import RecommendedMethod
from jointz.identify.recommended.walking_evidence import Evidence


def evidence_of(
    participant: str, recordings: Sequence[RecordingInput], settings: ParticipantSettings
) -> tuple[Evidence, ...]:
    """Predict and explain the pulses of a participant as the recommended method does."""
    evidence = []
    for unit, group in recording_groups(recordings, settings.kind):
        session, side = unit or ("", "")
        sources = prepare_sources(group, settings)
        estimates = RecommendedMethod().estimate(ParticipantData(participant, sources), settings)
        if estimates.evidence is not None:
            evidence.append(replace(estimates.evidence, session=session, side=side))
    return tuple(evidence)
