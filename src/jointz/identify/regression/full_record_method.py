"""The method ``full_record``: loads on a bench, estimated from whole trials."""

from jointz.core.method_names import FULL_RECORD
from jointz.identify.bench.bench_cells import FullRecordEstimator
from jointz.identify.estimators import Estimates, ParticipantData
from jointz.identify.preparation.sources import ParticipantSettings
from jointz.identify.study_kinds import StudyKind


class FullRecordMethod:
    """Estimator of whole trials; cases that share a recording are fitted pulse by pulse."""

    name = FULL_RECORD
    kinds = ("bench",)

    def baseline_for(self, kind: StudyKind) -> str:  # noqa: ARG002 - the protocol's
        """Return ``none``: nothing is subtracted from a whole trial."""
        return "none"

    def estimate(self, data: ParticipantData, settings: ParticipantSettings) -> Estimates:
        """Estimate every case."""
        return FullRecordEstimator(data.participant, data.sources, settings).estimates()
