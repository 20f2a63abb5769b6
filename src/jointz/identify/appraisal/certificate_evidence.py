"""The evidence of a participant: the recommended method run once, without its report."""

from collections.abc import Sequence
from dataclasses import replace

from jointz.identify.preparation.assignment import assign_pulses
from jointz.identify.preparation.recording_groups import recording_groups
from jointz.identify.preparation.sources import (
    ParticipantSettings,
    RecordingInput,
    prepare_sources,
)
from jointz.identify.recommended.walking_estimator import WalkingEstimator
from jointz.identify.recommended.walking_evidence import Evidence


def evidence_of(
    participant: str, recordings: Sequence[RecordingInput], settings: ParticipantSettings
) -> tuple[Evidence, ...]:
    """Predict and explain the pulses of a participant as the recommended method does."""
    evidence = []
    for unit, group in recording_groups(recordings, walking=settings.walking):
        session, side = unit or ("", "")
        sources = prepare_sources(group, settings)
        estimator = WalkingEstimator(participant, sources, settings)
        estimator.run(
            assign_pulses(participant, sources, settings, baseline=estimator.baseline, alone=True)
        )
        if estimator.evidence is not None:
            evidence.append(replace(estimator.evidence, session=session, side=side))
    return tuple(evidence)
